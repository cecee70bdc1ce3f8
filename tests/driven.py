"""Motion simulated by MuJoCo under friction, periodic and arbitrary torques."""

import mujoco
import numpy as np

from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.torque.task import Task
from monodyn.mechanism import load
from monodyn.results.torques import torques
from swings import white

RATE, NOISE, PERIOD = 30, 1e-3, 2.3
THICKNESS = {"link1.thickness": 0.006, "link2.thickness": 0.006}
MASSIVE = {**THICKNESS, "link1.width": 0.032, "link2.width": 0.028}
"""What makes torques newton metres: with lengths from the motion, the masses."""
SIZES = {"link1.length": 0.23, "link1.width": 0.032, "link2.length": 0.17, "link2.width": 0.028}
GEOM = 'type="box" density="2700" contype="0" conaffinity="0"'
DOUBLE = f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>
<body name="link1"><joint name="joint1" type="hinge" axis="0 -1 0" damping="0.001"/>
<geom {GEOM} size="0.115 0.003 0.016" pos="0.115 0 0"/>
<body name="link2" pos="0.23 -0.006 0"><joint name="joint2" type="hinge" axis="0 -1 0" damping="0.0005"/>
<geom {GEOM} size="0.085 0.003 0.014" pos="0.085 0 0"/></body></body></worldbody></mujoco>"""
CART = f"""<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><worldbody>
<body name="cart"><joint name="slider" type="slide" axis="1 0 0" damping="0.2"/>
<geom {GEOM} size="0.06 0.004 0.03"/>
<body name="pole" pos="0 -0.02 0"><joint name="hinge" type="hinge" axis="0 -1 0" damping="0.0005"/>
<geom {GEOM} size="0.15 0.003 0.012" pos="0.15 0 0"/></body></body></worldbody></mujoco>"""
SERIES = IdentifySettings(torque="fourier")
STIFF = 'solreffriction="0.002 1" solimpfriction="0.999 0.9999 0.001"'
"""MuJoCo's friction gives way a little by default."""


def simulated(model, start, frames, torque=None, seed=0):
    """Return a noisy record of MuJoCo's motion under ``torque(time)``, and the torques (frame, dof)."""
    model = mujoco.MjModel.from_xml_string(model)
    data = mujoco.MjData(model)
    steps = 33
    model.opt.timestep = 1.0 / RATE / steps
    data.qpos[:] = start
    position, applied = [], []
    for step in range(frames * steps):
        if torque is not None:
            data.qfrc_applied[:] = torque(data.time)
        if step % steps == 0:
            position.append(data.qpos.copy())
            applied.append(data.qfrc_applied.copy())
        mujoco.mj_step(model, data)
    count, dofs = frames, model.nv
    names = tuple(model.joint(i).name for i in range(dofs))
    noise = NOISE * np.random.default_rng(seed).normal(size=(count, dofs))
    return white(names, np.arange(count) / RATE, np.array(position) + noise, NOISE), np.array(applied)


def started(model, tmp_path, factor, **fixed):
    """Return the mechanism of a model with sizes that are ``factor`` times as large, some fixed."""
    path = tmp_path / "model.xml"
    path.write_text(model, encoding="utf-8")
    mechanism = load(path)
    sizes = {n: factor * v for n, v in mechanism.values.items() if n.endswith((".length", ".width"))}
    return mechanism.with_values(sizes).with_choices(fix=fixed)


def wave(time):
    return np.array([0.04 * np.sin(2 * np.pi * time / PERIOD), 0.006 * np.cos(2 * np.pi * time / PERIOD)])


def two_waves(time):
    turn = 2 * np.pi * time / PERIOD
    return np.array([0.03 * np.sin(turn) + 0.02 * np.cos(2 * turn), 0.006 * np.sin(3 * turn + 1)])


def pull(time):
    return np.array([0.05 * np.exp(-((time - 3.0) ** 2)), 0.01 * np.tanh(time - 2.0)])


def misses(fit, record, applied):
    """Return the rms error of the torques in shares of the rms torque, (dof,)."""
    error = torques(fit, record.time).torque - applied
    return np.sqrt(np.mean(error**2, axis=0) / np.mean(applied**2, axis=0))


def task_of(records, mechanism):
    """Return what a torque model is given of some records."""
    smoothed = tuple(smooth(ordered(one, mechanism)) for one in records)
    return Task(prepare(records, mechanism), smoothed, IdentifySettings(), None, records=tuple(records))
