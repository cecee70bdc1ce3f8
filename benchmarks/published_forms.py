"""What ``published.py`` measures of the published forms alone: Figure 2, Case II, and raw starts."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

import monodyn
from accuracy import FITTED, differences, rms
from figures import Figure, say
from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism
from monodyn.paper.locate import PaperScene
from monodyn.paper.settings import PaperIdentifySettings, PaperLocateSettings
from monodyn.reproduce.cases import run_case
from monodyn.reproduce.endings import endings
from monodyn.reproduce.plans import Design, FitPlan
from monodyn.reproduce.vision import Seen
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
STARTS = 10
"""Drawn starts."""


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
        for joint, error in zip(poses.joints, pose_errors(poses, clip.truth), strict=True):
            figures.append(Figure(case, f"{joint}, 0:{FITTED}", error, "deg", NEAR_POSE))
    return figures, *found["strict"]


def pose_errors(poses: Poses, truth: np.ndarray) -> np.ndarray:
    """Return the rms error of each joint over the first frames, where they were seen [deg], (dof,).

    Args:
        poses: What was tracked.
        truth: True positions [rad], (frame, dof).
    """
    rows = np.flatnonzero(poses.seen[:FITTED])
    at = poses.frame[rows]
    errors = [
        differences(poses.position[rows, dof], truth[at, dof], turns=True) for dof in range(truth.shape[1])
    ]
    return np.degrees([rms(error) for error in errors])


def ahead_errors(fit: Fit, poses: Poses, truth: np.ndarray, frames: int = FITTED) -> np.ndarray:
    """Return the rms error of each joint over the frames after a fit [deg], (dof,); NaN without a motion.

    Args:
        fit: The fit.
        poses: For the time stamps.
        truth: True positions [rad], (frame, dof).
        frames: Frames that were fitted.
    """
    if not fit.starts:
        return np.full(truth.shape[1], np.nan)
    ahead = slice(frames, frames + AHEAD)
    future = monodyn.predict(fit, times=poses.time[ahead])
    errors = [
        differences(future.position[:, dof], truth[ahead, dof], turns=True) for dof in range(truth.shape[1])
    ]
    return np.degrees([rms(error) for error in errors])


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
        fit = monodyn.identify(poses[:frames], scene.mechanism, settings)
        say(f"{case}: {fit.status}")
        figures += [
            Figure(case, "follows the record", float(fit.ok), "", 1.0, least=True),
            Figure(case, "unknowns", sum(p.free for p in fit.parameters), ""),
            Figure(case, "period", fit.mechanism.values["torque.period"], "s"),
            Figure(case, "periods in the record", _periods(fit, poses, frames), ""),
        ]
        most = SERIES_RESIDUAL if frames == SERIES_LENGTH else None
        future = ahead_errors(fit, poses, clip.truth, frames)
        for joint, ahead in zip(poses.joints, future, strict=True):
            left = float(np.degrees(fit.rms[joint]))
            figures.append(Figure(case, f"{joint} residual", left, "deg", most))
            figures.append(Figure(case, f"{joint} predicted", ahead, "deg"))
        for k, true in enumerate(clip.lengths, start=1):
            off = 100.0 * (fit.mechanism.values[f"link{k}.length"] / true - 1.0)
            figures.append(Figure(case, f"link{k}.length off", off, "%"))
        figures.append(Figure(case, "fit", 1e3 * fit.seconds, "ms"))
    return figures


def _periods(fit: Fit, poses: Poses, frames: int) -> float:
    return float(np.ptp(poses.time[:frames]) / fit.mechanism.values["torque.period"])


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
    # as the experiment makes and groups them
    design = Design(frames=FITTED, ahead=AHEAD, lengths=(), periods=())
    seen = Seen("paper", "done", tuple(scene.mechanism.joints), scene, poses)
    plans = [FitPlan("paper", "I", FITTED, start=number) for number in range(1, STARTS + 1)]
    places = endings([run_case(plan, seen, None, design) for plan in plans], seen.hinges)
    case = f"{clip.name}, {STARTS} raw starts"
    figures = [Figure(case, "places where the search ends", len(places), "")]
    for k, place in enumerate(places, start=1):
        fit = place.cases[0].fit
        assert fit is not None
        values = fit.mechanism.values
        ratio = values["link2.mass"] / values["link1.mass"]
        figures += [
            Figure(case, f"place {k}: starts", len(place.cases), ""),
            Figure(case, f"place {k}: residual", float(np.degrees(place.residual)), "deg"),
            Figure(case, f"place {k}: m2/m1", ratio, ""),
            Figure(case, f"place {k}: link1.length", values["link1.length"], "m"),
        ]
    return figures
