"""A controller and a model file in, their motion together in MuJoCo out: the check that shares no kernel."""

from __future__ import annotations

import importlib
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from monodyn.arrays import Frozen, freeze
from monodyn.errors import SettingsError
from monodyn.mechanism import Mechanism, write_mjcf
from monodyn.mechanism.unlogged import unlogged
from monodyn.results.linear import State, by_name
from monodyn.results.regulator import off

AT_END = 1.0
"""Last part of a motion, in which it has to be where it is to be [s]."""
LOST = 1e3
"""Rates beyond which a motion is given up [rad/s or m/s]."""
LONGEST, STRONGEST = 1e5, 1e6
"""Longest time [s] and largest factor that are simulated."""
ANGLE, LENGTH = 0.1, 0.1
"""How far off a balanced joint may be [rad, m]."""


class Controller(Protocol):
    """What gives torques to motors."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        ...

    @property
    def actuated(self) -> tuple[str, ...]:
        """Joints with a motor."""
        ...

    @property
    def position(self) -> np.ndarray:
        """Where the joints are to be in the end [rad or m], (dof,)."""
        ...

    @property
    def rate(self) -> float:
        """Measurements, and torques, a second [Hz]; in between the torques stay."""
        ...

    @property
    def turns(self) -> np.ndarray:
        """True for a hinge whose whole turns do not count, bool (dof,)."""
        ...

    def torque_at(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques of the motors [N m or N], (motor,).

        Args:
            time: Time since the controller began [s].
            q: Joint positions [rad or m], (dof,).
            v: Joint rates [rad/s or m/s], (dof,).
        """
        ...


@dataclass(frozen=True, eq=False)
class ClosedLoop(Frozen):
    """The motion of a mechanism under a controller.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
        torque: Torques of the motors from each time stamp on [N m or N], (frame, motor).
        off: Largest distance of each joint from where it is to be, in the last second [rad or m], (dof,).
        balanced: True where each stays within 0.1 rad or 0.1 m of there.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    off: np.ndarray
    balanced: bool

    def __post_init__(self) -> None:
        frames = len(self.time)
        freeze(self, (frames,), "time")
        freeze(self, (frames, None), "position", "velocity", "torque")


def closed_loop(
    model: Mechanism | str | Path,
    controller: Controller,
    position: State,
    velocity: State | None = None,
    *,
    seconds: float = 10.0,
    factor: float = 1.0,
) -> ClosedLoop:
    """Simulate a mechanism under a controller with MuJoCo.

    Args:
        model: An MJCF file (MuJoCo's own reading of it), or a mechanism, which is written as one first.
        controller: Gives the torques; a `Regulator` or a `SwingUp`.
        position: Joint positions at the beginning [rad or m], by name, zero for those left out, or (dof,).
        velocity: Joint rates there [rad/s or m/s], likewise; None is rest.
        seconds: How long [s].
        factor: What each torque is multiplied by: how many times as much the model moves as was identified,
            where that is known.

    Returns:
        The motion; it ends early where it runs away.

    Raises:
        SettingsError: The model has not the controller's joints, MuJoCo cannot read it, the time or the
            factor is not above 0 or too large; from deeper down: a joint of the start is not there.
    """
    for name, value, most in (("seconds", seconds, LONGEST), ("factor", factor, STRONGEST)):
        if not 0.0 < value <= most:
            raise SettingsError(
                f"closed_loop: expected {name} above 0 and up to {most:g}, got {value:g}; change it."
            )
    mujoco: Any = importlib.import_module("mujoco")
    with unlogged(mujoco):
        body = _body(mujoco, model)
    known = [body.joint(i).name for i in range(body.njnt)]
    if set(known) != set(controller.joints):
        raise SettingsError(
            f"closed_loop: expected a model with the joints {', '.join(controller.joints)}, got one with "
            f"{', '.join(known)}."
        )
    rows = np.array([body.joint(name).qposadr[0] for name in controller.joints])
    dofs = np.array([body.joint(name).dofadr[0] for name in controller.joints])
    driven = np.array([body.joint(name).dofadr[0] for name in controller.actuated])
    rate = controller.rate
    # a whole number of steps between two torques, none longer than the model's own
    steps = max(1, int(np.ceil(1.0 / (rate * body.opt.timestep) - 1e-9)))
    body.opt.timestep = 1.0 / (rate * steps)
    data = mujoco.MjData(body)
    data.qpos[rows] = by_name(controller.joints, "closed_loop: position", position)
    data.qvel[dofs] = by_name(
        controller.joints, "closed_loop: velocity", {} if velocity is None else velocity
    )
    time, states, torques = [], [], []
    with unlogged(mujoco) as said:
        for i in range(round(seconds * rate) + 1):
            q, v = data.qpos[rows], data.qvel[dofs]
            torque = controller.torque_at(i / rate, q, v)
            time.append(i / rate)
            states.append(np.concatenate((q, v)))
            torques.append(torque)
            if not np.all(np.abs(v) < LOST):
                break
            data.qfrc_applied[driven] = factor * torque
            mujoco.mj_step(body, data, steps)
            # where numbers become too large MuJoCo begins anew, from its own start
            if said:
                break
    q, v = np.split(np.array(states), 2, axis=1)
    last = np.array(time) >= seconds - AT_END
    far = np.array([np.abs(off(row, controller.position, controller.turns)) for row in q[last]])
    away = far.max(axis=0) if len(far) and not said else np.full(len(rows), np.inf)
    hinge = np.array([body.joint(name).type[0] == mujoco.mjtJoint.mjJNT_HINGE for name in controller.joints])
    balanced = bool(np.all(away < np.where(hinge, ANGLE, LENGTH)))
    return ClosedLoop(np.array(time), q, v, factor * np.array(torques), away, balanced)


def _body(mujoco: Any, model: Mechanism | str | Path) -> Any:
    """Return MuJoCo's model."""
    if isinstance(model, Mechanism):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.xml"
            write_mjcf(model, path)
            return mujoco.MjModel.from_xml_path(str(path))
    try:
        return mujoco.MjModel.from_xml_path(str(model))
    except ValueError as error:
        why = " ".join(str(error).split())
        raise SettingsError(
            f"closed_loop: expected a file that MuJoCo reads, got '{model}' ({why}); give another."
        ) from None
