"""Compare the published method with the default one, and the torque models, on clips with known truth.

Run: ``MONODYN_DATA=<folder> python benchmarks/published.py [--only NAME ...] [--json FILE] [--gate]``.
Frames 0:40 of the passive clips are fitted and the next 40 predicted; 0:200 of the driven one are fitted.
The published forms alone, Figure 2 both ways, Case II over three numbers of frames and raw starts, are
measured on the passive clips and on the clip that ``monodyn reproduce`` makes; the statuses of the fits go to
the standard error. Of other mechanisms and of real film it is measured how the published method follows them.
Everything but the fits of the published forms alone is run once before it is timed. Locating and fitting with
both methods count with the median of three runs; the published forms are timed once.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

import monodyn
from accuracy import FITTED
from figures import Figure, finish, say, table
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.paper.track import PaperPoses
from monodyn.reproduce.clip import ClipSettings, make_clip
from monodyn.reproduce.repetition import START
from monodyn.results.torques import torques
from published_forms import (
    Clip,
    ahead_errors,
    as_it_comes,
    case_two,
    frameworks,
    pose_errors,
    raw_starts,
)
from published_systems import real_film, system

Result = TypeVar("Result")
STUDY_FRAMES = 200
"""Frames of the made clip: those of the longest fit and those predicted after it."""
DRIVEN = 200
"""Fitted frames of the clip with torques."""
POSE, RESIDUAL = 1.0, 3.0
"""Most that the published method may miss poses and filtered start states by [deg]."""
SERIES, FREE, TORQUE, PERIOD = 0.2, 0.05, 8.0, 1.0
"""Most residual of Cases II and III [deg], error of the torque [%] and of its period [%]."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one method makes of a clip.

    Attributes:
        poses: What was tracked.
        fit: The fit of the first frames.
        drawn: Silhouettes drawn to locate the mechanism, None where they are not counted, and by frame to
            follow it.
        seconds: To locate, by frame to follow, to fit.
    """

    poses: monodyn.Poses
    fit: monodyn.Fit
    drawn: tuple[float | None, float]
    seconds: tuple[float, float, float]


def main() -> int:
    """Return the exit code after running the chosen clips and printing the table; 2 when data are missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=CLIPS, metavar="NAME", help=f"of {', '.join(CLIPS)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures there")
    parser.add_argument("--gate", action="store_true", help="exit code 1 when a target is missed")
    options = parser.parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing")
    if not (data / "rendered").is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    for name in options.only or CLIPS:
        began = time.perf_counter()
        figures += CLIPS[name](data / ("real" if CLIPS[name] is real_film else "rendered") / name)
        say(f"{name}: {time.perf_counter() - began:.1f} s")
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def passive(clip: Path) -> list[Figure]:
    """Return the figures of both methods on a passive double pendulum, with friction alone (Case I).

    Args:
        clip: The clip without its ending.
    """
    truth = np.array(json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))["q"])
    methods = {name: run(clip, name) for name in ("paper", "fast")}
    figures = []
    for name, found in methods.items():
        figures += against_truth(f"{clip.name}, {name}", found, truth, asked=name == "paper")
    figures += compared(clip.name, methods["paper"], methods["fast"], truth)
    document = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    lengths = np.array([link[0] for link in document["truth"]["links"]])
    return figures + published_forms(clip, truth, lengths)


def published_forms(clip: Path, truth: np.ndarray, lengths: np.ndarray) -> list[Figure]:
    """Return what is measured of the published forms alone.

    Args:
        clip: The clip without its ending.
        truth: True positions [rad], (frame, dof).
        lengths: True length of each link [m], (body,).
    """
    mechanism = monodyn.load(clip.with_suffix(".xml"))
    masks = monodyn.segment(monodyn.read(clip.with_suffix(".mp4")))
    given = Clip(clip.name, mechanism, masks, truth, lengths)
    figures, scene, poses = frameworks(given)
    return figures + case_two(given, scene, poses) + raw_starts(given, scene, poses)


def study(clip: Path) -> list[Figure]:
    """Return the same on the clip that ``monodyn reproduce`` makes, with more frames of it.

    Args:
        clip: Gives the name alone; the clip is made.
    """
    with tempfile.TemporaryDirectory() as folder:
        clip = Path(folder) / clip.name
        true = make_clip(clip.with_suffix(".mp4"), ClipSettings(frames=STUDY_FRAMES))
        clip.with_suffix(".xml").write_text(START, encoding="utf-8")
        return published_forms(clip, true.position, np.array(ClipSettings().pendulum.length))


def run(clip: Path, method: str) -> Outcome:
    """Return what locating, tracking and fitting with one method give.

    Args:
        clip: The clip without its ending.
        method: ``paper`` or ``fast``.
    """
    mechanism = monodyn.load(clip.with_suffix(".xml"))
    masks = monodyn.segment(monodyn.read(clip.with_suffix(".mp4")))
    locate, track, fit = (
        settings(method=method)
        for settings in (monodyn.LocateSettings, monodyn.TrackSettings, monodyn.IdentifySettings)
    )
    camera = monodyn.CameraSettings(method=method)
    scene, to_locate = timed(lambda: monodyn.locate(masks, mechanism, locate, camera=camera))
    poses, to_track = timed(lambda: monodyn.track(scene.masks, scene, track), runs=1)
    found, to_fit = timed(lambda: monodyn.identify(poses[:FITTED], scene.mechanism, fit))
    each = float(np.mean(poses.evaluations)) if isinstance(poses, PaperPoses) else 0.0
    first = float(scene.evaluations) if isinstance(scene, PaperScene) else None
    return Outcome(poses, found, (first, each), (to_locate, to_track / len(poses), to_fit))


def timed(step: Callable[[], Result], runs: int = 3) -> tuple[Result, float]:
    """Return the result of a step and its median time [s], after one run that loads and compiles.

    Args:
        step: What to run.
        runs: How often it is timed.
    """
    result, seconds = step(), []
    for _ in range(runs):
        began = time.perf_counter()
        result = step()
        seconds.append(time.perf_counter() - began)
    return result, float(np.median(seconds))


def against_truth(case: str, found: Outcome, truth: np.ndarray, *, asked: bool) -> list[Figure]:
    """Return the errors of poses and prediction against the truth.

    Args:
        case: What was run.
        found: What came of it.
        truth: True positions [rad], (frame, dof).
        asked: True where the targets hold.
    """
    names = [joint.name for joint in found.fit.mechanism.joints]
    poses, future = pose_errors(found.poses, truth), ahead_errors(found.fit, found.poses, truth)
    figures = [Figure(case, "frames seen, 0:40", 100.0 * float(found.poses.seen[:FITTED].mean()), "%")]
    for dof, name in enumerate(names):
        figures.append(Figure(case, f"{name}, 0:40", poses[dof], "deg", POSE if asked else None))
    for dof, name in enumerate(names):
        residual = float(np.degrees(found.fit.rms[name]))
        figures.append(Figure(case, f"{name} residual", residual, "deg", RESIDUAL if asked else None))
        figures.append(Figure(case, f"{name} predicted, 40:80", future[dof], "deg"))
    unknowns = sum(p.free for p in found.fit.parameters)
    figures.append(Figure(case, "unknowns besides the start state", unknowns, ""))
    figures.append(Figure(case, "rollouts of the fit", found.fit.evaluations, ""))
    if found.drawn[0] is None:
        figures.append(Figure(case, "silhouettes to locate (not counted)", float("nan"), ""))
    else:
        figures.append(Figure(case, "silhouettes to locate", found.drawn[0], ""))
    figures.append(Figure(case, "silhouettes a frame", found.drawn[1], ""))
    for what, value in zip(("locate", "track a frame", "fit"), found.seconds, strict=True):
        figures.append(Figure(case, what, 1e3 * value, "ms"))
    return figures


def compared(name: str, paper: Outcome, fast: Outcome, truth: np.ndarray) -> list[Figure]:
    """Return by how much the default method is better, as ratios that must exceed one.

    Args:
        name: Name of the clip.
        paper: The published method.
        fast: The default method.
        truth: True positions [rad], (frame, dof).
    """
    joints = [joint.name for joint in fast.fit.mechanism.joints]
    both, pairs = (paper, fast), []
    for dof, joint in enumerate(joints):
        pairs.append((f"{joint}, 0:40", *(pose_errors(one.poses, truth)[dof] for one in both)))
        pairs.append((f"{joint} residual", *(one.fit.rms[joint] for one in both)))
        future = (ahead_errors(one.fit, one.poses, truth)[dof] for one in both)
        pairs.append((f"{joint} predicted", *future))
    for k, what in enumerate(("locate", "track a frame", "fit")):
        pairs.append((f"time to {what}", paper.seconds[k], fast.seconds[k]))
    return [
        Figure(f"{name}, paper / fast", what, a / b if b else float("inf"), "", 1.0, least=True)
        for what, a, b in pairs
    ]


def driven(clip: Path) -> list[Figure]:
    """Return the figures of a periodic and of a free torque, default solver (Cases II and III).

    Args:
        clip: The clip without its ending.
    """
    document = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    applied = np.array(document["u"])[:DRIVEN]
    scene = monodyn.locate(
        monodyn.segment(monodyn.read(clip.with_suffix(".mp4"))), monodyn.load(clip.with_suffix(".xml"))
    )
    poses = monodyn.track(scene.masks, scene)[:DRIVEN]
    thick = {f"link{i}.thickness": link[2] for i, link in enumerate(document["truth"]["links"], start=1)}
    known = scene.mechanism.with_choices(fix=thick)
    true_period = period_of(applied[:, 0], poses.time)
    figures = []
    for model, most in (("fourier", SERIES), ("free", FREE)):
        case = f"{clip.name}, {model}"
        settings = monodyn.IdentifySettings(torque=model)
        fit, seconds = timed(partial(monodyn.identify, poses, scene.mechanism, settings))
        for name, value in fit.rms.items():
            figures.append(Figure(case, f"{name} residual", float(np.degrees(value)), "deg", most))
        unknowns = sum(p.free for p in fit.parameters)
        figures.append(Figure(case, "unknowns besides the start state", unknowns, ""))
        figures.append(Figure(case, "fit", 1e3 * seconds, "ms"))
        if model == "fourier":
            fit = monodyn.identify(poses, known, settings)
            figures += torque_figures(f"{case}, thickness known", fit, poses.time, applied, true_period)
    published = monodyn.identify(
        poses, scene.mechanism, PaperIdentifySettings(method="paper", torque="fourier")
    )
    return figures + as_it_comes(f"{clip.name}, Case II published form", published, true_period)


def torque_figures(
    case: str, fit: monodyn.Fit, times: np.ndarray, applied: np.ndarray, period: float
) -> list[Figure]:
    """Return how far a torque is from the one that was applied.

    Args:
        case: What was run.
        fit: The fit.
        times: Time stamps [s], (frame,).
        applied: True torques [N m], (frame, dof).
        period: True period [s].
    """
    error = torques(fit, times).torque - applied
    share = 100.0 * np.sqrt(np.mean(error**2, axis=0) / np.mean(applied**2, axis=0))
    off = 100.0 * abs(fit.parameter("torque.period").value / period - 1.0)
    asked = (TORQUE, None)
    return [
        *(Figure(case, f"torque at joint{i + 1}", s, "%", asked[min(i, 1)]) for i, s in enumerate(share)),
        Figure(case, "period", off, "%", PERIOD),
    ]


def period_of(torque: np.ndarray, times: np.ndarray) -> float:
    """Return the period of a sinusoidal torque [s] by least squares.

    Args:
        torque: The torque, (frame,).
        times: Time stamps [s], (frame,).
    """

    def left(period: float) -> float:
        turn = 2.0 * np.pi * times / period
        basis = np.column_stack([np.ones(len(times)), np.cos(turn), np.sin(turn)])
        return float(np.sum((torque - basis @ np.linalg.lstsq(basis, torque, rcond=None)[0]) ** 2))

    span = float(np.ptp(times))
    coarse = min(1.0 / np.arange(0.5 / span, 5.0, 0.05 / span), key=left)
    return min(coarse * np.linspace(0.98, 1.02, 2001), key=left)


CLIPS: dict[str, Callable[[Path], list[Figure]]] = {
    "double_a": passive,
    "double_b": passive,
    "study": study,
    "double_torque": driven,
    "single": system,
    "bob": system,
    "triple": system,
    "cartpole": system,
    "double_occluded": partial(system, hidden=True),
    "double_pendulum": real_film,
}

if __name__ == "__main__":
    raise SystemExit(main())
