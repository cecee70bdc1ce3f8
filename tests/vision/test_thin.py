"""Thin and faint masks, made as thick as the search needs them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL
from monodyn.vision.drawing.rig import SIZE_KINDS
from monodyn.vision.locating.thin import (
    MET_PX,
    SPECK,
    evened,
    lacking,
    thickened,
    thickened_mask,
)


def line(width: int, level: float = 1.0) -> np.ndarray:
    """Draw a level line of 50 px over a slanted one, both of one width and level."""
    mask = np.zeros((80, 100), np.uint8)
    mask[20 : 20 + width, 10:60] = round(FULL * level)
    cv2.line(mask, (60, 30), (90, 70), round(FULL * level), width)
    return mask


def test_wide_and_full_masks_are_searched_as_they_are() -> None:
    assert lacking([line(6), line(8)]) is None
    assert lacking([]) is None
    assert lacking([np.zeros((80, 100), np.uint8)]) is None


@pytest.mark.parametrize("width", [1, 2])
def test_thin_masks_are_made_as_thick_as_the_search_needs(width: int) -> None:
    by = lacking([line(width)])
    assert by is not None
    assert 2 * by + width >= MET_PX
    # the distance transform takes an even width for the odd one below
    assert 2 * (by - 1) + width <= MET_PX
    thick = thickened_mask(line(width), by)
    assert np.count_nonzero(thick[:, 30]) == 2 * by + width


def test_thin_links_with_wide_discs_are_searched_as_they_are() -> None:
    """Rods and cables of a pixel beside discs that the search meets, a third of the foreground."""
    mask = line(1)
    for centre in ((60, 30), (90, 70)):
        cv2.circle(mask, centre, 3, FULL, -1)
    cv2.line(mask, (0, 70), (50, 45), FULL, 1)
    assert lacking([line(1)]) is not None
    assert lacking([mask]) is None


def test_wide_but_faint_masks_are_evened_only() -> None:
    faint = line(8, 0.4)
    assert lacking([faint]) == 0
    np.testing.assert_array_equal(thickened_mask(faint, 0) > 0, faint > 0)
    assert set(np.unique(thickened_mask(faint, 0))) == {0, FULL}


def test_levels_are_taken_against_those_next_to_them() -> None:
    """A faint line next to none, and a full one with a blurred side."""
    mask = np.zeros((60, 60), np.uint8)
    mask[10:12, 5:55] = 60
    mask[40:43, 5:55] = FULL
    mask[43, 5:55] = 80
    even = evened(mask)
    assert (even[10:12, 5:55] == FULL).all()
    assert (even[43, 5:55] == 80).all()
    assert (even[40:43, 5:55] == FULL).all()


def test_specks_are_noise() -> None:
    mask = line(2)
    clean = evened(mask)
    mask[5 : 5 + 2, 70 : 70 + SPECK // 2 - 1] = FULL
    mask[60, 20] = 90
    np.testing.assert_array_equal(evened(mask), clean)


def test_a_mechanism_becomes_thicker_as_its_mask_does() -> None:
    mechanism = load("bob")
    before, after = mechanism.values, thickened(mechanism, 0.01).values
    sizes = [p.name for p in mechanism.parameters if p.kind in SIZE_KINDS]
    changed = {name: after[name] - before[name] for name in sizes if after[name] != before[name]}
    assert changed == pytest.approx(dict.fromkeys(changed, 0.02))
    assert sorted(changed) == ["link1.sphere.width", "link1.width"]
    back = thickened(thickened(mechanism, 0.01), -0.01)
    assert back.values == pytest.approx(before)
    assert thickened(mechanism, 0.0) is mechanism
    least = thickened(mechanism, -1.0, 0.003).values
    assert all(least[name] == 0.003 for name in changed)
