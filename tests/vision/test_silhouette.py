"""Silhouette kernels against slow, obvious twins."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.tree import ANCHOR_X, AXIS_Y, HINGE, SLIDE
from monodyn.types import Camera
from monodyn.vision.drawing.camera import pixels, rotation
from monodyn.vision.drawing.outline import outline
from monodyn.vision.drawing.rig import COARSE_RING, RING, rig_of
from monodyn.vision.drawing.silhouette import blank_outlines, convex_hull, draw, link_frames
from pictures import CAMERA


def place_by_hand(mechanism: Mechanism, q: np.ndarray) -> list[np.ndarray]:
    """Compose planar rigid motions as 3x3 matrices, one joint after the other."""
    tree = mechanism.tree
    poses = []
    for i, parent in enumerate(tree.parent):
        base = np.eye(3) if parent < 0 else poses[parent]
        x, y, angle, ax, ay = tree.links[i, ANCHOR_X : AXIS_Y + 1]
        move = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
        turn = angle + (ax * q[i] if tree.kind[i] == HINGE else 0.0)
        spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        slide = np.eye(3)
        if tree.kind[i] == SLIDE:
            slide[:2, 2] = np.array([ax, ay]) * q[i]
        poses.append(base @ move @ spin @ slide)
    return poses


@pytest.mark.parametrize("name", ["double", "cartpole", "chain:4"])
def test_link_frames_compose_rigid_motions(name: str) -> None:
    mechanism = load(name)
    q = np.random.default_rng(1).normal(size=len(mechanism.joints))
    frames = link_frames(rig_of(mechanism, CAMERA), q)
    for frame, pose in zip(frames, place_by_hand(mechanism, q), strict=True):
        np.testing.assert_allclose(frame[:2], pose[:2, 2], atol=1e-12)
        np.testing.assert_allclose([np.cos(frame[2]), np.sin(frame[2])], pose[:2, 0], atol=1e-12)


def test_box_outline_is_the_hull_of_its_projected_corners() -> None:
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


def test_ball_outline_is_its_tangent_cone() -> None:
    """A point p on the outline of a ball makes the cone's half angle, arcsin(r / d), with the ball's
    centre."""
    camera = Camera(640, 480, 400.0, x=-0.25, y=0.2, depth=0.5)
    mechanism = load("bob")
    ball = outline(mechanism, camera, np.array([0.3]))[-1][1]
    shapes = mechanism.shapes
    pose = place_by_hand(mechanism, np.array([0.3]))[0]
    local = shapes.points[shapes.first[-2]]
    centre = np.append(pose[:2, :2] @ local[:2] + pose[:2, 2], local[2])
    seen = rotation(camera) @ (centre - [camera.x, camera.y, camera.depth])
    rays = np.column_stack([ball - [(640 - 1) / 2, (480 - 1) / 2], np.full(len(ball), 400.0)])
    angles = np.arccos(rays @ seen / np.linalg.norm(rays, axis=1) / np.linalg.norm(seen))
    expected = np.arcsin(shapes.radius[-1] / np.linalg.norm(seen))
    # the ring is grown by 0.65 % so that the polygon of RING corners has the circle's area
    assert RING == 32
    np.testing.assert_allclose(angles, expected, rtol=0.01)


def test_convex_hull_against_opencv() -> None:
    rng = np.random.default_rng(3)
    for count in (3, 4, 8, 50):
        points = rng.normal(size=(count, 2)) * 20
        hull = np.empty(count + 2, dtype=np.int64)
        size = convex_hull(points, hull, np.arange(count))
        expected = cv2.convexHull(points.astype(np.float32))[:, 0]
        assert size == len(expected)
        area = cv2.contourArea(points[hull[:size]].astype(np.float32))
        assert area == pytest.approx(cv2.contourArea(expected), rel=1e-5)


def test_a_ball_in_a_reduced_picture_has_the_same_area() -> None:
    bob = load("bob")
    areas = []
    for shrink in (1.0, 2.0):
        rig = rig_of(bob, CAMERA, shrink=shrink)
        outlines = blank_outlines(rig, len(rig.radius))
        assert draw(rig, np.array([0.4]), outlines)
        corners = outlines.px[outlines.hull[outlines.first[-2] : outlines.first[-1]]]
        areas.append(shrink**2 * cv2.contourArea(corners.astype(np.float32)))
    # both polygons have the area of the circle
    assert areas[1] == pytest.approx(areas[0], rel=1e-3)
    assert RING % COARSE_RING == 0
