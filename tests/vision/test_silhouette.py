"""Silhouette kernels against slow, obvious twins."""

import cv2
import numpy as np
import pytest

from monodyn.mechanism import load
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.camera import camera_array, pixels, rotation, shrunk
from monodyn.vision.drawing.outline import covered_pixels, outline
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.drawing.silhouette import RING, convex_hull, link_frames, pose_mismatch, row_sums

CAMERA = Camera(320, 240, 300.0, x=0.05, y=-0.1, depth=0.9)


def place_by_hand(mechanism, q):
    """Compose planar rigid motions as 3x3 matrices, one joint after the other."""
    tree = mechanism.tree
    poses = []
    for i, parent in enumerate(tree.parent):
        base = np.eye(3) if parent < 0 else poses[parent]
        x, y, angle, ax, ay = tree.links[i, :5]
        move = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
        turn = angle + (ax * q[i] if tree.kind[i] == 0 else 0.0)
        spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        slide = np.eye(3)
        if tree.kind[i] == 1:
            slide[:2, 2] = np.array([ax, ay]) * q[i]
        poses.append(base @ move @ spin @ slide)
    return poses


@pytest.mark.parametrize("name", ["double", "cartpole", "chain:4"])
def test_link_frames_compose_rigid_motions(name):
    mechanism = load(name)
    tree = mechanism.tree
    q = np.random.default_rng(1).normal(size=len(tree.parent))
    frames = link_frames(tree.parent.copy(), tree.kind.copy(), tree.links.copy(), q)
    for frame, pose in zip(frames, place_by_hand(mechanism, q), strict=True):
        np.testing.assert_allclose(frame[:2], pose[:2, 2], atol=1e-12)
        np.testing.assert_allclose([np.cos(frame[2]), np.sin(frame[2])], pose[:2, 0], atol=1e-12)


def test_box_outline_is_the_hull_of_its_projected_corners():
    mechanism = load("double")
    q = np.array([-0.7, 0.4])
    shapes = mechanism.shapes
    poses = place_by_hand(mechanism, q)
    for g, (body, polygon) in enumerate(outline(mechanism, CAMERA, q)):
        points = shapes.points[shapes.first[g] : shapes.first[g + 1]]
        pose = poses[shapes.link[g]]
        world = np.column_stack([points[:, :2] @ pose[:2, :2].T + pose[:2, 2], points[:, 2]])
        expected = cv2.convexHull(pixels(CAMERA, world).astype(np.float32))[:, 0]
        assert body == shapes.body[g]
        # single precision of cv2's hull
        assert cv2.contourArea(polygon.astype(np.float32)) == pytest.approx(
            cv2.contourArea(expected), rel=1e-5
        )
        assert {tuple(p.round(2)) for p in polygon} == {tuple(p.round(2)) for p in expected.astype(float)}


def test_ball_outline_is_its_tangent_cone():
    """A point p on the outline of a ball makes the cone's half angle, arcsin(r / d), with the ball's
    centre."""
    camera = Camera(640, 480, 400.0, x=-0.25, y=0.2, depth=0.5)
    mechanism = load("bob")
    ball = outline(mechanism, camera, np.array([0.3]))[-1][1]
    shapes = mechanism.shapes
    pose = place_by_hand(mechanism, [0.3])[0]
    local = shapes.points[shapes.first[-2]]
    centre = np.append(pose[:2, :2] @ local[:2] + pose[:2, 2], local[2])
    seen = rotation(camera) @ (centre - [camera.x, camera.y, camera.depth])
    rays = np.column_stack([ball - [(640 - 1) / 2, (480 - 1) / 2], np.full(len(ball), 400.0)])
    angles = np.arccos(rays @ seen / np.linalg.norm(rays, axis=1) / np.linalg.norm(seen))
    expected = np.arcsin(shapes.radius[-1] / np.linalg.norm(seen))
    # the ring is grown by 0.65 % so that the polygon of RING corners has the circle's area
    assert RING == 32
    np.testing.assert_allclose(angles, expected, rtol=0.01)


@pytest.mark.parametrize(
    "turn", [{}, {"roll": 0.2}, {"pitch": 0.3}, {"yaw": -0.4}, {"roll": 0.1, "pitch": -0.2, "yaw": 0.3}]
)
def test_camera_turns_as_documented(turn):
    camera = Camera(100, 80, 90.0, depth=2.0, **turn)
    r = rotation(camera)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(r) == pytest.approx(1.0)
    right, up, middle = pixels(camera, np.array([[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.0]]))
    if "roll" in turn and len(turn) == 1:
        assert right[1] > middle[1]  # clockwise: the right end goes down
    if "pitch" in turn and len(turn) == 1:
        assert middle[1] > 39.5  # looking up: the mechanism moves down
    if "yaw" in turn and len(turn) == 1:
        assert middle[0] > 49.5  # looking left: the mechanism moves right
    if not turn:
        assert right[0] > middle[0]
        assert up[1] < middle[1]


def test_reduced_camera_sees_the_centre_of_each_block():
    whole = camera_array(CAMERA)
    small = shrunk(whole, 4.0)
    # pixel 0 of the reduced picture covers pixels 0..3, whose centre is 1.5
    for whole_px, small_px in ((1.5, 0.0), (5.5, 1.0)):
        assert (whole_px - whole[13]) / whole[12] == pytest.approx((small_px - small[13]) / small[12])


def test_convex_hull_against_opencv():
    rng = np.random.default_rng(3)
    for count in (3, 4, 8, 50):
        points = rng.normal(size=(count, 2)) * 20
        hull = np.empty(count + 2, dtype=np.int64)
        size = convex_hull(points, 0, count, hull)
        expected = cv2.convexHull(points.astype(np.float32))[:, 0]
        assert size == len(expected)
        area = cv2.contourArea(points[hull[:size]].astype(np.float32))
        assert area == pytest.approx(cv2.contourArea(expected), rel=1e-5)


@pytest.mark.parametrize("name", ["double", "bob", "cartpole"])
def test_mismatch_against_drawn_pictures(name):
    """sum |I_a - I_m| of drawn masks, four times finer, against the row sums' exact spans."""
    mechanism = load(name)
    rng = np.random.default_rng(5)
    soft = cv2.GaussianBlur((rng.random((240, 320)) > 0.5).astype(np.float32), (0, 0), 6.0)
    mask = np.clip((soft - 0.45) * 10 * FULL, 0, FULL).astype(np.uint8)
    rig = rig_of(mechanism, CAMERA)
    dofs = len(rig.parent)
    poses = rng.normal(scale=0.8, size=(6, dofs)) * np.where(rig.kind == 1, 0.1, 1.0)
    costs = pose_mismatch(row_sums(mask), rig, poses, len(rig.radius))
    fine = 8
    big = cv2.resize(mask, None, fx=fine, fy=fine, interpolation=cv2.INTER_NEAREST).astype(np.float64) / FULL
    for q, cost in zip(poses, costs, strict=True):
        drawn = np.zeros(big.shape, np.uint8)
        for _, polygon in outline(mechanism, CAMERA, q):
            corners = np.round(((polygon + 0.5) * fine - 0.5) * 16).astype(np.int32)
            cv2.fillPoly(drawn, [corners], 1, cv2.LINE_8, 4)
            assert polygon.min() > 0, "keep the test's poses in the picture"
            assert (polygon < [319, 239]).all(), "keep the test's poses in the picture"
        expected = np.sum(np.where(drawn > 0, 1.0 - 2.0 * big, 0.0)) / fine**2
        # a row is taken along its middle line: half a pixel's slope at the ends of each outline
        assert cost == pytest.approx(expected, abs=12.0)


def test_covered_pixels_grow():
    mechanism = load("single")
    inner = covered_pixels(mechanism, CAMERA, np.array([0.3]), grow=0.0)
    outer = covered_pixels(mechanism, CAMERA, np.array([0.3]), grow=3.0)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    assert (cv2.dilate(inner.astype(np.uint8), kernel) <= outer).all()
    assert outer.sum() < 2.0 * inner.sum()


def test_outline_behind_the_camera_is_empty():
    assert outline(load("single"), Camera(320, 240, 300.0, depth=-1.0), np.array([0.0])) == []
