"""How the noise of the samples reaches the parameters by way of a start state made of the same samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.paper.filter import FIRST, parabola
from monodyn.paper.fixed_start import FixedStart


def with_start_noise(fixed: FixedStart, x: np.ndarray, noise: float, known: Knowledge) -> Knowledge:
    """Let the noise of the samples act on the parameters both directly and by way of the start state.

    Samples y with noise e have the start state s = P y and the target L y, both linear. At the optimum the
    parameters change by A J' (L - J_s P) e with A = (J' J)^-1, and with the covariance R of the samples

        C_s = P R P', C_ps = A J' (L - J_s P) R P', C_p = A J' (L - J_s P) R (L - J_s P)' J A.

    For a start state that is independent of the target this is A (J' R J + J' J_s C_s J_s' J) A and
    -A J' J_s C_s. R is the stated covariance, or larger by the factor that makes the residuals as large as
    expected. The parabola through three samples misses what the motion has of third order: the error that
    it makes of the simulated motion counts as one more source.

    Args:
        fixed: The problem.
        x: Coordinates of the optimum, (param,).
        noise: Standard deviation of a residual.
        known: What would be known with the start state exact: its ``covariance`` is A.

    Returns:
        The knowledge with covariances of parameters and start states.
    """
    data, count = fixed.problem.data, len(x)
    jacobian = (fixed.jacobian(x) / noise).reshape(-1, count)
    by_start = fixed.start_jacobian(x).reshape(len(jacobian), -1) / noise
    starts = start_response(data).reshape(-1, data.position.size)
    cov = _stated(data)
    along, plain, shared = _direct(fixed, noise, jacobian, by_start, starts)
    whole = along - jacobian.T @ by_start @ starts
    # expected sum of squares of the residuals under R: of (L - J_s P) e, less what the parameters take up
    start_covariance = _times(starts, cov) @ starts.T
    left = plain - 2.0 * shared + float(np.sum((by_start @ start_covariance) * by_start))
    left -= float(np.sum((_times(whole, cov) @ whole.T) * known.covariance))
    squares = float(np.sum((fixed.residuals(x) / noise) ** 2))
    larger = max(squares / max(left, 1e-300), 1.0) if len(jacobian) > count else 1.0
    response = np.concatenate((known.covariance @ whole, starts))
    found = larger * (_times(response, cov) @ response.T)
    # the parabola's error is no noise: it counts once, in the direction in which it moves everything
    missed = starts @ np.where(data.measured, fixed.motion(x), 0.0).ravel() - fixed.start.ravel()
    missed = np.concatenate((-known.covariance @ (jacobian.T @ (by_start @ missed)), missed))
    found += np.outer(missed, missed)
    carry = _carry(fixed, x)
    full = carry @ found @ carry.T
    own = full[:count, :count]
    std = np.where(np.isfinite(known.std), np.sqrt(np.diag(own)), np.inf)
    return replace(known, covariance=own, std=std, full=0.5 * (full + full.T))


def _direct(
    fixed: FixedStart, noise: float, jacobian: np.ndarray, by_start: np.ndarray, starts: np.ndarray
) -> tuple[np.ndarray, float, float]:
    """What the samples do by way of the target: J' L, tr(L R L') and tr(L R P' J_s')."""
    cov = _stated(fixed.problem.data)
    if fixed.response:
        direct = target_response(fixed).reshape(-1, starts.shape[1]) / noise
        along, plain = jacobian.T @ direct, float(np.sum(_times(direct, cov) * direct))
        return along, plain, float(np.sum((_times(starts, cov) @ direct.T) * by_start.T))
    # measured angles alone: L is the identity, and as large as the square of the samples if it were formed
    plain = float(np.trace(cov, axis1=1, axis2=2).sum()) / noise**2
    return jacobian.T / noise, plain, float(np.sum(_times(starts, cov) * by_start.T) / noise)


def start_response(data: Data) -> np.ndarray:
    """Return what a one in each sample adds to the start states.

    Args:
        data: The measurements; every joint at least three times in each record.

    Returns:
        The response of each entry of ``FixedStart.start``, (entry, row, dof).
    """
    dofs, records = data.position.shape[1], data.records
    found = np.zeros((records, 2, dofs, *data.position.shape))
    for k, (first, stop) in enumerate(zip(data.first[:-1], data.first[1:], strict=True)):
        for dof in range(dofs):
            head = first + np.flatnonzero(data.measured[first:stop, dof])[:FIRST]
            back = data.times[first] - data.times[head[0]]
            carry = np.array([[1.0, back, 0.5 * back**2], [0.0, 1.0, back]])
            found[k, :, dof, head, dof] = (carry @ parabola(data.times[head])).T
    return found.reshape(records * 2 * dofs, *data.position.shape)


def target_response(fixed: FixedStart) -> np.ndarray:
    """Return what a one in each sample adds to the whitened target.

    Args:
        fixed: The problem.

    Returns:
        The response of each compared value, (row, column, row, dof).
    """
    data = fixed.problem.data
    (rows, dofs), columns = data.position.shape, fixed.target.shape[1]
    found = np.zeros((rows, columns, rows, dofs))
    record = data.by_row(np.arange(data.records))
    for k, response in enumerate(fixed.response):
        of = np.flatnonzero((record == k) & (data.source >= 0))
        at = data.source[of]
        part = response[np.ix_(at, np.arange(columns // dofs), np.arange(dofs), at)]
        # the filter takes each joint separately: a sample moves the states of its own joint alone
        for dof in range(dofs):
            for state in range(columns // dofs):
                place = np.ix_(of, np.array([state * dofs + dof]), of, np.array([dof]))
                found[place] = part[:, state, dof][:, None, :, None]
    if not fixed.filtered:
        found[:, :dofs] = np.eye(rows * dofs).reshape(rows, dofs, rows, dofs)
    found *= np.isfinite(fixed.target)[:, :, None, None]
    if fixed.white is not None:
        found = np.einsum("fij,fjed->fied", fixed.white, found, optimize=True)
    return found


def _stated(data: Data) -> np.ndarray:
    """Stated covariance of each row's samples, 0 where there are none, (row, dof, dof)."""
    both = data.measured[:, :, None] & data.measured[:, None, :]
    gaps = np.eye(data.measured.shape[1]) * ~data.measured[:, None, :]
    return np.where(both, np.linalg.inv(np.swapaxes(data.white, 1, 2) @ data.white + gaps), 0.0)


def _times(response: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Responses to the samples (entry, sample) times their covariance (row, dof, dof)."""
    rows, dofs = covariance.shape[:2]
    return np.einsum("wrd,rde->wre", response.reshape(-1, rows, dofs), covariance).reshape(response.shape)


def _carry(fixed: FixedStart, x: np.ndarray) -> np.ndarray:
    """Change of parameters and start states [rad or m] by that of parameters and ``fixed.start``."""
    problem, count, states = fixed.problem, len(x), fixed.states(x)
    dofs = states.shape[1] // 2
    slide = np.tile(problem.data.slide, 2)
    clock = problem.unknowns.of_kind("time_scale").astype(float)
    # logarithmic changes: of slides with the common scale, of rates with the clock
    by_unknown = slide[:, :, None] * problem.prior.weights
    by_unknown = by_unknown - np.repeat([0.0, 1.0], dofs)[:, None] * clock
    carry = np.eye(count + states.size)
    carry[count:, :count] = (states[:, :, None] * by_unknown).reshape(-1, count)
    carry[count:, count:] = np.diag(fixed.units(x).ravel())
    return carry
