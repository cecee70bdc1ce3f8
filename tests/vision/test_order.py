"""One link before another, from the colours of a picture to the edges of its mask."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL, Frame
from monodyn.vision.drawing.edges import BEHIND, NEAR, SAMPLES, SQUARES, TRUST, edge_terms, no_shifts
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.foreground.background import Background, Window
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.masks import BACK, FRONT, GeomColours
from monodyn.vision.foreground.palette import Palette, measured_palette
from pictures import CAMERA, stacked_mask

SIZE = (CAMERA.height, CAMERA.width)
FOLDED = np.array([0.4, np.pi - 0.05])


def seen(wall: tuple[int, ...], colours: list[tuple[int, ...]], *, grey_only: bool) -> tuple[int, np.ndarray]:
    """Return whether the second link's edges show before the first's, and what its edges are found to do in a
    picture of both in their colours, in the columns of ``edges``."""
    mechanism, rig = load("double"), rig_of(load("double"), CAMERA)
    planes = stacked_mask(mechanism, CAMERA, FOLDED) / FULL
    shown = [wall[k] + sum(planes[g] * (colours[g][k] - wall[k]) for g in range(2)) for k in range(3)]
    luma = np.round(shown[0]).astype(np.uint8)
    blue, red = (
        np.round(cv2.resize(plane, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)) for plane in shown[1:]
    )
    frame = Frame(0, 0.0, luma, (blue.astype(np.uint8), red.astype(np.uint8)))
    still = np.full(SIZE, wall[0], np.float32)
    tint = np.full(blue.shape, wall[1], np.float32), np.full(blue.shape, wall[2], np.float32)
    background = Background(still, tint, 1.0, np.ones(SIZE, bool), Window(0, SIZE[0], 0, SIZE[1]))
    nothing = np.zeros((1, 1, 1), np.float32)
    order = np.array([[0, BACK], [FRONT, 0]], np.int8)
    measured = GeomColours(np.array(colours, float), np.arange(2), np.zeros(2, np.bool_), order=order)
    palette = measured_palette(Palette(np.zeros((1, 3)), nothing, grey_only, nothing), background, measured)
    view = palette.view(2)
    assert view.order[0, 1] == BACK
    mask = coverage_of(frame, background, palette)
    found = edge_terms(mask, view, rig, no_shifts(rig), FOLDED, 4.0, 2.0).agreement.links
    return int(view.order[1, 0]), found


@pytest.mark.parametrize(
    ("wall", "colours", "grey_only", "shows"),
    [
        # the second link differs from the wall in another way than the first
        ((160, 128, 128), [(60, 128, 128), (160, 128, 220)], False, True),
        ((90, 128, 128), [(180, 128, 128), (90, 60, 128)], False, True),
        # beside the first it looks like more or less than the second beside the wall
        ((160, 128, 128), [(60, 128, 128), (230, 128, 128)], False, False),
        ((160, 128, 128), [(60, 128, 128), (230, 128, 128)], True, False),
        ((160, 128, 128), [(60, 128, 128), (110, 128, 128)], True, False),
        # what either has of the other is taken out
        ((40, 128, 128), [(150, 54, 34), (82, 90, 240)], False, True),
        # next to nothing would be left
        ((40, 128, 128), [(150, 54, 34), (160, 60, 40)], False, False),
    ],
)
def test_edges_before_another_link_count_where_they_lie_right(
    wall: tuple[int, ...], colours: list[tuple[int, ...]], grey_only: bool, shows: bool
) -> None:
    order, links = seen(wall, colours, grey_only=grey_only)
    assert (order == FRONT) == shows
    for link in links:
        assert link[NEAR] == pytest.approx(link[TRUST])
        assert np.sqrt(link[SQUARES] / max(link[NEAR], 1.0)) < 0.25
    assert (links[1, BEHIND] == 0) == shows
    assert links[0, BEHIND] > links[0, SAMPLES]


def palette_before(
    wall: tuple[int, ...],
    colours: list[tuple[int, ...]],
    order: np.ndarray | None,
    light: np.ndarray | None = None,
) -> Palette:
    """Return the palette of geoms with an order, one a colour, before a wall without a pattern."""
    still, half = np.full(SIZE, wall[0], np.float32), (SIZE[0] // 2, SIZE[1] // 2)
    tint = np.full(half, wall[1], np.float32), np.full(half, wall[2], np.float32)
    background = Background(still, tint, 1.0, np.ones(SIZE, bool), Window(0, SIZE[0], 0, SIZE[1]))
    nothing, count = np.zeros((1, 1, 1), np.float32), len(colours)
    measured = GeomColours(
        np.array(colours, float), np.arange(count), np.zeros(count, np.bool_), light=light, order=order
    )
    return measured_palette(Palette(np.zeros((1, 3)), nothing, False, nothing), background, measured)


def shown_order(
    wall: tuple[int, ...], colours: list[tuple[int, ...]], order: np.ndarray
) -> tuple[list[int], np.ndarray]:
    """Return which colours are taken out of which, and what stays of an order."""
    palette, count = palette_before(wall, colours, order), len(colours)
    return [-1] * count if palette.other is None else palette.other.tolist(), palette.view(count).order


def test_noise_counts_by_what_is_left_of_the_contrast() -> None:
    wall, colours = (130, 128, 128), [(140, 128, 128), (140, 158, 128)]
    order = np.array([[0, BACK], [FRONT, 0]], np.int8)
    mixed, apart = (palette_before(wall, colours, way).trust[:, 0, 0] for way in (None, order))
    # squared contrasts of 100 and 325, of which they have a product of 100 in common
    assert mixed == pytest.approx(np.sqrt([100.0, 325.0]) / 60.0, rel=1e-5)
    assert apart == pytest.approx(mixed * np.sqrt(1.0 - 100.0**2 / (100.0 * 325.0)), rel=1e-5)
    # with light a colour may count by so much less that the other one is negative in it
    light = np.array([0.1, 0.1])
    mixed, apart = (
        palette_before((130, 128, 128), [(150, 128, 128), (140, 153, 128)], way, light).trust[:, 0, 0]
        for way in (None, order)
    )
    assert (apart <= mixed).all()


def test_no_colour_is_taken_out_of_one_that_lies_before_a_third() -> None:
    wall, first, second, third = (130, 128, 128), (210, 128, 128), (134, 28, 128), (170, 228, 128)
    before_third = np.array([[0, FRONT], [BACK, 0]], np.int8)
    assert shown_order(wall, [first, third], before_third)[0] == [1, 0]
    # what is taken out of the first for the third would show the second in its plane
    before_both = np.array([[0, FRONT, FRONT], [BACK, 0, 0], [BACK, 0, 0]], np.int8)
    other, order = shown_order(wall, [first, second, third], before_both)
    assert other == [-1, -1, -1]
    assert order[0].tolist() == [0, FRONT, 0]


def test_what_looks_like_the_wall_shows_nothing_behind_an_edge() -> None:
    other, order = shown_order(
        (130, 128, 128), [(210, 128, 128), (133, 128, 128)], np.array([[0, FRONT], [BACK, 0]], np.int8)
    )
    assert other == [-1, -1]
    assert order[0, 1] == FRONT
