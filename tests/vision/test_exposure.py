"""How long pictures are exposed, from made masks of a known motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Mask, Poses
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.tracking.exposure import (
    SHARP,
    Exposure,
    _add_misfits,
    exposure_of,
    motion,
    with_shutter,
)
from pictures import CAMERA, exposed_mask, stacked_mask, stacked_view, trusted

RATE = 10.0
"""Frames a second [Hz]."""


def swing(count: int, *, unseen: tuple[int, ...] = (), wide: float = 0.8) -> Poses:
    """Return a swing of one joint at 5 rad/s."""
    t = np.arange(count) / RATE
    seen = np.array([i not in unseen for i in range(count)])
    position = np.where(seen, -1.6 + wide * np.sin(5.0 * t), np.nan)[:, None]
    return Poses(("joint1",), np.arange(count), t, position, np.full((count, 1, 1), 1e-6), seen, metric=False)


def filmed(poses: Poses, exposure: float, wide: float = 0.8) -> Any:
    """Return a scene whose masks show the swing, each exposed for so long [s]."""
    mechanism = load("bob")
    rate, acceleration = 5.0 * wide * np.cos(5.0 * poses.time), -25.0 * wide * np.sin(5.0 * poses.time)
    masks = [
        exposed_mask(mechanism, CAMERA, q, sweep=exposure * v, bend=exposure**2 / 8.0 * a)
        for q, v, a in zip(poses.position, rate, acceleration, strict=True)
    ]
    frames = [SimpleNamespace(index=i, time=float(t)) for i, t in enumerate(poses.time)]
    return SimpleNamespace(
        mechanism=mechanism,
        camera=CAMERA,
        masks=SimpleNamespace(
            samples=SimpleNamespace(frames=frames),
            of=lambda frame: Mask(frame.index, frame.time, masks[frame.index]),
            view=lambda geoms: trusted(mechanism),
        ),
    )


@pytest.mark.parametrize("exposure", [0.02, 0.06, 0.1])
def test_the_exposure_is_found(exposure: float) -> None:
    found = exposure_of(filmed(swing(8), exposure), swing(8))
    assert found.seconds == pytest.approx(exposure, rel=0.04, abs=0.0015)
    # three hundredths at least, for what sizes and rates leave
    assert 0.03 * found.seconds <= found.std < 0.2 * exposure


def test_edges_wider_than_a_whole_interval_blurs_them_are_none_of_an_exposure() -> None:
    assert exposure_of(filmed(swing(8), 0.12), swing(8)) == SHARP


def test_a_link_in_front_of_another_shows_how_long_it_was_exposed() -> None:
    """The second link lies on the first, and both turn by a tenth of a radian about the first hinge."""
    mechanism, q, sweep = load("double"), np.array([0.4, np.pi - 0.05]), np.array([0.1, 0.0])
    times = (np.arange(15) + 0.5) / 15 - 0.5
    planes = np.mean([stacked_mask(mechanism, CAMERA, q + t * sweep) for t in times], axis=0)
    rig, misfits = rig_of(mechanism, CAMERA)._replace(sweep=sweep), np.zeros(3)
    _add_misfits(planes.round().astype(np.uint8), stacked_view(), rig, q, np.array([0.5, 1.0, 1.5]), misfits)
    assert misfits[1] < 0.05 * misfits[[0, 2]].min()


def test_sharp_pictures_have_none() -> None:
    assert exposure_of(filmed(swing(8), 0.0), swing(8)) == SHARP
    # nor those of a motion that hardly moves the outline
    small = swing(8, wide=0.002)
    assert exposure_of(filmed(small, 0.1, wide=0.002), small) == SHARP
    few = swing(3)
    assert exposure_of(filmed(few, 0.06), few) == SHARP


def test_the_motion_goes_on_where_it_was_not_seen() -> None:
    poses = swing(20, unseen=(0, 7, 8, 19))
    position, rate, acceleration = motion(poses)
    truth = -1.6 + 0.8 * np.sin(5.0 * poses.time), 4.0 * np.cos(5.0 * poses.time)
    assert np.flatnonzero(np.isnan(rate[:, 0])).tolist() == [0, 19]
    assert np.flatnonzero(np.isnan(position[:, 0])).tolist() == [0, 19]
    inside = [i for i in range(2, 18) if i not in (7, 8)]
    # the error of a cubic spline is (5 / 10)^4 / 180 of the rate, more at the ends and in the gap
    assert np.abs(rate[inside, 0] - truth[1][inside]).max() < 0.08
    # the curvature of one is off by (5 / 10)^2 / 12 of it
    assert np.abs(acceleration[inside, 0] + 20.0 * np.sin(5.0 * poses.time[inside])).max() < 2.5
    assert position[[7, 8], 0] == pytest.approx(truth[0][[7, 8]], abs=0.05)
    assert rate[[7, 8], 0] == pytest.approx(truth[1][[7, 8]], abs=0.6)
    cubic = Poses(
        ("joint1",), np.arange(6), np.arange(6) / RATE, (np.arange(6) / RATE)[:, None] ** 2,
        np.full((6, 1, 1), 1e-6), np.ones(6, dtype=bool), metric=False,
    )  # fmt: skip
    assert motion(cubic)[1][:, 0] == pytest.approx(2.0 * cubic.time)
    assert motion(cubic)[2][:, 0] == pytest.approx(2.0 * np.ones(6))


def test_a_shutter_has_a_row_for_every_picture() -> None:
    poses = swing(12, unseen=(0,))
    scene: Any = filmed(swing(1), 0.0)
    from monodyn.vision.locating.scene import Scene

    whole = Scene(scene.mechanism, CAMERA, scene.masks, 0, np.zeros(1), (0,), np.zeros((1, 1)), {}, 0.0, ())
    shutter = with_shutter(whole, poses[:10], Exposure(0.05, 0.002), -0.01).shutter
    assert shutter is not None
    assert (shutter.exposure, shutter.std, shutter.readout) == (0.05, 0.002, -0.01)
    assert (shutter.position.shape, shutter.rate.shape) == ((10, 1), (10, 1))
    assert (shutter.acceleration.shape, shutter.acceleration[0, 0]) == ((10, 1), 0.0)
    assert np.isnan(shutter.position[0, 0])
    assert shutter.rate[0, 0] == shutter.rate[1, 0] != 0.0
