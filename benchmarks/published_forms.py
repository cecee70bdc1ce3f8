"""What ``published.py`` measures of the published forms alone: Figure 2, Case II, and raw starts."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

import monodyn
from accuracy import differences, rms
from figures import Figure, say
from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperIdentifySettings, PaperLocateSettings
from monodyn.reproduce.plans import started
from monodyn.types import Poses
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene

LENGTHS, AHEAD = (40, 80, 160), 40
"""Numbers of frames that Case II is fitted to, and frames that are predicted after them."""
SERIES_LENGTH, SERIES_RESIDUAL = 80, 1.5
"""The number of frames whose residual has a target, and the most that it may be [deg]."""
FRAMEWORKS: tuple[Literal["strict", "interleaved"], ...] = ("strict", "interleaved")
"""The ways through Figure 2."""
NEAR_POSE = 1.0
"""The most that the poses behind either may be off [deg]."""
STARTS, SAME_RESIDUAL, SAME_RATIO = 10, 0.05, 0.02
"""Drawn starts; shares by which residuals and mass ratios of fits that ended in one place may differ."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip with what is known of it.

    Attributes:
        name: Its name in the table.
        mechanism: What is given to the methods.
        masks: Its foreground.
        truth: True positions [rad], (frame, dof).
        lengths: True length of each link [m], (body,).
    """

    name: str
    mechanism: Mechanism
    masks: Masks
    truth: np.ndarray
    lengths: np.ndarray


def frameworks(clip: Clip) -> tuple[list[Figure], Scene, Poses]:
    """Locate and track by both ways through Figure 2.

    Args:
        clip: The clip.

    Returns:
        The figures, and scene and poses of the strict way, which the fits are made from.
    """
    figures: list[Figure] = []
    found: dict[str, tuple[PaperScene, Poses]] = {}
    for name in FRAMEWORKS:
        settings = PaperLocateSettings(method="paper", framework=name)
        camera = monodyn.CameraSettings(method="paper")
        monodyn.locate(clip.masks, clip.mechanism, settings, camera=camera)  # compiles
        began = time.perf_counter()
        scene = monodyn.locate(clip.masks, clip.mechanism, settings, camera=camera)
        seconds = time.perf_counter() - began
        assert isinstance(scene, PaperScene)
        poses = monodyn.track(scene.masks, scene, monodyn.TrackSettings(method="paper"))
        found[name] = scene, poses
        case = f"{clip.name}, Figure 2 {name}"
        figures.append(Figure(case, "mismatch", scene.mismatch_px2, "px^2"))
        figures.append(Figure(case, "silhouettes", scene.evaluations, ""))
        figures.append(Figure(case, "locate", 1e3 * seconds, "ms"))
        figures.append(Figure(case, "sub-problems solved", len(scene.history), ""))
        for dof, joint in enumerate(poses.joints):
            error = pose_error(poses, clip.truth, dof)
            figures.append(Figure(case, f"{joint}, 0:{LENGTHS[0]}", error, "deg", NEAR_POSE))
    return figures, *found["strict"]


def pose_error(poses: Poses, truth: np.ndarray, dof: int) -> float:
    """Return the rms error of one joint over the first frames in which it was seen [deg].

    Args:
        poses: What was tracked.
        truth: True positions [rad], (frame, dof).
        dof: Which joint.
    """
    rows = np.flatnonzero(poses.seen[: LENGTHS[0]])
    return float(np.degrees(rms(differences(poses.position[rows, dof], truth[rows, dof], turns=True))))


def case_two(clip: Clip, scene: Scene, poses: Poses) -> list[Figure]:
    """Fit Case II in its published form, a Fourier series alone, to more and more frames.

    Args:
        clip: The clip.
        scene: From the published method.
        poses: From the published method.

    Returns:
        The figures.
    """
    figures: list[Figure] = []
    settings = PaperIdentifySettings(method="paper", torque="fourier")
    for frames in LENGTHS:
        case = f"{clip.name}, Case II 0:{frames}"
        fit = monodyn.identify(poses.part(0, frames), scene.mechanism, settings)
        say(f"{case}: {fit.status}")
        figures += [
            Figure(case, "follows the record", float(fit.ok), "", 1.0, least=True),
            Figure(case, "unknowns", sum(p.free for p in fit.parameters), ""),
            Figure(case, "period", fit.mechanism.values["torque.period"], "s"),
            Figure(case, "periods in the record", _periods(fit, poses, frames), ""),
        ]
        most = SERIES_RESIDUAL if frames == SERIES_LENGTH else None
        for dof, joint in enumerate(poses.joints):
            left = float(np.degrees(fit.rms[joint]))
            figures.append(Figure(case, f"{joint} residual", left, "deg", most))
            figures.append(
                Figure(case, f"{joint} predicted", predicted(fit, poses, clip, frames, dof), "deg")
            )
        for k, true in enumerate(clip.lengths, start=1):
            off = 100.0 * (fit.mechanism.values[f"link{k}.length"] / true - 1.0)
            figures.append(Figure(case, f"link{k}.length off", off, "%"))
        figures.append(Figure(case, "fit", 1e3 * fit.seconds, "ms"))
    return figures


def _periods(fit: Fit, poses: Poses, frames: int) -> float:
    return float(np.ptp(poses.time[:frames]) / fit.mechanism.values["torque.period"])


def predicted(fit: Fit, poses: Poses, clip: Clip, frames: int, dof: int) -> float:
    """Return the rms error of one joint over the frames after a fit [deg].

    Args:
        fit: The fit.
        poses: For the time stamps.
        clip: For the truth.
        frames: Frames that were fitted.
        dof: Which joint.
    """
    ahead = slice(frames, frames + AHEAD)
    future = monodyn.predict(fit, times=poses.time[ahead])
    return float(np.degrees(rms(differences(future.position[:, dof], clip.truth[ahead, dof], turns=True))))


def as_it_comes(case: str, fit: Fit, period: float) -> list[Figure]:
    """Return what the published form makes of a driven clip, without targets.

    Args:
        case: Its name in the table.
        fit: The fit.
        period: True period of the torque [s].
    """
    say(f"{case}: {fit.status}")
    found = fit.mechanism.values["torque.period"]
    return [
        Figure(case, "follows the record", float(fit.ok), ""),
        Figure(case, "period", found, "s"),
        Figure(case, "period off the torque's", 100.0 * (found / period - 1.0), "%"),
        *(Figure(case, f"{name} residual", float(np.degrees(v)), "deg") for name, v in fit.rms.items()),
        Figure(case, "unknowns", sum(p.free for p in fit.parameters), ""),
        Figure(case, "fit", 1e3 * fit.seconds, "ms"),
    ]


def raw_starts(clip: Clip, scene: Scene, poses: Poses) -> list[Figure]:
    """Fit Case I from drawn start values as they are, and count how many end where.

    Args:
        clip: The clip.
        scene: From the published method.
        poses: From the published method.

    Returns:
        The figures.
    """
    settings = PaperIdentifySettings(method="paper", begin="given")
    part, fits = poses.part(0, LENGTHS[0]), []
    for number in range(1, STARTS + 1):
        fits.append(monodyn.identify(part, started(scene.mechanism, number, 0), settings))
    places: list[list[Fit]] = []
    for fit in sorted(fits, key=residual):
        for place in places:
            if _alike(place[0], fit):
                place.append(fit)
                break
        else:
            places.append([fit])
    case = f"{clip.name}, {STARTS} raw starts"
    figures = [Figure(case, "places where the search ends", len(places), "")]
    for k, place in enumerate(places, start=1):
        values = place[0].mechanism.values
        ratio = values["link2.mass"] / values["link1.mass"]
        figures += [
            Figure(case, f"place {k}: starts", len(place), ""),
            Figure(case, f"place {k}: residual", float(np.degrees(residual(place[0]))), "deg"),
            Figure(case, f"place {k}: m2/m1", ratio, ""),
            Figure(case, f"place {k}: link1.length", values["link1.length"], "m"),
        ]
    return figures


def residual(fit: Fit) -> float:
    """Return the residual over all joints, rms [rad].

    Args:
        fit: The fit.
    """
    return rms(np.array(list(fit.rms.values())))


def _alike(one: Fit, other: Fit) -> bool:
    """Return whether two fits ended in one place."""
    a, b = (fit.mechanism.values["link2.mass"] / fit.mechanism.values["link1.mass"] for fit in (one, other))
    near = residual(other) < (1.0 + SAME_RESIDUAL) * residual(one)
    return near and abs(b / a - 1.0) < SAME_RATIO
