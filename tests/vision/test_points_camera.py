"""Tracked points before a camera that looks obliquely, or moves."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from monodyn.stages import locate, track
from monodyn.vision.drawing.camera import from_origin
from monodyn.vision.points.drift import Drift, drift_of, smoothed
from monodyn.vision.points.follow import follow_points
from monodyn.vision.points.found import (
    motion_notes,
)
from monodyn.vision.points.poses import solved
from monodyn.vision.settings import LocateSettings
from support import slow
from tracked import CAMERA, apart, seen, spoiled, stretched, tracks

NAMES = ("joint1", "joint2", "link2")


@pytest.fixture(scope="module")
def double():
    return stretched()


def test_an_angle_of_the_camera_is_found_where_it_is_freed(double) -> None:
    file, truth, q = double
    camera = replace(CAMERA, x=0.4, yaw=-0.3)
    px = spoiled(seen(truth, q, NAMES, camera=camera))
    scene = locate(tracks(NAMES, px), file, free=["camera.yaw"])
    assert scene.camera.yaw == pytest.approx(-0.3, abs=4.0 * scene.camera_std["camera.yaw"] + 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("yaw", [slow(-0.35), 0.17])
def test_an_oblique_camera_is_found(double, yaw: float) -> None:
    file, truth, q = double
    camera = from_origin(replace(CAMERA, yaw=yaw))
    scene = locate(tracks(NAMES, spoiled(seen(truth, q, NAMES, camera=camera))), file)
    assert abs(scene.camera.yaw - yaw) < 4.0 * scene.camera_std["camera.yaw"] < 0.03
    assert abs(scene.camera.focal - CAMERA.focal) < 4.0 * scene.camera_std["camera.focal"]
    assert scene.rms_px < 0.6
    assert not scene.off.any()
    poses = track(scene.tracks, scene)
    assert (poses.measured.mean(axis=0) > [0.95, 0.8]).all()
    off = apart(poses.position, q) / np.sqrt(np.diagonal(poses.covariance, axis1=1, axis2=2))
    # in units of the noise; the first hinge takes up the roll, which a picture does not show
    assert np.nanstd(off, axis=0).max() < 1.2


@pytest.mark.slow
def test_what_is_not_known_of_turns_is_in_what_moves_all_poses(double) -> None:
    file, truth, q = double
    camera = from_origin(replace(CAMERA, yaw=np.radians(3.0)))
    table = tracks(NAMES, spoiled(seen(truth, q, NAMES, camera=camera), noise=2.0))
    scene = locate(table, file)
    assert scene.camera.yaw == 0.0
    assert np.radians(3.0) < 3.0 * scene.camera_std["camera.yaw"]
    assert scene.camera_std["camera.focal"] < 2.0 * 0.25 * CAMERA.focal
    assert scene.advice == ()
    given = locate(table, file, fix={"camera.yaw": 0.0, "camera.pitch": 0.0, "camera.focal": CAMERA.focal})
    assert not {"camera.yaw", "camera.pitch", "camera.focal"} & set(given.camera_std)
    together = [track(table, s).shifts for s in (scene, given)]
    doubted, known = (np.sqrt(np.sum(np.var(np.array(s), axis=1), axis=0)) for s in together)
    assert (doubted > 3.0 * known).all()


@pytest.mark.slow
def test_before_a_square_camera_turns_are_held(double) -> None:
    file, truth, q = double
    table = tracks(NAMES, spoiled(seen(truth, q, NAMES)))
    scene = locate(table, file)
    assert (scene.camera.pitch, scene.camera.yaw, scene.camera.focal) == (0.0, 0.0, CAMERA.focal)
    # the scene of a given focal length doubts the turns alone
    told = locate(table, file, LocateSettings(focal=CAMERA.focal))
    assert {"camera.pitch", "camera.yaw"} < set(told.camera_std)
    assert "camera.focal" not in told.camera_std


@pytest.mark.slow
def test_a_camera_that_moves_is_taken_out(double) -> None:
    file, truth, q = double
    way = np.arange(120) / 30.0
    shake = np.random.default_rng(3).normal(size=(120, 2))
    path = np.stack([12.0 * np.sin(1.5 * way), 8.0 * way], axis=1) + shake
    px = spoiled(seen(truth, q, NAMES) + path[:, None])
    scene = locate(tracks(NAMES, px), file)
    assert scene.drift is not None
    assert scene.adjustment.jitter == pytest.approx(1.0, abs=0.4)
    assert re.fullmatch(
        r"The camera moves: points that stand still shift by up to \d\d\.\d px from their mean place; taken "
        r"out of all points \(camera.csv\)\.",
        scene.advice[0],
    )
    found = scene.camera_path(130)
    assert found is not None
    assert found.registered.tolist() == [True] * 120 + [False] * 10
    smooth = path - shake
    assert np.abs(found.shift[:120] - (smooth - np.median(smooth, axis=0))).max() < 2.5
    np.testing.assert_allclose(found.zoom[:120], 1.0)
    np.testing.assert_allclose(found.std[:120], np.sqrt(2.0) * scene.adjustment.jitter)
    off = apart(track(scene.tracks, scene).position, q)
    assert np.nanstd(off[:, 0]) < np.radians(0.5)
    still = locate(tracks(NAMES, spoiled(seen(truth, q, NAMES))), file)
    assert still.drift is None
    assert still.camera_path(120) is None


def test_the_way_that_points_show_is_that_of_the_whole_picture() -> None:
    turn, shift = np.array([0.1, -0.2]), np.array([[3.0, -1.0], [0.0, 5.0]])
    drift, middle = Drift(shift, turn, np.array([100.0, 40.0])), np.array([319.5, 239.5])
    px = np.array([[[10.0, 20.0], [600.0, 50.0]]] * 2)
    maps = drift.maps(middle)
    by_map = np.einsum("nij,npj->npi", maps[:, :2, :2], px - middle) + maps[:, None, :2, 2] + middle
    np.testing.assert_allclose(by_map, drift.added(px), atol=1e-9)
    noted = motion_notes(drift, tracks(NAMES, np.zeros((2, 3, 2))))
    assert noted == [
        "The camera moves: points that stand still shift by up to 5.0 px and 11.46 deg from their mean "
        "place; taken out of all points (camera.csv)."
    ]


@pytest.mark.slow
def test_dots_before_a_moving_camera_are_as_sure_as_its_registration(double) -> None:
    file, truth, q = double
    table = replace(tracks(NAMES, spoiled(seen(truth, q, NAMES), outliers=0.0)), told_apart=True)
    scene = locate(table, file)
    still = follow_points(table, scene)
    clip = SimpleNamespace(camera_path=SimpleNamespace(std=np.full(120, 2.0)))
    moved = replace(scene, tracks=replace(table, clip=clip))
    poses = follow_points(moved.tracks, moved)
    added = np.sqrt(np.diagonal(poses.covariance - still.covariance, axis1=1, axis2=2))
    right, down = (
        solved(scene.adjustment, scene.fitted, replace(scene.seen, px=px), scene.fitted.position)
        - scene.fitted.position
        for px in (scene.seen.px + np.sqrt(2.0) * axis for axis in np.eye(2))
    )
    ratio = added[poses.seen] / np.hypot(right, down)[poses.seen]
    # points that lie outside count for little in the one and not at all in the other
    np.testing.assert_allclose(np.median(ratio, axis=0), 1.0, atol=0.1)
    assert motion_notes(None, moved.tracks) == [
        "No parallax is measured of dots: before this camera, which moves, they are taken to be as far away "
        "as the still scene. A mechanism that is nearer sways with the camera, which no interval contains: "
        "put the camera on a tripod."
    ]
    assert motion_notes(None, table) == []


@pytest.mark.slow
def test_an_exchanged_pivot_is_no_motion_of_the_camera(double) -> None:
    file, truth, q = double
    px = seen(truth, q, NAMES)
    px[30:70, [0, 2]] = px[30:70, [2, 0]]
    still = locate(tracks(NAMES, spoiled(px)), file)
    assert still.drift is None
    assert re.fullmatch(
        r"The points 'joint1' and 'link2' have exchanged names in frames (29|30):(70|71); put right.",
        still.advice[0],
    )
    assert np.nanmax(np.abs(apart(track(still.tracks, still).position, q))) < np.radians(3.0)
    way = np.arange(120) / 30.0
    path = np.stack([12.0 * np.sin(1.5 * way), 8.0 * way], axis=1)
    # both at once, and the same points once more as those of another clip
    table = tracks(NAMES, spoiled(px + path[:, None]))
    moving = locate(table, file)
    assert moving.drift is not None
    for points in (table, replace(table)):
        off = apart(track(points, moving).position, q)
        assert np.nanstd(off, axis=0).max() < np.radians(0.8)


def test_a_point_of_the_scene_shows_the_turn_of_the_camera() -> None:
    draw, way = np.random.default_rng(0), np.arange(200) / 30.0
    turn, shift = 0.01 * np.sin(way), np.stack([10.0 * np.sin(way), 6.0 * np.cos(way)], axis=1)
    base = np.array([[300.0, 200.0], [500.0, 260.0], [90.0, 330.0]])
    away = base - base[0]
    turned = np.stack(
        [np.cos(turn)[:, None] * away[:, 0] - np.sin(turn)[:, None] * away[:, 1],
         np.sin(turn)[:, None] * away[:, 0] + np.cos(turn)[:, None] * away[:, 1]], axis=2,
    )  # fmt: skip
    px = base[0] + shift[:, None] + turned + 0.5 * draw.normal(size=(200, 3, 2))
    found = drift_of(px, 640)
    assert found is not None
    off = found.turn - turn
    assert np.std(off) < np.radians(0.06)
    np.testing.assert_allclose(found.removed(found.added(px)), px, atol=1e-9)


def test_smoothing_solves_its_normal_equations() -> None:
    draw = np.random.default_rng(0)
    weight, path = draw.random(30), draw.normal(size=(30, 2))
    smooth = smoothed(path, weight, 5.0)
    bend = np.diff(np.eye(30), 2, axis=0)
    whole = np.diag(weight) + 5.0 * bend.T @ bend
    np.testing.assert_allclose(smooth, np.linalg.solve(whole, weight[:, None] * path), atol=1e-6)
