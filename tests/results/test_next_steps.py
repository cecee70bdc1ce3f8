"""Commands that go on from a run: each is one that the program takes."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import monodyn
from controllable import identified as swung
from fits import identified, record
from monodyn.cli.parse import parsed
from monodyn.estimation.fit import Doubt
from monodyn.estimation.parts import Start
from monodyn.results import next_steps as next_steps_module
from monodyn.results.filmed import filmed_of
from monodyn.results.findings import Findings
from monodyn.results.log import RunLog
from monodyn.results.next_steps import next_steps
from monodyn.results.sight import Sight
from monodyn.results.trace import trace_of
from monodyn.settings import RunSettings
from support import command
from swings import motion
from swings import record as measured

STANDING = """
<mujoco model="standing">
  <option gravity="0 0 -9.81"/>
  <default><geom density="2700"/></default>
  <worldbody>
    <body name="cart">
      <joint name="slider" type="slide" axis="1 0 0" damping="0.01"/>
      <geom type="box" size="0.06 0.01 0.03" mass="0.3"/>
      <body name="pole" pos="0 -0.02 0">
        <joint name="hinge" type="hinge" axis="0 1 0" damping="0.001" {limits}/>
        <geom type="box" size="0.015 0.003 0.1075" pos="0 0 0.0925"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""A cart-pole as gymnasium has it: its pole stands upright at zero, and clockwise counts."""


def test_every_command_is_understood():
    """Each one as it stands, of a pendulum and of a mechanism with a slide."""
    fit = identified()
    _, cart = swung("cartpole")
    commands = [step.command for one in (fit, cart) for step in next_steps(Findings(one))]
    words = [shlex.split(line) for line in commands]
    ours = [(word[1], word[2:]) for word in words if word[0] == "monodyn"]
    names = [name for name, _ in ours]
    assert names.count("predict") == 2
    assert names.count("identify") == 4
    assert names.count("control") == 1
    said = [step.what for step in next_steps(Findings(fit)) if step.what.startswith("Film it once more")]
    assert len(said) == 1
    for name, rest in ours:
        parsed(name, rest)
    assert sum(word[0] == "python" for word in words) == 2


def test_the_prediction_that_is_named_runs(tmp_path, monkeypatch):
    fit = identified()
    monodyn.report(fit, to=tmp_path / "run", poses=record(fit))
    monkeypatch.chdir(tmp_path / "run")
    line = next(step.command for step in next_steps(Findings(fit)) if "predict" in step.command)
    assert command(*shlex.split(line)[1:], "--quiet").code == 0
    assert (tmp_path / "run" / "ahead" / "prediction.csv").is_file()


def test_tables_are_found_from_the_folder_of_the_run(tmp_path, monkeypatch):
    """The command that takes both records is for another folder than that in which the table was named."""
    poses = record(identified(), 20)
    monodyn.write_poses(poses, tmp_path / "swing.csv")
    monkeypatch.chdir(tmp_path)
    log = RunLog("identify", {"model": "single", "poses 1": "swing.csv"}, RunSettings())
    steps = next_steps(Findings(identified(), log=log))
    line = next(step.command for step in steps if "again.csv" in step.command)
    assert shlex.split(line)[2] == str(tmp_path / "swing.csv")


def test_a_refused_fit_is_looked_at_and_measured_again(tmp_path, monkeypatch):
    """No command of it takes the model that is not to be relied on."""
    fit = identified().doubted([Doubt("refused", "It is another mechanism.")])
    monkeypatch.chdir(tmp_path)
    for given, named in (
        ("single", "single"), ("auto", "auto"), ("a b.xml", shlex.quote(str(tmp_path / "a b.xml")))
    ):  # fmt: skip
        if given.endswith("xml"):
            monodyn.write_mjcf(monodyn.load("single"), given)
        log = RunLog("identify", {"model": given, "poses 1": "swing.csv"}, RunSettings())
        look, again, driven = next_steps(Findings(fit, [trace_of(fit, record(fit))], log=log))
        assert look.what.startswith("Look at the residuals in the plots of this page")
        assert look.command == ""
        assert again.command == f"monodyn identify again.csv --model {named} --out again"
        parsed("identify", shlex.split(again.command)[2:])
        assert driven.what.startswith("Where a motor drives it")
        parsed("identify", shlex.split(driven.command)[2:])
    known = replace(fit, torque="known")
    assert len(next_steps(Findings(known, [trace_of(known, record(fit))], log=log))) == 2


def test_a_refused_clip_is_looked_at_and_filmed_again(filmed):
    scene, poses = filmed
    fit = replace(identified(), starts=()).doubted([Doubt("refused", "It is another mechanism.")])
    for sight, picture in ((None, "overlay.mp4"), (Sight(scene.video), "diagnosis.png")):
        shown = replace(filmed_of(fit, scene, poses), sight=sight)
        look, again, driven = next_steps(Findings(fit, filmed=shown))
        assert look.what.startswith(f"Look at {picture}: the outline has to lie on the mechanism")
        assert again.command == "monodyn run again.mp4 --model MODEL --out again"
        parsed("run", shlex.split(again.command)[2:])
        assert driven.what.startswith("Where a motor drives it")
        parsed("run", shlex.split(driven.command)[2:])


def standing(tmp_path, limits=""):
    """Identify a cart-pole whose file has the pole upright at zero, from a swing about where it hangs."""
    (tmp_path / "standing.xml").write_text(STANDING.format(limits=limits))
    mechanism = monodyn.load(tmp_path / "standing.xml")
    times = np.arange(60) / 30.0
    poses = measured(mechanism, times, motion(mechanism, times, (0.1, 2.4), (0.0, 0.0), steps=32))
    return monodyn.identify(poses, mechanism).check()


def balances(fit):
    """Return the commands that balance it."""
    return [step for step in next_steps(Findings(fit)) if " control " in step.command]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "said"), [("bundled", "joint1 is 1.5708"), ("standing", "hinge is 0")], ids=str
)
def test_what_is_balanced_stands_upright(tmp_path, monkeypatch, kind, said):
    """Wherever the file has its zero: in MuJoCo the pole's centre of mass is straight above the cart."""
    fit = swung("cartpole")[1] if kind == "bundled" else standing(tmp_path)
    monodyn.report(fit, to=tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    (step,) = balances(fit)
    assert f"({said} where it stands upright)" in step.what
    assert command(*shlex.split(step.command)[1:], "--no-film", "--quiet").code == 0
    document = json.loads((tmp_path / "run" / "control" / "control.json").read_text())
    assert document["closed_loop"]["balanced"]
    body = mujoco.MjModel.from_xml_path("control/model.xml")
    data = mujoco.MjData(body)
    for name, at in document["operating_point"]["position"].items():
        data.joint(name).qpos[0] = at
    mujoco.mj_forward(body, data)
    away = data.xipos[-1] - data.xpos[-1]
    assert away[2] > 0.05
    # as far as the centre of mass of the identified pole lies across it
    assert abs(away[0]) < 1e-4


@pytest.mark.slow
def test_what_a_stop_keeps_from_upright_is_not_balanced(tmp_path):
    assert balances(standing(tmp_path, 'limited="true" range="60 300"')) == []


SLIDE, LINK = (
    '<joint name="{}" type="slide" axis="{}"/><geom type="box" size="0.05 0.01 0.03"/>',
    '<body pos="0 0.02 0"><joint name="turn" axis="0 1 0"/>'
    '<geom type="box" size="0.01 0.01 0.1" pos="0 0 0.1"/></body>',
)


@pytest.mark.parametrize(
    ("gravity", "joints", "hung", "upright"),
    [
        ("0 0 -9.81", SLIDE.format("x", "1 0 0") + LINK, 3.0, 0.0),
        # no weight, a motor that pushes along the pole, two slides, no slide
        ("0 0 0", SLIDE.format("x", "1 0 0") + LINK, 3.0, None),
        ("0 0 -9.81", SLIDE.format("x", "0 0 1") + LINK, 3.0, None),
        ("0 0 -9.81", SLIDE.format("x", "1 0 0") + f"<body>{SLIDE.format('z', '0 0 1')}</body>", 0.0, None),
        ("0 0 -9.81", LINK + '<geom type="box" size="0.05 0.01 0.03"/>', 3.0, None),
    ],
)
def test_only_a_pole_that_a_cart_moves_is_balanced(tmp_path, gravity, joints, hung, upright):
    text = f'<mujoco><option gravity="{gravity}"/><worldbody><body>{joints}</body></worldbody></mujoco>'
    (tmp_path / "made.xml").write_text(text)
    mechanism = monodyn.load(tmp_path / "made.xml")
    position = np.array([0.0, hung])[-len(mechanism.joints) :]
    start = Start(0.0, position, 0.0 * position, np.zeros((2 * len(position),) * 2))
    steps = next_steps_module._balanced(replace(identified(), mechanism=mechanism, starts=(start,)))
    assert [step.command for step in steps] == (
        [] if upright is None else [f"monodyn control . --at turn={upright:g} --actuated x --out control"]
    )
