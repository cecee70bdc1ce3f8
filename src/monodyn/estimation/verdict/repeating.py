"""What a model lacks, as an unknown function of the state: how far off it may leave what was identified.

Random accelerations average out along a record. A force that is always the same in the same state, of which a
model knows nothing, does not: it moves what is identified the same way in every record of the mechanism. Nor
does an error of the readings that is the same in every pose, such as a picture leaves whose pixels are not
square. The residuals determine how strong both are, in all directions but those that the parameters have
taken up; in these they are taken to be as strong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.shares import Share, added
from monodyn.estimation.verdict.uncertainty import knowledge_at, without_states
from monodyn.estimation.verdict.unmodelled import noise_of_rows

WAVES, MOST_WAVES = 48, 192
"""Waves over the state that make up the unknown force at a joint, and the error of its readings; and those of
all joints together."""
LENGTHS = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Distances in the state over which the force stays about the same, and the error of the readings, tried: in
cosine and sine of hinges, in deviations of slides and of rates."""
STRENGTHS = np.append(0.0, 10.0 ** np.arange(-4.0, 3.01, 0.125))
"""Strengths tried, over that at which a cause would leave all of the residuals ..."""
BEGUN = 0.1
"""... and the one with which the others begin."""
ROUNDING = 1e-13
"""Noise that is taken at least, over the variance that a cause leaves."""
SWEEPS, SEED = 8, 0
"""Times that the causes are gone through, at most; seed of the waves."""


def repeating_share(found: Refined) -> Share:
    """Return what unknown forces and errors of the readings add to the standard deviations; nothing where the
    residuals of a row resemble those of the next no more than chance makes them.

    Args:
        found: The optimum, and what is known there.
    """
    if not np.any(found.noise.correlation > 1.0):
        return Share({}, {})
    problem, optimum, known = found.problem, found.optimum, found.known
    covariance = known.covariance + repeating(found)
    std = np.where(np.isinf(known.std), np.inf, np.sqrt(np.diag(covariance)))
    wider = replace(known, covariance=covariance, std=std)
    # of deviations alone, which do not depend on the width of an interval
    return Share(
        added(estimates(problem, optimum, known, 1.0), estimates(problem, optimum, wider, 1.0)),
        added(combinations(problem, optimum.x, known, 1.0), combinations(problem, optimum.x, wider, 1.0)),
    )


def repeating(found: Refined) -> np.ndarray:
    """Return what unknown forces and errors of the readings add to the covariance of the shared unknowns,
    (param, param).

    Args:
        found: The optimum, and what is known there.

    Source:
        Kennedy and O'Hagan, Bayesian calibration of computer models, 2001 (discrepancy); Rahimi and Recht,
        Random features for large-scale kernel machines, 2007 (waves that stand for a smooth function).
    """
    residuals = _residuals(found)
    problem, trial = found.weighted, found.optimum.trial
    clock, carried = found.carried_along
    state, dofs = _standard(problem, trial, residuals.unit), problem.data.position.shape[1]
    waves = [_waves(state / length, dofs) for length in LENGTHS]
    forces = [residuals.shown(moved) for moved in _pushed(clock, carried, trial, waves)]
    # what a reading is wrong by depends on the pose alone
    errors = [residuals.shown(_misread(_waves(state[:, :-dofs] / length, dofs))) for length in LENGTHS]
    most = _moving(problem, trial, clock, residuals.unit)
    more, likelihood = [], []
    seen = residuals.seen
    alike = [[left.T @ left for _, left in one] for one in (forces, errors)]
    for (i, (by_force, pushed)), (j, (by_error, misread)) in product(enumerate(forces), enumerate(errors)):
        both = pushed.T @ misread
        normal = np.block([[alike[0][i], both], [both.T, alike[1][j]]])
        right = np.concatenate((pushed.T @ seen, misread.T @ seen))
        strengths, value = _strengths(normal, right, most, float(seen @ seen))
        off = np.concatenate((by_force, by_error), axis=1) * strengths
        more.append(off @ off.T)
        likelihood.append(value)
    # no pair of lengths is certain: each counts as it is likely
    weight = np.exp(np.array(likelihood) - np.max(likelihood))
    return np.einsum("k,kij->ij", weight / np.sum(weight), np.stack(more))


@dataclass(frozen=True, eq=False)
class _Residuals:
    """What a fit leaves over, in deviations of the noise that changes from row to row.

    Attributes:
        problem: The problem, weighted with the noise as found.
        trial: Its optimum.
        unit: Metres per unit of the record, 1 for hinges, (row, dof).
        jacobian: Of the whitened residuals, (row, dof, column), the shared unknowns first.
        followed: Covariance of the shared unknowns, by which they follow residuals, (param, param).
        level: That noise of the whitened residuals, (row * dof,).
        seen: The residuals, (row * dof,).
    """

    problem: Problem
    trial: Trial
    unit: np.ndarray
    jacobian: np.ndarray
    followed: np.ndarray
    level: np.ndarray
    seen: np.ndarray

    def shown(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how the shared unknowns follow waves that move positions [rad or m], (row, dof, wave), and
        what of the waves the residuals still show: (param, wave) and (row * dof, wave)."""
        data, count, columns = self.problem.data, len(self.trial.x), self.jacobian.shape[2]
        pushed = np.einsum("fij,fjk->fik", data.white, moved / self.unit[..., None])
        pushed[~data.measured] = 0.0
        stacked = np.concatenate((self.jacobian, pushed), axis=2)
        # start states take up what they can, then the shared unknowns do
        order = [*range(count), *range(columns, stacked.shape[2]), *range(count, columns)]
        free = without_states(stacked[..., order], count + pushed.shape[2], self.trial.pieces)
        shared, forced = free[:, :count], free[:, count:]
        follows = -self.followed @ (shared.T @ forced)
        return follows, (forced + shared @ follows) / self.level[:, None]


def _residuals(found: Refined) -> _Residuals:
    """Return what a fit leaves over."""
    problem, trial = found.weighted, found.optimum.trial
    data, use = problem.data, problem.data.measured
    unit = np.broadcast_to(data.by_row(np.where(data.slide, problem.size(trial.x), 1.0)), data.position.shape)
    _, jacobian = problem.rows(trial)
    # what moves all positions of a record is no noise that the unknowns follow
    unshifted = problem.with_data(replace(data, shifts=None))
    followed = knowledge_at(unshifted, trial.x, jacobian, trial.pieces).covariance
    residual = np.nan_to_num(problem.differences(trial))
    rows = noise_of_rows(np.where(use, residual, np.nan), np.where(use, found.problem.data.std, np.nan))
    level = np.where(use, rows * np.einsum("fii->fi", data.white), 1.0).ravel()
    seen = np.where(use, np.einsum("fij,fj->fi", data.white, residual), 0.0).ravel() / level
    return _Residuals(problem, trial, unit, jacobian, followed, level, seen)


def _standard(problem: Problem, trial: Trial, unit: np.ndarray) -> np.ndarray:
    """Return the simulated state in units in which it is of order one, (row, coordinate)."""
    position = problem.simulated(trial)
    rate = problem.rates(trial) * unit
    columns = []
    for q, joint in zip(position.T, problem.mechanism.joints, strict=True):
        slides = joint.kind == "slide"
        columns += [q / max(float(np.std(q)), 1e-12)] if slides else [np.cos(q), np.sin(q)]
    columns += [v / max(float(np.sqrt(np.mean(v**2))), 1e-12) for v in rate.T]
    return np.stack(columns, axis=1)


def _moving(problem: Problem, trial: Trial, clock: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Return how large the accelerations of the joints are, rms, and then how far these move, (cause,): what
    is unknown of a motion is no larger than the motion itself."""
    position, rate = problem.simulated(trial) * unit, problem.rates(trial) * unit
    gained = [
        np.diff(rate[first:stop], axis=0) / np.diff(clock[first:stop])[:, None]
        for first, stop, _ in trial.runs
    ]
    return np.concatenate((np.sqrt(np.mean(np.concatenate(gained) ** 2, axis=0)), np.std(position, axis=0)))


def _misread(waves: list[np.ndarray]) -> np.ndarray:
    """Return errors of readings that are waves [rad or m], (row, dof, wave), joint after joint."""
    dofs, (rows, count) = len(waves), waves[0].shape
    moved = np.zeros((rows, dofs, dofs * count))
    for dof, wave in enumerate(waves):
        moved[:, dof, dof * count : (dof + 1) * count] = wave
    return moved


def _pushed(
    clock: np.ndarray, carried: np.ndarray, trial: Trial, waves: list[list[np.ndarray]]
) -> list[np.ndarray]:
    """Return how far accelerations of each joint that are waves over the state move the positions [rad or m
    by rad/s^2 or m/s^2], (row, dof, wave), for each set of waves; those of a joint stand together."""
    dofs, count = len(waves[0]), waves[0][0].shape[1]
    # (row, dof, set, wave): all sets are carried along at once
    acting = np.stack([np.stack(one, axis=1) for one in waves], axis=2)
    moved = np.zeros((len(clock), 2 * dofs, len(waves), dofs, count))
    for first, stop, _ in trial.runs:
        for row in range(first + 1, stop):
            h, before, now = clock[row] - clock[row - 1], moved[row - 1], moved[row]
            np.matmul(carried[row], before.reshape(2 * dofs, -1), out=now.reshape(2 * dofs, -1))
            mean = 0.5 * (acting[row - 1] + acting[row])
            for dof in range(dofs):
                now[dof, :, dof] += 0.5 * h**2 * mean[dof]
                now[dofs + dof, :, dof] += h * mean[dof]
    return [moved[:, :dofs, one].reshape(len(clock), dofs, -1) for one in range(len(waves))]


def _waves(state: np.ndarray, dofs: int) -> list[np.ndarray]:
    """Return waves over states, (row, wave) for each joint: their sum with random weights of unit variance
    has unit variance and the correlation of states by their distance, exp(-distance^2 / 2)."""
    rng, count = np.random.default_rng(SEED), min(WAVES, MOST_WAVES // (2 * dofs))
    found = []
    for _ in range(dofs):
        along, phase = rng.normal(size=(state.shape[1], count)), rng.uniform(0.0, 2.0 * np.pi, count)
        found.append(np.sqrt(2.0 / count) * np.cos(state @ along + phase))
    return found


def _strengths(
    normal: np.ndarray, right: np.ndarray, most: np.ndarray, total: float
) -> tuple[np.ndarray, float]:
    """Return the strength of each wave, (wave,), one for the waves of a cause, and the logarithm of the
    largest likelihood but for a constant.

    A strength is the root of its mean square where the other causes are as strong as is likeliest, each power
    of ten up to ``most`` (cause,) being as likely beforehand. ``normal`` (wave, wave) and ``right`` (wave,)
    are of the residuals in deviations of their noise, ``total`` is the sum of their squares.
    """
    causes = len(most)
    count = len(right) // causes
    own = [slice(i * count, (i + 1) * count) for i in range(causes)]
    traces = np.array([np.trace(normal[one, one]) for one in own])
    # what moves nothing has no strength
    whole = np.sqrt(total / np.where(traces > 0.0, traces, np.inf))
    likeliest, square, value = np.minimum(BEGUN * whole, most), np.zeros(causes), -np.inf
    for _ in range(SWEEPS):
        before = likeliest.copy()
        for cause, one in enumerate(own):
            tried = whole[cause] * STRENGTHS
            tried = tried[tried <= most[cause]]
            likelihood = _along(normal, right, one, np.repeat(likeliest, count), tried)
            likeliest[cause], value = tried[np.argmax(likelihood)], float(np.max(likelihood))
            weight = np.exp(likelihood - value)
            square[cause] = np.sum(weight * tried**2) / np.sum(weight)
        if np.array_equal(likeliest, before):
            break
    return np.repeat(np.sqrt(square), count), value


def _along(
    normal: np.ndarray, right: np.ndarray, one: slice, strengths: np.ndarray, tried: np.ndarray
) -> np.ndarray:
    """Return the logarithms of the likelihood at strengths of the waves ``one``, (strength,), where those of
    the others stay."""
    others = np.delete(np.arange(len(right)), one)
    by = strengths[others]
    scaled = by[:, None] * normal[np.ix_(others, others)] * by
    # noise that is less than the rounding of what is far stronger would not be seen
    noise = 1.0 + ROUNDING * np.max(np.diag(scaled), initial=0.0)
    factor = np.linalg.cholesky(scaled + noise * np.eye(len(by)))
    sides = np.column_stack((normal[others, one], right[others])) * by[:, None]
    solved = np.linalg.solve(factor, sides)
    taken, rest = solved[:, :-1], solved[:, -1]
    # what the others leave of these waves, in directions that do not share in anything
    power, axes = np.linalg.eigh(normal[one, one] - taken.T @ taken)
    power, along = np.maximum(power, 0.0), axes.T @ (right[one] - taken.T @ rest)
    squares = tried[:, None] ** 2
    own = 0.5 * np.sum(squares * along**2 / (1.0 + squares * power) - np.log1p(squares * power), axis=1)
    return own + 0.5 * rest @ rest - np.sum(np.log(np.diag(factor)))
