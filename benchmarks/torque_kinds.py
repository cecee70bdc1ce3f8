"""Print how often the kind of torque behind a motion is found, and the period of a periodic one.

Run: ``python benchmarks/torque_kinds.py [--only kinds|periods] [--count N] [--first SEED] [--json FILE]
[--gate]``. MuJoCo makes the records of mechanisms whose sizes, masses and friction are drawn; each starts
from the bundled file, whose sizes are others. A torque of share A is as strong as A times what holds a joint
level. Times are those of the processor.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import Mechanism
from monodyn.types import Poses

STEPS = 40
"""Integration steps of MuJoCo between two rows at the usual rate."""
NOISE = 1e-3
"""Of the positions [rad or m]."""
RATE = 60.0
"""Rows a second [Hz]."""
MODELS = ("single", "double", "cartpole")
"""Bundled mechanisms that are drawn from."""
SPREAD = {"length": 0.4, "width": 0.3, "thickness": 0.4, "mass": 0.7}
"""Half width of the drawn sizes, in logarithms."""
REST = 2e-3
"""Rate about which dry friction changes its sign [rad/s or m/s]; MuJoCo's own creeps, and is none."""
KINDS = ("none", "viscous", "dry", "drag", "periodic", "free")
"""What may act at the joints."""
WITHIN = 0.01
"""Largest relative error of a period that counts as found."""


@dataclass(frozen=True)
class Drawn:
    """A record of a drawn mechanism.

    Attributes:
        poses: The record.
        model: The bundled mechanism that the fit begins with.
        sizes: True sizes that a table does not show and a user would measure, by name [m].
        lengths: True lengths and thicknesses by name [m].
        about: What was drawn, in words.
        period: The period of the torque [s]; 0 for none.
        truth: The mechanism that moved, with its viscous friction and without the torque.
        state: Its positions and rates at the first row, (2 dof,).
    """

    poses: Poses
    model: str
    sizes: dict[str, float]
    lengths: dict[str, float]
    about: str
    period: float
    truth: Mechanism
    state: np.ndarray


Torque = Callable[[float], np.ndarray]
"""Torque at every joint [N m or N], (dof,), by time [s]."""


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    groups: dict[str, Callable[[Any], list[Figure]]] = {"periods": periods, "kinds": kinds}
    parser = command_line(__doc__, tuple(groups))
    parser.add_argument("--count", type=int, default=0, help="records of each (40 periods, 50 of a kind)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="first seed (0)")
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=KINDS, help="of these kinds alone")
    options = parser.parse_args()
    figures: list[Figure] = []
    for group in options.only or groups:
        figures += groups[group](options)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def periods(options: Any) -> list[Figure]:
    """Return how often the period of a random series is found, and how often it is refused.

    Args:
        options: The command line.
    """
    count, found, wrong, took = options.count or 40, 0, 0, []
    for seed in range(options.first, options.first + count):
        drawn = drawn_period(seed)
        began = time.process_time()
        fit = _identified(drawn, IdentifySettings(torque="fourier"), drawn.sizes)
        took.append(time.process_time() - began)
        value = fit.mechanism.values["torque.period"] if fit.starts else np.nan
        right = bool(abs(value / drawn.period - 1.0) < WITHIN)
        found, wrong = found + right, wrong + (fit.ok and not right)
        terms = (fit.mechanism.drive.table.shape[1] - 1) // 2
        said = f"period {value:.4g} s, {terms} harmonics, {fit.grade}, {took[-1]:.1f} s"
        say(f"{'' if right else 'MISSED '}{seed}: {drawn.about}: {said}{'' if fit.ok else ': ' + fit.status}")
    return [
        Figure("periods", "within 1 %", 100.0 * found / count, "%", 95.0, least=True),
        Figure("periods", "wrong and not refused", float(wrong), "", 0.0),
        Figure("periods", "time, median", float(np.median(took)), "s"),
    ]


def kinds(options: Any) -> list[Figure]:
    """Return how often the kind of torque is found, by kind.

    Args:
        options: The command line.
    """
    count, figures = options.count or 50, []
    for kind in options.kind:
        right, took = 0, []
        for seed in range(options.first, options.first + count):
            drawn = drawn_kind(kind, seed)
            began = time.process_time()
            given = drawn.lengths if kind == "free" else {}
            fit = _identified(drawn, IdentifySettings(torque="auto"), {**drawn.sizes, **given})
            took.append(time.process_time() - began)
            found = kind_of(fit)
            right += found == kind
            mark = "" if found == kind else "MISSED "
            said = f"{found}, {fit.grade}, {took[-1]:.1f} s"
            say(f"{mark}{kind} {seed}: {drawn.about}: {said}{'' if found == kind else ': ' + fit.status}")
        figures.append(Figure(kind, "found", 100.0 * right / count, "%", 94.0, least=True))
        figures.append(Figure(kind, "time, median", float(np.median(took)), "s"))
    return figures


def kind_of(fit: monodyn.Fit) -> str:
    """Return the kind of torque that a fit names.

    Args:
        fit: The fit.
    """
    words = {
        "periodic torque": "periodic",
        "free torque": "free",
        "air drag": "air",
        "quadratic drag": "drag",
        "dry friction": "dry",
        "viscous friction": "viscous",
    }
    return next((kind for word, kind in words.items() if word in fit.acting), "none")


def _identified(drawn: Drawn, settings: IdentifySettings, given: dict[str, float]) -> monodyn.Fit:
    mechanism = monodyn.load(drawn.model)
    kept = {name: value for name, value in given.items() if name in mechanism.values}
    return monodyn.identify(drawn.poses, mechanism.with_choices(fix=kept), settings)


def drawn_period(seed: int) -> Drawn:
    """Return a record under a random series: 1 to 7 harmonics, 1.5 to 8 periods.

    Args:
        seed: Where everything comes from.
    """
    rng = np.random.default_rng([seed, 1])
    model = MODELS[int(rng.integers(len(MODELS)))]
    terms, cycles = int(rng.integers(1, 8)), float(rng.uniform(1.5, 8.0))
    seconds, share = float(rng.uniform(3.0, 6.0)), float(np.exp(rng.uniform(np.log(0.05), np.log(0.5))))
    period = seconds / cycles
    about = f"{model}, {cycles:.1f} periods of {period:.3g} s, {terms} harmonics, {share:.2g} of the weight"

    def series(level: np.ndarray) -> Torque:
        size = rng.uniform(0.3, 1.0, (terms, len(level)))
        size *= share * level * np.sqrt(2.0) / np.sqrt(np.sum(size**2, axis=0))
        phase = rng.uniform(0.0, 2.0 * np.pi, size.shape)
        order = 2.0 * np.pi * np.arange(1, terms + 1) / period
        return lambda now: np.sum(size * np.sin(order[:, None] * now + phase), axis=0)

    return recorded(model, rng, seconds, series, about, ("damping",), period)


def drawn_kind(kind: str, seed: int) -> Drawn:
    """Return a record of a kind of torque.

    Args:
        kind: One of ``KINDS``.
        seed: Where everything comes from.
    """
    rng = np.random.default_rng([seed, 2, KINDS.index(kind)])
    model = MODELS[int(rng.integers(len(MODELS)))]
    seconds = float(rng.uniform(3.0, 6.0))
    if kind == "periodic":
        return drawn_period(1000 + seed)
    brakes = {"none": (), "viscous": ("damping",), "dry": ("damping", "friction"), "drag": ("drag",)}
    if kind != "free":
        return recorded(model, rng, seconds, None, model, brakes[kind])
    share = float(rng.uniform(0.1, 0.5))

    def pushes(level: np.ndarray) -> Torque:
        # some pushes of their own time, length and direction
        middle, width = rng.uniform(0.0, seconds, 5), rng.uniform(0.15, 0.5, 5)
        size = share * level * rng.choice([-1.0, 1.0], (5, 1)) * rng.uniform(0.5, 1.0, (5, len(level)))
        return lambda now: np.exp(-(((now - middle) / width) ** 2)) @ size

    return recorded(model, rng, seconds, pushes, f"{model}, pushes of {share:.2g}", ("damping",))


def recorded(
    model: str,
    rng: np.random.Generator,
    seconds: float,
    torque: Callable[[np.ndarray], Torque] | None,
    about: str,
    brakes: tuple[str, ...],
    period: float = 0.0,
    *,
    rate: float = RATE,
) -> Drawn:
    """Return the record of a drawn mechanism.

    Args:
        model: The bundled mechanism that is drawn from.
        rng: Where sizes, frictions, start and noise come from.
        seconds: Length of the record [s].
        torque: Gets what holds each joint level [N m or N], (dof,), and returns the torque over time; None
            for none.
        about: What was drawn, in words.
        brakes: Kinds of friction that act.
        period: The period of the torque [s]; 0 for none.
        rate: Rows a second [Hz].
    """
    mechanism = _drawn_mechanism(model, rng)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "moved.xml"
        monodyn.write_mjcf(mechanism, path)
        body = mujoco.MjModel.from_xml_path(str(path))
    every, steps = 1.0 / rate, round(STEPS * RATE / rate)
    body.opt.timestep, body.opt.integrator = every / steps, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(body)
    level = _level(body, data)
    inertia = level / 9.81 * 0.2
    # friction that takes a motion of a turn a second down within a few seconds
    pace = rng.uniform(0.05, 0.4, body.nv)
    body.dof_damping[:] = pace * inertia * 2.0 if "damping" in brakes else 0.0
    dry = level * rng.uniform(0.01, 0.04, body.nv) if "friction" in brakes else np.zeros(body.nv)
    drag = inertia * rng.uniform(0.1, 0.4, body.nv) if "drag" in brakes else np.zeros(body.nv)
    push = None if torque is None else torque(level)
    hinge = body.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    mujoco.mj_resetData(body, data)
    data.qpos[:] = np.where(hinge, rng.uniform(0.5, 1.5, body.nv) * rng.choice([-1, 1], body.nv), 0.0)
    data.qpos[:] += body.qpos0
    if hinge[0]:
        # the file's zero is level; hanging down is a quarter turn below it
        data.qpos[0] -= 0.5 * np.pi
    elif body.nv > 1:
        data.qpos[1] -= 0.5 * np.pi
    state, count = np.concatenate((data.qpos, data.qvel)), round(seconds * rate)
    position = np.zeros((count, body.nv))
    for row in range(count):
        position[row] = data.qpos
        for _ in range(steps):
            now = 0.0 if push is None else push(data.time + 0.5 * body.opt.timestep)
            data.qfrc_applied[:] = (
                now - drag * np.abs(data.qvel) * data.qvel - dry * np.tanh(data.qvel / REST)
            )
            mujoco.mj_step(body, data)
    position += rng.normal(scale=NOISE, size=position.shape)
    names = tuple(body.joint(j).name for j in range(body.njnt))
    covariance = np.repeat((NOISE**2 * np.eye(body.nv))[None], count, axis=0)
    poses = Poses(
        names, np.arange(count), np.arange(count) * every, position, covariance, np.ones(count, dtype=bool)
    )
    shown = {p.name: p.value for p in mechanism.parameters if p.free and p.kind in ("width", "tail", "tip")}
    lengths = {
        p.name: p.value for p in mechanism.parameters if p.free and p.kind in ("length", "thickness", "mass")
    }
    damping = {f"{name}.damping": float(value) for name, value in zip(names, body.dof_damping, strict=True)}
    return Drawn(poses, model, shown, lengths, about, period, mechanism.with_values(damping), state)


def _drawn_mechanism(model: str, rng: np.random.Generator) -> Mechanism:
    mechanism = monodyn.load(model)
    changes = {
        p.name: p.value * float(np.exp(rng.uniform(-SPREAD[p.kind], SPREAD[p.kind])))
        for p in mechanism.parameters
        if p.free and p.kind in SPREAD
    }
    return mechanism.with_values(changes)


def _level(body: Any, data: Any) -> np.ndarray:
    """Return what holds each hinge level [N m], and the weight of a cart [N], (dof,)."""
    mujoco.mj_resetData(body, data)
    mujoco.mj_forward(body, data)
    hinge = body.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    return np.where(hinge, np.abs(data.qfrc_bias), 9.81 * float(body.body_mass.sum()))


if __name__ == "__main__":
    sys.exit(main())
