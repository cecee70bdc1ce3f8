"""What is taken from the sample frames once the motion in each exposure is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import Camera, Poses
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.drawing.shutter import Shutter
from monodyn.vision.locating import again
from monodyn.vision.locating.again import _blurred_masks, _Followed, _followed, _slow
from monodyn.vision.locating.locate import MARGIN_PX
from monodyn.vision.locating.unit import scaled
from pictures import CAMERA


def exposed(rates: np.ndarray, exposure: float, readout: float = 0.0) -> Shutter:
    """Return a shutter of pictures between which joints move at given rates, (frame, dof)."""
    return Shutter(exposure, 0.0, readout, np.zeros(rates.shape), rates, np.zeros(rates.shape))


def sampled(numbers: list[int]) -> Any:
    """Return what samples there are of the frames of a clip."""
    return SimpleNamespace(frames=[SimpleNamespace(index=number) for number in numbers])


def test_slow_frames_are_hardly_blurred_or_the_few_that_are_least() -> None:
    assert _slow(np.array([0.0, 9.0, 1.9, 2.0, 2.1, 1.0])).tolist() == [0, 2, 3, 5]
    assert _slow(np.array([9.0, 5.0, 8.0, 6.0, 7.0])).tolist() == [1, 2, 3, 4]
    assert _slow(np.array([9.0, 5.0])).tolist() == [0, 1]


def test_samples_in_which_all_was_seen_are_followed_in_units_of_the_distance() -> None:
    cart, camera = load("cartpole"), replace(CAMERA, depth=2.0)
    rates = np.zeros((6, 2))
    rates[4] = 0.4, 0.0
    tracked = Poses(
        ("slide", "joint1"), np.arange(6), np.arange(6) / 30.0, np.column_stack([np.arange(6) / 10.0] * 2),
        np.zeros((6, 2, 2)), np.arange(6) != 2,
    )  # fmt: skip
    scene: Any = SimpleNamespace(
        mechanism=cart, camera=camera, masks=SimpleNamespace(samples=sampled([0, 2, 4, 9])),
        shutter=exposed(rates, 0.05, -0.1),
    )  # fmt: skip
    # the same picture from one unit away
    near = Camera(camera.width, camera.height, camera.focal, 0.5 * camera.x, 0.5 * camera.y, 1.0)
    found = _followed(scene, tracked, scaled(cart, 0.5), near)
    assert found.rows.tolist() == [0, 2]
    np.testing.assert_allclose(found.positions, [[0.0, 0.0], [0.2, 0.4]])
    np.testing.assert_allclose(found.shutter.rate, [[0.0, 0.0], [0.2, 0.0]])
    # 0.4 m/s seen from 2 m: 60 px/s; of a row 0.05 s, of the picture 0.15 s; the pole stands 1 % nearer
    np.testing.assert_allclose(found.blurs, [0.0, 3.0], rtol=0.02)
    np.testing.assert_allclose(found.ways, [0.0, 9.0], rtol=0.02)


def test_background_is_where_the_mechanism_is_at_no_time_of_an_exposure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bob, positions = load("bob"), np.array([[-1.5], [-1.0], [-0.5], [0.0], [0.5]])
    rates = np.array([[0.0], [8.0], [0.1], [0.0], [0.0]])
    shutter = exposed(rates, 0.05)
    followed = _Followed(
        np.array([0, 1, 3, 4, 5]), positions, shutter, *[np.array([0.0, 30.0, 0.5, 0.0, 0.0])] * 2
    )
    kept: dict[str, Any] = {}

    def measured(samples: Any, background: Any, guess: Any, fits: Any, meanwhile: Any) -> str:
        kept.update(samples=samples, positions=guess.positions, meanwhile=meanwhile)
        return "colours"

    def refined(covered: list[np.ndarray]) -> Any:
        kept["covered"] = covered
        return masks

    monkeypatch.setattr(again, "geom_colours", measured)
    masks: Any = SimpleNamespace(
        background=SimpleNamespace(luma=np.zeros((CAMERA.height, CAMERA.width))), refined=refined,
        samples=sampled([0, 5, 10, 15, 20, 25]), coloured=lambda colours: colours,
    )  # fmt: skip
    assert _blurred_masks(masks, bob, CAMERA, followed) == "colours"
    at = [covered_pixels(bob, CAMERA, q, margin=MARGIN_PX) for q in positions]
    # the third sample was not followed: nothing in it is surely background
    assert kept["covered"][2].all()
    np.testing.assert_array_equal(kept["covered"][0], at[0])
    whole = kept["covered"][1]
    for angle in np.linspace(-1.2, -0.8, 9):
        covered = covered_pixels(bob, CAMERA, np.array([angle]), margin=0.0)
        assert whole[covered].all()
    assert whole.sum() > 1.3 * at[1].sum()
    assert not whole.all()
    # blurred by 30 px: no colour is measured there
    assert [frame.index for frame in kept["samples"]] == [0, 15, 20, 25]
    np.testing.assert_array_equal(kept["positions"], positions[[0, 2, 3, 4]])
    ways = [np.ptp(poses) for poses in kept["meanwhile"]]
    np.testing.assert_allclose(ways, [0.0, 0.005, 0.0, 0.0], atol=1e-12)
