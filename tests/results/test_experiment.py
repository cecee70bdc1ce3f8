"""Which motion to film next, and whether it keeps what is promised of it."""

from dataclasses import replace

import numpy as np
import pytest

import monodyn
from fits import identified
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Doubt
from monodyn.estimation.parts import Unmodelled
from monodyn.mechanism import load
from monodyn.mechanism.simulate import simulate
from monodyn.results import experiment
from monodyn.results.experiment import HALVED, next_commands, next_motion
from monodyn.results.information import Quantities
from monodyn.results.releases import Release
from monodyn.stages import identify
from support import refuses
from swings import record

SPRING = """<mujoco><worldbody><body name="block"><joint name="slide" type="slide" axis="1 0 0"
stiffness="5"/><geom type="box" size=".05 .05 .05" mass="0.3"/></body></worldbody></mujoco>"""
STOPPED = """<mujoco><default><joint type="hinge" axis="0 -1 0" damping="0.001"/><geom type="box"
density="2700"/></default><worldbody><body name="link1"><joint name="joint1" range="-160 -20"/>
<geom size="0.1075 0.003 0.015" pos="0.0925 0 0"/></body></worldbody></mujoco>"""


def filmed(mechanism, start, count=45, seed=0):
    """Return a record of a motion from rest."""
    times = np.arange(count) / 30.0
    start = np.array(start, float)
    return record(mechanism, times, simulate(mechanism, times, start, 0.0 * start).position, seed=seed)


@pytest.fixture(scope="module")
def little():
    """A double pendulum that has hardly moved."""
    mechanism = load("double")
    poses = filmed(mechanism, [-1.4, 0.1])
    return poses, identify(poses, mechanism).check()


def test_the_motion_leaves_of_the_interval_what_was_said(little):
    first, fit = little
    advised = next_motion(fit)
    assert advised is not None
    assert advised.release is not None
    assert advised.halves
    # two degrees off, as by hand
    start = advised.release.position + np.radians([2.0, -2.0])
    second = filmed(load("double"), start, round(30 * advised.seconds) + 1, seed=1)
    both = identify([first, second], load("double")).check()
    before, after = (
        next(c for c in one.combinations if c.name == advised.name) for one in (fit, both)
    )  # fmt: skip
    left = (after.upper - after.lower) / (before.upper - before.lower)
    assert left <= HALVED
    # the derivatives are those of the first fit, whose parameters are some per cent off
    assert left == pytest.approx(advised.share, rel=0.5)


def test_it_names_what_is_known_worst_of_what_a_motion_halves(little):
    _, fit = little
    advised = next_motion(fit)
    assert advised is not None
    one = next(c for c in fit.combinations if c.name == advised.name)
    assert advised.relative == pytest.approx(1.96 * one.std / abs(one.value))
    # widths, which are taken in proportion to lengths, are known worse, but no motion tells them
    width = fit.parameter("link1.width")
    assert width.std / width.value > one.std / one.value
    assert advised.scaled == ("link1.thickness", "link2.thickness", "joint1.damping", "joint2.damping")


def test_random_accelerations_leave_more(little):
    _, fit = little
    rough = replace(fit, unmodelled=Unmodelled(np.array([0.5, 0.5]), np.zeros((4, 4))))
    known, root = experiment.quantities(fit), experiment.root_of(fit)
    at = known.names.index("link1.J / link2.J")
    exact, lacking = (
        min(one.left[at] for one in experiment._tried(each, known, root, (2.0,))) for each in (fit, rough)
    )
    assert lacking > 1.5 * exact


def test_joints_are_let_go_and_move_within_their_limits(tmp_path):
    (tmp_path / "stopped.xml").write_text(STOPPED)
    mechanism = load(tmp_path / "stopped.xml")
    fit = identify(filmed(mechanism, [-1.4]), mechanism).check()
    advised = next_motion(fit)
    assert advised is not None
    assert advised.release is not None
    # the wider amplitudes hit a stop
    assert abs(advised.release.away[0]) <= np.radians(60.0) + 1e-9
    lower, upper = np.radians([-160.0, -20.0])
    moved = simulate(
        fit.mechanism, np.linspace(0.0, 8.0, 241), advised.release.position, np.zeros(1)
    ).position
    assert np.all((lower - 1e-9 <= moved) & (moved <= upper + 1e-9))


def test_a_slide_on_a_spring_is_let_go_from_as_far_as_was_seen(tmp_path):
    (tmp_path / "spring.xml").write_text(SPRING)
    mechanism = load(tmp_path / "spring.xml").with_choices(free=["slide.stiffness"])
    fit = identify(filmed(mechanism, [0.1]), mechanism).check()
    advised = next_motion(fit)
    assert advised is not None
    assert advised.release is not None
    assert 0.0 < abs(advised.release.position[0]) < 0.102
    assert " mm from where it hangs)" in advised.said


def test_where_there_is_nothing_to_advise_from_there_is_no_advice():
    fit = identified()
    assert next_motion(fit) is not None
    assert next_motion(replace(fit, starts=())) is None
    assert next_motion(fit.doubted([Doubt("refused", "No.")])) is None
    assert next_motion(replace(fit, torque="free")) is None
    assert next_motion(replace(fit, covariance=np.full_like(fit.covariance, np.nan))) is None
    for wrong in ((), (2.0, 0.0)):
        with refuses(
            SettingsError,
            f"next_motion: expected lengths of records above 0 and up to 3600 s, got {list(wrong)}; give "
            "seconds.",
        ):
            next_motion(fit, seconds=wrong)


def test_without_a_motion_that_tells_more_it_says_so(little, monkeypatch):
    _, fit = little
    monkeypatch.setattr(experiment, "releases", lambda fit: [])
    advised = next_motion(fit)
    assert advised is not None
    assert advised.release is None
    assert not advised.halves
    assert advised.share == 1.0
    # then the worst of all is named: what widths leave open
    assert advised.said.startswith("No further motion tells much more. What is known worst is ")


def test_the_advice_in_words(little):
    _, fit = little
    lifted = np.array([np.pi / 2.0, 0.0])
    release = Release(np.array([0.0, -np.pi / 2.0]), lifted, np.array([True, False]))
    motion = experiment._Tried(release, 4.0, np.zeros(0), np.zeros((0, 0)))
    name, masses = "link1.J / link2.J", ("link1.thickness", "link2.thickness")
    said = experiment._said
    assert said(fit, name, 0.13, motion, 0.21, ("", 1.0), masses) == (
        "Film it once more: hold it still at joint1 = 0 deg (90 deg from where it hangs) and "
        "joint2 = -90 deg (hanging by itself), let go, and film 4 s. Of the interval of link1.J / link2.J "
        "(+- 13 % now) about 21 % is left then."
    )
    assert said(fit, name, 0.13, motion, 0.7, ("link1.length", 0.3), masses) == (
        "Film it once more: hold it still at joint1 = 0 deg (90 deg from where it hangs) and "
        "joint2 = -90 deg (hanging by itself), let go, and film 4 s. Of the interval of link1.J / link2.J "
        "(+- 13 % now) about 70 % is left then; no motion that was tried halves it. In its place, "
        "link1.length measured and given with --fix link1.length=VALUE leaves 30 %."
    )
    assert said(fit, name, 0.02, None, 1.0, ("link1.length", 0.3), masses) == (
        "No further motion tells much more. What is known worst is link1.J / link2.J (+- 2 %); link1.length "
        "measured and given with --fix link1.length=VALUE leaves 30 % of its interval. No motion depends on "
        "the scale of link1.thickness and link2.thickness: one of them, measured and given with --fix, "
        "fixes it."
    )
    assert said(fit, name, 0.02, None, 1.0, ("", 1.0), ()) == (
        "No further motion tells much more. What is known worst is link1.J / link2.J (+- 2 %)."
    )
    assert said(fit, name, 3.0, None, 1.0, ("", 1.0), (), lacking=True) == (
        "No further motion tells much more. What is known worst is link1.J / link2.J (not told from zero): "
        "what the model lacks limits it, not what was filmed."
    )


def test_what_is_off_the_axis_is_compared_with_the_distance_from_the_hinge():
    names = ("link1.my * gravity / link2.J", "link1.mx * gravity / link2.J", "joint1.damping / link1.J")
    known = Quantities(names, np.array([0.03, 4.0, -2.0]), np.array([0.3, 0.1, 0.5]), np.zeros((3, 0)))
    np.testing.assert_allclose(experiment._relative(known), [0.3 / np.hypot(0.03, 4.0), 0.025, 0.25])


def test_a_measured_size_leaves_what_fixing_it_leaves(little):
    first, fit = little
    known, root = experiment.quantities(fit), experiment.root_of(fit)
    at = known.names.index("link1.J / link2.J")
    name, left = experiment._measured(fit, known, at, root)
    assert name == "link1.length"
    fixed = load("double").with_choices(fix={name: fit.parameter(name).value})
    after = identify(first, fixed).check()
    now = next(c for c in after.combinations if c.name == "link1.J / link2.J")
    assert now.std / known.std[at] == pytest.approx(left, rel=0.25)


@pytest.mark.slow
def test_a_run_that_was_read_back_says_the_same(little, tmp_path):
    poses, fit = little
    monodyn.report(fit, to=tmp_path / "run", poses=poses)
    here, there = next_motion(fit), next_motion(monodyn.open_run(tmp_path / "run"))
    assert here is not None
    assert there is not None
    assert here.release is not None
    assert there.release is not None
    assert there.name == here.name
    np.testing.assert_array_equal(there.release.position, here.release.position)
    assert there.share == pytest.approx(here.share, rel=0.2)


def test_the_commands_take_both_records():
    assert next_commands("run", clip="my clip.mp4") == (
        "monodyn track 'my clip.mp4' --model run --out second",
        "monodyn identify run/poses.csv second/poses.csv --model run --out both",
    )
    assert next_commands("a run", tables=["first.csv"], second="log.csv") == (
        "monodyn identify first.csv log.csv --model 'a run' --out both",
    )
