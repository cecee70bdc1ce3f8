"""Jacobian at the optimum in, covariance and identifiability out.

The start states are eliminated by QR, so that what is left says what the motion (and the picture) know of the
shared unknowns alone. Its singular values, with every column scaled to length one, tell the directions that
the data do not fix at all: along those the standard deviation is infinite, not large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.estimation.record.samples import Data
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Grown
from monodyn.estimation.shooting.unknowns import Unknowns, kind_of

BLIND = 1e-6
"""Singular values below this share of the largest count as zero; derivatives are exact to about 1e-8."""
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
        """Return those of ``names`` that are an open direction by themselves: nothing depends on them."""
        if not self.open.size:
            return ()
        alone = np.linalg.norm(self.open, axis=1) > 1.0 - 1e-6
        return tuple(name for name, is_alone in zip(names, alone, strict=True) if is_alone)


def know(problem: Problem, grown: Grown) -> Knowledge:
    """Compute covariance and identifiability at the optimum.

    Args:
        problem: The problem, its data weighted with the noise as found.
        grown: The optimum.

    Returns:
        What is known. The picture's knowledge of sizes counts as data, the damping of the search does not.

    Source:
        Seber and Wild, Nonlinear Regression, 1989, section 2.1 (covariance).
    """
    count = len(problem.unknowns)
    stacked, local = [], []
    _, jacobian = problem.rows(grown.x, grown.states, grown.pieces, grown.substeps)
    for first, stop in zip(grown.pieces.first[:-1], grown.pieces.first[1:], strict=True):
        rows = jacobian[first:stop].reshape(-1, jacobian.shape[2])
        rows = rows[np.any(rows != 0, axis=1)]
        shared, states = rows[:, :count], rows[:, count:]
        q, r = np.linalg.qr(states)
        inverse = np.linalg.pinv(r, rcond=1e-12)
        onto = q.T @ shared
        stacked.append(shared - q @ onto)
        local.append((inverse @ inverse.T, inverse @ onto))
    values, vectors = np.linalg.eigh(problem.prior.information)
    stacked.append(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
    _, triangle = np.linalg.qr(np.concatenate(stacked))
    covariance, blind = _split(triangle, problem.unknowns)
    relative = relative_change(problem.unknowns, grown.x)
    unfixed, loaded = _open_directions(blind, relative)
    std = np.where(loaded, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return Knowledge(covariance, unfixed, relative, std, _with_states(covariance, local))


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
    singular = np.concatenate((singular, np.zeros(count - len(singular))))
    fixed = singular > BLIND * singular[0] if singular[0] > 0 else np.zeros(count, dtype=bool)
    basis = rows[fixed].T / singular[fixed]
    return (basis @ basis.T) / np.outer(unit, unit), rows[~fixed].T / unit[:, None]


def relative_change(unknowns: Unknowns, x: np.ndarray) -> np.ndarray:
    """Return the relative change of each parameter by unit of its coordinate, (param,).

    A damping or a centre of mass near zero is measured against the largest of its kind.
    """
    values = np.abs(unknowns.values(x))
    relative = np.ones(len(unknowns))
    for i, name in enumerate(unknowns.names):
        if not unknowns.log[i]:
            kinds = ("com_x", "com_y") if kind_of(name) in ("com_x", "com_y") else (kind_of(name),)
            like = [values[j] for j, other in enumerate(unknowns.names) if kind_of(other) in kinds]
            relative[i] = 1.0 / max(values[i], 1e-2 * max(like), 1e-12)
    return relative


def _open_directions(blind: np.ndarray, relative: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal relative changes that the data do not see, and which parameters they move."""
    if blind.shape[1] == 0:
        return blind, np.zeros(len(relative), dtype=bool)
    changes, _ = np.linalg.qr(blind * relative[:, None])
    loaded = np.linalg.norm(changes, axis=1) > LOADED
    return changes, loaded


def _with_states(covariance: np.ndarray, local: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Covariance of shared unknowns and all start states: each start state follows the shared unknowns."""
    count = len(covariance)
    width = local[0][0].shape[0] if local else 0
    full = np.zeros((count + width * len(local), count + width * len(local)))
    follow = np.concatenate([np.eye(count), *(-gain for _, gain in local)])
    full += follow @ covariance @ follow.T
    for k, (own, _) in enumerate(local):
        block = slice(count + k * width, count + (k + 1) * width)
        full[block, block] += own
    return 0.5 * (full + full.T)


def noise_factors(data: Data, difference: np.ndarray, unknowns: int) -> tuple[np.ndarray, np.ndarray]:
    """Compare the residuals with the stated noise, joint by joint.

    Each residual is held against its own stated deviation, sqrt(C_jj), because the factor scales that; a
    whitened one would be a mixture of joints.

    The second factor is what residuals that resemble their neighbours cost: n samples with autocorrelation
    rho_k know as much as n / (1 + 2 sum rho_k) independent ones.

    Args:
        data: The data, with its stated noise.
        difference: Measured less simulated positions in the record's units, NaN in gaps, (row, dof).
        unknowns: Number of unknowns that were fitted, start states included.

    Returns:
        By joint: size of the residuals against the stated noise, and the root of the factor by which
        autocorrelation reduces the number of samples, at least 1; both (dof,).

    Source:
        Bayley and Hammersley, The effective number of independent observations in an autocorrelated time
        series, 1946.
    """
    dofs = data.position.shape[1]
    size, spread = np.ones(dofs), np.ones(dofs)
    residuals = np.where(data.measured, difference / data.std, 0.0)
    share = 1.0 - min(unknowns / max(data.samples, 1), 0.9)
    for dof in range(dofs):
        use = data.measured[:, dof]
        if use.any():
            size[dof] = np.sqrt(np.mean(residuals[use, dof] ** 2) / share)
            spread[dof] = np.sqrt(_autocorrelation(data, residuals[:, dof], use))
    return np.maximum(size, 1e-6), spread


def _autocorrelation(data: Data, values: np.ndarray, use: np.ndarray) -> float:
    """1 + 2 sum of the autocorrelations up to the first that could be chance."""
    total, variance = 1.0, float(np.mean(values[use] ** 2))
    if variance <= 0:
        return 1.0
    record = np.repeat(np.arange(len(data.first) - 1), np.diff(data.first))
    for lag in range(1, len(values) // 4):
        pairs = use[lag:] & use[:-lag] & (record[lag:] == record[:-lag])
        if pairs.sum() < 8:
            break
        rho = float(np.mean(values[lag:][pairs] * values[:-lag][pairs])) / variance
        if rho < 1.5 / np.sqrt(pairs.sum()):
            break
        total += 2.0 * rho
    return total
