"""What light that is mixed before it is coded does to sizes: in closed form, and on masks made so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL, Frame
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.foreground.background import Background, Window
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.exactness import Exactness
from monodyn.vision.locating.knowledge import size_information
from monodyn.vision.locating.mixing import lit_planes, lit_sizes
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import CAMERA, drawn_mask, trusted

GREY = [128.0, 128.0]
"""Neutral blue and red difference."""


def lit(share: float, figure: list[float], ground: list[float]) -> float:
    """Return what becomes of the coverage of one pixel."""
    planes = np.full((1, 1, 1), round(FULL * share), dtype=np.uint8)
    behind = [np.full((1, 1), value) for value in ground]
    return float(lit_planes(planes, np.array([figure]), behind, np.ones((1, 1), bool))[0, 0, 0]) / FULL


def test_half_of_the_level_between_black_and_white_in_closed_form() -> None:
    # half of the level of white is 0.5^2.2 of its light
    assert lit(0.5, [235.0, *GREY], [16.0, *GREY]) == pytest.approx(0.5**2.2, abs=1 / FULL)
    assert lit(0.5, [16.0, *GREY], [235.0, *GREY]) == pytest.approx(1.0 - 0.5**2.2, abs=1 / FULL)
    # nearly alike, and so nearly linear
    assert lit(0.5, [120.0, *GREY], [125.0, *GREY]) == pytest.approx(0.5, abs=0.015)


def test_what_is_whole_empty_alike_or_not_known_stays() -> None:
    for share in (0.0, 1.0, 1.4):
        assert lit(share, [16.0, *GREY], [235.0, *GREY]) == round(FULL * share) / FULL
    assert lit(0.5, [120.0, *GREY], [121.0, *GREY]) == 0.5
    assert lit(0.5, [np.nan] * 3, [121.0, *GREY]) == 0.5


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_colours_are_mixed_as_red_green_and_blue(share: float) -> None:
    def coded(rgb: np.ndarray) -> np.ndarray:
        grey = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]
        blue, red = (rgb[2] - grey) / 1.772, (rgb[0] - grey) / 1.402
        return np.array([16.0 + 219.0 * grey, 128.0 + 224.0 * blue, 128.0 + 224.0 * red])

    figure, ground = np.array([0.9, 0.2, 0.1]), np.array([0.1, 0.5, 0.8])
    mixed = coded((share * figure**2.2 + (1.0 - share) * ground**2.2) ** (1.0 / 2.2))
    # as a segmentation takes coverage from a picture: differences of colour count a quarter
    weighted = (coded(figure) - coded(ground)) * [1.0, 0.25, 0.25]
    level = weighted @ (mixed - coded(ground)) / (weighted @ (coded(figure) - coded(ground)))
    assert abs(level - share) > 0.02
    assert lit(level, coded(figure).tolist(), coded(ground).tolist()) == pytest.approx(share, abs=1.5 / FULL)


def filmed(figure: float, ground: float) -> tuple[KeyMasks, list[Frame], Background, Bundle]:
    """Return masks of a double pendulum as a camera shows it, in grey levels, and a refinement on them."""
    mechanism = load("double")
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 8), rng.uniform(-1.5, 1.5, 8)])
    light = [((level - 16.0) / 219.0) ** 2.2 for level in (figure, ground)]
    masks, frames = [], []
    for i, q in enumerate(poses):
        share = drawn_mask(mechanism, CAMERA, q)[0] / FULL
        picture = 16.0 + 219.0 * (light[1] + share * (light[0] - light[1])) ** (1.0 / 2.2)
        frames.append(Frame(i, 0.1 * i, np.round(picture).astype(np.uint8)))
        masks.append(np.round(FULL * (picture - ground) / (figure - ground)).astype(np.uint8)[None])
    variables = scene_variables(mechanism, ["link1.length", "link1.width", "link2.length", "link2.width"])
    shown = KeyMasks(masks, trusted(mechanism))
    guess = SceneGuess(mechanism, CAMERA, poses, np.zeros(8))
    bundle = refine(shown, guess, variables, EdgeSearch(np.full(6, 4.0), 3.0), settle=4)
    behind = np.full((CAMERA.height, CAMERA.width), ground, np.float32)
    return (
        shown,
        frames,
        Background(behind, None, 1.0, behind > 0, Window(0, CAMERA.height, 0, CAMERA.width)),
        bundle,
    )


@pytest.mark.parametrize(("figure", "ground"), [(40.0, 220.0), (220.0, 40.0)])
def test_the_change_is_what_the_sizes_of_a_camera_are_wrong_by(figure: float, ground: float) -> None:
    masks, frames, background, bundle = filmed(figure, ground)
    change = lit_sizes(masks, frames, background, bundle, range(8))
    file, values = load("double").values, bundle.mechanism.values
    px = CAMERA.focal / CAMERA.depth
    for name in ("link1.width", "link2.width"):
        wrong = (values[name] - file[name]) * px
        # a dark body comes out too narrow, a bright one too wide
        assert np.sign(wrong) == np.sign(figure - ground)
        assert abs(wrong) > 0.3
        assert -change[name] * values[name] * px == pytest.approx(wrong, rel=0.15)
    # from hinge to hinge nothing changes
    assert abs(change["link1.length"]) * values["link1.length"] * px < 0.05


def test_what_is_known_of_sizes_contains_the_common_direction() -> None:
    *_, bundle = filmed(40.0, 220.0)
    names = bundle.variables.names
    way = dict.fromkeys(names, 0.0) | {"link1.width": 0.02, "link2.width": 0.03}
    exact = Exactness(1e-6, 0.1).of(bundle)
    covariance = [
        np.linalg.inv(size_information(b, scale_free=False).information)
        for b in (exact, replace(exact, alternatives=(way,)))
    ]
    added = np.array([way[name] for name in names])
    np.testing.assert_allclose(covariance[1] - covariance[0], np.outer(added, added), atol=1e-7)


def test_what_is_far_from_the_outlines_is_not_looked_at() -> None:
    planes, near = np.full((1, 2, 3), FULL // 2, dtype=np.uint8), np.zeros((2, 3), bool)
    near[1, 2] = True
    found = lit_planes(planes, np.array([[235.0, 128.0, 128.0]]), [np.full((2, 3), 16.0)], near)
    assert found[0, 1, 2] not in (0, FULL // 2)
    assert not found[0][~near].any()
