"""Springs that are tried or freed: where they begin to be slack."""

from dataclasses import replace

import numpy as np

from monodyn.estimation.torque.laws import middles, slackened, sprung
from monodyn.mechanism import load
from swings import TIMES, motion, record

DOUBLE = load("double")
POSES = record(DOUBLE, TIMES, motion(DOUBLE, TIMES, [-0.8, 0.4], [0.0, 0.0]))


def test_a_freed_spring_begins_in_the_middle_of_the_motion_and_frees_where_it_is_slack() -> None:
    began = slackened(DOUBLE.with_choices(free=["joint2.stiffness"]), [POSES])
    assert began.values["joint2.rest"] == middles([POSES])[1] != 0.0
    assert began.parameter("joint2.rest").free
    assert not began.parameter("joint1.rest").free


def test_what_a_user_or_a_file_says_of_a_spring_stays() -> None:
    for given in (
        DOUBLE.with_choices(free=["joint2.stiffness"], fix={"joint2.rest": 0.0}),
        DOUBLE.with_values({"joint2.rest": 0.3}).with_choices(free=["joint2.stiffness"]),
        DOUBLE.with_values({"joint2.stiffness": 0.1}).with_choices(free=["joint2.stiffness"]),
        DOUBLE,
    ):
        began = slackened(given, [POSES])
        assert began.values == given.values
        assert not began.parameter("joint2.rest").free


def test_springs_are_tried_where_nobody_gave_one() -> None:
    given = DOUBLE.with_choices(fix={"joint1.stiffness": 0.0, "joint2.rest": 0.2})
    mechanism, laws = sprung(given, np.array([0.5, 0.7]))
    assert laws == {"joint2": ["joint2.stiffness"]}
    assert (mechanism.values["joint1.rest"], mechanism.values["joint2.rest"]) == (0.0, 0.2)


def test_a_joint_that_has_turned_far_begins_at_the_bound() -> None:
    turned = replace(POSES, position=POSES.position + 20.0)
    began = slackened(
        DOUBLE.with_choices(free=["joint1.stiffness"], bounds={"joint1.rest": (-1.0, 2.0)}), [turned]
    )
    assert began.values["joint1.rest"] == 2.0
    mechanism, _ = sprung(DOUBLE, middles([turned]))
    assert mechanism.values["joint1.rest"] == 4.0 * np.pi


def test_the_middle_is_that_of_what_was_measured() -> None:
    seen = np.arange(len(TIMES)) % 3 > 0
    part = replace(POSES, seen=seen)
    shown = np.concatenate((POSES.position, POSES.position[seen]))
    np.testing.assert_allclose(middles([POSES, part]), shown.mean(axis=0))
