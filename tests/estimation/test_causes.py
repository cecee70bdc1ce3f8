"""What a model lacks is named: records that MuJoCo moved with something in addition."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.accelerations import smooth_motion
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.starts import matched
from monodyn.estimation.shooting.swinging import swing_of
from monodyn.estimation.torque import laws
from monodyn.estimation.verdict import causes
from monodyn.estimation.verdict.further import Further, further_link
from monodyn.mechanism import load
from monodyn.stages import identify
from support import slow
from swings import TIMES, motion, record, white

NOISE = 1e-3
POLE = """<mujoco><option gravity="0 0 -9.81" timestep="0.0005"/><worldbody>
<body><joint name="joint1" type="hinge" axis="0 -1 0" damping="0.0005"/>
<geom type="box" density="2700" size="0.15 0.003 0.012" pos="0.15 0 0"/></body></worldbody></mujoco>"""
QUICK = IdentifySettings(torque="friction", starts=2)


def swung(push, frames=120, text=POLE):
    """Return a noisy record of a pole; ``push`` changes MuJoCo's model and data before each step."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0] = -0.2
    rows = []
    for step in range(40 * frames):
        if step % 40 == 0:
            rows.append(data.qpos[:1].copy())
        push(model, data)
        mujoco.mj_step(model, data)
    noise = NOISE * np.random.default_rng(0).normal(size=(frames, 1))
    return white(("joint1",), np.arange(frames) / 50.0, np.array(rows) + noise, NOISE)


def drag(model, data):
    data.qfrc_applied[0] = -0.004 * abs(data.qvel[0]) * data.qvel[0]


def tilt(model, data):
    model.opt.gravity[:] = 9.81 * np.array([np.sin(0.2), 0.0, -np.cos(0.2)])


def base(model, data):
    model.opt.gravity[0] = 0.03 * 8.0**2 * np.sin(8.0 * data.time)


def test_a_right_model_has_no_cause():
    fit = identify(swung(lambda model, data: None), load("single"), QUICK)
    assert fit.grade == "trusted"
    assert not any("times as close" in said or "usual causes" in said for said in fit.advice)


@pytest.mark.parametrize(
    ("push", "begins"),
    [
        (drag, "With quadratic drag at its joints the motion comes "),
        slow(tilt, "With gravity 11 deg from straight down where the angles are measured the motion comes "),
        slow(base, "On a base that swings to the right and back, over 60 mm at 1.3 Hz, the motion comes "),
    ],
)
def test_what_is_lacking_is_named(push, begins):
    fit = identify(swung(push), load("single"), QUICK)
    assert fit.grade != "trusted"
    assert fit.advice[0].startswith(begins)


def test_a_hinge_about_the_vertical_lacks_weight(tmp_path):
    file = tmp_path / "flat.xml"
    file.write_text(POLE.replace('axis="0 -1 0"', 'axis="0 0 1"'))
    fit = identify(swung(lambda model, data: None), load(file), QUICK)
    assert fit.grade == "refused"
    said = next(line for line in fit.advice if line.startswith("With weight"))
    times = float(said.split("comes ")[1].split()[0])
    assert times > 10.0
    assert said == (
        f"With weight, gravity of 9.81 m/s^2 in the plane of motion, the motion comes {times:g} times as "
        "close to the record."
    )


@pytest.mark.parametrize("stiffness", [0.0, 0.05])
def test_the_swing_that_accelerations_call_for(stiffness):
    def moved(model, data):
        base(model, data)
        data.qfrc_applied[0] = -stiffness * (data.qpos[0] + 1.0)

    record = swung(moved)
    spring = {"joint1.stiffness": stiffness, "joint1.rest": -1.0}
    mechanism = load("single").with_values(spring).with_torque("friction")
    mechanism = mechanism.with_choices(free=["joint1.stiffness"] if stiffness else [])
    problem = posed(mechanism, prepare((record,), mechanism))
    motion = smooth_motion(problem, (smooth(ordered(record, mechanism)),))
    swing = swing_of(problem, matched(problem, motion), motion)
    assert swing is not None
    # the frequencies that are tried are a tenth of a turn over the record apart
    assert swing.rate == pytest.approx(8.0, abs=0.1 * 2.0 * np.pi / 2.3)
    np.testing.assert_allclose(swing.at(record.time), 0.03 * np.sin(8.0 * record.time), atol=6e-3)


def test_no_swing_pushes_a_body_that_is_balanced(tmp_path):
    """A base of no swing is no cause: its place would have no variance."""
    path = tmp_path / "balanced.xml"
    path.write_text(POLE.replace('pos="0.15 0 0"', 'pos="0 0 0"'), encoding="utf-8")
    mechanism = load(path).with_torque("friction")
    moved = swung(lambda model, data: None)
    problem = posed(mechanism, prepare((moved,), mechanism))
    motion = smooth_motion(problem, (smooth(ordered(moved, mechanism)),))
    assert swing_of(problem, matched(problem, motion), motion) is None
    assert identify(moved, mechanism, IdentifySettings(bodies="uniform")).grade == "refused"


HUNG = POLE.replace(
    "</body></worldbody>",
    """<body pos="0.29 0 0"><joint name="joint2" type="hinge" axis="0 -1 0" damping="0.0003"/>
<geom type="box" density="2700" size="0.1 0.003 0.012" pos="0.1 0 0"/></body></body></worldbody>""",
)
"""A shorter pole hangs near the end of the pole."""


@pytest.mark.slow
def test_a_link_more_is_named():
    fit = identify(swung(lambda model, data: None, text=HUNG), load("single"), QUICK)
    assert fit.grade == "refused"
    said = fit.advice[0]
    found = re.match(
        r"With a link more at the end of link1, about (\d+) mm long and (\S+) times as heavy as link1, the "
        r"motion comes (\d+) times as close to the record, to within its noise: more hangs there",
        said,
    )
    assert found, said
    length, heavier, times = map(float, found.groups())
    assert length == pytest.approx(200.0, rel=0.1)
    assert heavier == pytest.approx(2.0 / 3.0, rel=0.2)
    assert times > 20.0


@pytest.mark.slow
def test_a_link_more_is_not_what_drags():
    """A hidden link comes nearer to much; only what it brings to within the noise is one."""
    record = swung(drag)
    further = further_link((record,), load("single"), QUICK)
    assert further is not None
    assert further.left == np.inf


@pytest.mark.slow
def test_sizes_that_are_not_quite_right_are_no_link_more():
    """Over a second a hidden link meets a motion missed by a hundredth; but it moves nothing that little."""
    double, ends = load("double"), ("link1.tail", "link1.tip", "link2.tail")
    true = double.with_values(dict.fromkeys(ends, 0.001))
    moved = record(true, TIMES, motion(true, TIMES, [0.9, -0.6], [0.0, 0.0]), noise=3e-4)
    widths = ("link1.width", "link2.width")
    given = double.with_choices(fix={name: double.values[name] for name in (*ends, *widths)})
    fit = identify(moved, given, replace(QUICK, bodies="uniform"))
    assert fit.grade == "approximate"
    assert not any("link more" in said for said in fit.advice)


def test_a_link_more_hangs_from_one_record_alone():
    record = swung(drag)
    assert further_link((record, record), load("single"), QUICK) is None


@pytest.mark.slow
def test_nothing_usual(monkeypatch):
    """A cause has to halve what is left over."""
    record = swung(drag)
    fit = identify(record, load("single"), replace(QUICK, starts=1))
    monkeypatch.setattr(causes, "HALVED", 1e9)
    assert causes.lacking((record,), load("single"), QUICK, fit) == (
        "None of the usual causes halves what is left over (quadratic drag, tilted gravity, a base that "
        "swings and a link more at the end of link1): look whether something else moves along with the "
        "mechanism or acts on it, and whether the file is that of this mechanism.",
        False,
    )


def test_sentences():
    assert Further("link2", 180, 0.8, 0.2653, 1.0821).said(312.4) == (
        "With a link more at the end of link2, about 265 mm long and 1.1 times as heavy as link2, the motion "
        "comes 310 times as close to the record, to within its noise: more hangs there than the file has. "
        "Take a mechanism with a body and a joint more."
    )
    # neither the problem nor its optimum is looked at
    nothing: Any = None
    assert causes.dragged(laws.QUADRATIC, ["joint1.drag", "joint2.drag"], nothing, nothing, 6.13) == (
        "With quadratic drag at its joints the motion comes 6.1 times as close to the record: --free "
        "joint1.drag joint2.drag estimates it."
    )
    assert causes.tilted(-0.1745, 12.2) == (
        "With gravity 10 deg from straight down where the angles are measured the motion comes 12 times as "
        "close to the record: a camera is out of level by that much, or the zero of an encoder is; --free "
        "camera.roll estimates it, --fix camera.roll=VALUE [rad] gives it."
    )
    assert causes.swung(0.04, 9.0, 43.0) == (
        "On a base that swings to the right and back, over 40 mm at 1.4 Hz, the motion comes 43 times as "
        "close to the record: what holds the mechanism moves. Fasten it, or give the file a body on a slide "
        "with a spring for it."
    )
