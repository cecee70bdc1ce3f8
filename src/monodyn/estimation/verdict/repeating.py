"""What a model lacks, as an unknown function of the state: how far off it may leave what was identified.

Random accelerations average out along a record. A force that is always the same in the same state, of which a
model knows nothing, does not: it moves what is identified the same way in every record of the mechanism. Nor
does an error of the readings that is the same in every pose, such as a picture leaves whose pixels are not
square. The residuals determine how strong both are, in all directions but those that the parameters have
taken up; in these they are taken to be as strong. What of the residuals repeats is told from what does not,
random accelerations, by the likelihood of both together: otherwise forces of any strength would be taken to
follow what no function of the state can.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.estimation.shooting.common import without_states
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.shares import Share, added
from monodyn.estimation.verdict.uncertainty import knowledge_at
from monodyn.estimation.verdict.unmodelled import Wander, wander

WAVES, MOST_WAVES = 48, 192
"""Waves over the state that make up the unknown force at a joint, and the error of its readings; and those of
all joints together."""
LENGTHS = (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
"""Distances in the state over which the force stays about the same, and the error of the readings, tried: in
cosine and sine of hinges, in deviations of slides and of rates."""
STRENGTHS = np.append(0.0, 10.0 ** np.arange(-4.0, 3.01, 0.125))
"""Strengths tried, over that at which a cause would leave all of the residuals ..."""
BEGUN = 0.1
"""... and the one with which the others begin."""
ROUNDING = 1e-13
"""Noise that is taken at least, over the variance that a cause leaves."""
SHARES, COARSE = (0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0), 2
"""Shares of the random accelerations that explain the residuals alone, tried with every second length."""
UNTOLD = 0.1
"""Logarithm of the likelihood of each position up to which a smaller share is taken as possible."""
SWEEPS, SEED = 8, 0
"""Times that the causes are gone through, at most; seed of the waves."""


def repeating_share(found: Refined, random: np.ndarray) -> Share:
    """Return what unknown forces and errors of the readings add to the standard deviations; nothing where the
    residuals of a row resemble those of the next no more than chance makes them.

    Args:
        found: The optimum, and what is known there.
        random: Spectral density of the random accelerations that would explain the residuals alone
            [rad^2/s^3 or m^2/s^3], (dof,).
    """
    if not np.any(found.noise.correlation > 1.0):
        return Share({}, {})
    problem, optimum, known = found.problem, found.optimum, found.known
    covariance = known.covariance + repeating(found, random)
    std = np.where(np.isinf(known.std), np.inf, np.sqrt(np.diag(covariance)))
    wider = replace(known, covariance=covariance, std=std)
    # of deviations alone, which do not depend on the width of an interval
    return Share(
        added(estimates(problem, optimum, known, 1.0), estimates(problem, optimum, wider, 1.0)),
        added(combinations(problem, optimum.x, known, 1.0), combinations(problem, optimum.x, wider, 1.0)),
    )


def repeating(found: Refined, random: np.ndarray) -> np.ndarray:
    """Return what unknown forces and errors of the readings add to the covariance of the shared unknowns,
    (param, param).

    Args:
        found: The optimum, and what is known there.
        random: As in ``repeating_share``, (dof,).

    Source:
        Kennedy and O'Hagan, Bayesian calibration of computer models, 2001 (discrepancy); Rahimi and Recht,
        Random features for large-scale kernel machines, 2007 (waves that stand for a smooth function).
    """
    about, seen = wander(found)
    residuals = _residuals(found)
    problem, trial = found.weighted, found.optimum.trial
    clock, carried = found.carried_along
    state, dofs = _standard(problem, trial, residuals.unit), problem.data.position.shape[1]
    waves = [_waves(state / length, dofs) for length in LENGTHS]
    forces = on_all_cores(residuals.shown, _pushed(clock, carried, trial, waves))
    # what a reading is wrong by depends on the pose alone
    misread = [_misread(_waves(state[:, :-dofs] / length, dofs)) for length in LENGTHS]
    errors = on_all_cores(residuals.shown, misread)
    most = _moving(problem, trial, clock, residuals.unit)

    def left(density: np.ndarray, some: slice) -> _Left:
        return _left(about, density, seen, forces[some], errors[some])

    # What repeats is told from what does not by how likely both are together: as noise that changes from row
    # to row alone, what does not repeat would be laid to forces of any strength
    densities = [share * random for share in SHARES] if random.any() else [random]
    some = slice(None, None, COARSE)

    def likely_with(density: np.ndarray) -> float:
        coarse = left(density, some)
        return max(coarse.likelihood(k, k, most)[1] for k in range(len(coarse.forces)))

    likely = on_all_cores(likely_with, densities) if len(densities) > 1 else [0.0]
    # a record too short to tell leaves both possible: then what repeats is the more cautious
    possible = np.array(likely) > max(likely) - UNTOLD * np.count_nonzero(problem.data.measured)
    whole = left(densities[int(np.argmax(possible))], slice(None))

    def with_lengths(pair: tuple[int, int]) -> tuple[np.ndarray, float]:
        strengths, likelihood = whole.likelihood(*pair, most)
        pull = np.concatenate((forces[pair[0]][0], errors[pair[1]][0]), axis=1)
        return residuals.wider(pull * strengths), likelihood

    found_so = on_all_cores(with_lengths, product(range(len(LENGTHS)), range(len(LENGTHS))))
    # no pair of lengths is certain: each counts as it is likely
    likelihood = np.array([value for _, value in found_so])
    weight = np.exp(likelihood - np.max(likelihood))
    return np.einsum("k,kij->ij", weight / np.sum(weight), np.stack([more for more, _ in found_so]))


@dataclass(frozen=True, eq=False)
class _Left:
    """What a fit leaves over, and what waves would leave, in deviations of what does not repeat.

    Attributes:
        seen: The residuals, (row * dof,).
        forces: What waves of accelerations leave, (row * dof, wave) each.
        errors: What waves of errors of the readings leave, likewise.
        alike: Their products with themselves, (wave, wave), of forces and of errors.
        constant: Logarithm of the density of the residuals where nothing repeats.
    """

    seen: np.ndarray
    forces: list[np.ndarray]
    errors: list[np.ndarray]
    alike: tuple[list[np.ndarray], list[np.ndarray]]
    constant: float

    def likelihood(self, i: int, j: int, most: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the strengths of forces ``i`` and errors ``j``, (wave,), and the logarithm of their largest
        likelihood; ``most`` as in ``_strengths``."""
        pushed, misread, seen = self.forces[i], self.errors[j], self.seen
        both = pushed.T @ misread
        normal = np.block([[self.alike[0][i], both], [both.T, self.alike[1][j]]])
        right = np.concatenate((pushed.T @ seen, misread.T @ seen))
        strengths, value = _strengths(normal, right, most, float(seen @ seen))
        return strengths, value + self.constant


def _left(
    about: Wander,
    density: np.ndarray,
    seen: np.ndarray,
    forces: list[tuple[np.ndarray, np.ndarray]],
    errors: list[tuple[np.ndarray, np.ndarray]],
) -> _Left:
    """Bring what is left over to deviations of noise from row to row and random accelerations ``density``."""
    new, logarithm = about.innovations(seen[..., None], density)

    def deviations(waves: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        one = about.innovations(waves[1], density)[0].reshape(new.size, -1)
        return one, one.T @ one

    both = on_all_cores(deviations, (*forces, *errors))
    left, alike = [one for one, _ in both], [one for _, one in both]
    seen, count = new.ravel(), len(forces)
    constant = logarithm - 0.5 * float(seen @ seen)
    return _Left(seen, left[:count], left[count:], (alike[:count], alike[count:]), constant)


@dataclass(frozen=True, eq=False)
class _Residuals:
    """How what moves positions is taken up by a fit.

    Attributes:
        problem: The problem, weighted with the noise as found.
        trial: Its optimum.
        unit: Metres per unit of the record, 1 for hinges, (row, dof).
        jacobian: Of the whitened residuals, (row, dof, column), the shared unknowns first.
        followed: Covariance of the shared unknowns, by which they follow residuals, (param, param).
        alone: The same from the motion alone, without what is known of them before, (param, param).
        tension: How hard what is known before pulls at the optimum, against the motion, (param,).
        plain: What undoes the whitening, (row, dof, dof).
    """

    problem: Problem
    trial: Trial
    unit: np.ndarray
    jacobian: np.ndarray
    followed: np.ndarray
    alone: np.ndarray
    tension: np.ndarray
    plain: np.ndarray

    def shown(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how waves that move positions [rad or m], (row, dof, wave), pull at the shared unknowns, and
        what of the waves the residuals still show [rad or m]: (param, wave) and (row, dof, wave)."""
        data, count, columns = self.problem.data, len(self.trial.x), self.jacobian.shape[2]
        pushed = np.einsum("fij,fjk->fik", data.white, moved / self.unit[..., None])
        pushed[~data.measured] = 0.0
        stacked = np.concatenate((self.jacobian, pushed), axis=2)
        # start states take up what they can, then the shared unknowns do
        order = [*range(count), *range(columns, stacked.shape[2]), *range(count, columns)]
        free = without_states(stacked[..., order], count + pushed.shape[2], self.trial.pieces)
        shared, forced = free[:, :count], free[:, count:]
        pull = shared.T @ forced
        left = (forced - shared @ (self.followed @ pull)).reshape(pushed.shape)
        return pull, np.einsum("fij,fjk->fik", self.plain, left) * self.unit[..., None]

    def wider(self, pull: np.ndarray) -> np.ndarray:
        """Return what waves of random weights add to the covariance of the shared unknowns, (param, param).

        They make the motion less worth, and not what is known before. With the information A of the motion,
        B of what is known before, and pulls G the posterior has the information B + A (A + G G')^-1 A, whose
        inverse is F + F G (1 + G' (A^-1 - F) G)^-1 G' F for F = (A + B)^-1: no wider than B alone allows. Its
        mean lies nearer to what is known before than the optimum does, about which the intervals are.

        Args:
            pull: How they pull at the unknowns, times their strength, (param, wave).
        """
        # what the motion does not see nothing pulls at: there the difference is rounding alone
        value, axes = np.linalg.eigh(pull.T @ (self.alone - self.followed) @ pull)
        moved = self.followed @ pull @ (axes / np.sqrt(1.0 + np.maximum(value, 0.0)))
        more = moved @ moved.T
        inner = np.linalg.solve(
            np.eye(pull.shape[1]) + pull.T @ self.alone @ pull, pull.T @ self.alone @ self.tension
        )
        shift = (self.followed + more) @ (pull @ inner)
        return more + np.outer(shift, shift)


def _residuals(found: Refined) -> _Residuals:
    """Return how what moves positions is taken up by a fit."""
    problem, trial = found.weighted, found.optimum.trial
    data = problem.data
    unit = np.broadcast_to(data.by_row(np.where(data.slide, problem.size(trial.x), 1.0)), data.position.shape)
    _, jacobian = problem.rows(trial)
    # what moves all positions of a record is no noise that the unknowns follow
    unshifted = problem.with_data(replace(data, shifts=None))
    followed = knowledge_at(unshifted, trial.x, jacobian, trial.pieces).covariance
    prior = problem.prior
    unknown = replace(unshifted, prior=replace(prior, information=np.zeros_like(prior.information)))
    alone = knowledge_at(unknown, trial.x, jacobian, trial.pieces).covariance
    tension = prior.information @ prior.away(trial.x - problem.unknowns.x0)
    return _Residuals(problem, trial, unit, jacobian, followed, alone, tension, np.linalg.pinv(data.white))


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
