"""The least variance that any unbiased fit of the tracked poses can have (Cramer-Rao)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import Pieces, prepare
from monodyn.estimation.shooting.prior import size_prior
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.shooting.unknowns import choose_unknowns
from monodyn.estimation.verdict.uncertainty import knowledge_at
from monodyn.mechanism import Mechanism
from monodyn.types import Poses

SUBSTEPS = 8
"""Integration steps between frames: the error of the sensitivities is far below the noise at 30 Hz."""


def bounded(fit: Fit, poses: Poses, mechanism: Mechanism) -> Fit:
    """Return the fit with the Cramer-Rao bound in place of its own covariance.

    C = (sum_t J_t^T S_t^-1 J_t + P)^-1 with J the sensitivities of the fitted motion by parameters and start
    state, S_t the covariance that the tracker states for frame t, errors of different frames taken as
    independent, and P what the key frames know of the sizes. The fit's own covariance is S_t scaled to the
    residuals that were found; this one is not.

    Args:
        fit: The fit of ``poses``, with uniform bodies.
        poses: The fitted frames.
        mechanism: The located mechanism that was given to the fit.

    Returns:
        The fit with the bound as ``covariance``; `monodyn.predict` carries it on.
    """
    mechanism = mechanism.with_bodies("uniform")
    # dry friction is no unknown before a fit has found some
    mechanism = mechanism.with_choices(free=[p for p in fit.shared if not mechanism.parameter(p).free])
    data, unknowns = prepare((poses,), mechanism), choose_unknowns(mechanism)
    problem = Problem(mechanism, unknowns, size_prior(mechanism, unknowns), data)
    found = fit.mechanism.values
    x = unknowns.coordinates(np.array([found[name] for name in unknowns.names]))
    start = fit.starts[0]
    pieces = Pieces(np.array([0, len(data.times)]), np.array([0]))
    trial = Trial(x, np.concatenate((start.position, start.velocity))[None], pieces, SUBSTEPS)
    _, jacobian = problem.rows(trial)
    covariance = knowledge_at(problem, x, jacobian, pieces).full
    count, slope = len(unknowns), np.eye(len(covariance))
    slope[:count, :count] = unknowns.slope(x)
    return replace(fit, covariance=slope @ covariance @ slope.T)


def spread_of(fit: Fit, name: str) -> float:
    """Return the standard deviation of one parameter under the fit's covariance; NaN where it is no unknown.

    Args:
        fit: The fit.
        name: Name of the parameter.
    """
    if name not in fit.names:
        return float("nan")
    at = fit.names.index(name)
    return float(np.sqrt(max(fit.covariance[at, at], 0.0)))
