"""How exactly edges are known: against profiles in closed form, and against sizes that masks get wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.drawing.halfway import half_ways
from monodyn.vision.drawing.probe import AT_X, AT_Y, AWAY, BORDER, INNER, NORMAL_X, SAMPLE_COLUMNS
from monodyn.vision.foreground.masks import plain_view
from monodyn.vision.locating.bundle import NOISE_PX, SYSTEMATIC_PX, Bundle, KeyMasks, refine
from monodyn.vision.locating.exactness import TAKEN_UP, Exactness, exactness_of
from monodyn.vision.locating.knowledge import size_information
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from pictures import CAMERA, drawn_mask, trusted

PLACE = 20.3
"""Column of the edge of a made profile [px]."""


def found(profile: np.ndarray, *, shaded: bool = False, border: bool = False) -> float:
    """Return where a profile along the columns passes half of its level, from column 20 [px]."""
    planes = np.tile(np.round(FULL * profile).astype(np.uint8), (1, 9, 1))
    view = plain_view(np.ones(planes.shape[1:], np.float32), 1)
    view = view._replace(shaded=np.array([shaded]))
    sample = np.zeros((1, SAMPLE_COLUMNS))
    sample[0, [AT_X, AT_Y, NORMAL_X, INNER, AWAY, BORDER]] = 20.0, 4.0, 1.0, 5.0, 0.2, border
    return float(half_ways(planes, view, sample, 5.0)[0])


def test_half_way_of_profiles_in_closed_form() -> None:
    columns = np.arange(41)
    # linear over three pixels, so that linear interpolation is exact but for the 160 levels
    ramp = np.clip(0.5 - (columns - PLACE) / 3.0, 0.0, 1.0)
    assert found(ramp) == pytest.approx(PLACE - 20.0, abs=0.02)
    # A halo that falls off outwards: the area goes on by 3 px, half of the level is reached at 3 ln 2. The
    # chord from pixel to pixel lies above the curve, which makes 0.04 px of it.
    halo = np.where(columns < PLACE, 1.0, np.exp(-(columns - PLACE) / 3.0))
    assert found(halo) == pytest.approx(PLACE - 20.0 + 3.0 * np.log(2.0), abs=0.06)
    # against its own level an edge in the shade stays where it is
    assert found(0.6 * ramp, shaded=True) == pytest.approx(PLACE - 20.0, abs=0.03)
    assert found(0.6 * ramp) == pytest.approx(PLACE - 20.0 - 1.0, abs=0.03)


def test_no_half_way_where_nothing_passes_it() -> None:
    ramp = np.clip(0.5 - (np.arange(41) - PLACE) / 3.0, 0.0, 1.0)
    assert np.isnan(found(0.4 * ramp))
    assert np.isnan(found(ramp, border=True))


def pair(level: float = 1.0) -> tuple[KeyMasks, Bundle]:
    """Return masks of a double pendulum, of which the colour shows at a level, and a refinement on them."""
    mechanism = load("double")
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(-2.5, -0.5, 8), rng.uniform(-1.5, 1.5, 8)])
    masks = [np.round(level * drawn_mask(mechanism, CAMERA, q)).astype(np.uint8) for q in poses]
    names = ["link1.length", "link1.width", "link1.tip", "link2.length", "link2.width", "camera.depth"]
    variables = scene_variables(mechanism, names)
    guess = SceneGuess(mechanism, CAMERA, poses, np.zeros(8))
    shown = KeyMasks(masks, trusted(mechanism))
    return shown, refine(shown, guess, variables, EdgeSearch(np.full(6, 4.0), 3.0), settle=4)


def test_right_masks_are_known_exactly() -> None:
    masks, bundle = pair()
    exact = exactness_of(masks, bundle, np.arange(8))
    assert exact.noise_px < 0.1
    assert exact.systematic_px < 0.06


@pytest.mark.parametrize("level", [0.94, 0.9])
def test_a_colour_that_is_off_is_part_of_what_is_not_known(level: float) -> None:
    """The area under a level that is too low ends too soon: widths come out too small, in every frame."""
    masks, bundle = pair(level)
    exact = exactness_of(masks, bundle, np.arange(8))
    file, values = load("double").values, bundle.mechanism.values
    scale = bundle.camera.focal / bundle.camera.depth * values["link1.length"] / file["link1.length"]
    off = [
        (values[f"link{k}.width"] * file["link1.length"] / values["link1.length"] - file[f"link{k}.width"])
        * scale
        for k in (1, 2)
    ]
    # both edges of each are off by several tenths of a pixel, many times the noise of the samples
    assert max(off) < -0.25
    # and what is stated contains that, without being much wider
    assert 0.4 * exact.systematic_px < np.abs(off).max() < 1.7 * exact.systematic_px


def test_what_is_known_follows_the_noise_and_ends_at_what_is_systematic() -> None:
    _, bundle = pair()
    finer = Exactness(0.5 * NOISE_PX, 1e-9).of(bundle)
    np.testing.assert_allclose(finer.information, 4.0 * bundle.information, rtol=1e-12)
    assert Exactness().of(bundle).systematic_px == SYSTEMATIC_PX
    # of samples without noise only the systematic part is left: 0.1 px on the width
    sharp = size_information(Exactness(1e-6, 0.1).of(bundle), scale_free=False)
    at = sharp.names.index("link2.width")
    px = bundle.mechanism.values["link2.width"] * bundle.camera.focal / bundle.camera.depth
    assert 1.0 / np.sqrt(sharp.information[at, at]) == pytest.approx(0.1 / px, rel=1e-3)


def test_masks_that_sway_as_a_whole_are_part_of_what_is_not_known() -> None:
    """Every second mask shows the mechanism 2 px to the right: no pose, size or camera follows that."""
    masks, bundle = pair()
    assert exactness_of(masks, bundle, np.arange(8)).sway_px < 0.3
    moved = [np.roll(plane, 2 * (k % 2), axis=-1) for k, plane in enumerate(masks.planes)]
    exact = exactness_of(replace(masks, planes=moved), bundle, np.arange(8))
    # 1 px to either side of their mean
    assert exact.sway_px == pytest.approx(TAKEN_UP * 1.0, rel=0.2)
    assert exact.of(bundle).sway_px == exact.sway_px


def test_what_is_assumed_of_the_camera_is_not_noise() -> None:
    _, bundle = pair()
    names = [*bundle.variables.names, "camera.pitch"]
    more = scene_variables(bundle.mechanism, names)
    information = np.diag(more.assumed)
    again = Exactness(0.1).of(replace(bundle, variables=more, information=information))
    np.testing.assert_allclose(again.information, information)


def test_without_an_edge_what_is_assumed_stays() -> None:
    masks, bundle = pair()
    nothing = replace(bundle, matched=np.zeros(8))
    assert exactness_of(masks, nothing, np.arange(8)) == Exactness(NOISE_PX, SYSTEMATIC_PX)
    # masks that show nothing have no half way
    blank = replace(masks, planes=[np.zeros_like(plane) for plane in masks.planes])
    assert exactness_of(blank, bundle, np.arange(8)).systematic_px == SYSTEMATIC_PX
