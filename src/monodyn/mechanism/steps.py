"""Time stamps between which a motion is integrated, and how finely.

A rollout takes the same number of steps between any two stamps, so that these have to be about as far apart
everywhere: a gap in a record is cut into usual steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.arrays import usual_step
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.substeps import least_substeps

ERROR_BOUND = 1e-6
"""Largest integration error that is aimed at [rad or m]."""
ALONE = 0.05
"""Step of what goes on from a single time stamp [s]."""
MOST_SUBSTEPS = 64
"""Integration steps between two stamps at most."""


class Steps(NamedTuple):
    """Where a motion away from a start is integrated.

    Attributes:
        stamps: Time stamps [s], (sample,), the start's the first, in steps that are fine enough.
        rows: Which of them were asked for, int (frame,).
        clock: The same in true time [s], (sample,).
        drive: What acts in addition to friction and springs.
        substeps: Integration steps between two stamps.
    """

    stamps: np.ndarray
    rows: np.ndarray
    clock: np.ndarray
    drive: Drive
    substeps: int


def steps_away(
    mechanism: Mechanism,
    state: tuple[np.ndarray, np.ndarray],
    stamps: np.ndarray,
    rows: np.ndarray,
    driven: tuple[Drive, int],
    error_bound: float = ERROR_BOUND,
) -> Steps:
    """Find how finely a motion has to be integrated.

    Args:
        mechanism: The mechanism.
        state: Joint positions and rates at the first stamp [SI], (dof,) each.
        stamps: Time stamps of about equal steps [s], (sample,), as of ``fine_stamps``.
        rows: Which of them were asked for, int (frame,).
        driven: What acts, and the least number of integration steps between two stamps.
        error_bound: Largest integration error that is aimed at [rad or m].

    Returns:
        The steps.
    """
    from monodyn.mechanism.simulate import rollout

    drive, least = driven
    # a clip k times slower than life has time_scale 1/k: dynamics and drive run on the stretched clock
    clock = stamps * mechanism.values["time_scale"]

    def positions(substeps: int) -> np.ndarray:
        return rollout(mechanism.tree, clock, *state, substeps=substeps, drive=drive)[0]

    substeps, _ = least_substeps(positions, error_bound, MOST_SUBSTEPS, least)
    return Steps(stamps, rows, clock, drive, substeps)


def spacing(stamps: np.ndarray) -> float:
    """Return the usual time between two frames of a record [s].

    Args:
        stamps: Its time stamps [s], (frame,).
    """
    return usual_step(stamps) if len(stamps) > 1 else ALONE


def fine_stamps(first: float, times: np.ndarray, usual: float) -> tuple[np.ndarray, np.ndarray]:
    """Put the start before ``times`` and stamps into gaps over twice the usual step.

    Args:
        first: Time stamp of the start [s].
        times: Time stamps [s], (frame,), rising or falling away from it.
        usual: The usual step [s].

    Returns:
        All stamps, and which of them are ``times``, int (frame,).
    """
    # substeps are chosen for the usual step; a gap (frames that did not decode) is cut into such steps
    stamps = times if times[0] == first else np.concatenate(([first], times))
    parts = np.maximum(np.ceil(np.abs(np.diff(stamps)) / (2.0 * usual) - 1e-9), 1.0).astype(int)
    at = np.concatenate(([0], np.cumsum(parts)))
    filled = np.interp(np.arange(at[-1] + 1), at, stamps)
    return filled, at[len(stamps) - len(times) :]
