"""Points in place of masks: marks, first poses, the robust refinement, exchanged names."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from monodyn.errors import MechanismError, SettingsError, VideoError
from monodyn.mechanism import load, write_mjcf
from monodyn.stages import locate, track, track_freely
from monodyn.types import Camera
from monodyn.vision.points.begin import begin, circle
from monodyn.vision.points.found import (
    camera_notes,
    exchange_notes,
    pair_notes,
)
from monodyn.vision.points.marks import marks_of
from monodyn.vision.points.poses import Exchange, combined, likeliest
from monodyn.vision.points.shown import Places, in_plane, pose_slopes, project, shown_by
from monodyn.vision.points.tracks import without_pictures
from monodyn.vision.settings import LocateSettings
from support import refuses
from tracked import CAMERA, apart, seen, spoiled, stretched, swing, tracks

NAMES = ("joint1", "joint2", "link2")
SITES = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="arm"><joint name="pin" type="hinge" axis="0 -1 0"/>
<geom type="capsule" size="0.01" fromto="0 0 0 0.2 0 0"/>
<site name="knob" pos="0.1 -0.02 0.05"/><site pos="0 0 0"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def double():
    return stretched()


def test_sites_of_a_file_are_marks(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(SITES, encoding="utf-8")
    mechanism = load(path)
    (site,) = mechanism.plan.links[0].sites
    np.testing.assert_allclose([*site.place, site.ahead], [0.1, 0.05, 0.02], atol=1e-12)
    write_mjcf(mechanism.with_values({"arm.length": 0.4}), path)
    (longer,) = load(path).plan.links[0].sites
    np.testing.assert_allclose([*longer.place, longer.ahead], [0.2, 0.1, 0.04], atol=1e-9)
    marks = marks_of(mechanism, ["Knob", "pin", "ARM tip", "ground2", "dot"], {"dot": "arm.marker"})
    assert [mark.kind for mark in marks] == ["site", "joint", "end", "scene", "free"]
    np.testing.assert_allclose(marks[2].place, [0.2, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("names", "mapped", "message"),
    [
        (["joint1", "nose"], {},
         "points 'nose': expected joints, bodies (their far ends), sites or the scene ('joint1', 'joint2', "
         "'link1', 'link2', 'world'); say what each is with --points.map NAME=TARGET, or leave it out with "
         "NAME=none."),
        (["joint1"], {"knee": "joint2"},
         "points.map: point 'knee' is not in the table; points: 'joint1'."),
        (["joint1", "a"], {"a": "jiont2"},
         "point 'a=jiont2': expected a joint, a body (its far end), a site or the scene; did you mean "
         "'joint2'?"),
        (["joint1", "a"], {"a": "joint1"},
         "points 'joint1' and 'a': expected one point at 'joint1', got two; leave one out with "
         "--points.map a=none."),
    ],
)  # fmt: skip
def test_names_that_are_nothing_are_refused(names: list[str], mapped: dict[str, str], message: str) -> None:
    with refuses(SettingsError, message):
        marks_of(load("double"), names, mapped)


def test_points_that_show_too_little_are_refused(double) -> None:
    file, truth, q = double
    with refuses(MechanismError, "points: expected at least one point of the mechanism, got none; map some."):
        marks_of(file, ["a"], {"a": "none"})
    px = seen(truth, q, NAMES)
    with refuses(
        MechanismError,
        "points: expected a point for each joint that its body moves, got none for 'joint1'; track the far "
        "end of that body, its next joint or a site on it.",
    ):
        locate(tracks(("joint1", "link2"), px[:, [0, 2]]), file)
    gone = px.copy()
    gone[:, 1] = np.nan
    with refuses(
        VideoError,
        "points.csv: expected places of point 'joint2' with a likelihood above 0, got none in 120 frames; "
        "leave it out with --points.map joint2=none.",
    ):
        locate(tracks(NAMES, gone), file)
    with refuses(VideoError, "points.csv: expected points in at least 5 frames, got 3; track more frames."):
        locate(tracks(NAMES, px[:3]), file)
    rest = np.repeat(px[:1], 60, axis=0)
    with refuses(
        VideoError,
        "points.csv: expected points that show joint 'joint1', got none: where it is not tracked itself, "
        "points of its body have to move about it; track the joint.",
    ):
        locate(tracks(NAMES[1:], rest[:, 1:]), file)
    with refuses(
        VideoError,
        "points.csv: expected the points that show joint 'joint1' apart from it, got them at one place; give "
        "the points of this mechanism.",
    ):
        locate(tracks(NAMES, np.zeros((60, 3, 2))), file)
    with refuses(
        SettingsError,
        "method 'paper': the published method looks at silhouettes; points take the method 'fast' for "
        "camera and location.",
    ):
        locate(tracks(NAMES, px), file, LocateSettings(method="paper"))


def test_a_circle_is_found_among_outliers() -> None:
    turn = np.linspace(0.0, 1.5, 60)
    points = np.array([3.0, -2.0]) + 5.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points[::12] = [40.0, 40.0]
    points[5] = np.nan
    centre, radius = circle(points)
    np.testing.assert_allclose([*centre, radius], [3.0, -2.0, 5.0], atol=1e-6)


def test_geometry_alone_finds_poses_and_ratios(double) -> None:
    file, truth, q = double
    camera = replace(CAMERA, x=0.0, y=0.0)
    flat = truth.with_values({"link2.offset": 1e-9})
    plane = in_plane(camera, seen(flat, q, ("joint2", "link2"), camera=camera))
    # the pivot is not tracked: it is the centre of a circle
    found = begin(marks_of(file, ("joint2", "link2")), file, plane)
    assert np.abs(apart(found.position, q)).max() < 1e-4
    np.testing.assert_allclose(found.scale[0] / found.scale[1], 1.4 / 0.8, rtol=1e-5)


def test_slopes_are_those_of_the_places(double) -> None:
    _, truth, q = double
    shown = shown_by(
        Places(tuple(marks_of(truth, NAMES)), truth, np.zeros(0, int)), truth, CAMERA, np.zeros((0, 2))
    )
    shifted = np.column_stack([q, np.full((len(q), 2), 0.1)])
    base = project(shown, shifted)
    np.testing.assert_allclose(base - project(shown, q), 5.0, atol=1e-9)
    step = 1e-4 * np.array([1.0, -2.0, 3.0, 1.0])
    moved = project(shown, shifted + step)
    np.testing.assert_allclose(pose_slopes(shown, shifted, base) @ step, moved - base, atol=1e-4)


@pytest.mark.slow
def test_camera_lengths_and_poses_with_honest_errors(double) -> None:
    file, truth, q = double
    px = spoiled(seen(truth, q, NAMES))
    px[40:70, [1, 2]] = px[40:70, [2, 1]]
    scene = locate(tracks(NAMES, px), file)
    values = scene.mechanism.values
    ratio = truth.values["link1.length"] / truth.values["link2.length"]
    assert values["link1.length"] / values["link2.length"] == pytest.approx(ratio, rel=5e-3)
    np.testing.assert_allclose(scene.fitted.noise, 0.5, atol=0.1)
    # frames whose points are missing at the end of a stretch belong to either side of it
    assert re.fullmatch(
        r"The points 'joint2' and 'link2' have exchanged names in frames (38|39|40):70; put right.",
        scene.advice[0],
    )
    assert scene.mechanism.measured is not None
    assert "link1.width" not in scene.mechanism.measured.names
    poses = track(scene.tracks, scene)
    off = apart(poses.position, q)
    std = np.sqrt(np.diagonal(poses.covariance, axis1=1, axis2=2))
    assert (poses.measured.mean(axis=0) > [0.95, 0.8]).all()
    z = (off / std)[poses.measured]
    assert 0.85 < z.std() < 1.15
    assert np.abs(z).max() < 5.0


@pytest.mark.slow
def test_names_that_are_wrong_in_all_frames_are_put_right(double) -> None:
    file, truth, q = double
    px = spoiled(seen(truth, q, NAMES))
    scene = locate(tracks(("joint2", "joint1", "link2"), px), file)
    assert scene.advice[0] == (
        "The points 'joint2' and 'joint1' have exchanged names in frames 0:120; put right."
    )
    assert np.nanmax(np.abs(apart(track(scene.tracks, scene).position, q))) < 0.1


@pytest.mark.slow
def test_markers_off_the_axis_get_their_places(double) -> None:
    file, truth, q = double
    mapped = {"a": "link1.marker", "b": "link2.marker"}
    px = spoiled(seen(truth, q, (*NAMES, "a", "b"), mapped, [[0.5, 0.3], [0.4, -0.5]]))
    scene = locate(tracks((*NAMES, "a", "b"), px), file, mapped=mapped)
    np.testing.assert_allclose(scene.fitted.own, [[0.5, 0.3], [0.4, -0.5]], atol=0.01)


def test_a_point_that_is_elsewhere_at_the_right_distance_is_not_believed(double) -> None:
    file, truth, q = double
    px = spoiled(seen(truth, q, NAMES), outliers=0.0, missing=0.0)
    away = px[60, 2] - px[60, 1]
    px[60, 2] = px[60, 1] + np.array([[0.0, -1.0], [1.0, 0.0]]) @ away
    scene = locate(tracks(NAMES, px), file)
    assert scene.lying[60].all()
    poses = track(scene.tracks, scene)
    assert np.flatnonzero(~poses.seen).tolist() == [60]


@pytest.mark.slow
def test_a_cart_slides(double) -> None:
    file = load("cartpole")
    joints = [joint.name for joint in file.joints]
    q = swing(file, 90, (0.1, 0.7))
    names = (*joints, file.bodies[-1])
    scene = locate(tracks(names, spoiled(seen(file, q, names))), file)
    poses = track(scene.tracks, scene)
    assert scene.camera.x == 0.0
    # where the slide is zero is a matter of choice, and so is the scale of a picture
    slide = np.polyfit(q[poses.seen, 0], poses.position[poses.seen, 0], 1)
    assert slide[0] == pytest.approx(1.0, abs=0.15)
    assert np.nanmax(np.abs(apart(poses.position[:, 1], q[:, 1]))) < 0.02


def test_pairs_of_points_that_are_not_looked_at_are_told() -> None:
    file = load("double")
    names = (*NAMES, *(f"m{i}" for i in range(14)))
    marks = marks_of(file, names, dict.fromkeys(names[3:], "link2.marker"))
    table = tracks(names, np.zeros((9, 17, 2)))
    assert pair_notes(marks[:16], table) == []
    assert pair_notes(marks, replace(table, told_apart=True)) == []
    assert pair_notes(marks, table) == [
        "Of 16 of 136 pairs of points it was not found out whether they have exchanged names, 'm12' and "
        "'m13' among them; leave points out with --points.map NAME=none where tracks may have."
    ]


def test_exchanges_of_one_pair_are_put_together() -> None:
    one, two = Exchange((0, 1), 0, 90), Exchange((0, 1), 30, 40)
    other = Exchange((0, 2), 10, 20)
    assert combined([one, other, two]) == combined([two, one, other])
    assert [(e.tracks, e.first, e.stop) for e in combined([one, other, two])] == [
        ((0, 1), 0, 30), ((0, 2), 10, 20), ((0, 1), 40, 90),
    ]  # fmt: skip
    assert combined([one, one]) == []


def test_names_change_only_for_long_enough() -> None:
    costs = np.zeros((2, 30))
    costs[0, 5], costs[0, 12:20], costs[1, :12], costs[1, 20:] = 8.0, 8.0, 8.0, 8.0
    assert likeliest(costs, 9.0).tolist() == [0] * 12 + [1] * 8 + [0] * 10


def test_masks_and_points_do_not_mix(double) -> None:
    file, truth, q = double
    scene = locate(tracks(NAMES, seen(truth, q, NAMES)), file)
    with refuses(VideoError, "track: expected masks with a scene of masks, or points with one of points."):
        track(SimpleNamespace(), scene)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_rest_before_the_release_does_not_count(double) -> None:
    file, truth, q = double
    held = np.concatenate([np.repeat(q[:1], 20, axis=0), q])
    scene = locate(tracks(NAMES, spoiled(seen(truth, held, NAMES), noise=0.1)), file)
    poses, span = track_freely(scene.tracks, scene)
    assert 15 <= span.first <= 24
    assert not poses.measured[: span.first].any()
    given = track_freely(scene.tracks, scene, span=(1.0, 3.0))[1]
    assert (given.first, given.stop) == (30, 91)


def test_frames_that_a_table_lacks_have_times_too() -> None:
    px = np.zeros((3, 1, 2))
    some = replace(tracks(("a",), px), frame=np.array([2, 3, 6]), time=np.array([2.0, 3.0, 6.0]) / 10)
    video = without_pictures(some)
    np.testing.assert_allclose(video.times, np.arange(7) / 10, atol=1e-9)
    assert list(video.frames()) == []


def test_sentences_about_what_was_found() -> None:
    marks = marks_of(load("double"), NAMES)
    table = tracks(NAMES, np.zeros((9, 3, 2)))
    exchanges = [Exchange((0, 2), 1, 3), Exchange((0, 2), 5, 6)]
    assert exchange_notes(exchanges, marks, table) == [
        "The points 'joint1' and 'link2' have exchanged names in frames 1:3, 5:6; put right."
    ]
    camera = Camera(640, 480, 500.0)
    assert camera_notes(camera, {"camera.yaw": 0.05, "camera.x": 9.0}) == []
    assert camera_notes(camera, {"camera.yaw": 0.2, "camera.focal": 200.0}) == [
        "The points hardly determine camera.yaw, camera.focal: leave out --free, or give the value with "
        "--fix."
    ]


@pytest.mark.slow
def test_what_moves_all_poses_together_is_stated(double) -> None:
    file, truth, q = double
    px, means, stated = seen(truth, q, NAMES), [], []
    for seed in range(8):
        spoilt = spoiled(px, noise=0.3, outliers=0.0, missing=0.0, seed=seed)
        scene = locate(tracks(NAMES, spoilt), file)
        poses = track(scene.tracks, scene)
        assert poses.shifts is not None
        means.append(apart(poses.position, q)[poses.seen].mean(axis=0))
        own = np.diagonal(poses.covariance[poses.seen], axis1=1, axis2=2).mean(axis=0) / poses.seen.sum()
        stated.append(np.sqrt(np.sum(poses.shifts[:, poses.seen].mean(axis=1) ** 2, axis=0) + own))
    # eight draws determine a standard deviation within a quarter
    ratio = np.std(means, axis=0) / np.mean(stated, axis=0)
    assert (ratio > 0.4).all()
    assert (ratio < 1.8).all()
