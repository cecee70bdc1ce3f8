"""A mechanism before the scene that a moving camera is registered on, drawn with known displacements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Frame, Mask
from monodyn.vision.clip.steady import NO_PARALLAX, CameraPath, Parallax, displaced
from monodyn.vision.locating.parallax import find_past_parallax, parallax_of, scene_sway
from pictures import CAMERA, drawn_mask, trusted
from scenes import moved

MECHANISM = load("double").with_values({"link1.width": 0.03, "link2.width": 0.03})
COUNT = 14
_T = np.linspace(0.0, 4.0, COUNT)
POSES = np.column_stack([-1.4 + 0.8 * np.sin(2.0 * _T), 0.9 * np.cos(3.1 * _T)])
SHIFTS = np.column_stack([9.0 * np.sin(_T + 0.3), 6.0 * np.cos(1.7 * _T)])
SHIFTS -= SHIFTS.mean(axis=0)


@dataclass(frozen=True)
class Drawn:
    """Masks of the mechanism, displaced by a share of the scene's displacement beyond the parallax known."""

    share: float
    video: Any
    samples: Any
    parallax: Parallax = NO_PARALLAX

    def of(self, frame: Frame) -> Mask:
        planes = drawn_mask(MECHANISM, CAMERA, POSES[frame.index])
        left = (self.share - self.parallax.share) * SHIFTS[frame.index]
        return Mask(frame.index, frame.time, displaced(planes, left))

    def view(self, geoms: int) -> Any:
        return trusted(MECHANISM)

    def nearer(self, parallax: Parallax) -> Drawn:
        return replace(self, parallax=parallax)


def scene_of(share: float, *, still: bool = False, parallax: Parallax = NO_PARALLAX) -> Any:
    """Return the mechanism as it was located in all frames."""
    frames = [Frame(k, k / 30, np.zeros((CAMERA.height, CAMERA.width), np.uint8)) for k in range(COUNT)]
    maps = np.array([moved(shift).entries for shift in SHIFTS])
    path = None if still else CameraPath(maps, np.full(COUNT, 0.05), frames[0])
    masks = Drawn(share, SimpleNamespace(camera_path=path), SimpleNamespace(frames=frames), parallax)
    return SimpleNamespace(
        mechanism=MECHANISM, camera=CAMERA, masks=masks, key_frames=tuple(range(COUNT)), key_positions=POSES
    )


def test_the_sway_of_the_whole_mechanism_is_measured() -> None:
    sway = scene_sway(scene_of(0.3))
    assert np.abs(sway.shift - 0.3 * SHIFTS).max() < 0.35
    size = np.sqrt(np.mean(np.sum((0.3 * SHIFTS) ** 2, axis=1)))
    assert sway.rms_px == pytest.approx(size, rel=0.25)
    assert scene_sway(scene_of(0.0)).rms_px < 0.15


def test_the_parallax_is_what_it_has_in_common_with_the_way() -> None:
    found = parallax_of(scene_of(0.3))
    assert found is not None
    assert found.parallax.share == pytest.approx(0.3, abs=0.02)
    assert found.std_px < 0.1 * found.rms_px
    none = parallax_of(scene_of(0.0))
    assert none is not None
    assert none.rms_px < 0.1
    assert parallax_of(scene_of(0.3, still=True)) is None


def test_the_mechanism_is_located_again_until_it_stands_still() -> None:
    tried: list[Parallax] = []

    def find(sought: Any) -> Any:
        tried.append(sought.masks.parallax)
        return scene_of(0.3, parallax=sought.masks.parallax)

    @dataclass(frozen=True)
    class Sought:
        masks: Drawn

    scene = find_past_parallax(Sought(scene_of(0.3).masks), find)  # type: ignore[arg-type]
    assert tried[0] == NO_PARALLAX
    assert scene.masks.parallax.share == pytest.approx(0.3, abs=0.01)
    assert len(tried) <= 3
