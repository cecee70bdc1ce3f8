"""Print how far other programs, given the files of a run folder, are from its tables.

Run: ``python benchmarks/handed_over.py [--only CASE ...] [--json FILE] [--gate]``.
MuJoCo begins at the keyframe of ``model.xml`` and follows ``states.csv`` and ``prediction.csv``, where there
is a drive also by the lines of ``torques.csv``; PyBullet, Drake and pinocchio read ``model.urdf``. A program
that is not installed (``pip install .[test-clients]``) is left out, and the standard error says so.
"""

from __future__ import annotations

import csv
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import accelerations, simulate
from monodyn.types import Poses

CASES = ("swinging", "wild", "driven", "cart")
RATE, FRAMES, FITTED = 30.0, 240, 120
"""Frames a second, of a record and of those the ones that are fitted."""
STARTS = {"swinging": (-0.8, 0.3), "wild": (0.6, -0.4), "driven": (0.6, -0.4), "cart": (0.0, -0.6)}
"""Positions that each case begins with [rad or m]; links hang at -pi / 2."""
NOISE = 5e-4
"""Standard deviation of a position [rad or m]."""
PERIOD = 0.9
"""Of the torque at the joints of ``driven`` [s]."""
STEPS = 160
"""MuJoCo's steps from one frame to the next."""
BULLET_STEP, BULLET_SECONDS = 1.0 / 960.0, 2.7
FOLLOWED, LINEAR, BULLET, AGREED = 1e-4, 0.05, 1.0, 1e-12
"""Targets: MuJoCo, and by the lines of torques.csv [deg]; PyBullet [deg]; accelerations as a share of the
largest."""
STATES = 50
"""States at which accelerations are compared."""
SEED = 20120806


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    options = command_line(__doc__, CASES).parse_args()
    figures = handed_over(options.only or CASES)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def handed_over(cases: Sequence[str] = CASES) -> list[Figure]:
    """Compare what other programs make of the files with the tables beside them.

    Args:
        cases: Which of ``CASES``.

    Returns:
        Figures.
    """
    found = []
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            found += _figures(case, made_run(case, Path(folder) / "run"))
    return found


def made_run(case: str, out: Path) -> Path:
    """Identify a mechanism from the first half of a simulated record and write the run folder.

    Args:
        case: One of ``CASES``.
        out: The folder.

    Returns:
        The folder.
    """
    rng = np.random.default_rng(SEED)
    mechanism = monodyn.load("cartpole" if case == "cart" else "double")
    settings, moving = monodyn.IdentifySettings(), mechanism
    if case == "driven":
        # torques are in proportion to masses, which sizes give
        moving = mechanism.with_torque("fourier", terms=2, period=PERIOD)
        waves = {"joint1.torque.sin1": 0.03, "joint1.torque.cos2": 0.02, "joint2.torque.sin2": 0.006}
        moving = moving.with_values(waves)
        sizes = [n for n in mechanism.values if n.endswith((".width", ".thickness"))]
        # and the period is given: to find it is another benchmark's matter
        mechanism = mechanism.with_torque("fourier", terms=2, period=PERIOD)
        fix = {name: mechanism.values[name] for name in (*sizes, "torque.period")}
        mechanism = mechanism.with_choices(fix=fix)
        settings = monodyn.IdentifySettings(torque="fourier", terms=2)
    time = np.arange(FRAMES) / RATE
    position = simulate(moving, time, np.array(STARTS[case]), np.array([0.2, -0.5])).position
    position = position + rng.normal(scale=NOISE, size=position.shape)
    covariance = np.tile(NOISE**2 * np.eye(2), (FRAMES, 1, 1))
    joints = tuple(joint.name for joint in mechanism.joints)
    poses = Poses(joints, np.arange(FRAMES), time, position, covariance, np.ones(FRAMES, dtype=bool))
    fit = monodyn.identify(poses[:FITTED], mechanism, settings).check()
    future = monodyn.predict(fit, times=time[FITTED:])
    monodyn.report(fit, future, to=out, poses=poses)
    return out


def _figures(case: str, run: Path) -> list[Figure]:
    """Return the figures of one run folder."""
    mechanism = monodyn.load(run / "model.xml")
    found = []
    for name in ("states", "prediction"):
        if case == "driven":
            off = followed(run, name, by=series_of(run))
            found.append(Figure(case, f"MuJoCo from {name}.csv, by the series", off, "deg, mm", FOLLOWED))
            off = followed(run, name, by=lines_of(run))
            found.append(Figure(case, f"MuJoCo from {name}.csv, by torques.csv", off, "deg, mm", LINEAR))
        else:
            found.append(Figure(case, f"MuJoCo from {name}.csv", followed(run, name), "deg, mm", FOLLOWED))
    if case == "driven":
        return found
    if installed("pybullet"):
        states, kinds = columns(run / "states.csv"), [joint.kind for joint in mechanism.joints]
        theirs, stated = (bullet_motion(run, mechanism, states, of_file=own) for own in (False, True))
        listed = np.column_stack([states[joint.name] for joint in mechanism.joints])[: len(theirs)]
        # what a wild motion makes of the first order of its integrator is no matter of the file
        target = None if case == "wild" else BULLET
        hinges = [kind == "hinge" for kind in kinds]
        off = _far(["hinge"], (theirs - listed)[:, hinges])
        found.append(Figure(case, "PyBullet, default flags", off, "deg", target))
        off = _far(kinds, theirs - stated)
        found.append(Figure(case, "PyBullet, from that by the inertia of the file", off, "deg, mm", FOLLOWED))
    if installed("pydrake"):
        off = disagreement(mechanism, drake_accelerations(run, mechanism))
        found.append(Figure(case, "accelerations, Drake", off, "", AGREED))
    if installed("pinocchio"):
        off = disagreement(mechanism, pinocchio_accelerations(run, mechanism))
        found.append(Figure(case, "accelerations, pinocchio", off, "", AGREED))
    return found


def installed(module: str) -> bool:
    """Return whether a program is there; the standard error says where it is not.

    Args:
        module: Its module.
    """
    if find_spec(module) is None:
        say(f"handed_over: {module} SKIPPED, it is not installed; pip install .[test-clients]")
        return False
    return True


def columns(path: Path) -> dict[str, np.ndarray]:
    """Read a table; an empty cell is NaN.

    Args:
        path: The file.

    Returns:
        Its columns by name, each (row,).
    """
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def followed(run: Path, name: str, by: Callable[[float], np.ndarray] | None = None) -> float:
    """Follow a table in MuJoCo from the keyframe of the model.

    Args:
        run: The run folder.
        name: ``states`` or ``prediction``.
        by: Controls by time, where there is a drive.

    Returns:
        Largest distance [deg or mm].
    """
    model = mujoco.MjModel.from_xml_path(str(run / "model.xml"))
    data, listed = mujoco.MjData(model), columns(run / f"{name}.csv")
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    joints = [model.joint(j).name for j in range(model.njnt)]
    kinds = ["hinge" if kind == mujoco.mjtJoint.mjJNT_HINGE else "slide" for kind in model.jnt_type]
    times = listed["time"][listed["time"] > data.time]
    wanted = np.column_stack([listed[joint] for joint in joints])[-len(times) :]

    def control(_: mujoco.MjModel, now: mujoco.MjData) -> None:
        now.ctrl[:] = by(now.time)

    # RK4 asks for the controls at each of its stages, each at its own time
    mujoco.set_mjcb_control(None if by is None else control)
    far = 0.0
    try:
        for time, row in zip(times, wanted, strict=True):
            steps = max(1, round((time - data.time) * RATE * STEPS))
            model.opt.timestep = (time - data.time) / steps
            mujoco.mj_step(model, data, steps)
            far = max(far, _far(kinds, (data.qpos - row)[None]))
    finally:
        mujoco.set_mjcb_control(None)
    return far


def _far(kinds: Sequence[str], error: np.ndarray) -> float:
    """Return the largest of some errors [deg], of slides [mm]; the last axis is that of the joints."""
    factor = np.array([np.degrees(1.0) if kind == "hinge" else 1000.0 for kind in kinds])
    return float(np.max(np.abs(error) * factor))


def series_of(run: Path) -> Callable[[float], np.ndarray]:
    """Return the controls of a drive by the formula that ``model.xml`` states.

    Args:
        run: The run folder.
    """
    numbers = {
        numeric.get("name", ""): np.array(numeric.get("data", "").split(), dtype=float)
        for numeric in ET.parse(run / "model.xml").getroot().iter("numeric")
    }
    period = numbers.pop("torque.period")[0]
    tables = np.array(list(numbers.values()))
    orders = np.arange(1, tables.shape[1] // 2 + 1)

    def controls(time: float) -> np.ndarray:
        waves = 2.0 * np.pi * orders * time / period
        return tables[:, 0] + tables[:, 1::2] @ np.cos(waves) + tables[:, 2::2] @ np.sin(waves)

    return controls


def lines_of(run: Path) -> Callable[[float], np.ndarray]:
    """Return the controls by the rows of ``torques.csv``, linear in between and none where they are empty.

    Args:
        run: The run folder.
    """
    acting = columns(run / "torques.csv")
    joints = [name for name in acting if name not in ("frame", "time") and not name.endswith("_std")]
    torque = np.array([acting[name] for name in joints])
    return lambda now: np.array([np.nan_to_num(np.interp(now, acting["time"], row)) for row in torque])


def bullet_motion(
    run: Path, mechanism: Mechanism, states: dict[str, np.ndarray], *, of_file: bool
) -> np.ndarray:
    """Return the motion by PyBullet from the first row of ``states.csv`` on.

    Args:
        run: The run folder.
        mechanism: The mechanism.
        states: Its columns, each (row,).
        of_file: True takes the inertia from the file; False is PyBullet's default.

    Returns:
        Joint positions at the first rows of the table [rad or m], (frame, dof).
    """
    bullet: Any = import_module("pybullet")
    joints = [joint.name for joint in mechanism.joints]
    client = bullet.connect(bullet.DIRECT)
    try:
        bullet.setGravity(0.0, 0.0, float(mechanism.tree.gravity[1]))
        bullet.setTimeStep(BULLET_STEP)
        flags = bullet.URDF_USE_INERTIA_FROM_FILE if of_file else 0
        body = bullet.loadURDF(str(run / "model.urdf"), useFixedBase=True, flags=flags)
        links = range(bullet.getNumJoints(body))
        number = {bullet.getJointInfo(body, j)[1].decode(): j for j in links}
        for j in (-1, *links):
            bullet.changeDynamics(body, j, linearDamping=0, angularDamping=0)
        for joint in joints:
            bullet.setJointMotorControl2(body, number[joint], bullet.VELOCITY_CONTROL, force=0)
            bullet.resetJointState(body, number[joint], states[joint][0], states[f"{joint}_vel"][0])
        rows = [[bullet.getJointState(body, number[joint])[0] for joint in joints]]
        for _ in range(int(BULLET_SECONDS * RATE)):
            for _ in range(round(1.0 / RATE / BULLET_STEP)):
                bullet.stepSimulation()
            rows.append([bullet.getJointState(body, number[joint])[0] for joint in joints])
    finally:
        bullet.disconnect(client)
    return np.array(rows)


def disagreement(mechanism: Mechanism, theirs: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> float:
    """Compare joint accelerations at random states, as a share of the largest of each state.

    Args:
        mechanism: The mechanism.
        theirs: Accelerations by positions and rates, (dof,) each.

    Returns:
        The largest difference.
    """
    rng, dofs, far = np.random.default_rng(SEED), len(mechanism.joints), 0.0
    for _ in range(STATES):
        q, v = rng.uniform(-3.0, 3.0, dofs), rng.uniform(-5.0, 5.0, dofs)
        ours = accelerations(mechanism.tree, q[None], v[None], np.zeros((1, dofs)))[0]
        far = max(far, float(np.abs(theirs(q, v) - ours).max() / np.abs(ours).max()))
    return far


def drake_accelerations(run: Path, mechanism: Mechanism) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return joint accelerations by Drake, with its contacts between links as they are by default.

    Args:
        run: The run folder.
        mechanism: The mechanism.
    """
    drake: Any = import_module("pydrake.all")
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    drake.Parser(plant).AddModels(str(run / "model.urdf"))
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, float(mechanism.tree.gravity[1])])
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    joints = [plant.GetJointByName(joint.name) for joint in mechanism.joints]
    positions, velocities = ([f(j) for j in joints] for f in (_position_start, _velocity_start))

    def found(q: np.ndarray, v: np.ndarray, _: object = diagram) -> np.ndarray:
        both = np.zeros((2, len(q)))
        both[0, positions], both[1, velocities] = q, v
        plant.SetPositionsAndVelocities(context, both.ravel())
        return plant.EvalTimeDerivatives(context).CopyToVector()[len(q) :][velocities]

    return found


def _position_start(joint: Any) -> int:
    return int(joint.position_start())


def _velocity_start(joint: Any) -> int:
    return int(joint.velocity_start())


def pinocchio_accelerations(
    run: Path, mechanism: Mechanism
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return joint accelerations by pinocchio, the damping among the torques.

    Args:
        run: The run folder.
        mechanism: The mechanism.
    """
    pin: Any = import_module("pinocchio")
    model = pin.buildModelFromUrdf(str(run / "model.urdf"))
    model.gravity.linear = np.array([0.0, 0.0, float(mechanism.tree.gravity[1])])
    data, joints = model.createData(), [model.joints[model.getJointId(j.name)] for j in mechanism.joints]
    rows = [joint.idx_v for joint in joints]

    def found(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        state, rate = pin.neutral(model), np.zeros(model.nv)
        for joint, at in zip(joints, q, strict=True):
            # a hinge without limits is a point of a circle
            values = [np.cos(at), np.sin(at)] if joint.nq == 2 else [at]
            state[joint.idx_q : joint.idx_q + joint.nq] = values
        rate[rows] = v
        return pin.aba(model, data, state, rate, -model.damping * rate)[rows]

    return found


if __name__ == "__main__":
    raise SystemExit(main())
