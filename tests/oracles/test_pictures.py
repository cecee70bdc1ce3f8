"""The picture kernels against slow, obvious twins."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.mechanism.tree import SLIDE
from monodyn.types import FULL, Frame
from monodyn.vision.clip.blocks import block_means, block_squares
from monodyn.vision.drawing.mismatch import (
    UNDRAWABLE,
    blank_cuts,
    pose_balance,
    pose_mismatch,
    row_balance,
    row_sums,
    silhouette_sums,
)
from monodyn.vision.drawing.normals import edge_samples
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.probe import AT_X, AT_Y, AWAY, INNER, NORMAL_X, NORMAL_Y, SAMPLE_COLUMNS
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import (
    Outlines,
    blank_outlines,
    convex_hull,
    draw,
    fill_hulls,
)
from monodyn.vision.foreground.background import Background, Window
from monodyn.vision.foreground.coverage import coverage_of
from monodyn.vision.foreground.inner import ABSENT, MOVING, Scenery, fill_moving
from monodyn.vision.foreground.masks import (
    BACK,
    EVERY_PLANE,
    FRONT,
    LEFT,
    PLANE,
    RIGHT,
    ROW,
    GeomColours,
    Wanted,
)
from monodyn.vision.foreground.median import FARTHEST, NEAR, NEAREST, QUARTILE, masked_median
from monodyn.vision.foreground.palette import CHROMA_WEIGHT, Palette, measured_palette
from pictures import CAMERA, drawn_mask, trusted


def slow_hull(points: np.ndarray) -> set[int]:
    """List the corners: points that some line has on itself with all others on one side."""
    found = set()
    for i, p in enumerate(points):
        for j, q in enumerate(points):
            if i == j:
                continue
            side = (q[0] - p[0]) * (points[:, 1] - p[1]) - (q[1] - p[1]) * (points[:, 0] - p[0])
            if (np.delete(side, [i, j]) > 0).all():
                found |= {i, j}
    return found


@pytest.mark.parametrize("count", [3, 5, 12, 40])
def test_convex_hull_has_the_corners_of_a_slow_one(count: int) -> None:
    points = np.random.default_rng(count).normal(size=(count, 2))
    hull, order = np.empty(count + 1, np.int64), np.arange(count)
    size = convex_hull(points, hull, order)
    assert set(hull[:size].tolist()) == slow_hull(points)


def test_convex_hull_is_the_same_from_any_order() -> None:
    """Poses begin with the order that the points had in the pose before."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(40, 2))
    hulls = [np.empty(41, np.int64) for _ in range(8)]
    found = [hull[: convex_hull(points, hull, rng.permutation(40))].tolist() for hull in hulls]
    assert len(found[0]) > 4
    assert all(corners == found[0] for corners in found)


def test_convex_hull_leaves_out_points_along_an_edge() -> None:
    points = np.array([[0, 0], [1, 0], [2, 0], [2, 2], [1, 2], [0, 2], [0, 1]], dtype=float)
    hull = np.empty(8, np.int64)
    assert sorted(hull[: convex_hull(points, hull, np.arange(7))].tolist()) == [0, 2, 3, 5]


def test_row_sums_are_sums_of_the_row() -> None:
    mask = np.random.default_rng(0).integers(0, 256, (7, 13), dtype=np.uint8)
    shares = np.minimum(mask, FULL).astype(float) / FULL
    expected = np.array([[shares[y, :x].sum() for x in range(14)] for y in range(7)])
    # float32 of sums up to 13
    np.testing.assert_allclose(row_sums(mask), expected, atol=1e-6)
    np.testing.assert_allclose(row_balance(mask), np.arange(14) - 2.0 * expected, atol=2e-6)


def slow_mismatch(mask: np.ndarray, polygons: list[np.ndarray], lines: int = 40) -> tuple[float, float]:
    """Sum 1 - 2 I_a and area over a union of convex polygons along ``lines`` lines through each row."""
    height, width = mask.shape
    sums = np.concatenate([np.zeros((height, 1)), np.cumsum(np.minimum(mask, FULL) / FULL, axis=1)], axis=1)
    ends = np.concatenate(polygons)[:, 1]
    cost = area = 0.0
    for y in (np.arange(np.floor(ends.min()) * lines, np.ceil(ends.max()) * lines) + 0.5) / lines:
        spans = []
        for polygon in polygons:
            crossings = [
                p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
                for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)
                if min(p[1], q[1]) <= y < max(p[1], q[1])
            ]
            if crossings:
                spans.append((min(crossings), max(crossings)))
        end = -np.inf
        for left, right in sorted(spans):
            left, end = max(left, end), max(right, end)
            area += max(right - left, 0.0) / lines
            cost += max(right - left, 0.0) / lines
            row = int(np.floor(y + 0.5))
            if right > left and 0 <= row < height:
                before, until = np.interp([left, right], np.arange(width + 1) - 0.5, sums[row])
                cost -= 2.0 * (until - before) / lines
    return cost, area


def sums_over(mask: np.ndarray, polygons: list[np.ndarray]) -> tuple[float, float]:
    """Return the sum of 1 - 2 I_a and the area as the kernel finds them."""
    px, count = np.concatenate(polygons).astype(float), len(polygons)
    starts = np.concatenate([[0], np.cumsum([len(polygon) for polygon in polygons])])
    hull, first = np.empty(len(px) + 2 * count + 2, np.int64), np.zeros(count + 1, np.int64)
    outlines = Outlines(starts, px, hull, first, np.empty((0, 3)), np.arange(len(px)))
    fill_hulls(outlines, 0)
    inside = np.empty(1)
    area = silhouette_sums(row_sums(mask)[np.newaxis], outlines, blank_cuts(count), inside)
    return area - 2.0 * float(inside[0]), area


def square(x: float, y: float, side: float) -> np.ndarray:
    return np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]])


@pytest.mark.parametrize("shift", [0.0, 18.0, -25.0])
def test_mismatch_counts_every_covered_pixel_once(shift: float) -> None:
    """Overlapping outlines, in and partly out of a small picture."""
    rng = np.random.default_rng(2)
    mask = rng.integers(0, FULL + 40, (24, 32), dtype=np.uint8)
    polygons = [
        np.array([[3.3, 2.1], [20.4, 6.7], [17.2, 15.9], [5.5, 12.2]]) + shift,
        np.array([[10.1, 4.4], [29.7, 9.3], [15.6, 20.8]]) + shift,
        np.array([[11.0, 6.0], [16.0, 7.0], [14.0, 12.0]]) + shift,
    ]
    assert sums_over(mask, polygons) == pytest.approx(slow_mismatch(mask, polygons), abs=0.02)


@pytest.mark.parametrize("along", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])
@pytest.mark.parametrize("shift", [0.0, 0.1, 0.4, 0.5, 0.9])
def test_a_shifted_square_loses_what_it_leaves(along: tuple[float, float], shift: float) -> None:
    """Any part of a pixel counts, across the rows as well as along them; the area stays."""
    mask = np.zeros((60, 60), np.uint8)
    mask[10:50, 10:50] = FULL
    right, down = shift * np.array(along)
    cost, area = sums_over(mask, [square(9.5 + right, 9.5 + down, 40.0)])
    assert area == pytest.approx(1600.0, abs=1e-9)
    assert cost == pytest.approx(1600.0 - 2.0 * (40.0 - right) * (40.0 - down), abs=1e-3)


def test_a_union_of_squares_with_common_sides() -> None:
    """The same square three times, two that touch, and one inside of another on its side."""
    mask = np.full((60, 60), FULL, np.uint8)
    first = square(10.2, 10.3, 20.0)
    assert sums_over(mask, [first] * 3) == pytest.approx((-400.0, 400.0), abs=1e-3)
    assert sums_over(mask, [first, square(30.2, 10.3, 20.0)]) == pytest.approx((-800.0, 800.0), abs=1e-3)
    assert sums_over(mask, [first, square(10.2, 10.3, 5.0)]) == pytest.approx((-400.0, 400.0), abs=1e-3)


def test_an_edge_crossed_twice_loses_both_parts() -> None:
    """The geom that is met last is listed first."""
    mask = np.full((60, 60), FULL, np.uint8)
    bar = np.array([[5.0, 20.0], [45.0, 20.0], [45.0, 24.0], [5.0, 24.0]])
    crossing = [square(32.0, 15.0, 6.0), square(10.0, 15.0, 6.0)]
    assert sums_over(mask, [bar, *crossing]) == pytest.approx((-220.0, 220.0), abs=1e-3)


@pytest.mark.parametrize("apart", [1e-6, 1e-8, 3e-9, 1e-10, 1e-12])
def test_squares_that_nearly_agree_count_once(apart: float) -> None:
    """Sides on one line to rounding, also where a corner is doubled."""
    mask = np.full((60, 60), FULL, np.uint8)
    near = square(10.0 + apart, 10.0 + apart, 40.0)
    doubled = np.vstack([square(10.0, 10.0, 40.0), [[10.0, 50.0 - apart], [10.0 + apart, 50.0]]])
    for polygons in ([square(10.0, 10.0, 40.0), near], [near, doubled], [doubled, square(30.0, 45.0, 5.0)]):
        assert sums_over(mask, polygons) == pytest.approx((-1600.0, 1600.0), abs=2e-3)


def area_within(polygon: np.ndarray, left: float, top: float) -> float:
    """Return the area of the part of a polygon that lies in a pixel, which is cut out side by side."""
    for axis, sign, at in ((0, 1.0, left), (0, -1.0, left + 1.0), (1, 1.0, top), (1, -1.0, top + 1.0)):
        kept = []
        for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            inside_p, inside_q = sign * (p[axis] - at), sign * (q[axis] - at)
            if inside_p >= 0.0:
                kept.append(p)
            if inside_p * inside_q < 0.0:
                kept.append(p + inside_p / (inside_p - inside_q) * (q - p))
        if len(kept) < 3:
            return 0.0
        polygon = np.array(kept)
    x, y = polygon.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))


@pytest.mark.parametrize("wide", [0.0, 4.0, 40.0], ids=["any", "flat", "steep"])
@pytest.mark.parametrize("on_borders", [False, True])
def test_a_triangle_covers_of_each_pixel_what_lies_in_it(wide: float, on_borders: bool) -> None:
    """Edges of all directions, within the picture, across each of its sides and beside it."""
    rng = np.random.default_rng(3)
    mask = rng.integers(0, 256, (9, 14), dtype=np.uint8)
    worth = np.minimum(mask, FULL) / FULL
    for middle in ((7.0, 4.5), (0.0, 4.0), (14.0, 4.0), (7.0, 0.0), (7.0, 9.0), (-9.0, 4.0), (23.0, 4.0)):
        for _ in range(8):
            stretch = np.array([1.0, wide] if wide == 4.0 else [wide, 1.0]) if wide else np.ones(2)
            # less than a pixel, and more than the picture
            points = np.array(middle) + rng.normal(size=(3, 2)) * rng.choice([0.3, 3.0, 20.0]) / (1 + stretch)
            if on_borders:
                points = np.round(2.0 * points) / 2.0
            if abs(np.linalg.det(np.c_[points, np.ones(3)])) < 1e-6:
                continue
            covered = [[area_within(points, x - 0.5, y - 0.5) for x in range(14)] for y in range(9)]
            cost, area = sums_over(mask, [points])
            # float32 sums of whole rows, times the rows
            assert 0.5 * (area - cost) == pytest.approx(np.sum(np.array(covered) * worth), abs=2e-5)


def blots(rng: np.random.Generator) -> np.ndarray:
    """A mask of soft blots."""
    soft = cv2.GaussianBlur((rng.random((240, 320)) > 0.5).astype(np.float32), (0, 0), 6.0)
    return np.clip((soft - 0.45) * 10 * FULL, 0, FULL).astype(np.uint8)


@pytest.mark.parametrize("name", ["double", "bob", "cartpole"])
def test_pose_mismatch_of_all_geoms_and_of_the_first_alone(name: str) -> None:
    """Boxes, a disk and a slide over a mask of soft blots, in the picture and partly out of it."""
    mechanism = load(name)
    rng = np.random.default_rng(5)
    mask = blots(rng)
    rig, sums = rig_of(mechanism, CAMERA), row_sums(mask)
    q = rng.normal(scale=0.8, size=len(rig.parent)) * np.where(rig.kind == SLIDE, 0.1, 1.0)
    polygons = [polygon for _, polygon in outline(mechanism, CAMERA, q)]
    for geoms in {int(np.sum(rig.link <= 0)), len(rig.radius)}:
        found = pose_mismatch(sums, rig, q[None], geoms)[0]
        # a line's spans change by a few pixels from one end of a row to the other
        assert found == pytest.approx(slow_mismatch(mask, polygons[:geoms])[0], abs=0.1)


@pytest.mark.parametrize("name", ["triple", "cartpole", "bob"])
def test_poses_that_share_their_first_joints_cost_what_each_costs_alone(name: str) -> None:
    mechanism = load(name)
    rng = np.random.default_rng(6)
    mask = blots(rng)
    rig, balance = rig_of(mechanism, CAMERA), row_balance(mask)
    slide = np.where(rig.kind == SLIDE, 0.1, 1.0)
    parents = rng.normal(scale=0.8, size=(3, len(rig.parent))) * slide
    positions = np.repeat(parents, 24, axis=0)
    positions[:, -1] = np.tile(np.linspace(-3.0, 3.0, 24), 3)
    # one that cannot be drawn stands between two others
    positions[30, -1] = np.nan
    together = pose_balance(balance, rig, positions, len(rig.radius))
    outlines, cuts, inside = blank_outlines(rig, len(rig.radius)), blank_cuts(len(rig.radius)), np.empty(1)
    for q, cost in zip(positions, together, strict=True):
        if draw(rig, q, outlines):
            silhouette_sums(balance[np.newaxis], outlines, cuts, inside)
            assert cost == pytest.approx(inside[0], abs=1e-6)
        else:
            assert cost == UNDRAWABLE
    assert np.flatnonzero(together == UNDRAWABLE).tolist() == [30]


def slow_median(samples: np.ndarray) -> tuple[float, float]:
    """Median within the middle level by its share of the counts, and noise of the samples near it."""
    ordered = np.sort(samples.astype(float))

    def level(share: float) -> float:
        wanted = share * len(ordered)
        middle = next(v for v in ordered if np.sum(ordered <= v) >= wanted)
        below, at = np.sum(ordered < middle), np.sum(ordered == middle)
        return float(middle - 0.5 + (wanted - below) / at)

    centre = level(0.5)
    reach = NEAR / QUARTILE * min(level(0.75) - centre, centre - level(0.25))
    near = ordered[np.abs(ordered - centre) <= np.clip(reach, NEAREST, FARTHEST)]
    return centre, float(np.sqrt(np.mean((near - centre) ** 2))) if len(near) else 0.0


def test_masked_median_counts_levels_as_a_sorted_list_does() -> None:
    rng = np.random.default_rng(3)
    stack = np.clip(rng.normal(90, 6, (17, 4, 5)), 0, 255).astype(np.uint8)
    hidden = rng.random(stack.shape) < 0.4
    hidden[:, 0, 0] = True
    median, noise, count = masked_median(stack, hidden)
    np.testing.assert_array_equal(count, np.sum(~hidden, axis=0))
    for y in range(4):
        for x in range(5):
            shown = stack[~hidden[:, y, x], y, x] if count[y, x] else stack[:, y, x]
            expected = slow_median(shown)
            assert median[y, x] == pytest.approx(expected[0], abs=1e-4)
            assert noise[y, x] == pytest.approx(expected[1], abs=1e-4)


@pytest.mark.parametrize(("grey_only", "dimmed"), [(True, 0.0), (False, 0.0), (False, 0.3)])
def test_coverage_is_the_projection_of_each_pixel_on_each_colour(grey_only: bool, dimmed: float) -> None:
    rng = np.random.default_rng(4)
    size, window = (8, 12), Window(2, 8, 0, 10)
    luma = rng.integers(16, 235, size, dtype=np.uint8)
    back = rng.uniform(40, 200, size).astype(np.float32)
    # the colour planes are constant, so that their enlargement to the picture's size is too
    chroma = tuple(np.full((4, 6), value, np.uint8) for value in (110, 150))
    behind = tuple(np.full((4, 6), value, np.float32) for value in (128.0, 126.0))
    colours = np.array([[30.0, 100.0, 160.0], [220.0, 128.0, 90.0]])
    scale = rng.uniform(0.001, 0.01, (2, *size)).astype(np.float32)
    trust = np.ones((2, *size), np.float32)
    light = (np.full((2, *size), dimmed, np.float32), np.full((2, 4, 6), dimmed, np.float32))
    palette = Palette(colours, scale, grey_only, trust, dimmed=light if dimmed else None)
    background = Background(back, behind, 1.0, np.ones(size, bool), window)
    found = coverage_of(Frame(0, 0.0, luma, chroma), background, palette)
    for k, (grey, blue, red) in enumerate(colours):
        for y in range(8):
            for x in range(12):
                own = dimmed * (np.array([grey, blue, red]) - [16, 128, 128])
                value = (float(luma[y, x]) - back[y, x]) * (grey - back[y, x] - own[0])
                if not grey_only:
                    steps = (blue - 128 - own[1], red - 126 - own[2])
                    value += CHROMA_WEIGHT * ((110 - 128) * steps[0] + (150 - 126) * steps[1])
                inside = window.top <= y < window.bottom and window.left <= x < window.right
                expected = min(max(value * scale[k, y, x], 0.0), 255.0) if inside else 0.0
                # rounded to a level; single precision may round the other way
                assert abs(found[k, y, x] - expected) <= 0.51


@pytest.mark.parametrize("light", [None, np.array([0.1, 0.1])], ids=["even", "light"])
def test_of_two_colours_that_overlap_each_has_its_own_share_of_a_pixel(light: np.ndarray | None) -> None:
    """Flat pictures are mixed by hand of both and the background, their levels rounded."""
    size, small = (12, 16), (6, 8)
    back, colours = np.array([130.0, 126.0, 122.0]), np.array([[122.0, 104.0, 184.0], [74.0, 140.0, 126.0]])
    still, tint, red = (
        np.full(shape, value, np.float32) for shape, value in zip((size, small, small), back, strict=True)
    )
    background = Background(still, (tint, red), 1.0, np.ones(size, bool), Window(0, size[0], 0, size[1]))
    order, nothing = np.array([[0, BACK], [FRONT, 0]], np.int8), np.zeros((1, 1, 1), np.float32)
    measured = GeomColours(colours, np.arange(2), np.zeros(2, np.bool_), light=light, order=order)
    palette = measured_palette(Palette(np.zeros((1, 3)), nothing, False, nothing), background, measured)
    assert palette.other is not None
    assert palette.other.tolist() == [1, 0]
    assert (palette.dimmed is None) == (light is None)
    shares = np.vstack((np.eye(3), np.random.default_rng(8).dirichlet((1.0, 1.0, 1.0), 12)))
    for share, mixed in zip(shares, shares @ np.vstack((colours, back)), strict=True):
        luma, *chroma = (
            np.full(shape, round(value), np.uint8)
            for shape, value in zip((size, small, small), mixed, strict=True)
        )
        found = coverage_of(Frame(0, 0.0, luma, (chroma[0], chroma[1])), background, palette)
        np.testing.assert_allclose(found[:, 6, 8] / FULL, share[:2], atol=0.02)
    # one on the left and the other on the right, of which a part is wanted
    halves = np.arange(size[1]) // 8
    luma, *chroma = (
        np.tile(colours[halves[:: size[1] // shape[1]], k].astype(np.uint8), (shape[0], 1))
        for k, shape in enumerate((size, small, small))
    )
    row = np.empty((1, 4), np.int64)
    row[0, [PLANE, ROW, LEFT, RIGHT]] = EVERY_PLANE, 6, 12, 15
    wanted = Wanted(row, Window(6, 7, 2, 15))
    found = coverage_of(Frame(0, 0.0, luma, (chroma[0], chroma[1])), background, palette, wanted)
    np.testing.assert_allclose(found[:, 6, 12:15] / FULL, [[0.0] * 3, [1.0] * 3], atol=0.02)


def test_an_edge_sample_is_the_area_under_the_coverage_along_its_normal() -> None:
    """The integral along the normal in steps of a hundredth of a pixel, less the length inside."""
    mechanism = load("single")
    rig = rig_of(mechanism, CAMERA)
    mask = drawn_mask(mechanism, CAMERA, np.array([-0.5]))
    outlines = blank_outlines(rig, len(rig.radius))
    assert draw(rig, np.array([-0.505]), outlines)
    ends, samples = np.empty((400, 2), np.int64), np.empty((400, SAMPLE_COLUMNS))
    count = edge_samples(mask, trusted(mechanism), outlines, np.empty((0, 7)), (4.0, 5.0), ends, samples)
    assert count > 10
    for sample in samples[:count]:
        t = np.arange(-sample[INNER], 4.0, 0.01) + 0.005
        x, y = sample[AT_X] + t * sample[NORMAL_X], sample[AT_Y] + t * sample[NORMAL_Y]
        ix, iy = x.astype(int), y.astype(int)
        fx, fy = x - ix, y - iy
        c = (
            mask[0, iy, ix] * (1 - fx) * (1 - fy)
            + mask[0, iy, ix + 1] * fx * (1 - fy)
            + mask[0, iy + 1, ix] * (1 - fx) * fy
            + mask[0, iy + 1, ix + 1] * fx * fy
        )
        area = float(np.minimum(c, FULL).sum()) * 0.01 / FULL
        # trapezoids of half a pixel over bilinear pieces
        assert sample[AWAY] == pytest.approx(area - sample[INNER], abs=0.03)


@pytest.mark.parametrize(
    ("shape", "size"),
    [((37, 53), (9, 13)), ((40, 60), (10, 15)), ((41, 60), (10, 15)), ((24, 36), (12, 18)), ((5, 7), (5, 7))],
)
def test_blocks_have_the_means_and_squares_of_their_pixels(
    shape: tuple[int, int], size: tuple[int, int]
) -> None:
    rng = np.random.default_rng(5)
    one, other = rng.integers(0, 256, (2, 3, *shape), dtype=np.uint8)
    means, squares = np.empty(size, np.uint8), np.empty(size, np.float32)
    # rows of a decoded picture are padded
    block_means(np.pad(one[0], ((0, 0), (0, 11)))[:, : shape[1]], means)
    block_squares(one, other, squares)
    rows, columns = (np.arange(n + 1) * side // n for n, side in zip(size, shape, strict=True))
    for i in range(size[0]):
        for j in range(size[1]):
            block = (slice(rows[i], rows[i + 1]), slice(columns[j], columns[j + 1]))
            assert abs(means[i, j] - one[0][block].mean()) <= 0.5
            change = (one.astype(float) - other)[:, *block] ** 2
            assert squares[i, j] == pytest.approx(change.sum(axis=0).mean(), rel=1e-5)


@pytest.mark.parametrize("rows", [255, 256, 257, 258, 290, 300])
def test_tall_blocks_hold_all_that_is_bright(rows: int) -> None:
    means = np.empty((2, 3), np.uint8)
    block_means(np.full((2 * rows, 12), 255, np.uint8), means)
    assert (means == 255).all()


@pytest.mark.parametrize("channels", [0, 2])
def test_what_moves_differs_from_the_background_and_more_from_what_is_around(channels: int) -> None:
    rng, shape, window = np.random.default_rng(6), (24, 33), Window(3, 22, 4, 30)
    luma, *chroma = rng.integers(90, 130, (1 + channels, *shape), dtype=np.uint8)
    back, *tint = rng.uniform(90, 130, (1 + channels, *shape)).astype(np.float32)
    around = rng.uniform(90, 130, (1 + channels, 3, 4)).astype(np.float32)
    noise, counts = rng.uniform(0.5, 4.0, shape).astype(np.float32), rng.random(shape) < 0.8
    rows, columns = np.arange(shape[0]) * 3 // shape[0], np.arange(shape[1]) * 4 // shape[1]
    tints, shades = np.array(chroma).reshape(-1, *shape).astype(np.uint8), np.array(tint).reshape(-1, *shape)
    behind = Scenery(back, shades.astype(np.float32), around, noise, counts, window, rows, columns)
    found = np.full(shape, 7, np.uint8)
    fill_moving(luma, tints, behind, (8.0, 5.0), found)
    for y in range(shape[0]):
        for x in range(shape[1]):
            if not (3 <= y < 22 and 4 <= x < 30):
                assert found[y, x] == 7
                continue
            shown = np.array([luma[y, x], *(plane[y, x] for plane in chroma)], dtype=float)
            usual = np.array([back[y, x], *(plane[y, x] for plane in tint)], dtype=float)
            near = around[:, rows[y], columns[x]]
            changed = np.linalg.norm(shown - usual) > max(8.0, 5.0 * noise[y, x])
            absent = np.linalg.norm(shown - near) <= np.linalg.norm(usual - near)
            assert found[y, x] == (counts[y, x] and changed) * (ABSENT if absent else MOVING)


def test_a_median_without_noise_is_the_same() -> None:
    stack = np.random.default_rng(7).integers(0, 256, (12, 5, 6), dtype=np.uint8)
    every = np.zeros((0, 0, 0), np.bool_)
    median, noise, count = masked_median(stack, every, False)
    for found, expected in zip((median, count), masked_median(stack, every)[::2], strict=True):
        np.testing.assert_array_equal(found, expected)
    assert not noise.any()
