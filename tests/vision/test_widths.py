"""Widths that begin anew where much of an outline lies on no edge."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.vision.drawing.follow import EdgeSearch
from monodyn.vision.locating.bundle import Bundle, KeyMasks, refine
from monodyn.vision.locating.search import SceneGuess
from monodyn.vision.locating.variables import scene_variables
from monodyn.vision.locating.widths import WELL_MATCHED, rewidened
from pictures import CAMERA, drawn_mask, trusted

SEARCH = EdgeSearch(np.array([5.0, 4.0, 4.0, 4.0]), 2.0)
PX = CAMERA.depth / CAMERA.focal
POSES = np.array([[-2.2, 0.9], [-1.4, -0.7], [-0.6, 0.4], [-1.0, 1.2], [-2.0, -0.5]])
NAMES = ["link1.width", "link2.width"]


def striped(level: float) -> list[np.ndarray]:
    """Draw a double pendulum whose second rod, of 24 px, has a line of 6 px along it between two paler ones
    of 6 px, of a coverage of ``level`` in the squares of one colour of a checkerboard."""
    model = load("double").with_values(dict.fromkeys(NAMES, 24.0 * PX))
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] // 12
    masks = []
    for q in POSES:
        whole, pale, line = (
            drawn_mask(model.with_values({"link2.width": width * PX}), CAMERA, q).astype(float)
            for width in (24.0, 18.0, 6.0)
        )
        masks.append(np.round(whole - (1.0 - level) * ((x + y) % 2) * (pale - line)).astype(np.uint8))
    return masks


def refined(masks: list[np.ndarray], width: float) -> tuple[KeyMasks, Bundle]:
    """Refine the widths from ``width`` of the second rod [px]."""
    model = load("double").with_values({"link1.width": 25.0 * PX, "link2.width": width * PX})
    frames = KeyMasks(masks, trusted(model))
    guess = SceneGuess(model, CAMERA, POSES, np.zeros(len(POSES)))
    return frames, refine(frames, guess, scene_variables(model, NAMES), SEARCH)


def test_a_rod_that_settled_on_a_line_inside_of_it_gets_its_width() -> None:
    frames, begun = refined(striped(0.0), 7.0)
    assert begun.mechanism.values["link2.width"] < 8.0 * PX
    assert np.median(begun.matched) < WELL_MATCHED
    found = rewidened(frames, begun, SEARCH)
    assert found.agreement > begun.agreement
    assert found.positions.shape == begun.positions.shape
    # the paler lines beside that one draw the sides inwards
    assert found.mechanism.values["link1.width"] / PX == pytest.approx(24.0, abs=1.0)
    assert found.mechanism.values["link2.width"] / PX == pytest.approx(22.0, abs=3.0)


def test_a_ball_that_hardly_shows_is_not_hidden_in_its_rod() -> None:
    """Without the ball, which shows in every other square, a larger share of what is left lies on edges."""
    names = ["link1.width", "link1.sphere.width"]
    model = load("bob").with_values({"link1.width": 6.0 * PX, "link1.sphere.width": 40.0 * PX})
    rod = model.with_values({"link1.sphere.width": 6.0 * PX})
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width] // 6
    poses = np.array([[-2.2], [-1.4], [-0.6], [-1.0], [-2.0]])
    masks = [np.where((x + y) % 2, drawn_mask(model, CAMERA, q), drawn_mask(rod, CAMERA, q)) for q in poses]
    frames = KeyMasks(masks, trusted(model))
    guess = SceneGuess(model, CAMERA, poses, np.zeros(len(poses)))
    begun = refine(frames, guess, scene_variables(model, names), SEARCH)
    assert np.median(begun.matched) < WELL_MATCHED
    found = rewidened(frames, begun, SEARCH).mechanism.values
    assert [found[name] / PX for name in names] == pytest.approx([6.0, 40.0], rel=0.2)


def test_outlines_on_their_edges_stay_as_they_are() -> None:
    frames, begun = refined(striped(1.0), 22.0)
    assert rewidened(frames, begun, SEARCH) is begun
