"""The identification of the 2012 paper as published: eq. (14) with its three torque models and its solver.

Unlike the default method it takes the start state from the filtered poses, compares angles without weights,
takes no sizes from a picture, and searches with BFGS and an active set. Where the paper is silent:

* Bodies keep their aspect ratio. Case II takes its period from the poses, eq. (10), and holds it. Its series
  has 7 harmonics unless the user sets another number, and stands for the friction too: 4 + 2 s_1 + 2 s_2 + 2
  = 34 unknowns for two links. The paper counts 36 and does not say which: with the dampings of Case I (our
  ``with-friction``), with a period for each joint, with omega and a phase, with both coefficients of j = 0
  to 7 for both joints, 32 + 4, or with two values of the start state. Free torques are linear between time
  stamps; 2 k + 4 unknowns for two links.
* The start state of each record is the filtered one, eq. (6), at its first sample: the parabola through the
  first three samples, before any correction, so that the gains count only with filtered states or rates.
* Bounds are a factor of ten about the sizes of file or picture, lengths in the common scale of the start (a
  factor of three under free torques) and within the user's bounds; dampings up to where friction alone
  balances the weight; torques up to ten times that of weight and inertia, three times for free ones.
* The start matches the accelerations of smoothed motion, or is that of the file as it is (``begin``). A
  series starts as that of the torque that the periodic poses require, eq. (12); free torques as those that
  lead the motion along the smoothed poses. Both are fitted to the first samples before more. No sample is
  left out as a gross error, which the paper does not do either.
* Intervals are those of the least squares with the noise of the samples, which reaches the parameters
  directly and by way of the start state; free torques, underdetermined, have none.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.estimation.fit import Doubt, Fit
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, typical
from monodyn.estimation.verdict.summary import UNSTARTED, fit_of, refused
from monodyn.estimation.verdict.uncertainty import knowledge_at
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dots import chosen_bodies
from monodyn.paper.descent import Descent, descend
from monodyn.paper.filter import Gains, filter_response, filtered
from monodyn.paper.fit_verdict import published_advice, published_verdict
from monodyn.paper.fixed_start import FixedStart, start_states, targets
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.paper.start_noise import with_start_noise
from monodyn.paper.torque_model import TorqueModel, torque_model
from monodyn.types import Poses, Progress


def identify_published(
    records: Sequence[Poses],
    mechanism: Mechanism,
    settings: PaperIdentifySettings,
    progress: Progress | None = None,
) -> Fit:
    """Minimize |X_s - X_e| over the unknowns of the paper's Case I, II or III, within bounds.

    Unknowns are the free lengths and thicknesses and, with ``settings.torque``, in Case I (``friction``) the
    dampings, b in tau = -b v; in Case II (``fourier``) the coefficients of a series for each joint; in Case
    III (``free``) a torque for each joint and time stamp; in both without the dampings, or with them.

    Args:
        records: Records of joint positions, at least one.
        mechanism: Topology, start values, what is free and fixed.
        settings: The torque model, gains, what is compared, how many starts.
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The identified mechanism; ``ok`` is False, with the reason as its status, where it does not follow the
        record or nothing could be identified. ``evaluations`` counts rollouts, each
        a simulated motion of all records, with or without derivatives; by differences a Jacobian takes two
        for each unknown.

    Source:
        Eq. (9), (13) and (14) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    began = time.perf_counter()
    mechanism = replace(mechanism.with_bodies(chosen_bodies(mechanism, settings.bodies)), measured=None)
    data = prepare(tuple(records), mechanism)
    records = tuple(ordered(record, mechanism) for record in records)
    smoothed = tuple(smooth(record) for record in records)
    model = torque_model(mechanism, settings, data)
    if model.reason is not None:
        return _refused(model, model.reason, records, settings, began)
    found = descend(
        _fixed_start(model.problem, records, settings), smoothed, model.series, settings, progress
    )
    if found is None:
        return _refused(model, UNSTARTED, records, settings, began)
    return _fit(found, model, records, settings, began)


def _fixed_start(problem: Problem, records: tuple[Poses, ...], settings: PaperIdentifySettings) -> FixedStart:
    """Filter the records, and take from them the start states and what is compared."""
    gains, data = Gains.of(settings.gains, settings.filter), problem.data
    seen = [np.where(record.measured, record.position, np.nan) for record in records]
    pairs = list(zip(records, seen, strict=True))
    motion = tuple(filtered(r.time, positions, gains, r.covariance) for r, positions in pairs)
    target, white = targets(data, motion, settings.states, settings.rates)
    through_filter = settings.rates or settings.states == "filtered"
    response = tuple(filter_response(r.time, np.isfinite(at), gains) for r, at in pairs if through_filter)
    return FixedStart(
        problem=problem,
        start=start_states(data, motion),
        target=target,
        white=white,
        scale=np.ones(len(problem.unknowns)),
        substeps=1,
        response=response,
        filtered=settings.states == "filtered",
    )


def _refused(
    model: TorqueModel,
    reason: str,
    records: tuple[Poses, ...],
    settings: PaperIdentifySettings,
    began: float,
) -> Fit:
    fit = refused(model.problem, reason, records, time.perf_counter() - began)
    return replace(fit, torque=settings.torque)


def _fit(
    found: Descent,
    model: TorqueModel,
    records: tuple[Poses, ...],
    settings: PaperIdentifySettings,
    began: float,
) -> Fit:
    """Collect what was found; intervals from the Jacobian and the noise of the samples."""
    fixed, x = found.fixed, found.x
    problem, determined = fixed.problem, fixed.compared > len(x)
    freedom = max(fixed.compared - len(x), 1)
    residuals = fixed.residuals(x)
    noise = max(float(np.sqrt(np.sum(residuals**2) / freedom)), 1e-12)
    # start states are given: the Jacobian has the columns of the unknowns alone
    known = knowledge_at(problem, x, fixed.jacobian(x) / noise, fixed.pieces)
    known = with_start_noise(fixed, x, noise, known)
    # more unknowns than values: every direction is open, however small the linear algebra's numbers are
    if not determined:
        full = known.full.copy()
        full[: len(x)] = full[:, : len(x)] = np.nan
        known = replace(known, open=np.eye(len(x)), std=np.full(len(x), np.inf), full=full)
    optimum = _optimum(found, residuals / noise)
    fit = fit_of(problem, optimum, known, records, freedom=freedom, began=began)
    if not determined:
        # bounds of what is not determined would be read as intervals
        parameters = (
            replace(p, lower=-np.inf, upper=np.inf) if np.isinf(p.std) else p for p in fit.parameters
        )
        fit = replace(fit, combinations=(), parameters=tuple(parameters))
    status, ok = published_verdict(found, fit.rms, settings, model)
    without_effect = known.without_effect(problem.unknowns.names)
    advice = published_advice(found, model, fit, records, settings, without_effect)
    return replace(fit, status=status, doubts=() if ok else (Doubt("refused", status),), advice=advice)


def _optimum(found: Descent, residuals: np.ndarray) -> Optimum:
    """The end of the search in the form that estimates take; residuals in standard deviations."""
    fixed, (low, high) = found.fixed, found.bounds
    # the solver keeps bounds to rounding in its own scaled coordinates
    near = 1e-6 * fixed.scale
    return Optimum(
        fixed.trial(found.x), residuals, 0.5 * float(np.sum(residuals**2)),
        typical(residuals, np.isfinite(fixed.target)), found.evaluations, found.converged,
        (found.x <= low + near) | (found.x >= high - near),
    )  # fmt: skip
