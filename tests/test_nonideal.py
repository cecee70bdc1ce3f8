"""Clips that are not ideal: drawn from a seed alone, filmed as stated, judged as stated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from imperfect_film import Film, given, material_points, moved
from imperfections import CAREFUL, FACTORS, KINDS, NAMED, Draw, drawn
from judge import CHECK, lost_to_check, outcome
from monodyn.types import Camera
from monodyn.vision.drawing.camera import pixels
from nonideal import table, wilson
from spec import Case, Part, view

GOOD: dict[str, Any] = {
    "grade": "trusted",
    "pose_share": 0.01,
    "length_off": 0.003,
    "length_sigmas": 2.0,
    "worst": "camera.roll",
    "worst_sigmas": 2.5,
}
BALL = Case(
    "ball",
    (Part(0.5, 0.0006, shape="capsule", ball=0.03),),
    (-1.2,),
    size=(320, 240),
    seconds=1.0,
    pivot=(0.5, 0.1),
    fill=1.4,
    wall="plain",
    noise=0.0,
)


def still(draw: Draw) -> Draw:
    """Return a draw without what only costs time here."""
    return replace(draw, case=replace(draw.case, seconds=0.2), lead=0.1)


def test_a_draw_follows_from_seed_and_number_alone() -> None:
    first = [drawn("1", number) for number in range(40)]
    assert [drawn("1", number) for number in reversed(range(40))] == first[::-1]
    others = [drawn("24bb41be", number) for number in range(40)]
    assert all(a != b for a, b in zip(first, others, strict=True))
    assert {draw.kind for draw in first + others} == set(KINDS)
    factors = [factor for draw in first + others for _, factor in draw.factors]
    assert min(factors) >= FACTORS[0]
    assert max(factors) <= FACTORS[1]
    assert {name for draw in first + others for name, _ in draw.factors} == set(CAREFUL)


def test_a_kind_has_only_imperfections_that_it_can_have() -> None:
    for number in range(60):
        draw = drawn("1", number)
        assert all(draw.kind in CAREFUL[name].kinds for name, _ in draw.factors)
        # the rows of one picture are read before those of the next
        assert abs(draw.readout) < 1.0 / draw.case.rate


@pytest.mark.parametrize("number", [3, 7])
def test_points_are_shown_where_the_camera_of_the_program_sees_them(number: int) -> None:
    """The program's camera with the true place and turns, of a lens that bends nothing."""
    turned = (2.0, 5.0, -6.0)
    draw = still(drawn("projection", number))
    draw = replace(draw, case=replace(draw.case, turned=turned, bends=()), readout=0.0)
    film = Film(draw, moved(draw))
    focal, (x, away, up) = view(draw.case)
    roll, pitch, yaw = np.radians(turned)
    camera = Camera(*draw.case.size, focal, x, up, -away, roll, pitch, yaw)
    points = film.points(film.truth.at(0.1))
    # the plane of the program: x right, y up, z toward the camera
    expected = pixels(camera, np.column_stack([points[:, 0], points[:, 2], -points[:, 1]]))
    # rounding alone
    assert film.shown(0.1) == pytest.approx(expected, abs=1e-8)


def test_a_drawn_ball_lies_where_its_row_is_exposed() -> None:
    """The centre of the ink against the projected centre, with rows read from the top and from below."""
    # 1.1 s after the release it passes below the pivot
    time, draw = 0.6, Draw(BALL, "ball", "ball", lead=0.5)
    truth, shown = moved(draw), []
    for readout in (0.0, 0.03, -0.03):
        film = Film(replace(draw, readout=readout), truth)
        picture, area = film.picture(time)
        ink = np.abs(picture.astype(float) - film.wall).sum(2)
        # a thread is a fraction of a pixel wide
        rows, columns = np.nonzero(ink > 200)
        shown.append(film.shown(time)[0])
        # whole pixels are counted, and a rolling shutter shears the ball a little
        assert [columns.mean(), rows.mean()] == pytest.approx(shown[-1], abs=0.5)
        assert area == pytest.approx(len(rows), rel=0.1)
    # below the middle a row is exposed later or earlier: by more than is allowed above
    assert np.linalg.norm(shown[1] - shown[2]) > 2.0


def test_an_ellipse_is_as_wide_as_drawn() -> None:
    """Small swings are two harmonic motions a quarter period apart: a closed form."""
    ratio, angle = 0.1, 0.05
    case = replace(BALL, start=(-np.pi / 2 + angle,), seconds=2.0)
    draw = Draw(case, "ball", "bob", ellipse=ratio, lead=0.0)
    film = Film(draw, moved(draw))
    ends = np.array([film.points(film.truth.at(t))[0] for t in np.linspace(0.0, 2.0, 400)])
    long, across = np.ptp(ends[:, 0]) / 2, np.ptp(ends[:, 1]) / 2
    # damping takes 1 % a swing, the angle squared over 16 the rest
    assert long == pytest.approx(0.5 * np.sin(angle), rel=0.01)
    assert across / long == pytest.approx(ratio, rel=0.02)


def test_a_pivot_gives_way_and_a_thread_stretches_by_what_is_drawn() -> None:
    case = replace(BALL, seconds=4.0)
    truth = moved(Draw(case, "ball", "bob", pivot=0.01))
    pivot = truth.qpos[truth.time >= 0, 0]
    assert np.ptp(pivot) / 2 == pytest.approx(0.01, rel=0.05)
    truth = moved(Draw(replace(case, start=(-np.pi / 2,)), "ball", "bob", stretch=0.01))
    stretch = truth.qpos[truth.time >= 0, truth.model.joint("stretch").qposadr[0]]
    # at rest under its weight
    assert stretch == pytest.approx(0.005, rel=1e-3)


def test_a_ball_is_where_it_sits_however_long_its_rod_is() -> None:
    """A run may part the ball from a thread that it does not see."""
    for name, count in (("plane_above_bob", 1), ("bob", 2)):
        draw = NAMED.get(name, Draw(BALL, "bob", "file"))
        text = given(draw).replace('fromto="0 0 0 0.1 0 0"', 'fromto="0 0 0 0.001 0 0"')
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.qpos[:] = -np.pi / 2
        mujoco.mj_kinematics(model, data)
        points = material_points(model, data, draw, {"link1": 0.001})
        assert len(points) == count
        # hanging, at the distance of the user's file
        assert points[-1] == pytest.approx([0.0, 0.0, -0.1], abs=1e-12)


def test_the_file_of_a_ball_alone_has_no_thread() -> None:
    for draw, kinds in ((NAMED["plane_above_ball"], ["SPHERE"]), (NAMED["ideal_double"], ["BOX", "BOX"])):
        model = mujoco.MjModel.from_xml_string(given(draw))
        shapes = [mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_") for kind in model.geom_type]
        assert shapes == kinds


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, "right"),
        ({"grade": "approximate"}, "right"),
        ({"grade": "refused"}, "refused"),
        ({"grade": "none"}, "refused"),
        ({"pose_share": 0.05}, "inexact"),
        ({"pose_share": 0.2}, "wrong"),
        ({"pose_share": float("nan")}, "wrong"),
        ({"pose_share": 0.2, "grade": "approximate"}, "inexact"),
        ({"pose_share": 0.2, "grade": "refused"}, "refused"),
        ({"worst_sigmas": 4.1}, "wrong"),
        ({"worst_sigmas": 4.1, "grade": "approximate"}, "right"),
        ({"length_off": 0.05}, "right"),
        ({"length_off": 0.05, "length_sigmas": 4.5, "worst_sigmas": 4.5}, "wrong"),
        ({"length_off": 0.05, "length_sigmas": 4.5, "grade": "approximate"}, "inexact"),
    ],
)
def test_what_comes_of_a_run(change: dict[str, Any], expected: str) -> None:
    assert outcome({**GOOD, **change})["outcome"] == expected


def test_a_right_run_that_only_the_picture_check_refuses_is_lost() -> None:
    row = {**GOOD, "grade": "refused", "doubts": [f"{CHECK} lies beside what moves."]}
    assert lost_to_check({**row, **outcome(row)})
    row["doubts"].append("The motion is not explained.")
    assert not lost_to_check({**row, **outcome(row)})
    assert not lost_to_check({**GOOD, "doubts": [], **outcome(GOOD)})


def test_the_table_counts_outcomes_with_their_intervals() -> None:
    # Wilson's interval for 1 of 20, from its formula by hand
    assert wilson(1, 20) == pytest.approx((0.0089, 0.2361), abs=1e-4)
    row = {
        "kind": "ball",
        "factors": {"lens": 2.0},
        "imperfection": "lens",
        "doubts": [],
        "said": "",
        "why": "far off",
    }
    rows = [{**row, "name": str(k), "outcome": "right", "within": True} for k in range(3)]
    rows.append({**row, "name": "3", "outcome": "wrong", "within": False})
    lines = table(rows).splitlines()
    assert lines[-1] == "wrong: 3 (ball, lens): far off"
    assert next(line for line in lines if line.startswith("all")).split()[1:7] == [
        "4",
        "3",
        "0",
        "0",
        "1",
        "0",
    ]
