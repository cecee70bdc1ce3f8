"""Records of mechanisms moved by MuJoCo, right ones and ones to which something was done."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import monodyn

RATE, SECONDS, NOISE = 60.0, 3.0, 1e-3
"""Of a record that is as it should be [Hz], [s], [rad or m]."""
AHEAD = 1.0
"""How long the motion is known after the record [s]."""
STEP = 2e-4
"""Integration step [s]."""

Forces = Callable[[Any, Any], None]
"""Sets forces of MuJoCo's model and data before a step."""


@dataclass(frozen=True)
class Record:
    """A table, the model that is to explain it, and what is known.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        joints: Their names.
        model: The bundled model that it is identified with.
        lengths: True lengths by name [m].
        fix: Parameters that are given.
        free: Parameters that are freed.
        ahead: How it went on: time stamps [s], (frame,), and positions without noise, (frame, dof); None
            where the damage leaves no such thing.
    """

    time: np.ndarray
    position: np.ndarray
    joints: tuple[str, ...]
    model: str
    lengths: dict[str, float]
    fix: dict[str, float] = field(default_factory=dict)
    free: tuple[str, ...] = ()
    ahead: tuple[np.ndarray, np.ndarray] | None = None

    def text(self) -> str:
        """Return the table as comma-separated values."""
        rows = np.column_stack([self.time, self.position])
        lines = [",".join(("time", *self.joints))]
        return "\n".join([*lines, *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"


def drawn(
    rng: np.random.Generator,
    kind: str = "double",
    *,
    model: str = "",
    forces: Forces | None = None,
    gravity: float = 0.0,
    noise: float = NOISE,
    rate: float = RATE,
    seconds: float = SECONDS,
    base: tuple[float, float] = (0.0, 0.0),
    friction: float = 0.0,
) -> Record:
    """Draw a mechanism of a kind, let it go, and measure it.

    Args:
        rng: Where sizes, start and noise come from.
        kind: Bundled mechanism that is drawn.
        model: Bundled model for the identification; empty is the same.
        forces: What else acts.
        gravity: Tilt of gravity [rad].
        noise: Of the positions [rad or m].
        rate: Of the table [Hz].
        seconds: Its length [s].
        base: Amplitude [m] and rate [rad/s] of a base that swings to the right and back.
        friction: Dry friction of every hinge, as a share of what holds the mechanism level.

    Returns:
        The record.
    """
    mechanism = monodyn.load(kind)
    changes = {
        p.name: p.value * float(np.exp(rng.uniform(-0.5, 0.5)))
        for p in mechanism.parameters
        if p.free and p.kind in ("length", "width", "thickness", "damping")
    }
    mechanism = mechanism.with_values(changes)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawn.xml"
        monodyn.write_mjcf(mechanism, path)
        body = mujoco.MjModel.from_xml_path(str(path))
    body.opt.timestep, body.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    down = float(np.linalg.norm(body.opt.gravity))
    body.opt.gravity[:] = down * np.array([np.sin(gravity), 0.0, -np.cos(gravity)])
    body.dof_frictionloss[:] = friction * down * float(body.body_mass.sum()) * 0.1
    data = mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-1.2, 1.2, body.nq)
    count, every = round(rate * seconds), round(1.0 / (rate * STEP))
    position = np.zeros((count + round(rate * AHEAD), body.nq))
    for row in range(len(position)):
        position[row] = data.qpos
        for _ in range(every):
            data.qfrc_applied[:] = 0.0
            # seen from a base that is accelerated, everything is pushed back
            push = base[0] * base[1] ** 2 * np.sin(base[1] * data.time)
            body.opt.gravity[0] = down * np.sin(gravity) + push
            if forces is not None:
                forces(body, data)
            mujoco.mj_step(body, data)
    time, measured = every * STEP * np.arange(len(position)), position[:count]
    measured = measured + rng.normal(scale=noise, size=measured.shape)
    joints = tuple(mujoco.mj_id2name(body, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(body.njnt))
    lengths = {p.name: p.value for p in mechanism.parameters if p.kind == "length" and p.free}
    ahead = time[count:], position[count:]
    return Record(time[:count], measured, joints, model or kind, lengths, ahead=ahead)


def _drag(body: Any, data: Any) -> None:
    # as large as the damping at 2 rad/s
    data.qfrc_applied[:] = -0.5 * body.dof_damping * np.abs(data.qvel) * data.qvel


def _pull(body: Any, data: Any) -> None:
    data.qfrc_applied[0] = 0.05 * np.sin(7.0 * data.time)


def _spring(body: Any, data: Any) -> None:
    # slack where the mechanism hangs; a seventh of what its weight does there
    data.qfrc_applied[0] = -0.05 * (data.qpos[0] + 0.5 * np.pi)


def _magnet(body: Any, data: Any) -> None:
    data.qfrc_applied[0] = 0.03 * np.sin(2.0 * (data.qpos[0] + 1.2))


def _with(change: Callable[[Record, np.random.Generator], Record]) -> Callable[[np.random.Generator], Record]:
    """Return a damage that changes a right record."""
    return lambda rng: replace(change(drawn(rng), rng), ahead=None)


def _spoilt(record: Record, rows: np.ndarray, values: np.ndarray | float) -> Record:
    """Return a record with other positions of the second joint in some rows."""
    position = record.position.copy()
    position[rows, 1] = values
    return replace(record, position=position)


def _outliers(record: Record, rng: np.random.Generator) -> Record:
    rows = rng.random(len(record.time)) < 0.05
    return _spoilt(record, rows, rng.uniform(-3.0, 3.0, int(rows.sum())))


def _gap(record: Record, rng: np.random.Generator) -> Record:
    keep = (record.time < 1.0) | (record.time > 2.0)
    return replace(record, time=record.time[keep], position=record.position[keep])


def _first_as(record: Record, model: str, joints: tuple[str, ...]) -> Record:
    """Return the record of the first joints alone, for a model that has no more."""
    return replace(record, position=record.position[:, : len(joints)], joints=joints, model=model, ahead=None)


DAMAGES: dict[str, Callable[[np.random.Generator], Record]] = {
    "degrees": _with(lambda r, _: replace(r, position=np.degrees(r.position))),
    "milliseconds": _with(lambda r, _: replace(r, time=1e3 * r.time)),
    "degrees and milliseconds": _with(
        lambda r, _: replace(r, time=1e3 * r.time, position=np.degrees(r.position))
    ),
    "one sample of 1e20": _with(lambda r, _: _spoilt(r, np.array([50]), 1e20)),
    "one sample of 100": _with(lambda r, _: _spoilt(r, np.array([50]), 100.0)),
    "outliers": _with(_outliers),
    "straight lines": _with(
        lambda r, _: replace(r, position=np.outer(r.time, [1.0, -0.5]) + np.array([-1.0, 0.3]))
    ),
    "at rest": _with(lambda r, rng: replace(r, position=rng.normal(scale=NOISE, size=r.position.shape))),
    "noise alone": _with(lambda r, rng: replace(r, position=rng.normal(size=r.position.shape))),
    "nine rows": _with(lambda r, _: replace(r, time=r.time[:9], position=r.position[:9])),
    "a gap of a second": _with(_gap),
    "one joint swapped for the other": _with(lambda r, _: replace(r, position=r.position[:, ::-1])),
    "a joint the other way round": _with(
        lambda r, _: replace(r, position=r.position * np.array([1.0, -1.0]))
    ),
    "a joint 20 deg off": _with(lambda r, _: replace(r, position=r.position + np.array([0.0, 0.35]))),
    "a joint of half the angle": _with(lambda r, _: replace(r, position=r.position * np.array([1.0, 0.5]))),
    "absolute angles": _with(lambda r, _: replace(r, position=np.cumsum(r.position, axis=1))),
    "backwards": _with(lambda r, _: replace(r, position=r.position[::-1])),
    "in steps of 0.1 rad": _with(lambda r, _: replace(r, position=np.round(r.position, 1))),
    "stops at half the angle": _with(
        lambda r, _: replace(r, position=np.clip(r.position, -0.5 * np.ptp(r.position), None))
    ),
    "every other row later": _with(
        lambda r, _: replace(r, time=r.time + 4e-3 * (np.arange(len(r.time)) % 2))
    ),
    "a clock slow by 20 %": _with(lambda r, _: replace(r, time=1.2 * r.time, fix={**r.lengths})),
    "drifting zero": _with(lambda r, _: replace(r, position=r.position + np.outer(r.time, [0.0, 0.1]))),
    "gravity tilted by 10 deg": lambda rng: replace(
        drawn(rng, gravity=np.radians(10.0)), fix={"camera.roll": 0.0}
    ),
    "quadratic drag": lambda rng: drawn(rng, forces=_drag),
    "a hidden force": lambda rng: drawn(rng, forces=_pull),
    "dry friction": lambda rng: drawn(rng, friction=0.02),
    "a base that swings": lambda rng: drawn(rng, base=(0.02, 9.0)),
    "triple as double": lambda rng: _first_as(drawn(rng, "triple"), "double", ("joint1", "joint2")),
    "double as single": lambda rng: _first_as(drawn(rng, "double"), "single", ("joint1",)),
    "a spring at the first joint": lambda rng: drawn(rng, forces=_spring),
    "a spring at the hinge": lambda rng: drawn(rng, "single", forces=_spring),
    "a magnet at the hinge": lambda rng: drawn(rng, "single", forces=_magnet),
    "three frames a second": lambda rng: drawn(rng, rate=3.0, seconds=20.0),
}
"""What may be wrong with a record, by what it is."""
