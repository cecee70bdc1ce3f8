"""A mechanism on a base that swings, against MuJoCo seen from the base."""

import mujoco
import numpy as np

from monodyn.mechanism import load, write_mjcf
from monodyn.mechanism.mounted import mounted
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
