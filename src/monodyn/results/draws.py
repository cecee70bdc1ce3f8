"""A fit in, mechanisms that may be the true one out: drawn so that each moves as the data allow.

Where sizes and masses are known in combination only, a step along their covariance leaves the curve on which
the motion stays. What is drawn here is therefore what the motion depends on: the accelerations in many
states, which the covariance determines well; of the mechanisms with those the nearest is taken.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.choices import MOST_DRAWN, check_whole
from monodyn.estimation.fit import Fit
from monodyn.estimation.masses import various_states
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import acceleration_derivatives
from monodyn.mechanism.tree import Directions

ROUNDS = 12
"""Gauss-Newton steps to a draw at most; three are usual."""
MET = 1e-4
"""A draw is found where its accelerations are met to that share of the usual ones."""
LONGEST = 0.3
"""Longest step of a parameter, as a share of its value."""
MOST_TRIES, SPARE_TRIES = 10, 200
"""Draws a mechanism that is found, at most, and how many more: of one in ten that lies within the bounds a
few draws would often find none."""
SEEN = 1e-7
"""Directions along which accelerations change less than this share of the most stay as they are."""


class Response(NamedTuple):
    """What a torque at a joint does to that joint: the scale of the masses is told by it.

    Attributes:
        position: Joint positions [rad or m], (dof,).
        row: The dof.
    """

    position: np.ndarray
    row: int


def drawn(fit: Fit, count: int, *, seed: int = 0, response: Response | None = None) -> list[Mechanism]:
    """Draw mechanisms from the covariance of the parameters; those beyond a bound are drawn again.

    Args:
        fit: The identified mechanism.
        count: How many, at most 100.
        seed: Of the draws.
        response: What all mechanisms have in common where the data leave the scale of the masses open; None
            takes the first joint, all positions zero.

    Returns:
        The mechanisms; fewer where some were not found, none where the fit has no covariance.

    Raises:
        SettingsError: From deeper down: the number or the seed is no whole number or less than 0, or the
            number is above 100.

    Example:
        ``[monodyn.write_mjcf(one, f"{k}.xml") for k, one in enumerate(drawn(fit, 20))]``
    """
    check_whole("seed", seed)
    check_whole("draws", count, MOST_DRAWN)
    covariance = fit.shared_covariance
    if not fit.shared or not np.all(np.isfinite(covariance)):
        return []
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng, dofs = np.random.default_rng(seed), len(fit.mechanism.joints)
    states = various_states(fit.mechanism)
    # what weight does is compared: what torques do follows from it, but for the scale of the masses
    states[2] = 0.0
    features = _Features(fit, states, response or Response(np.zeros(dofs), 0))
    start, slopes = features.of(fit.mechanism)
    found: list[Mechanism] = []
    measured = fit.mass_scale is not None
    for _ in range(SPARE_TRIES + MOST_TRIES * count):
        if len(found) == count:
            break
        change = root @ rng.normal(size=len(values))
        moved = slopes @ change
        # the last is the scale of the masses
        moved[-1] *= measured
        one = _nearest(fit, features, start + moved)
        found += [] if one is None else [one]
    return found


class _Features:
    """What the motion of a mechanism depends on, and the scale of its masses."""

    def __init__(self, fit: Fit, states: np.ndarray, response: Response) -> None:
        self._fit, self._states, self._response = fit, states, response
        at, _ = acceleration_derivatives(fit.mechanism.tree, _directions(fit, fit.mechanism), *states)
        self._usual = np.sqrt(np.mean(at**2, axis=0)) + 1e-12

    def of(self, mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations over their usual size, then the logarithm of the response, and derivatives.

        Args:
            mechanism: The mechanism.

        Returns:
            Features (row,) and their derivatives by the estimated parameters (row, param).
        """
        tree, directions = mechanism.tree, _directions(self._fit, mechanism)
        params = directions.links.shape[2]
        at, slopes = acceleration_derivatives(tree, directions, *self._states)
        rows = (at / self._usual).ravel()
        by = (slopes[:, :, :params] / self._usual[:, None]).reshape(-1, params)
        # the acceleration is linear in the torque: with one less without
        q, row = self._response
        tau = np.zeros((2, len(q)))
        tau[0, row] = 1.0
        at, slopes = acceleration_derivatives(tree, directions, np.stack((q, q)), 0.0 * tau, tau)
        response, by_response = at[0, row] - at[1, row], slopes[0, row, :params] - slopes[1, row, :params]
        return np.append(rows, np.log(response)), np.vstack((by, by_response / response))


def _directions(fit: Fit, mechanism: Mechanism) -> Directions:
    """Return the derivatives of a mechanism's tree by the estimated parameters, tied sizes with them."""
    count, values = len(fit.shared), mechanism.values
    chain = np.eye(count + len(fit.tied))[:, :count]
    for k, (size, length) in enumerate(fit.tied):
        chain[count + k, fit.shared.index(length)] = values[size] / (values[length] or 1.0)
    found = mechanism.directions((*fit.shared, *(size for size, _ in fit.tied)))
    # a table of torques is not looked at, and could not be chained
    none = np.full((len(mechanism.joints), 0), -1)
    return Directions(found.links, found.gravity, none, found.load, found.clock, found.lag).chained(chain)


def _nearest(fit: Fit, features: _Features, wanted: np.ndarray) -> Mechanism | None:
    """Return the mechanism with wanted features that is nearest to the identified one, or None."""
    names = fit.shared
    table = [fit.mechanism.parameter(name) for name in names]
    best = fit.mechanism.values
    x = np.array([best[name] for name in names])
    deviation = np.sqrt(np.maximum(np.diag(fit.shared_covariance), 0.0))
    # steps are measured in shares of the values; what may be zero in standard deviations
    unit = np.where(np.abs(x) > 0.0, np.abs(x), deviation)
    mechanism = fit.mechanism
    for _ in range(ROUNDS):
        at, slopes = features.of(mechanism)
        lacking = wanted - at
        if np.max(np.abs(lacking)) < MET:
            return mechanism
        step = np.linalg.lstsq(slopes * unit, lacking, rcond=SEEN)[0]
        x = x + unit * np.clip(step, -LONGEST, LONGEST)
        x = np.array([np.clip(value, p.lower, p.upper) for value, p in zip(x, table, strict=True)])
        new = dict(zip(names, x.tolist(), strict=True))
        new |= {size: best[size] * new[length] / best[length] for size, length in fit.tied}
        mechanism = fit.mechanism.with_values(new)
    return None
