"""Print how soon, how exactly and how fast a stream is identified while it goes on, and what that costs.

Run: ``MONODYN_DATA=<folder> python benchmarks/live.py [--only NAME ...] [--json FILE] [--gate]``.
``accuracy`` compares what is known at every second of a clip with its truth, ``batch`` with one fit of the
same frames; ``soon`` plays clips with a truth at their own pace until the mechanism is found, ``paced`` drawn
ones, ``memory`` a stream of half an hour as fast as it goes. Times are those of an idle machine.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import dropwhile
from pathlib import Path
from typing import Any

import numpy as np

import monodyn
from accuracy import differences, rms, true_sizes
from cases import chain
from clips import cached
from endless import SWING, followed, let_go
from figures import Figure, command_line, finish, say, table
from monodyn.checks import drawn_mechanism
from monodyn.live.settings import LiveSettings
from monodyn.live.sources import open_source
from monodyn.live.step import Step
from monodyn.live.stream import Session
from monodyn.settings import RunSettings
from monodyn.types import Camera
from monodyn.vision.drawing.outline import covered_pixels
from spec import Case
from speed import monodyn_command

CLIPS = ("double_a", "single", "double_b", "triple", "bob", "cartpole")
"""Clips of ``MONODYN_DATA`` that swing freely; the first one has targets."""
EARLY, LATE = 2, 5
"""Seconds of motion from which on the wide targets hold, and the narrow ones."""
LENGTH, ANGLE = {EARLY: 0.5, LATE: 0.2}, {EARLY: 1.5, LATE: 0.5}
"""Targets of the worst length [%], and of the worst angle of the next second, rms [deg]."""
WHOLE = 10.0
"""Seconds after which the window is compared with one fit of all of them."""
SWUNG = chain((0.22, 0.18), (0.03, 0.027), damping=2e-5)
"""A pendulum that still swings after a minute."""
PACED = {
    30: Case("paced_30", SWUNG, (-0.7, 0.5), seconds=60.0),
    120: Case("paced_120", SWUNG, (-0.7, 0.5), seconds=30.0, rate=120),
}
"""Clips that are played, by their frames a second."""
WARM = 3.0
"""Seconds of such a clip that are followed first, so that everything is compiled."""
SOON = (
    ("triple", None), ("triple", "chain:3"), ("cartpole", None), ("double_a", None), ("double_b", "double"),
    ("single", None), ("bob", None),
)  # fmt: skip
"""Clips of ``MONODYN_DATA`` in which it is looked for, some by another mechanism than that of their file."""
TURNED, MOVED, UNCOVERED = 30.0, 0.1, 0.5
"""Enough motion, by the truth: every hinge has turned by as much since the first frame [deg], every slide has
moved by this share of its body's length, and this share of the pixels that the mechanism covered in the first
frame has been seen without it."""
FOUND = 3.0
"""Seconds of the stream from enough motion on within which it is followed."""
GUESSED = "It is followed as a first guess has it."
"""How what is said begins until the search in all that was watched has ended."""
SETTLED = 300.0
"""Seconds of a stream after which its memory grows no more."""


@dataclass(frozen=True)
class Filmed:
    """A clip with the model that a user gives.

    Attributes:
        video: The clip.
        model: Its mechanism file.
    """

    video: Path
    model: Path

    @property
    def name(self) -> str:
        """What it is called."""
        return self.video.parent.name.partition("-")[0] if self.video.stem == "clip" else self.video.stem


def main() -> int:
    """Measure what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    # on Linux a process begins with the peak memory of the one that started it: that stream comes first
    parts: dict[str, Callable[[Path, float], list[Figure]]] = {
        "memory": lambda _, seconds: memory(seconds),
        "accuracy": lambda data, _: [figure for name in CLIPS for figure in accuracy(data, name)],
        "batch": lambda data, _: batch(_given(data, CLIPS[0])) + batch(_drawn(PACED[30])),
        "soon": lambda data, _: [figure for case in SOON for figure in soon(data, *case)],
        "paced": lambda *_: [figure for rate in PACED for figure in paced(rate)],
    }
    parser = command_line(__doc__, tuple(parts))
    parser.add_argument(
        "--minutes", type=float, default=30.0, metavar="N", help="length of the stream of memory (30)"
    )
    options = parser.parse_args()
    chosen, data = options.only or tuple(parts), Path(os.environ.get("MONODYN_DATA") or "missing")
    if {"accuracy", "batch", "soon"} & {*chosen} and not (data / "rendered").is_dir():
        print("live.py: expected MONODYN_DATA with rendered/, found none; set it.", file=sys.stderr)
        return 2
    figures = []
    for name in (part for part in parts if part in chosen):
        say(f"{name} ...")
        figures += parts[name](data, 60.0 * options.minutes)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def accuracy(data: Path, name: str) -> list[Figure]:
    """Compare what is known of a clip at every whole second with its truth.

    Args:
        data: The data folder.
        name: Name of the clip.

    Returns:
        The worst length and the worst angle of the next second by time, and how often all intervals of
        lengths hold.
    """
    truth = json.loads((data / "rendered" / f"{name}.json").read_text(encoding="utf-8"))
    clip, begin = _given(data, name), truth["times"][0]
    figures, held, second = [], [], EARLY
    for step in monodyn.stream(clip.video, clip.model):
        # a stamp of three digits stands for itself
        if step.estimate is None or step.time - begin < second - 1e-3:
            continue
        errors, holds = lengths(step, truth["truth"])
        held.append(holds)
        late = LATE if second >= LATE else EARLY
        most = (LENGTH[late], ANGLE[late]) if name == CLIPS[0] else (None, None)
        figures.append(Figure(name, f"worst length at {second} s", errors, "%", most[0]))
        if step.time + 1.0 <= truth["times"][-1] + 1e-3:
            ahead = foreseen(step, np.array(truth["times"]), np.array(truth["q"]))
            figures.append(Figure(name, f"prediction from {second} s", ahead, "deg", most[1]))
        second += 1
    share = 100.0 * float(np.mean(held)) if held else float("nan")
    least = 100.0 if name == CLIPS[0] else None
    return [*figures, Figure(name, "seconds at which all lengths hold", share, "%", least, least=True)]


def lengths(step: Step, truth: dict[str, Any]) -> tuple[float, bool]:
    """Compare the lengths that are known at a frame with the truth.

    Args:
        step: What is known.
        truth: True sizes.

    Returns:
        The worst error [%], and whether the 95 % intervals contain all of them.
    """
    fit = step.fit
    assert fit is not None
    true = true_sizes(truth, tuple(fit.mechanism.values))
    rows = [(fit.parameter(name), size) for name, size in true.items() if name.endswith(".length")]
    worst = max(100.0 * abs(row.value / size - 1.0) for row, size in rows)
    return worst, all(row.lower <= size <= row.upper for row, size in rows)


def foreseen(step: Step, times: np.ndarray, truth: np.ndarray) -> float:
    """Compare what is predicted of the next second with the truth.

    Args:
        step: What is known at a frame.
        times: Times of the true positions [s], (frame,).
        truth: True joint positions [rad or m], (frame, dof).

    Returns:
        The rms error of the worst hinge [deg].
    """
    future, fit = step.future, step.fit
    assert future is not None
    assert fit is not None
    # the zero of a slide is where the camera puts it: it has no truth
    hinges = [dof for dof, joint in enumerate(fit.mechanism.joints) if joint.kind == "hinge"]
    errors = [
        rms(differences(future.position[:, dof], np.interp(future.time, times, truth[:, dof]), turns=True))
        for dof in hinges
    ]
    return float(np.rad2deg(max(errors)))


def batch(clip: Filmed) -> list[Figure]:
    """Compare the window after ten seconds with one fit of the same poses, and a stream with itself.

    Args:
        clip: The clip.

    Returns:
        The worst parameter in standard deviations of that fit, the worst ratio of the two deviations, and
        the largest difference of any number between two streams of the same frames.
    """
    with _session(clip) as session:
        steps = list(_until(session, WHOLE))
        found, poses = session.found, session.identifier.record.whole
    with _session(clip) as session:
        again = list(_until(session, WHOLE))
    if found is None or poses is None or steps[-1].fit is None:
        return [Figure(clip.name, "identified", 0.0, "", 1.0, least=True)]
    scene, fit = found.scene, steps[-1].fit
    slides = np.array([joint.kind == "slide" for joint in scene.mechanism.joints])
    whole = monodyn.identify(
        poses if scene.doubt is None else scene.doubt.with_shifts(poses, slides), scene.mechanism
    )
    rows = [(row, fit.parameter(row.name)) for row in whole.parameters if row.free and np.isfinite(row.std)]
    off = max(abs(other.value - row.value) / row.std for row, other in rows)
    ratios = [other.std / row.std for row, other in rows]
    case = f"{clip.name}, {steps[-1].time:.2f} s"
    return [
        Figure(case, "worst parameter, off the batch fit", off, "deviations", 0.3),
        Figure(case, "deviation over that of the batch fit, least", min(ratios), "times"),
        Figure(case, "the same, most", max(ratios), "times"),
        Figure(case, "the same frames again, difference", unlike(steps, again), "", 0.0),
    ]


def unlike(steps: list[Step], again: list[Step]) -> float:
    """Return the largest difference of any number that two streams of the same frames give; infinite where
    one knows what the other does not.

    Args:
        steps: Steps of the one.
        again: Steps of the other.
    """
    if len(steps) != len(again):
        return float("inf")
    most = 0.0
    for one, other in zip(steps, again, strict=True):
        for mine, others in zip(_numbers(one), _numbers(other), strict=True):
            if mine.shape != others.shape or (np.isnan(mine) != np.isnan(others)).any():
                return float("inf")
            most = max(most, float(np.nanmax(np.abs(mine - others), initial=0.0)))
    return most


def _numbers(step: Step) -> list[np.ndarray]:
    """Return pose, its covariance, prediction and covariance of the parameters; empty where unknown."""
    pose, known, none = step.pose, step.estimate, np.zeros(0)
    poses = [none, none] if pose is None else [pose.position, pose.covariance]
    return [*poses, *([none, none] if known is None else [known.future.position, known.covariance])]


def soon(data: Path, name: str, model: str | None) -> list[Figure]:
    """Play a clip at its own pace to ``monodyn live``, in a process of its own, until what it shows is found.

    Args:
        data: The data folder.
        name: Name of the clip.
        model: The mechanism; None for that of its file.

    Returns:
        When enough has moved, and how long after that the mechanism is followed, as it was guessed first and
        as the search has found it, and identified.
    """
    clip = _given(data, name)
    mechanism = model or str(clip.model)
    say(f"  {name}, {mechanism}: compiled first ...")
    settings, live = RunSettings(), LiveSettings()
    source = open_source(clip.video, live)
    with Session(source, drawn_mechanism(mechanism, settings), live, settings) as session:
        for _ in _until(session, WARM):
            pass
    before = _taken_away()
    with tempfile.TemporaryDirectory() as folder:
        lines = Path(folder) / "lines.ndjson"
        words = ["live", str(clip.video), "--model", mechanism, "--pace", "real", "--quiet"]
        subprocess.run([*monodyn_command(), *words, "--ndjson", str(lines)], check=False, capture_output=True)
        steps = [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines()]
    begin, never = enough_motion(data, name), float("inf")
    following = [step for step in steps if step["phase"] == "following"]
    at = {
        "followed": next((step["time"] for step in following), never),
        "searched": next((step["time"] for step in following if not step["said"].startswith(GUESSED)), never),
        "identified": next((step["time"] for step in steps if step["verdict"]), never),
    }
    case = name if model is None else f"{name}, {model}"
    return [
        Figure(case, "enough motion", begin, "s"),
        Figure(case, "followed, after that", at["followed"] - begin, "s", FOUND),
        Figure(case, "by what the search has found", at["searched"] - begin, "s"),
        Figure(case, "identified, after that", at["identified"] - begin, "s"),
        Figure(case, "processor time taken away meanwhile", _taken_away() - before, "s"),
    ]


def enough_motion(data: Path, name: str) -> float:
    """Return from which time on a clip shows enough motion, by its truth [s].

    Args:
        data: The data folder.
        name: Name of the clip.
    """
    clip = data / "rendered" / name
    truth = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    mechanism = monodyn.load(clip.with_suffix(".xml"))
    mechanism = mechanism.with_values(true_sizes(truth["truth"], tuple(mechanism.values)))
    camera, position = _camera_of(truth["camera"]), np.array(truth["q"])
    way = np.maximum.accumulate(position) - np.minimum.accumulate(position)
    needed = [
        np.deg2rad(TURNED) if joint.kind == "hinge" else MOVED * mechanism.values[f"{joint.body}.length"]
        for joint in mechanism.joints
    ]
    left = covered_pixels(mechanism, camera, position[0], margin=0.0)
    most = (1.0 - UNCOVERED) * left.sum()
    for time, pose, moved in zip(truth["times"], position, way, strict=True):
        left &= covered_pixels(mechanism, camera, pose, margin=0.0)
        if np.all(moved >= needed) and left.sum() <= most:
            return float(time)
    return float("inf")


def _camera_of(truth: dict[str, Any]) -> Camera:
    """Return the camera of a clip that looks squarely at the plane of its mechanism."""
    x, away, z = map(float, truth["pos"].split())
    focal = 0.5 * truth["h"] / np.tan(0.5 * np.radians(truth["fovy"]))
    return Camera(truth["w"], truth["h"], float(focal), x, z, -away)


def paced(rate: int) -> list[Figure]:
    """Play a drawn clip at its own pace to ``monodyn live``, in a process of its own.

    Args:
        rate: Frames a second.

    Returns:
        Frames that were skipped, or came without having been identified with, and how long poses and what
        was identified took from the arrival of their frames; the processor time that other machines had.
    """
    clip, case = _drawn(PACED[rate]), f"{rate} frames a second"
    say("  compiled first ...")
    with _session(clip) as session:
        for _ in _until(session, WARM):
            pass
    with tempfile.TemporaryDirectory() as folder:
        lines = Path(folder) / "lines.ndjson"
        words = ["live", str(clip.video), "--model", str(clip.model), "--pace", "real", "--quiet"]
        before = _taken_away()
        subprocess.run([*monodyn_command(), *words, "--ndjson", str(lines)], check=False)
        taken = _taken_away() - before
        steps = [json.loads(line) for line in lines.read_text(encoding="utf-8").splitlines()]
    followed_ = [step for step in steps if step["phase"] == "following"]
    # what waited while the mechanism was looked for is identified with together, before the first
    started = [step["fresh"] for step in dropwhile(lambda step: step["fresh"] is None, followed_)]
    fresh = [seconds for seconds in started if seconds is not None]
    late = len(started) - len(fresh) if started else len(followed_)
    pose = 1e3 * np.percentile([step["latency"] for step in followed_] or [np.nan], [50.0, 99.0])
    known = 1e3 * np.percentile(fresh or [np.nan], [50.0, 99.0])
    usual = rate == 30
    return [
        Figure(case, "frames followed", float(len(followed_)), ""),
        Figure(case, "frames skipped", float(steps[-1]["skipped"] if steps else np.nan), "", 0.0),
        Figure(case, "frames not identified with", float(late), "", 0.0 if usual else None),
        Figure(case, "pose, median", float(pose[0]), "ms"),
        Figure(case, "pose, 99 of 100", float(pose[1]), "ms", None if usual else 16.0),
        Figure(case, "identified, median", float(known[0]), "ms"),
        Figure(case, "identified, 99 of 100", float(known[1]), "ms", 33.0 if usual else None),
        Figure(case, "processor time taken away meanwhile", taken, "s"),
    ]


def _taken_away() -> float:
    """Return the processor time that other machines have had of this one's cores so far [s]; NaN where the
    system does not tell: Linux alone does, and where it is the only one it is 0."""
    try:
        stolen = Path("/proc/stat").read_text(encoding="ascii").split(maxsplit=9)[8]
    except OSError:
        return np.nan
    return int(stolen) / os.sysconf("SC_CLK_TCK")


def memory(seconds: float) -> list[Figure]:
    """Follow a stream as fast as it goes, in a process of its own, and watch its memory.

    Args:
        seconds: Length of the stream [s].

    Returns:
        The peak, how much it grows from the first minutes to the last, and the share of frames with which
        was identified.
    """
    found = followed(let_go(SWING), seconds)
    case, settled = f"{seconds / 60.0:g} minutes, {found.frames} frames", min(SETTLED, seconds / 6.0)
    growth = found.most(seconds - settled, seconds) - found.most(settled, 2.0 * settled)
    share = 100.0 * found.known / max(found.since, 1)
    return [
        Figure(case, "peak memory", found.peak, "MB", 400.0),
        Figure(case, f"growth from {settled / 60.0:g} minutes on", growth, "MB", 10.0),
        Figure(case, "frames identified with, once found", share, "%", 99.0, least=True),
    ]


def _given(data: Path, name: str) -> Filmed:
    """Return a clip of the data folder."""
    clip = data / "rendered" / name
    return Filmed(clip.with_suffix(".mp4"), clip.with_suffix(".xml"))


def _drawn(case: Case) -> Filmed:
    """Return a clip that is drawn on first use."""
    say(f"  drawing {case.name} where it is not there yet ...")
    clip = cached(case)
    return Filmed(clip.video, clip.model)


def _session(clip: Filmed) -> Session:
    """Return a stream of a clip as fast as it goes."""
    settings, live = RunSettings(), LiveSettings()
    mechanism = drawn_mechanism(clip.model, settings)
    return Session(open_source(clip.video, live), mechanism, live, settings)


def _until(session: Session, seconds: float) -> Iterator[Step]:
    """Yield the steps of a stream up to a time, without their pictures."""
    for step in session.steps():
        yield replace(step, frame=replace(step.frame, luma=step.frame.luma[:1, :1], chroma=None))
        if step.time >= seconds - 1e-3:
            session.stop()


if __name__ == "__main__":
    raise SystemExit(main())
