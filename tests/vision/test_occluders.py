"""Where something hides the mechanism: drawn masks of a link that swings behind a post."""

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.tracking.occluders import CELL_PX, Occluders, without
from pictures import CAMERA, drawn_mask, stacked_mask, stacked_view, trusted


def swung(blank):
    """Note a link that swings through the picture, ``blank`` (height, width) pixels of it taken out."""
    mechanism = load("single")
    found = Occluders(rig_of(mechanism, CAMERA), trusted(mechanism))
    ever = np.zeros((CAMERA.height, CAMERA.width), dtype=bool)
    for angle in np.linspace(-2.0, -1.0, 60):
        mask = drawn_mask(mechanism, CAMERA, np.array([angle]))
        ever |= mask[0] > 80
        found.note(np.where(blank, np.uint8(0), mask), np.array([angle]), np.array([True]))
    return found.hidden(), ever


def test_a_post_is_found_where_the_link_passes():
    blank = np.zeros((CAMERA.height, CAMERA.width), dtype=bool)
    _, ever = swung(blank)
    middle = int(np.nonzero(ever.any(axis=0))[0].mean())
    blank[:, middle : middle + 12] = True
    hidden, _ = swung(blank)
    # all of it but a margin, and nothing beyond it but that
    near = np.zeros_like(blank)
    near[:, middle - 2 * CELL_PX : middle + 12 + 2 * CELL_PX] = True
    assert not hidden[~near].any()
    assert hidden[blank & ever].mean() > 0.9


def test_nothing_is_hidden_where_all_shows():
    hidden, _ = swung(np.zeros((CAMERA.height, CAMERA.width), dtype=bool))
    assert not hidden.any()


@pytest.mark.parametrize("known", [True, False])
def test_a_link_behind_another_is_not_behind_an_occluder(known):
    """The second link lies on the first, which swings about; each has its own colour, the second in shade."""
    mechanism = load("double")
    found = Occluders(rig_of(mechanism, CAMERA), stacked_view(known=known))
    for angle in np.linspace(-0.52, -0.5, 9):
        q = np.array([angle, np.pi - 0.05])
        planes = (stacked_mask(mechanism, CAMERA, q) * [[[1.0]], [[0.4]]]).astype(np.uint8)
        found.note(planes, q, np.array([True, True]))
    assert found.hidden().any() != known


def test_links_whose_place_is_not_known_count_nothing():
    mechanism = load("single")
    found = Occluders(rig_of(mechanism, CAMERA), trusted(mechanism))
    nothing = np.zeros((1, CAMERA.height, CAMERA.width), np.uint8)
    for _ in range(9):
        found.note(nothing, np.array([-1.5]), np.array([False]))
    assert not found.hidden().any()


def test_a_view_without_some_pixels():
    view = trusted(load("single"))
    hidden = np.zeros(view.trust.shape[1:], dtype=bool)
    hidden[3, 5] = True
    found = without(view, hidden).trust
    assert found[0, 3, 5] == 0.0
    assert found.sum() == view.trust.sum() - 1.0
