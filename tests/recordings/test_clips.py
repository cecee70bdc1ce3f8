"""Rendered clips with truth and real clips (MONODYN_DATA): poses and geometry from the topology alone."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Literal

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


def followed(clip: Path, model: Path | str, method: Literal["fast", "paper"] = "fast") -> tuple[Scene, Poses]:
    masks, camera = monodyn.segment(monodyn.read(clip)), monodyn.CameraSettings(method=method)
    settings = monodyn.LocateSettings(method=method)
    scene = monodyn.locate(masks, monodyn.load(model), settings, camera=camera)
    return scene, monodyn.track(masks, scene, monodyn.TrackSettings(method=method))


@pytest.mark.parametrize(
    ("name", "limit"),
    [("single", 0.1), ("double_a", 0.15), ("double_b", 0.15), ("triple", 0.3), ("bob", 0.15)],
)
def test_joint_angles_of_rendered_clips(name: str, limit: float) -> None:
    """The limits are issue 2's, in degrees; the errors found were 0.01 to 0.1."""
    _, poses = followed(DATA / "rendered" / f"{name}.mp4", DATA / "rendered" / f"{name}.xml")
    truth = np.array(json.loads((DATA / "rendered" / f"{name}.json").read_text())["q"])
    error = np.degrees((poses.position - truth + np.pi) % (2 * np.pi) - np.pi)
    assert poses.seen.all()
    assert np.sqrt((error**2).mean(axis=0)).max() < limit


def test_the_real_double_pendulum_is_followed() -> None:
    """Its pivot was measured near (550, 494) and its first link 151 px long, each within a pixel or two."""
    scene, poses = followed(DATA / "real" / "double_pendulum.webm", "double")
    camera, scale = scene.camera, scene.camera.focal / scene.camera.depth
    assert poses.seen.mean() > 0.9
    assert scene.mechanism.values["link1.length"] * scale == pytest.approx(151.0, rel=0.015)
    assert (camera.width - 1) / 2 - camera.x * scale == pytest.approx(550.0, abs=3.0)
    assert (camera.height - 1) / 2 + camera.y * scale == pytest.approx(494.0, abs=3.0)


def test_the_real_rod_pendulum_is_followed() -> None:
    """Pivot near (508, 584) within 3 px (issue 2)."""
    scene, poses = followed(DATA / "real" / "holonomic_pendulum.webm", "bob")
    camera, scale = scene.camera, scene.camera.focal / scene.camera.depth
    assert poses.seen.mean() > 0.98
    pivot = ((camera.width - 1) / 2 - camera.x * scale, (camera.height - 1) / 2 + camera.y * scale)
    assert np.hypot(pivot[0] - 508.0, pivot[1] - 584.0) < 3.0


def test_the_radius_of_the_real_rod_pendulum() -> None:
    """The ball moves on a circle of 333 px; 331.9 px were found."""
    scene, _ = followed(DATA / "real" / "holonomic_pendulum.webm", "bob")
    scale = scene.camera.focal / scene.camera.depth
    assert scene.mechanism.values["link1.length"] * scale == pytest.approx(333.0, rel=0.005)


def test_the_real_ball_on_a_string_is_followed() -> None:
    """The ball moves on a circle of 1004 px, of which 40 deg are seen; 993 px were found."""
    scene, poses = followed(DATA / "real" / "string_pendulum.webm", "ball")
    scale = scene.camera.focal / scene.camera.depth
    assert poses.seen.mean() > 0.95
    assert scene.mechanism.values["link1.length"] * scale == pytest.approx(1004.0, rel=0.04)


@pytest.mark.parametrize("name", ["bob", "cartpole", "double_occluded"])
def test_angles_by_the_published_method(name: str) -> None:
    """Within a degree over 40 frames, in one turn over the whole clip, also after thirteen hidden frames."""
    clip = DATA / "rendered" / name
    scene, poses = followed(clip.with_suffix(".mp4"), clip.with_suffix(".xml"), "paper")
    truth = np.array(json.loads(clip.with_suffix(".json").read_text())["q"])[poses.frame]
    hinge = np.array([joint.kind == "hinge" for joint in scene.mechanism.joints])
    off = (poses.position - truth)[:, hinge]
    error = np.degrees((off + np.pi) % (2 * np.pi) - np.pi)
    assert poses.seen.all() or name == "double_occluded"
    assert np.sqrt(np.nanmean(error[:40] ** 2, axis=0)).max() < 1.0
    turns = np.round(off[poses.seen] / (2 * np.pi))
    assert np.ptp(turns, axis=0).max() == 0.0


def test_the_real_double_pendulum_by_the_published_method() -> None:
    """Its pivot was measured near (550, 494) within a pixel or two, its first link 151 px long.

    The mismatch has two minima 4 px apart, at 547 px with a link of 152 px and at 551 px with one of 146 px:
    of eight contrasts and regions four led to each.
    """
    scene, poses = followed(DATA / "real" / "double_pendulum.webm", "double", "paper")
    camera, scale = scene.camera, scene.camera.focal / scene.camera.depth
    assert poses.seen.mean() > 0.9
    assert scene.mechanism.values["link1.length"] * scale == pytest.approx(151.0, rel=0.05)
    assert (camera.width - 1) / 2 - camera.x * scale == pytest.approx(550.0, abs=5.0)
    assert (camera.height - 1) / 2 + camera.y * scale == pytest.approx(494.0, abs=3.0)
