"""Run the whole path on clips of many kinds and print what went right: ``python benchmarks/robustness.py``.

For every case of ``cases.py``: read, segment, locate, track; identify on the first 1.33 s, predict the next
1.33 s. The clips are made on first use and kept in a folder of temporary files. The truth only judges.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from cases import CASES
from clips import Clip, cached
from spec import NoRenderer

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism
    from monodyn.types import Poses

FIT_SECONDS = 4.0 / 3.0
"""Time that is fitted, and as much after it that is predicted: 40 frames of 30 a second [s]."""
STAMP = 1e-6
"""A frame this much before a time counts as at it: time stamps are rounded [s]."""
LIMITS = {"angle": 0.3, "slide": 3.0, "length": 1.5, "width": 5.0, "ahead": 2.0, "ahead_slide": 6.0}
"""Largest values of the fields of `Result` that pass, in their units: degrees, millimetres and per cent."""
LEAST_SEEN = 0.9
"""Smallest share of measured frames that passes."""
MOST_EXIT = 100
"""Largest exit code: a process has one byte for it, and codes above 125 mean other things to a shell."""


@dataclass
class Result:
    """What one case gave.

    Attributes:
        name: The case.
        angle: Largest rms error of a hinge over the clip [deg].
        slide: Largest rms error of a slide over the clip, up to its scale and zero [mm].
        seen: Share of the frames that were measured.
        ratio: Largest error of a length after location, up to the common scale [%].
        length: Largest error of a length after identification [%].
        width: Largest error of a width after identification [%].
        ahead: Largest rms error of a hinge in the prediction [deg].
        ahead_slide: Largest rms error of a slide in the prediction, up to its zero [mm].
        seconds: Wall time of segment, locate, track, identify [s].
        notes: What else went wrong.
        skipped: Why the case could not be run, or empty.
    """

    name: str
    angle: float = np.nan
    slide: float = np.nan
    seen: float = np.nan
    ratio: float = np.nan
    length: float = np.nan
    width: float = np.nan
    ahead: float = np.nan
    ahead_slide: float = np.nan
    seconds: list[float] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    skipped: str = ""

    @property
    def failed(self) -> list[str]:
        """Names of the limits that are not met."""
        if self.skipped:
            return []
        kinds = CASES[self.name].parts
        hinges = any(part.kind == "hinge" for part in kinds)
        slides = any(part.kind == "slide" for part in kinds)
        skip = {*(() if hinges else ("angle", "ahead")), *(() if slides else ("slide", "ahead_slide"))}
        # written so that NaN fails: a figure that is missing although the case has such joints
        found = [
            name for name, most in LIMITS.items() if name not in skip and not getattr(self, name) <= most
        ]
        return found + (["seen"] if not self.seen >= LEAST_SEEN else [])


def measure(name: str, clips: Path | None, pictures: Path | None) -> Result:
    """Run one case.

    Args:
        name: Of the case.
        clips: Folder of the clips; None for the usual one.
        pictures: Folder for a picture of masks and outlines; None for none.

    Returns:
        What came of it, also when it failed.
    """
    result = Result(name)
    try:
        _run(cached(CASES[name], clips), result, pictures)
    except NoRenderer as error:
        result.skipped = str(error)
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        result.notes.append(f"{type(error).__name__} ({Path(last.filename).name}:{last.lineno}): {error}")
    return result


def _run(clip: Clip, result: Result, pictures: Path | None) -> None:
    """Go from the clip to the prediction and judge every stage."""
    import monodyn

    truth = monodyn.load(clip.truth)
    clock = [time.perf_counter()]
    masks = monodyn.segment(monodyn.read(clip.video))
    clock.append(time.perf_counter())
    scene = monodyn.locate(masks, monodyn.load(clip.model))
    clock.append(time.perf_counter())
    poses = monodyn.track(scene.masks, scene)
    clock.append(time.perf_counter())
    hinge = np.array([joint.kind == "hinge" for joint in truth.joints])
    result.seconds = np.diff(clock).tolist()
    result.seen = float(np.mean(poses.seen))
    errors = _tracked_errors(poses.position, clip.position, hinge, result)
    result.angle, result.slide = _worst(errors, hinge)
    result.ratio = _sizes(scene.mechanism.values, truth.values, ".length", scaled=True)
    if pictures is not None:
        from drawings import draw

        draw(clip, scene, poses, errors, pictures / f"{clip.case.name}.png")
    _judge_fit(clip, scene.mechanism, poses, hinge, result)


def _judge_fit(clip: Clip, mechanism: Mechanism, poses: Poses, hinge: np.ndarray, result: Result) -> None:
    """Identify on the first frames and compare sizes and prediction with the truth."""
    import monodyn

    truth = monodyn.load(clip.truth).values
    stop = int(np.searchsorted(poses.time, FIT_SECONDS - STAMP))
    last = int(np.searchsorted(poses.time, 2 * FIT_SECONDS - STAMP))
    began = time.perf_counter()
    fit = monodyn.identify(poses[:stop], mechanism)
    result.seconds.append(time.perf_counter() - began)
    if not fit.ok:
        result.notes.append(f"fit: {fit.status}")
    found = {p.name: p.value for p in fit.parameters}
    result.length = _sizes(found, truth, ".length")
    result.width = _sizes(found, truth, ".width")
    if not fit.starts or last <= stop:
        return
    # a slide's zero is a matter of the camera: its mean error over the fitted frames does not count
    past = monodyn.fill(fit, poses.time[:stop]).position - clip.position[:stop]
    ahead = monodyn.predict(fit, times=poses.time[stop:last]).position - clip.position[stop:last]
    ahead = np.where(hinge, _wrapped(ahead), ahead - past.mean(0))
    result.ahead, result.ahead_slide = _worst(ahead, hinge)


def _tracked_errors(found: np.ndarray, truth: np.ndarray, hinge: np.ndarray, result: Result) -> np.ndarray:
    """Return tracked minus true positions [rad or m], (frame, dof); slides up to their scale and zero."""
    if found.shape != truth.shape:
        result.notes.append(f"{len(found)} of {len(truth)} frames came back")
    count = min(len(found), len(truth))
    errors = found[:count] - truth[:count]
    for i in range(errors.shape[1]):
        seen = np.isfinite(errors[:, i])
        if not hinge[i]:
            # a picture leaves scale and zero of a slide open: the straight line of least squares removes both
            line = np.column_stack([found[:count, i][seen], np.ones(seen.sum())])
            best = np.linalg.lstsq(line, truth[:count, i][seen])[0]
            errors[seen, i] = line @ best - truth[:count, i][seen]
        # one number of whole turns for all frames is a matter of where counting began; a change is an error
        elif len(np.unique(np.round(errors[seen, i] / (2 * np.pi)))) > 1:
            result.notes.append(f"joint {i + 1} lost count of its turns")
    return np.where(hinge, _wrapped(errors), errors)


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Return angles brought into -pi to pi [rad]."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _worst(errors: np.ndarray, hinge: np.ndarray) -> tuple[float, float]:
    """Return the largest rms of the hinges [deg] and of the slides [mm]; NaN where there is none."""
    seen = errors[np.all(np.isfinite(errors), axis=1)]
    if not len(seen):
        return np.nan, np.nan
    rms = np.sqrt(np.mean(seen**2, axis=0))
    angles, slides = np.degrees(rms[hinge]), 1e3 * rms[~hinge]
    return max(angles.tolist(), default=np.nan), max(slides.tolist(), default=np.nan)


def _sizes(found: dict[str, float], truth: dict[str, float], ending: str, *, scaled: bool = False) -> float:
    """Return the largest error of the sizes with an ending [%], up to a common scale if ``scaled``."""
    ratio = np.array(
        [found[n] / truth[n] for n in truth if n.endswith(ending) and truth[n] > 0 and n in found]
    )
    if scaled:
        ratio = ratio / np.exp(np.mean(np.log(ratio)))
    return float(100 * np.max(np.abs(ratio - 1))) if len(ratio) else np.nan


def row(result: Result) -> str:
    """Return one line of the table.

    Args:
        result: Of a case.
    """

    if result.skipped:
        return f"{result.name:31}SKIPPED {result.skipped}"

    def show(value: float, form: str) -> str:
        return format(value, form) if np.isfinite(value) else "-".rjust(int(form.split(".")[0]))

    cells = [show(result.angle, "7.3f"), show(result.slide, "6.2f"), show(100 * result.seen, "5.0f")]
    cells += [show(result.ratio, "6.2f"), show(result.length, "6.2f"), show(result.width, "6.2f")]
    cells += [show(result.ahead, "7.2f"), show(result.ahead_slide, "6.2f")]
    times = "+".join(f"{s:.1f}" for s in result.seconds)
    failed = result.failed
    verdict = "FAIL " + ",".join(failed) if failed else "OK"
    return (
        f"{result.name:31}"
        + " ".join(cells)
        + f"  {times:18}{verdict}"
        + "".join(f"\n    {n}" for n in result.notes)
    )


HEAD = (
    f"{'case':31}{'rms deg':>7} {'mm':>6} {'seen%':>5} {'rat%':>6} {'len%':>6} {'wid%':>6} "
    f"{'ahead':>7} {'mm':>6}  seconds"
)
"""Head of the table."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the cases and print the table.

    Args:
        words: Command line; None takes the program's own.

    Returns:
        The number of cases that do not meet the limits.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=list(CASES), help="names, or starts of names")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--clips", type=Path, help="folder that keeps the clips")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of masks and outlines")
    parser.add_argument("--make", action="store_true", help="only make the clips")
    asked = parser.parse_args(words)
    names = [name for name in CASES if any(name.startswith(start) for start in asked.cases)]
    if not names:
        parser.error(f"no case starts with {', '.join(asked.cases)}; cases: {', '.join(CASES)}")
    if asked.pictures:
        asked.pictures.mkdir(parents=True, exist_ok=True)
    if asked.make:
        for name in names:
            print(cached(CASES[name], asked.clips).video, flush=True)
        return 0
    print(HEAD, flush=True)
    results = []
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("spawn")) as pool:
        for result in pool.map(measure, names, [asked.clips] * len(names), [asked.pictures] * len(names)):
            results.append(result)
            print(row(result), flush=True)
    bad = sum(bool(result.failed) for result in results)
    ran = sum(not result.skipped for result in results)
    skipped = len(results) - ran
    print(f"{ran - bad} of {ran} cases ({skipped} skipped) meet the limits {LIMITS}, seen {LEAST_SEEN}")
    return bad


if __name__ == "__main__":
    raise SystemExit(min(main(), MOST_EXIT))
