"""Print how exact Monodyn is on clips with known truth and on real records, next to targets and bounds.

Run: ``MONODYN_DATA=<folder> python benchmarks/accuracy.py [--only NAME ...] [--json FILE] [--gate]``.
Every clip is run with default settings; of the truth nothing enters the run.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import monodyn
from bound import bounded, spread_of
from figures import Figure, command_line, finish, say, table
from recordings import ball, encoders, links

FITTED, PREDICTED = 40, 80
"""Frames 0:40 are fitted, 40:80 are predicted."""


@dataclass(frozen=True)
class Targets:
    """What one rendered clip must reach.

    Attributes:
        angle: Error of every joint angle over the clip, rms [deg].
        length: Error of every length [%].
        width: Error of every width [%]; None where there is no target.
        ahead: Error of every predicted joint angle, rms [deg].
        slide: Error of the cart's position over the clip, rms [mm].
        slide_ahead: Error of its prediction, rms [mm].
        damping: Error of damping over inertia, whole clip fitted [%]; None leaves it out.
    """

    angle: float
    length: float
    width: float | None
    ahead: float
    slide: float = float("nan")
    slide_ahead: float = float("nan")
    damping: float | None = None


CLIPS = {
    "single": Targets(0.1, 0.7, 3.0, 0.3, damping=15.0),
    "double_a": Targets(0.15, 1.0, 4.0, 0.75, damping=15.0),
    "double_b": Targets(0.15, 1.0, 4.0, 0.75),
    "triple": Targets(0.3, 1.5, 5.0, 1.5),
    "bob": Targets(0.15, 1.0, None, 0.4),
    "cartpole": Targets(0.2, 1.5, 4.0, 1.0, slide=2.0, slide_ahead=3.0),
}

RECORDINGS: dict[str, Callable[[Path], list[Figure]]] = {
    "double_pendulum": links,
    "holonomic_pendulum": ball,
    "encoders": encoders,
}


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    names = (*CLIPS, *RECORDINGS)
    options = command_line(__doc__, names).parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing")
    if not (data / "rendered").is_dir():
        got = f"'{data}'" if "MONODYN_DATA" in os.environ else "nothing"
        print(
            f"MONODYN_DATA: expected the folder that holds rendered/, real/ and encoders/, got {got}; "
            "set the environment variable.",
            file=sys.stderr,
        )
        return 2
    figures: list[Figure] = []
    for name in options.only or names:
        began = time.perf_counter()
        try:
            found = rendered(data, name) if name in CLIPS else RECORDINGS[name](data)
        except monodyn.MonodynError as error:
            say(f"{name}: {error}")
            found = [Figure(name, "run", float("nan"), "", 0.0)]
        figures += found
        say(f"{name}: {time.perf_counter() - began:.1f} s")
    print(table(figures, bound="bound"))
    return finish(figures, to=options.json, gate=options.gate)


def rendered(data: Path, name: str) -> list[Figure]:
    """Run one rendered clip and compare it with its truth.

    Args:
        data: The data folder.
        name: Name of the clip.

    Returns:
        Its figures.

    Raises:
        FitError: The fit has no start state to predict from.
    """
    targets = CLIPS[name]
    clip = data / "rendered" / name
    mechanism = monodyn.load(clip.with_suffix(".xml"))
    video = monodyn.read(clip.with_suffix(".mp4"))
    scene = monodyn.locate(monodyn.segment(video), mechanism)
    poses = monodyn.track(scene.masks, scene)
    fitted = poses[:FITTED]
    fit = monodyn.identify(fitted, scene.mechanism)
    if not fit.starts:
        raise monodyn.FitError(fit.status)
    if not fit.ok:
        say(f"{name}: {fit.status}")
    # the bound is that of the sizes and the motion that were found: close enough to those of the truth
    least = bounded(fit, fitted, scene.mechanism)
    document = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    q = np.array(document["q"])
    figures = [Figure(name, "frames tracked", 100.0 * float(np.mean(poses.seen)), "%")]
    figures += over_clip(name, targets, fit, poses, q)
    figures += sizes(name, targets, fit, least, document["truth"])
    figures += prediction(name, targets, fit, least, video.times[FITTED:PREDICTED], q[FITTED:PREDICTED])
    if targets.damping is not None:
        whole = monodyn.identify(poses, scene.mechanism)
        figures += dampings(name, targets.damping, whole, document["truth"])
    return figures


def over_clip(
    name: str, targets: Targets, fit: monodyn.Fit, poses: monodyn.Poses, truth: np.ndarray
) -> list[Figure]:
    """Compare the tracked joint positions with the truth; the bound is the tracker's own standard deviation.

    Args:
        name: Name of the clip.
        targets: Its targets.
        fit: Gives the metric scale of slides.
        poses: What was tracked.
        truth: True joint positions [rad or m], (frame, dof).

    Returns:
        The rms error of each joint.
    """
    figures = []
    for dof, joint in enumerate(fit.mechanism.joints):
        slide = joint.kind == "slide"
        unit, factor, scale, most = (
            ("mm", 1e3, fit.scale, targets.slide) if slide else ("deg", np.rad2deg(1.0), 1.0, targets.angle)
        )
        tracked = poses.position[poses.seen, dof] * scale
        spread = np.sqrt(poses.covariance[poses.seen, dof, dof]) * scale
        error = differences(tracked, truth[poses.frame[poses.seen], dof], turns=not slide)
        figures.append(
            Figure(name, f"{joint.name} over the clip", factor * rms(error), unit, most, factor * rms(spread))
        )
    return figures


def sizes(name: str, targets: Targets, fit: monodyn.Fit, least: monodyn.Fit, truth: dict) -> list[Figure]:
    """Compare lengths and widths with the truth.

    Args:
        name: Name of the clip.
        targets: Its targets.
        fit: The fit of the first frames.
        least: The same with the bound as covariance.
        truth: The clip's truth.

    Returns:
        The relative error of each size.
    """
    figures = []
    values = fit.mechanism.values
    for size, true in true_sizes(truth, tuple(values)).items():
        most = targets.length if size.endswith(".length") else targets.width
        error = 100.0 * abs(values[size] / true - 1.0)
        figures.append(Figure(name, size, error, "%", most, 100.0 * spread_of(least, size) / true))
    return figures


def true_sizes(truth: dict, names: tuple[str, ...]) -> dict[str, float]:
    """Return true sizes by parameter name [m]; of a bob the length is that from pivot to ball centre.

    Args:
        truth: The clip's truth.
        names: Parameter names of the mechanism.
    """
    found: dict[str, float] = {}
    for i, (length, width, _) in enumerate(truth["links"], start=1):
        found |= {f"link{i}.length": length, f"link{i}.width": width}
    if truth["bob"]:
        ball = next(name for name in names if name.endswith("sphere.width"))
        found[ball] = 2.0 * truth["bob"]["radius"]
    if truth["cart"]:
        found |= dict(zip(("cart.length", "cart.width"), truth["cart"]["size"], strict=True))
    return dict(sorted(found.items(), key=lambda item: not item[0].endswith(".length")))


def prediction(
    name: str, targets: Targets, fit: monodyn.Fit, least: monodyn.Fit, times: np.ndarray, truth: np.ndarray
) -> list[Figure]:
    """Compare the prediction from the fitted frames alone with the truth.

    Args:
        name: Name of the clip.
        targets: Its targets.
        fit: The fit of the first frames.
        least: The same with the bound as covariance.
        times: Time stamps of the predicted frames [s], (frame,).
        truth: True joint positions there [rad or m], (frame, dof).

    Returns:
        The rms error of each joint.
    """
    future = monodyn.predict(fit, times=times)
    spread = monodyn.predict(least, times=times).std
    figures = []
    for dof, joint in enumerate(fit.mechanism.joints):
        slide = joint.kind == "slide"
        unit, factor, most = (
            ("mm", 1e3, targets.slide_ahead) if slide else ("deg", np.rad2deg(1.0), targets.ahead)
        )
        error = differences(future.position[:, dof], truth[:, dof], turns=not slide)
        figures.append(
            Figure(
                name, f"{joint.name} predicted", factor * rms(error), unit, most, factor * rms(spread[:, dof])
            )
        )
    return figures


def dampings(name: str, most: float, fit: monodyn.Fit, truth: dict) -> list[Figure]:
    """Compare the dampings over the inertia they act on with the truth, for a chain of boxes.

    J_i = I_i + m_i c_i^2 + (sum of the masses further out) L_i^2, about the hinge of link i.

    Args:
        name: Name of the clip.
        most: Target [%].
        fit: The fit of the whole clip.
        truth: The clip's truth.

    Returns:
        The relative error of each ratio, from the first joint on.
    """
    found = {combination.name: combination.value for combination in fit.combinations}
    figures, beyond = [], 0.0
    # from the last link inward: what hangs on a link counts as a point at its end, of the mass summed so far
    for i, (length, width, thickness) in reversed(list(enumerate(truth["links"], start=1))):
        mass = truth["density"] * length * width * thickness
        inertia = mass * (length**2 / 3.0 + width**2 / 12.0) + beyond * length**2
        beyond += mass
        ratio = found.get(f"joint{i}.damping / link{i}.J", float("nan"))
        error = 100.0 * abs(ratio * inertia / truth["damping"][i - 1] - 1.0)
        figures.append(Figure(name, f"joint{i}.damping / link{i}.J, whole clip", error, "%", most))
    return figures[::-1]


def differences(found: np.ndarray, truth: np.ndarray, *, turns: bool) -> np.ndarray:
    """Return found less true positions, (frame,); whole turns that all frames share do not count.

    Args:
        found: Positions [rad or m], (frame,).
        truth: True positions [rad or m], (frame,).
        turns: True for a hinge.
    """
    error = found - truth
    if turns and len(error):
        error = error - 2.0 * np.pi * np.round(np.median(error) / (2.0 * np.pi))
    return error


def rms(values: np.ndarray) -> float:
    """Return the root mean square; NaN of nothing.

    Args:
        values: Numbers, (frame,).
    """
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


if __name__ == "__main__":
    raise SystemExit(main())
