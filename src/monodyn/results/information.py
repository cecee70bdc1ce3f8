"""A motion of an identified mechanism in, what a record of it would tell of the parameters out.

The information is that of the innovations of a Kalman filter along the motion: its start state is free, and
where the model lacks something the motion goes astray by random accelerations, so that what lies long ago
tells ever less of what is seen now.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.estimation.fit import Estimate, Fit
from monodyn.estimation.parts import Combination
from monodyn.estimation.verdict.combinations import inertial_ratios, inertial_values
from monodyn.estimation.verdict.unmodelled import Wander
from monodyn.mechanism.simulate import transitions
from monodyn.results.fill import Carried

FREE = 1.0
"""Standard deviation of the start state of a record to come [rad or m]."""
FREE_RATE = 10.0
"""Likewise of its rates [rad/s or m/s]."""
LEAST_NOISE = 1e-6
"""Noise that is counted on at least [rad or m]."""
NONE_KNOWN = 1e-13
"""Directions of relative change whose variance is below this share of the largest are those that the fit has
no variance along: they move no motion, or are held by what was given."""
COMPLEX_STEP = 1e-30


class Quantities(NamedTuple):
    """What a fit has an interval of and the motion depends on: estimated parameters, and combinations.

    Attributes:
        names: Their names.
        values: Their values [SI], (quantity,).
        std: Their standard deviations as the fit states them [SI], (quantity,).
        slopes: Derivatives by the estimated parameters, (quantity, param).
    """

    names: tuple[str, ...]
    values: np.ndarray
    std: np.ndarray
    slopes: np.ndarray


def quantities(fit: Fit) -> Quantities:
    """Collect what has an interval, with its derivatives.

    Args:
        fit: The identified mechanism.

    Returns:
        The quantities; a combination of parameters that the mechanism does not have (a run that was read back
        has masses where the fit had thicknesses) is left out.
    """
    count, rows = len(fit.shared), []
    for at, name in enumerate(fit.shared):
        if _told(one := fit.parameter(name)):
            rows.append((one, np.eye(count)[at]))
    inertial, known = _inertial(fit), set(fit.shared)
    for one in fit.combinations:
        if _told(one):
            slope = inertial[one.name] if one.name in inertial else _power_slope(fit, one, known)
            rows += [] if slope is None else [(one, slope)]
    return Quantities(
        tuple(one.name for one, _ in rows),
        np.array([one.value for one, _ in rows]),
        np.array([one.std for one, _ in rows]),
        np.array([slope for _, slope in rows]).reshape(len(rows), count),
    )


def _told(one: Estimate | Combination) -> bool:
    """Return whether there is an interval that is not known exactly, about a value that is not zero."""
    return 0.0 < one.std < np.inf and one.value != 0.0


def _inertial(fit: Fit) -> dict[str, np.ndarray]:
    """Differentiate the regrouped inertias and their ratios by the estimated parameters, (param,) by name."""
    tree, directions = fit.mechanism.tree, fit.directions()
    slopes: dict[str, list[float]] = {}
    for at in range(len(fit.shared)):
        moved = tree.along(directions, at, COMPLEX_STEP * 1j)
        found = inertial_ratios(fit.mechanism, moved, full=True) | inertial_values(fit.mechanism, moved)
        for name, value in found.items():
            slopes.setdefault(name, []).append(float(np.imag(value)) / COMPLEX_STEP)
    # what is zero at one parameter's step and not at another's has no slope at zero either
    return {name: np.array(slope) for name, slope in slopes.items() if len(slope) == len(fit.shared)}


def _power_slope(fit: Fit, one: Combination, known: set[str]) -> np.ndarray | None:
    """Differentiate a product of powers of estimated parameters; None where there are others in it."""
    slope = np.zeros(len(fit.shared))
    for sign, part in zip((1.0, -1.0), one.name.split(" / "), strict=False):
        for factor in part.split(" * "):
            name, _, power = factor.partition("^")
            if name not in known:
                return None
            above, _, below = power.strip("()").partition("/")
            exponent = sign * float(above or 1.0) / float(below or 1.0)
            slope[fit.shared.index(name)] += exponent * one.value / fit.parameter(name).value
    return slope


def root_of(fit: Fit) -> np.ndarray:
    """Return a root B of the covariance of the estimated parameters: C = B B', (param, direction).

    Directions that the fit has no variance along are left out. A further record is counted on to tell nothing
    of them: it cannot of scales, on which no motion depends.

    Args:
        fit: The identified mechanism.
    """
    values = np.array([fit.parameter(name).value for name in fit.shared])
    deviation = np.sqrt(np.maximum(np.diag(fit.shared_covariance), 0.0))
    # in relative changes, and what may be zero in standard deviations, all have about one size
    unit = np.maximum(np.abs(values), deviation)
    unit = np.where(unit > 0.0, unit, 1.0)
    spread, vectors = np.linalg.eigh(fit.shared_covariance / np.outer(unit, unit))
    kept = spread > NONE_KNOWN * max(spread[-1], 0.0)
    return unit[:, None] * vectors[:, kept] * np.sqrt(spread[kept])


def variances(slopes: np.ndarray, root: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Return the variances g' (C^-1 + F)^-1 g of quantities with a further record, (quantity,).

    With C = B B' that is (B' g)' (1 + B' F B)^-1 (B' g), which needs no inverse of C.

    Args:
        slopes: Derivatives g of the quantities, (quantity, param).
        root: B, (param, direction).
        information: F, (param, param).
    """
    known = slopes @ root
    both = np.eye(root.shape[1]) + root.T @ information @ root
    return np.sum(known * np.linalg.solve(both, known.T).T, axis=1)


def noise_of(fit: Fit) -> np.ndarray:
    """Return the noise that is expected of a record to come, that of the fitted ones [rad or m], (dof,).

    Args:
        fit: The identified mechanism.
    """
    samples = len(fit.rms) * sum(len(stamps) for stamps in fit.time)
    # what was fitted to the noise left the residuals smaller than it is
    left = max(1.0 - len(fit.names) / max(samples, 1), 0.1)
    rms = np.array([fit.rms[joint.name] for joint in fit.mechanism.joints])
    return np.maximum(rms / np.sqrt(left), LEAST_NOISE)


def information_along(fit: Fit, motion: Carried, noise: np.ndarray) -> np.ndarray:
    """Return what a record of a motion tells of the estimated parameters, its start state free.

    Args:
        fit: The identified mechanism.
        motion: The motion, from the start of the record on.
        noise: Standard deviation of a measured position [rad or m], (dof,).

    Returns:
        Fisher information of the record up to each sample, (sample, param, param).

    Source:
        Information of a linear stochastic system by its innovations: Mehra, Optimal input signals for
        parameter estimation in dynamic systems, 1974.
    """
    count, dofs = len(fit.shared), len(noise)
    clock = motion.stamps * fit.mechanism.values["time_scale"]
    steps = transitions(
        fit.mechanism.tree, clock, motion.motion, substeps=motion.substeps, drive=motion.drive
    )
    lacking = np.zeros(dofs) if fit.unmodelled is None else fit.unmodelled.density
    signal = motion.slopes[:, :dofs, :count]
    late = (fit.stamp_error * motion.motion[:, dofs:]) ** 2
    begin = np.repeat([FREE**2, FREE_RATE**2], dofs)
    about = Wander(
        noise**2 + late, steps, np.diff(clock, prepend=clock[0]), np.arange(len(clock)) == 0, begin
    )
    # the state explains the signal of each parameter as far as it can; what it cannot is what the record
    # tells of the parameter
    new, _ = about.innovations(signal, lacking)
    return np.cumsum(np.einsum("fip,fir->fpr", new, new), axis=0)
