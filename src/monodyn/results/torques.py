"""The torques that a fit found to act at the joints in addition to friction, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.estimation.fit import Fit


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques over time.

    Attributes:
        time: Time stamps [s], (frame,).
        torque: Torque [N m] at a hinge, force [N] at a slide, (frame, dof).
        std: Standard deviation from that of the fit, the mass scale as it was assumed; infinite where the
            fit has none, (frame, dof).
    """

    time: np.ndarray
    torque: np.ndarray
    std: np.ndarray


def torques(fit: Fit, times: np.ndarray, *, record: int = 0) -> Torques:
    """Return the torque of the fitted drive; friction and springs are not part of it.

    Args:
        fit: A fit with ``torque`` ``fourier``, ``free`` or ``known``.
        times: Time stamps [s], (frame,).
        record: Which record, for known torques.

    Returns:
        The torques at ``times``; zero without a drive, and outside of the knots of free torques.
    """
    mechanism = fit.mechanism
    clock = times * mechanism.values["time_scale"]
    drive, _ = fit.driven(times, record)
    found, slopes = drive.derivatives(mechanism.directions(fit.shared), clock)
    variance = np.einsum("fip,pr,fir->fi", slopes, fit.shared_covariance, slopes, optimize=True)
    variance = np.where(np.isnan(variance), np.inf, variance)
    return Torques(times, found, np.sqrt(np.maximum(variance, 0.0)))
