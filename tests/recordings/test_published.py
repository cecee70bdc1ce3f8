"""The published method on rendered mechanisms and on a real clip (MONODYN_DATA): poses."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

import monodyn
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene

DATA = Path(os.environ.get("MONODYN_DATA", ""))

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        "MONODYN_DATA" not in os.environ or not (DATA / "rendered").is_dir(),
        reason="MONODYN_DATA has no rendered folder: no clips to follow",
    ),
]


def followed(clip: Path, model: Path | str) -> tuple[Scene, Poses]:
    settings, camera = monodyn.LocateSettings(method="paper"), monodyn.CameraSettings(method="paper")
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip)), monodyn.load(model), settings, camera=camera)
    return scene, monodyn.track(scene.masks, scene, monodyn.TrackSettings(method="paper"))


@pytest.mark.parametrize("name", ["bob", "cartpole", "double_occluded"])
def test_angles_of_rendered_clips(name: str) -> None:
    """Within a degree over 40 frames, in one turn over the whole clip, also after thirteen hidden frames."""
    clip = DATA / "rendered" / name
    scene, poses = followed(clip.with_suffix(".mp4"), clip.with_suffix(".xml"))
    truth = np.array(json.loads(clip.with_suffix(".json").read_text())["q"])[poses.frame]
    hinge = np.array([joint.kind == "hinge" for joint in scene.mechanism.joints])
    off = (poses.position - truth)[:, hinge]
    error = np.degrees((off + np.pi) % (2 * np.pi) - np.pi)
    assert poses.seen.all() or name == "double_occluded"
    assert np.sqrt(np.nanmean(error[:40] ** 2, axis=0)).max() < 1.0
    turns = np.round(off[poses.seen] / (2 * np.pi))
    assert np.ptp(turns, axis=0).max() == 0.0


def test_the_real_double_pendulum() -> None:
    """Its pivot was measured near (550, 494) within a pixel or two, its first link 151 px long."""
    scene, poses = followed(DATA / "real" / "double_pendulum.webm", "double")
    camera, scale = scene.camera, scene.camera.focal / scene.camera.depth
    assert poses.seen.mean() > 0.9
    assert scene.mechanism.values["link1.length"] * scale == pytest.approx(151.0, rel=0.05)
    assert (camera.width - 1) / 2 - camera.x * scale == pytest.approx(550.0, abs=3.0)
    assert (camera.height - 1) / 2 + camera.y * scale == pytest.approx(494.0, abs=3.0)
