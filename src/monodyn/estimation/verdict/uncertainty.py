"""Jacobian at the optimum in, covariance and identifiability out.

The start states are eliminated by QR, so that what remains is the information of the motion (and the picture)
about the shared unknowns alone. Its singular values, with every column scaled to length one, show the
directions that the data do not fix at all: along those the standard deviation is infinite, not large.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monodyn.estimation.record.samples import Data, Pieces
from monodyn.estimation.shooting.common import whitened_shifts
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.unknowns import CENTRE_KINDS, Unknowns
from monodyn.estimation.verdict.stamps import stamp_error

SLOW = 1.5
"""Root of what autocorrelation costs, above which residuals count as changing slowly."""
BLIND = 1e-6
"""Singular values below this share of the largest count as zero; derivatives are exact to about 1e-8."""
SAME = 1e-3
"""Share by which two sizes of the noise differ that are about the same."""
ROUNDING = 1e-13
"""Share of a number that is lost at most where it is the difference of two that are about the same."""
HALVINGS = 40
"""Steps of the bisection for a factor of the noise."""
LOADED = 1e-3
"""A parameter that moves by less than this share along an unfixed direction is not touched by it."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What the data know about the unknowns, in coordinates.

    Attributes:
        covariance: Covariance of the shared unknowns within the directions that are fixed, (param, param).
        open: Directions that the data do not fix, as relative changes of the parameters, (param, direction).
        relative: Relative change of a parameter by unit of its coordinate, (param,).
        std: Standard deviation of each coordinate, infinite where an open direction moves it, (param,).
        full: Covariance of shared unknowns and start states of all pieces, (unknown, unknown).
    """

    covariance: np.ndarray
    open: np.ndarray
    relative: np.ndarray
    std: np.ndarray
    full: np.ndarray

    def without_effect(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Name the unknowns that form an open direction alone: nothing depends on them.

        Args:
            names: Names of the unknowns.

        Returns:
            Those of them.
        """
        if not self.open.size:
            return ()
        alone = np.linalg.norm(self.open, axis=1) > 1.0 - 1e-6
        return tuple(name for name, is_alone in zip(names, alone, strict=True) if is_alone)


def knowledge_at(problem: Problem, x: np.ndarray, jacobian: np.ndarray, pieces: Pieces) -> Knowledge:
    """Compute covariance and identifiability at the optimum.

    Args:
        problem: Gives the unknowns and the picture's knowledge of sizes.
        x: Coordinates of the optimum, (param,).
        jacobian: Jacobian of the residuals, in standard deviations of the noise as found, by the shared
            unknowns and then by the start state of the row's piece, (row, dof, column); without the latter's
            columns where start states were given.
        pieces: Which rows share a start state.

    Returns:
        What is known. The picture's knowledge of sizes counts as data, the damping of the search does not.

    Source:
        Seber and Wild, Nonlinear Regression, 1989, section 2.1 (covariance).
    """
    count = len(problem.unknowns)
    stacked, local, pulls = [], [], []
    shifts = whitened_shifts(problem.data)
    for first, stop in zip(pieces.first[:-1], pieces.first[1:], strict=True):
        rows = jacobian[first:stop].reshape(-1, jacobian.shape[2])
        # nor does a row tell anything that a motion depends on beyond all numbers
        used = np.any(rows != 0, axis=1) & np.isfinite(rows).all(axis=1)
        # there may be no direction at all, so the number of rows is not left open
        rows, shift = rows[used], shifts[first:stop].reshape(len(rows), shifts.shape[2])[used]
        shared, states = rows[:, :count], rows[:, count:]
        # what a start state can compensate gives no information about the shared unknowns: it is projected
        # out, and kept, so that the start state's own covariance follows from theirs afterwards
        q, r = np.linalg.qr(states)
        inverse = np.linalg.pinv(r, rcond=1e-12)
        onto = q.T @ shared
        stacked.append(shared - q @ onto)
        local.append(_Local(inverse @ inverse.T, inverse @ onto, inverse @ (q.T @ shift)))
        pulls.append(stacked[-1].T @ shift)
    # the picture's information is that of as many further rows as it has eigenvalues
    values, vectors = np.linalg.eigh(problem.prior.information)
    stacked.append(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
    _, triangle = np.linalg.qr(np.concatenate(stacked))
    covariance, blind = _split(triangle, problem.unknowns)
    # a shift of all positions is no noise: it moves the optimum as a whole
    moved = covariance @ np.sum(pulls, axis=0)
    full = _with_states(covariance, moved, local)
    covariance = covariance + moved @ moved.T
    return _known(problem.unknowns, x, covariance, blind, full)


def covariance_of(unknowns: Unknowns, information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance that the information about the unknowns and one start state leaves.

    Args:
        unknowns: The unknowns.
        information: Second derivatives of the cost by unknowns and start state, (unknown, unknown).

    Returns:
        Covariance of both, (unknown, unknown), as ``Knowledge.full``, and a basis of the directions that are
        open and left out of it, but for what rounding hides in squares, (param, direction).

    Raises:
        ArithmeticError: Rounding in what is known of the state is more than what is known of the unknowns.
    """
    count = len(unknowns)
    states, cross = information[count:, count:], information[count:, :count]
    size = np.sqrt(np.maximum(np.diag(states), 1e-300))
    inverse = np.linalg.pinv(states / np.outer(size, size), rcond=1e-14, hermitian=True) / np.outer(
        size, size
    )
    gain = inverse @ cross
    left = information[:count, :count] - cross.T @ gain
    alone = np.diag(left)
    if np.any(alone < -ROUNDING * np.diag(information)[:count]):
        raise ArithmeticError("what is known of the unknowns is less than rounding in what the state is")
    seen = alone > 0.0
    left = np.where(np.outer(seen, seen), left, 0.0)
    size = np.sqrt(np.where(seen, alone, 1.0))
    values, vectors = np.linalg.eigh(left / np.outer(size, size))
    covariance, blind = _split(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size, unknowns)
    nothing = np.zeros((count, 0))
    return _with_states(covariance, nothing, [_Local(inverse, gain, np.zeros((len(states), 0)))]), blind


def _known(
    unknowns: Unknowns, x: np.ndarray, covariance: np.ndarray, blind: np.ndarray, full: np.ndarray
) -> Knowledge:
    """Say which parameters what is not fixed moves; ``blind`` is a basis of that, (param, direction)."""
    relative = relative_change(unknowns, x)
    unfixed, loaded = _open_directions(blind, relative)
    std = np.where(loaded, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return Knowledge(covariance, unfixed, relative, std, full)


class _Local(NamedTuple):
    """A start state: its covariance alone, how it follows shared unknowns, and shifts of the positions."""

    covariance: np.ndarray
    gain: np.ndarray
    shift: np.ndarray


def _split(triangle: np.ndarray, unknowns: Unknowns) -> tuple[np.ndarray, np.ndarray]:
    """Covariance within what the rows fix, and a basis of what they do not, both in coordinates."""
    count = triangle.shape[1]
    if count == 0:
        return np.zeros((0, 0)), np.zeros((0, 0))
    norms = np.linalg.norm(triangle, axis=0)
    # a logarithm whose standard deviation alone would be over 1000 is not seen at all
    norms = np.where(norms > np.where(unknowns.log, 1e-3, 1e-12 * norms.max()), norms, 0.0)
    unit = np.where(norms > 0, norms, 1.0)
    _, singular, rows = np.linalg.svd(np.where(norms > 0, triangle / unit, 0.0), full_matrices=True)
    # columns of length one make singular values comparable: a small one means unknowns of equal effect, and
    # not one in small units
    singular = np.concatenate((singular, np.zeros(count - len(singular))))
    fixed = singular > BLIND * singular[0] if singular[0] > 0 else np.zeros(count, dtype=bool)
    basis = rows[fixed].T / singular[fixed]
    return (basis @ basis.T) / np.outer(unit, unit), rows[~fixed].T / unit[:, None]


def relative_change(unknowns: Unknowns, x: np.ndarray) -> np.ndarray:
    """Return the relative change of each parameter by unit of its coordinate.

    A damping or a centre of mass near zero is measured against the largest of its kind.

    Args:
        unknowns: The unknowns.
        x: Their coordinates, (param,).

    Returns:
        1 for logarithms, ratios, angles and lags, one over the size of the others, (param,).
    """
    values, slopes = np.abs(unknowns.values(x)), np.diag(unknowns.slope(x))
    relative = np.ones(len(unknowns))
    for i, kind in enumerate(unknowns.kinds):
        if not (unknowns.log[i] or unknowns.ratio[i] or kind in ("roll", "lag")):
            alike = CENTRE_KINDS if kind in CENTRE_KINDS else (kind,)
            largest = max(values[unknowns.of_kind(*alike)])
            relative[i] = slopes[i] / max(values[i], 1e-2 * largest, 1e-12)
    return relative


def _open_directions(blind: np.ndarray, relative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal relative changes that the data do not see, and which parameters they move."""
    if blind.shape[1] == 0:
        return blind, np.zeros(len(relative), dtype=bool)
    # in relative changes a direction compares a length with a damping; any basis of the same space is as good
    changes, _ = np.linalg.qr(blind * relative[:, None])
    loaded = np.linalg.norm(changes, axis=1) > LOADED
    return changes, loaded


def _with_states(covariance: np.ndarray, moved: np.ndarray, local: list[_Local]) -> np.ndarray:
    """Covariance of shared unknowns and all start states: each start state follows the shared unknowns, and
    both follow shifts of the positions, by ``moved`` (param, direction) and by their own."""
    count = len(covariance)
    width = len(local[0].covariance) if local else 0
    full = np.zeros((count + width * len(local), count + width * len(local)))
    # a change d of the shared unknowns moves a start state by -gain d, to where it fits best again
    follow = np.concatenate([np.eye(count), *(-state.gain for state in local)])
    full += follow @ covariance @ follow.T
    away = np.concatenate([moved, *(state.shift - state.gain @ moved for state in local)])
    full += away @ away.T
    for k, state in enumerate(local):
        block = slice(count + k * width, count + (k + 1) * width)
        full[block, block] += state.covariance
    return 0.5 * (full + full.T)


class NoiseFactors(NamedTuple):
    """How the residuals compare with the stated noise, by joint.

    Attributes:
        size: Size of the residuals against the stated noise, (dof,).
        correlation: Root of the factor by which autocorrelation reduces the number of samples, at least 1,
            (dof,).
        stamps: Standard deviation of the time stamps [s].
        shift: What an error of the stamps of that size moves, ``stamps`` times the rates, (row, dof); empty
            where the stamps are exact.
    """

    size: np.ndarray
    correlation: np.ndarray
    stamps: float = 0.0
    shift: np.ndarray = np.zeros((0, 0))

    @property
    def slow(self) -> np.ndarray:
        """True where residuals change slowly, as what a model lacks does and noise does not, (dof,)."""
        return self.correlation > SLOW

    def is_about(self, other: NoiseFactors) -> bool:
        """Return whether all of it is that of other factors but for what no interval shows.

        Args:
            other: The others, of the same joints.
        """
        mine, others = (np.array([*n.size, *n.correlation, n.stamps]) for n in (self, other))
        return bool(np.all(np.abs(mine - others) <= SAME * others))

    def weighted(self, data: Data) -> Data:
        """Return data with the noise as found, for honest intervals.

        Args:
            data: The data, with its stated noise.
        """
        return data.scaled(self.size, self.shift).scaled(self.correlation)


def noise_factors(
    data: Data, difference: np.ndarray, unknowns: int, rates: np.ndarray | None = None
) -> NoiseFactors:
    """Compare the residuals with the stated noise, joint by joint.

    Each residual is compared with its own stated deviation, sqrt(C_jj), because the factor scales that; a
    whitened one would be a mixture of joints.

    The second factor is what residuals that resemble their neighbours cost: n samples with autocorrelation
    rho_k know as much as n / (1 + 2 sum rho_k) independent ones.

    Args:
        data: The data, with its stated noise.
        difference: Measured less simulated positions in the record's units, NaN in gaps, (row, dof).
        unknowns: Number of unknowns that were fitted, start states included.
        rates: Simulated rates in the record's units by stamped second, (row, dof), from which an error of the
            time stamps is told apart; None takes the stamps to be exact.

    Returns:
        Both factors, and the error of the stamps.

    Source:
        Bayley and Hammersley, The effective number of independent observations in an autocorrelated time
        series, 1946.
    """
    dofs = data.position.shape[1]
    size, correlation = np.ones(dofs), np.ones(dofs)
    stamps = 0.0 if rates is None else stamp_error(data, difference, rates)
    shift = stamps * rates if rates is not None and stamps > 0 else np.zeros((0, 0))
    moved = shift**2 if len(shift) else np.zeros_like(difference)
    # a fit of as many unknowns as samples leaves nothing over; a tenth of them is left at least
    share = 1.0 - min(unknowns / max(data.samples, 1), 0.9)
    for dof in range(dofs):
        use = data.measured[:, dof]
        if use.any():
            stated, squares = data.std[use, dof] ** 2, difference[use, dof] ** 2
            size[dof] = max(_size(squares, stated, moved[use, dof], share), 1e-6)
            whole = size[dof] ** 2 * np.where(use, data.std[:, dof], 1.0) ** 2 + moved[:, dof]
            residuals = np.where(use, difference[:, dof] / np.sqrt(whole), 0.0)
            correlation[dof] = np.sqrt(_autocorrelation(data, residuals, use))
    return NoiseFactors(size, correlation, stamps, shift)


def _size(squares: np.ndarray, stated: np.ndarray, moved: np.ndarray, share: float) -> float:
    """Return the factor of the stated noise that is most likely where the stamps move the joints too.

    Seen from the likelihood a row counts by its share of the stated noise, so that rows which the stamps move
    far hardly do.
    """
    size = float(np.sqrt(np.mean(squares / stated) / share))
    if not np.any(moved > 0):
        return size
    low, high = 1e-6, max(size, 1e-6)
    # the likelihood falls beyond the factor, which would be largest if the stamps moved nothing
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        whole = middle**2 * stated + moved
        above = np.mean((squares / share - whole) * stated / whole**2) > 0
        low, high = (middle, high) if above else (low, middle)
    return high


def _autocorrelation(data: Data, values: np.ndarray, use: np.ndarray) -> float:
    """1 + 2 sum of the autocorrelations up to the first that could be chance."""
    total, variance = 1.0, float(np.mean(values[use] ** 2))
    if variance <= 0:
        return 1.0
    record = data.by_row(np.arange(data.records))
    for lag in range(1, len(values) // 4):
        pairs = use[lag:] & use[:-lag] & (record[lag:] == record[:-lag])
        if pairs.sum() < 8:
            break
        rho = float(np.mean(values[lag:][pairs] * values[:-lag][pairs])) / variance
        # correlations that are nothing but chance would sum up to any number
        if rho < 1.5 / np.sqrt(pairs.sum()):
            break
        total += 2.0 * rho
    return total
