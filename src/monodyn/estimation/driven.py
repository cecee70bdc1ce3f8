"""The torque of a drive as a linear function of its table: what each unknown adds to it, at any times."""

from __future__ import annotations

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.drive import Drive
from monodyn.mechanism.drive import basis as basis_at


def torque_slopes(
    drive: Drive, ways: tuple[np.ndarray, np.ndarray, np.ndarray], times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate the torque by the unknowns.

    Args:
        drive: The torque over time.
        ways: Which unknown each entry of the table is, -1 for none, (dof, column); derivatives in shares of
            the torque and of t times its rate, each (param,).
        times: True times [s], (row,).

    Returns:
        The torque [N m or N], (row, dof), and its derivatives, (row, dof, param).
    """
    way, grow, drift = ways
    shapes, rates = basis(drive, times)
    torque, rate = shapes @ drive.table.T, rates @ drive.table.T
    slopes = torque[:, :, None] * grow + (times[:, None] * rate)[:, :, None] * drift
    for i, c in zip(*np.nonzero(way >= 0), strict=True):
        slopes[:, i, way[i, c]] += shapes[:, c]
    return torque, slopes


def basis(drive: Drive, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what a one in each column of the table adds to the torque, and its time derivative.

    Args:
        drive: The torque over time.
        times: True times [s], (row,).

    Returns:
        Values and rates [1/s], each (row, column).
    """
    values, rates = np.zeros((2, len(times), drive.table.shape[1]))
    middle = float(np.mean(drive.times)) if len(drive.times) else 0.0
    for row, time in enumerate(times):
        basis_at(drive.mode, drive.times, time, middle, values[row], rates[row])
    return values, rates


def drifts(mechanism: Mechanism, names: tuple[str, ...]) -> np.ndarray:
    """Return what parameters do to the clock of the torque: a longer period slows it down.

    Args:
        mechanism: The mechanism.
        names: Parameters, not their coordinates.

    Returns:
        Derivatives of the logarithm of the clock by the parameters, (param,).
    """
    drift = np.zeros(len(names))
    if "torque.period" in names:
        drift[names.index("torque.period")] = -1.0 / mechanism.values["torque.period"]
    return drift
