"""What ``published.py`` measures of the published method on other mechanisms and on real film: poses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import monodyn
from accuracy import differences, rms
from figures import Figure
from monodyn.paper.locate import PaperScene
from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.types import FULL, Poses
from monodyn.vision.locating.scene import Scene

ANGLE, SLIDE, SEEN = 1.0, 1.0, 90.0
"""Most that angles [deg] and slides [mm] may be off over the first frames, least share of frames seen [%]."""
FIRST = 40
"""Frames over which poses are compared."""
PIVOT, LINK = (550.0, 494.0), 151.0
"""Where the pivot of the real double pendulum is and how long its first link, as its users measured [px]."""
PIVOT_OFF = 3.0
"""Most that the pivot may be off [px]."""
MISSED = 10.0
"""Most of the first frame's silhouette that may differ from the drawn one [%]."""


def system(clip: Path, *, hidden: bool = False) -> list[Figure]:
    """Return how the published method follows a rendered mechanism.

    Args:
        clip: The clip without its ending.
        hidden: True where something hides the mechanism for a time: the share of frames has no target.
    """
    truth = np.array(json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))["q"])
    scene, poses = followed(clip.with_suffix(".mp4"), clip.with_suffix(".xml"), "paper")
    case = f"{clip.name}, followed by paper"
    seen = Figure(
        case, "frames seen", 100.0 * float(poses.seen.mean()), "%", None if hidden else SEEN, least=True
    )
    figures, rows = [seen], np.flatnonzero(poses.seen)
    for dof, joint in enumerate(scene.mechanism.joints):
        hinge = joint.kind == "hinge"
        found, true = poses.position[rows, dof], truth[poses.frame[rows], dof]
        # a slide is in the start scale and its zero is where the camera was put: both are taken out
        if not hinge:
            found = np.polyval(np.polyfit(found, true, 1), found)
        error = differences(found, true, turns=hinge)[: np.searchsorted(rows, FIRST)]
        off = float(np.degrees(rms(error))) if hinge else 1e3 * rms(error)
        figures.append(
            Figure(case, f"{joint.name}, 0:{FIRST}", off, "deg" if hinge else "mm", ANGLE if hinge else SLIDE)
        )
        if hinge:
            turns = np.ptp(np.round((found - true) / (2.0 * np.pi)))
            figures.append(Figure(case, f"{joint.name}, turns invented", float(turns), "", 0.0))
    return figures


def real_film(clip: Path) -> list[Figure]:
    """Return how the published method follows the real double pendulum.

    Args:
        clip: The clip without its ending.
    """
    case, film = f"{clip.name}, followed by paper", clip.with_suffix(".webm")
    scene, poses = followed(film, "double", "paper")
    _, default = followed(film, "double", "fast")
    camera, scale = scene.camera, scene.camera.focal / scene.camera.depth
    pivot = (camera.width - 1) / 2 - camera.x * scale, (camera.height - 1) / 2 + camera.y * scale
    away = float(np.hypot(*np.subtract(pivot, PIVOT)))
    link = scene.mechanism.values["link1.length"] * scale
    both = poses.seen & default.seen
    assert isinstance(scene, PaperScene)
    first = next(iter(scene.masks.video.frames()))
    area = np.count_nonzero(ClipSilhouettes(scene.masks, scene.level).picture(first) == FULL)
    figures = [
        Figure(case, "frames seen", 100.0 * float(poses.seen.mean()), "%", SEEN, least=True),
        Figure(case, "silhouette that differs", 100.0 * scene.mismatch_px2 / float(area), "%", MISSED),
        Figure(case, f"pivot off {PIVOT}", away, "px", PIVOT_OFF),
        Figure(case, f"first link off {LINK:g} px", abs(link - LINK), "px"),
    ]
    for dof, joint in enumerate(poses.joints):
        apart = differences(poses.position[both, dof], default.position[both, dof], turns=True)
        median = float(np.degrees(np.median(np.abs(apart))))
        figures.append(Figure(case, f"{joint} from the default method's, median", median, "deg"))
    return figures


def followed(film: Path, model: Path | str, method: str) -> tuple[Scene, Poses]:
    """Return scene and poses by one method.

    Args:
        film: The clip.
        model: Mechanism file or bundled name.
        method: ``paper`` or ``fast``.
    """
    masks = monodyn.segment(monodyn.read(film))
    if method == "fast":
        scene = monodyn.locate(masks, monodyn.load(model))
        return scene, monodyn.track(scene.masks, scene)
    camera = monodyn.CameraSettings(method="paper")
    scene = monodyn.locate(masks, monodyn.load(model), monodyn.LocateSettings(method="paper"), camera=camera)
    return scene, monodyn.track(scene.masks, scene, monodyn.TrackSettings(method="paper"))
