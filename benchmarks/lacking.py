"""Print how often intervals hold where the model lacks something: records with forces or readings it has not.

Run: ``python benchmarks/lacking.py [--only KIND ...] [--records N] [--json FILE] [--gate]``.
MuJoCo moves double pendulums on which something more acts than the model has, or whose angles are misread.
The residuals are several times the noise; what can be identified all the same is to lie within its intervals.
In ``fits`` stands how many fits were to be used, in ``residual`` the median of residual over noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from intervals import drawn_pendulum, inertias, valued
from monodyn.estimation.fit import Fit
from monodyn.types import Poses

RATE, FRAMES, NOISE = 60.0, 160, 3e-4
"""Rows a second [Hz], their number, and their noise [rad]."""
SUBSTEPS = 20
"""Integration steps from row to row."""
LEAST = 90.0
"""Share of intervals that are to hold [%]."""
HELD = {"joint1.friction": 0.0, "joint2.friction": 0.0}
"""What the model is told not to have."""
APPARENT = ("damping", "friction", ".my", ".inertia", ".com_")
"""What has no true value where other forces act, or belongs to other coordinates, by part of its name."""

Push = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Acceleration of each joint by position and rate, times the joint's own inertia [N m]."""
Reading = Callable[[np.ndarray], np.ndarray]
"""What is read of positions, (row, dof)."""


@dataclass(frozen=True)
class Swing:
    """A record of a mechanism that has more than the model.

    Attributes:
        poses: What is measured.
        known: True values by name [SI].
    """

    poses: Poses
    known: dict[str, float]


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, tuple(KINDS))
    parser.add_argument("--records", type=int, default=12, metavar="N", help="records of each kind")
    options = parser.parse_args()
    figures: list[Figure] = []
    every: list[bool] = []
    for kind in options.only or KINDS:
        held, residuals, fits = [], [], 0
        for seed in range(options.records):
            swing = swung(kind, np.random.default_rng([seed, list(KINDS).index(kind)]))
            settings = monodyn.IdentifySettings(torque="friction", bodies="free")
            fit = monodyn.identify(swing.poses, monodyn.load("double").with_choices(fix=HELD), settings)
            residuals.append(max(fit.rms.values()) / NOISE)
            fits += fit.ok
            if fit.ok:
                held += intervals(fit, swing)
        every += held
        share = 100.0 * float(np.mean(held)) if held else float("nan")
        say(f"{kind}: {share:.1f} % of {len(held)}")
        figures += [
            Figure(kind, "fits", fits, f"of {options.records}"),
            Figure(kind, "residual", float(np.median(residuals)), "times the noise"),
            Figure(kind, "intervals that hold", share, "%"),
        ]
    share = 100.0 * float(np.mean(every)) if every else float("nan")
    figures.append(Figure("all", f"intervals that hold ({len(every)})", share, "%", LEAST, least=True))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def intervals(fit: Fit, swing: Swing) -> list[bool]:
    """Return of each combination that has a true value whether its interval contains it.

    Args:
        fit: The fit.
        swing: Its record.
    """
    return [
        bool(c.lower <= valued(c.name, swing.known) <= c.upper)
        for c in fit.combinations
        if c.std > 0.0 and not any(part in c.name for part in APPARENT)
    ]


def swung(kind: str, rng: np.random.Generator) -> Swing:
    """Return what is measured of a drawn double pendulum that has more than the model.

    Args:
        kind: What the model lacks.
        rng: Where all is drawn from.
    """
    known, text = drawn_pendulum(rng)
    body = mujoco.MjModel.from_xml_string(text)
    body.opt.timestep = 1.0 / (RATE * SUBSTEPS)
    known |= inertias(body)
    push, read = KINDS[kind](rng)
    own, data = np.array([known["link1.J"], known["link2.J"]]), mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-1.2, 1.2, 2)
    position = np.zeros((FRAMES, 2))
    for row in range(FRAMES):
        position[row] = data.qpos
        for _ in range(SUBSTEPS):
            data.qfrc_applied[:] = own * push(data.qpos, data.qvel)
            mujoco.mj_step(body, data)
    measured = read(position) + rng.normal(scale=NOISE, size=position.shape)
    covariance, frame = np.tile(NOISE**2 * np.eye(2), (FRAMES, 1, 1)), np.arange(FRAMES)
    seen = np.ones(FRAMES, dtype=bool)
    return Swing(Poses(("joint1", "joint2"), frame, frame / RATE, measured, covariance, seen), known)


def dry(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return dry friction at both joints.

    Args:
        rng: Where it is drawn from.
    """
    size = 0.25 * _sizes(rng)
    return lambda q, v: -size * np.tanh(v / 0.05), _as_it_is


def drag(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return quadratic drag at both joints.

    Args:
        rng: Where it is drawn from.
    """
    size = 0.06 * _sizes(rng)
    return lambda q, v: -size * np.abs(v) * v, _as_it_is


def cogging(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return a pull towards three places of a turn, as a motor's magnets have it.

    Args:
        rng: Where it is drawn from.
    """
    size, phase = 0.6 * _sizes(rng), rng.uniform(0.0, 2.0 * np.pi, 2)
    return lambda q, v: size * np.sin(3.0 * q + phase), _as_it_is


def cable(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return a cable at each joint that pulls it to one side.

    Args:
        rng: Where it is drawn from.
    """
    size, rest = 0.8 * _sizes(rng), rng.uniform(0.0, 0.6, 2)
    return lambda q, v: -size * (q - rest), _as_it_is


def stretched(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return angles of a picture whose pixels are up to 5 % wider or less wide than high.

    Args:
        rng: Where it is drawn from.
    """
    stretch = rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.05)

    def read(position: np.ndarray) -> np.ndarray:
        turned = np.cumsum(position, axis=1)
        off = stretch * np.sin(turned) * np.cos(turned)
        return np.diff(turned + np.arctan2(off, 1.0 + stretch * np.cos(turned) ** 2), axis=1, prepend=0.0)

    return _nothing, read


def eccentric(rng: np.random.Generator) -> tuple[Push, Reading]:
    """Return angles of scales that do not turn about their middle.

    Args:
        rng: Where it is drawn from.
    """
    size, phase = rng.uniform(0.002, 0.02, 2), rng.uniform(0.0, 2.0 * np.pi, 2)
    return _nothing, lambda position: position + size * np.sin(position + phase)


KINDS = {one.__name__: one for one in (dry, drag, cogging, cable, stretched, eccentric)}
"""What the model may lack, by name."""


def _sizes(rng: np.random.Generator) -> np.ndarray:
    return np.exp(rng.uniform(-0.7, 0.7, 2))


def _nothing(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.zeros(2)


def _as_it_is(position: np.ndarray) -> np.ndarray:
    return position


if __name__ == "__main__":
    raise SystemExit(main())
