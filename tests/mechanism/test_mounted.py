"""A mechanism on a base that swings, against MuJoCo seen from the base; with a link more, against MuJoCo."""

import mujoco
import numpy as np

from monodyn.mechanism import load, write_mjcf
from monodyn.mechanism.mounted import hung, mounted
from monodyn.mechanism.simulate import rollout

REACH, RATE = 0.03, 8.0
"""Amplitude [m] and rate [rad/s] of the base."""


def test_a_base_swings_as_it_does_for_mujoco(tmp_path):
    mechanism = load("double")
    write_mjcf(mechanism, tmp_path / "model.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    model.opt.timestep = 2e-4
    data = mujoco.MjData(model)
    data.qpos[:] = [-1.0, 0.4]
    expected = []
    for step in range(5001):
        if step % 250 == 0:
            expected.append(data.qpos.copy())
        # the base is at reach sin(rate t): seen from it everything is pushed the other way
        model.opt.gravity[0] = REACH * RATE**2 * np.sin(RATE * data.time)
        mujoco.mj_step(model, data)
    moved, joint = mounted(mechanism, RATE)
    assert joint == "base"
    times = np.arange(21) * 0.05
    start = np.array([0.0, -1.0, 0.4]), np.array([REACH * RATE, 0.0, 0.0])
    found, _ = rollout(moved.tree, times, *start, substeps=40)
    # pushed back by bodies of a ten thousandth of its mass, whose centre moves by some 0.2 m
    np.testing.assert_allclose(found[:, 0], REACH * np.sin(RATE * times), atol=5e-5)
    # the mass of the base is finite, and MuJoCo's gravity is held during a step
    np.testing.assert_allclose(found[:, 1:], expected, atol=2e-3)


def test_a_base_leaves_the_choices_of_the_mechanism():
    mechanism = load("single").with_choices(fix={"link1.length": 0.31}, bounds={"link1.width": (0.01, 0.05)})
    moved, _ = mounted(mechanism, 5.0)
    freed = {p.name for p in moved.parameters if p.free}
    assert freed == {p.name for p in mechanism.parameters if p.free} | {"base.stiffness"}
    assert moved.values["link1.length"] == 0.31
    assert (moved.parameter("link1.width").lower, moved.parameter("link1.width").upper) == (0.01, 0.05)
    again, joint = mounted(moved, 5.0)
    assert (joint, again.bodies) == ("base_", ("base_", "base", "link1"))


TWO = """<mujoco><option gravity="0 0 -9.81" timestep="0.0002" integrator="RK4"/><worldbody>
<body><joint type="hinge" axis="0 -1 0" damping="0.002"/>
<geom type="box" density="2700" size="0.15 0.003 0.012" pos="0.12 0 0"/>
<body pos="0.27 0 0"><joint type="hinge" axis="0 -1 0" damping="0.001"/>
<geom type="box" density="2700" size="0.15 0.003 0.012" pos="0.12 0 0"/></body></body></worldbody></mujoco>"""
ONE = TWO.replace(TWO[TWO.index('<body pos="0.27') : TWO.index("</body></worldbody>")], "")
"""A pole, and one of the same kind with another like it where it ends, 0.27 m from its hinge."""


def test_a_link_more_hangs_where_the_last_one_ends(tmp_path):
    (tmp_path / "one.xml").write_text(ONE.replace("<body>", '<body name="pole">'))
    grown = hung(load(tmp_path / "one.xml"))
    assert grown is not None
    mechanism, joint = grown
    assert (joint, mechanism.bodies) == ("further", ("pole", "further"))
    model = mujoco.MjModel.from_xml_string(TWO)
    data = mujoco.MjData(model)
    data.qpos[:] = [-0.4, 0.9]
    expected = []
    for step in range(2001):
        if step % 250 == 0:
            expected.append(data.qpos.copy())
        mujoco.mj_step(model, data)
    start = np.array([-0.4, 0.9]), np.zeros(2)
    found, _ = rollout(mechanism.tree, np.arange(9) * 0.05, *start, substeps=40)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_link_more_is_like_the_last_one_as_it_is():
    mechanism = load("double").with_choices(fix={"link1.length": 0.31})
    grown = hung(mechanism.with_values({"link2.length": 0.5, "link2.thickness": 0.01}))
    assert grown is not None
    values = grown[0].values
    assert (values["further.length"], values["further.thickness"]) == (0.5, 0.01)
    assert not grown[0].parameter("link1.length").free
    assert {p.name for p in grown[0].parameters if p.free} >= {"further.length", "further.damping"}
    again = hung(grown[0])
    assert again is not None
    assert again[1] == "further_"
