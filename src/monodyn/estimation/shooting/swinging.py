"""The swing of a base that the accelerations call for: its rate, and how far it goes.

Seen from a base that is accelerated, everything is pushed back: gravity has a horizontal part that changes
with time. Along smooth motion the accelerations are linear in it, so that for every rate of the base its
swing is one linear least squares, in which the other unknowns may move as well.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.shooting.accelerations import SmoothMotion, mismatch_rows
from monodyn.estimation.shooting.problem import Problem
from monodyn.mechanism.simulate import accelerations
from monodyn.mechanism.tree import STIFFNESS

SAMPLES = 4.0
"""Stamps in the shortest period that is tried."""
STEP = 0.1
"""Spacing of the frequencies that are tried, in turns over the record."""


class Swing(NamedTuple):
    """A base that swings to the right and back.

    Attributes:
        rate: Rate of its oscillation [rad/s].
        cosine: Amplitude of its place as a cosine of the time stamps [m].
        sine: The same of the sine [m].
        left: What it leaves of the accelerations, a sum of weighed squares.
    """

    rate: float
    cosine: float
    sine: float
    left: float

    def at(self, time: np.ndarray) -> np.ndarray:
        """Return where the base is [m], (frame,).

        Args:
            time: Time stamps [s], (frame,).
        """
        return self.cosine * np.cos(self.rate * time) + self.sine * np.sin(self.rate * time)


def swing_of(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> Swing | None:
    """Find the swing of the base that explains most of the accelerations.

    Args:
        problem: The problem.
        x: Coordinates at which its accelerations are nearest, (param,).
        motion: Smooth motion.

    Returns:
        The swing; None where the mechanism does not hang on a single hinge, does not feel gravity, has no
        finite accelerations, where the record is too short, or where no swing explains any of them.

    Source:
        Golub and Pereyra, The differentiation of pseudo-inverses and nonlinear least squares problems whose
        variables separate, 1973.
    """
    push = _pushed(problem, x, motion)
    span = float(np.ptp(motion.time)) if len(motion.time) > 1 else 0.0
    if push is None or span == 0.0:
        return None
    rows, jacobian = mismatch_rows(problem, x, motion)
    # far from any mechanism accelerations may be beyond all numbers
    if not (np.isfinite(rows).all() and np.isfinite(jacobian).all() and np.isfinite(push).all()):
        return None
    # what the other unknowns can explain is taken out of both rows and columns (variable projection)
    q, _ = np.linalg.qr(jacobian)
    rest, best = rows - q @ (q.T @ rows), None
    pace = usual_step(np.unique(motion.time))
    for turns in np.arange(1.0, span / (SAMPLES * pace), STEP):
        rate = 2.0 * np.pi * turns / span
        waves = np.stack([np.cos(rate * motion.time), np.sin(rate * motion.time)], axis=-1)
        columns = np.zeros((len(rows), 2))
        columns[: motion.weight.size] = ((push * motion.weight)[:, :, None] * waves[:, None]).reshape(-1, 2)
        columns -= q @ (q.T @ columns)
        size, *_ = np.linalg.lstsq(columns, -rest, rcond=1e-9)
        left = rest + columns @ size
        if best is None or left @ left < best.left:
            # a push to the left is an acceleration to the right, which is against the place
            cosine, sine = -size / rate**2
            best = Swing(rate, float(cosine), float(sine), float(left @ left))
    return best if best is not None and best.left < rest @ rest else None


def _pushed(problem: Problem, x: np.ndarray, motion: SmoothMotion) -> np.ndarray | None:
    """Return what a push of 1 m/s^2 to the left on everything adds to the accelerations, (frame, dof)."""
    instance = problem.at(x)
    gravity = float(np.hypot(*instance.tree.gravity))
    if not motion.by_roll.any() or gravity == 0.0:
        return None
    still, quarter = np.zeros_like(motion.position), 0.5 * np.pi
    position = motion.position + motion.by_roll * instance.roll
    # positions turned counter-clockwise have gravity act to the left; without rates and springs it acts alone
    links = instance.tree.links.copy()
    links[:, STIFFNESS] = 0.0
    sides = [
        accelerations(replace(instance.tree, links=links), position + motion.by_roll * turn, still, still)
        for turn in (quarter, -quarter)
    ]
    return (sides[0] - sides[1]) * instance.stretch**2 / (2.0 * gravity)
