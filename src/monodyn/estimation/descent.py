"""Starts and bounds of the published least squares in, the best end of its search out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.grow import Route, choose_substeps
from monodyn.estimation.held import Held
from monodyn.estimation.problem import posed, smooth_motion
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.smooth import Smoothed
from monodyn.estimation.starts import starts
from monodyn.estimation.torque import fourier_coefficients, inverse_dynamics
from monodyn.estimation.unknowns import kind_of
from monodyn.estimation.verdict import motion_sizes
from monodyn.mechanism.tree import DAMPING, FRICTION, STIFFNESS
from monodyn.optimize import Minimum, SearchSettings
from monodyn.types import Progress

REACH = float(np.log(10.0))
"""Positive parameters are looked for within a factor of ten of their start."""
TYPICAL = 0.1
"""Typical change of a logarithm, by which the search scales it."""
FINE = 1e-3
"""The search ends when the cost falls by less than this share of what the stated noise alone costs."""
WEAKEST = 0.01
"""Modes of free torques below this share of the strongest are taken as that strong."""
MOST_DRIVEN = 2
"""Starts at the most with a torque over time, whose many unknowns make up for a start that is off."""
CLOSE = 0.02
"""A start is good, and no other is tried, when the rms residual is below this share of the motion."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where the search ended.

    Attributes:
        held: The problem, with the scales and integration steps of the search.
        x: Coordinates, (param,).
        bounds: Lower and upper bounds of the coordinates, (2, param).
        evaluations: Rollouts from all starts.
        converged: True when the search reached its minimum.
        tried: Starts that were tried.
        error: Integration error [rad or m].
    """

    held: Held
    x: np.ndarray
    bounds: np.ndarray
    evaluations: int
    converged: bool
    tried: int
    error: float

    @property
    def size(self) -> float:
        """Sum of the squares of the residuals."""
        return float(np.sum(self.held.residuals_at(self.x) ** 2))


def descend(
    held: Held,
    smoothed: tuple[Smoothed, ...],
    start: np.ndarray | None,
    settings: IdentifySettings,
    progress: Progress | None = None,
) -> Descent | None:
    """Search from one start after the other until the motion is explained.

    Args:
        held: The problem; its scales and integration steps are chosen here.
        smoothed: Smooth motion of each record.
        start: Coordinates at which a torque of the period explains the accelerations, (param,), or None.
        settings: Starts, seed, evaluations (each as many rollouts as a gradient takes), error bound.
        progress: Called as ``progress("identify", done, None)`` after each start.

    Returns:
        The best end, or None where no start can be simulated.
    """
    motion = motion_sizes(held.data)
    best: Descent | None = None
    evaluations, tried = 0, 0
    for x in _starts(held, smoothed, start, settings):
        found = _search(held, x, smoothed, settings)
        tried += 1
        if found is not None:
            evaluations += found.evaluations
            best = found if best is None or found.size < best.size else best
        if progress is not None:
            progress("identify", tried, None)
        if found is not None and (_rms(found) < CLOSE * motion).all():
            break
    return None if best is None else replace(best, evaluations=evaluations, tried=tried)


def _rms(found: Descent) -> np.ndarray:
    """Root mean square of simulated less measured positions in the record's units, (dof,)."""
    held = found.held
    difference = held.differences(found.x, held.states(found.x), held.pieces, held.substeps)
    return np.sqrt(np.nanmean(difference**2, axis=0))


def _starts(
    held: Held, smoothed: tuple[Smoothed, ...], start: np.ndarray | None, settings: IdentifySettings
) -> Iterator[np.ndarray]:
    """Yield starts: that of the guessed period, then those of the default search without a torque.

    A Fourier series starts as that of the torque that the smoothed poses ask for there, eq. (12) and (13);
    free torques start at zero.
    """
    driven = held.mechanism.torque != "friction"
    count = min(settings.starts, MOST_DRIVEN) if driven else settings.starts
    if start is not None:
        yield _driven(held, start, smoothed)
        count -= 1
    if count < 1:
        return
    undriven = posed(held.mechanism.with_torque("friction"), held.data)
    place = held.unknowns.index(undriven.unknowns.names)
    route = Route(settings.piece, settings.error_bound, SearchSettings(evaluations=settings.evaluations))
    for x, _ in starts(undriven, smooth_motion(undriven, smoothed), smoothed, route, count, settings.seed):
        whole = held.unknowns.x0.copy()
        whole[place] = x
        yield _driven(held, whole, smoothed)


def _driven(held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> np.ndarray:
    """Put the coefficients of the torque that smoothed poses ask for into ``x`` (param,)."""
    if held.mechanism.torque != "fourier":
        return x
    mechanism, parts = held.mechanism_at(x), []
    for k, found in enumerate(smoothed):
        q, v, a = _true_motion(held, x, k, found)
        parts.append((found.time[2:-2] * held.stretch(x), inverse_dynamics(mechanism, q, v, a)[2:-2]))
    time, torque = (np.concatenate(part) for part in zip(*parts, strict=True))
    ways = mechanism.drive_ways(held.unknowns.names)
    period = mechanism.values["torque.period"]
    coefficients = fourier_coefficients(time, torque, period, ways.shape[1] // 2)
    x = x.copy()
    x[ways[ways >= 0]] = coefficients.T[ways >= 0]
    return x


def _true_motion(
    held: Held, x: np.ndarray, record: int, found: Smoothed
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smoothed positions, rates and accelerations in metres and true time, each (frame, dof)."""
    unit, stretch = np.where(held.data.slide[record], held.size(x), 1.0), held.stretch(x)
    return found.position * unit, found.velocity * unit / stretch, found.acceleration * unit / stretch**2


def _search(
    held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...], settings: IdentifySettings
) -> Descent | None:
    """Search from one start; again where the end needs more integration steps than the start did."""
    held, bounds = _ranged(held, x, smoothed)
    x = np.clip(x, *bounds)
    evaluations, converged = 0, False
    error = np.inf
    for _ in range(3):
        substeps, error = choose_substeps(held, x, held.states(x), held.pieces, settings.error_bound)
        if evaluations and substeps <= held.substeps:
            break
        held = replace(held, substeps=max(substeps, held.substeps))
        end = _minimum(held, x, bounds, settings.evaluations * (len(x) + 1))
        evaluations += end.evaluations
        if not np.isfinite(end.value):
            return None
        x, converged = end.x, end.converged
    return Descent(held, x, bounds, evaluations, converged, 1, error)


def _minimum(held: Held, x: np.ndarray, bounds: np.ndarray, most: int) -> Minimum:
    """Search within bounds (2, param) by the paper's solver, unknowns in units of their scale.

    Free torques are searched along their modes instead, of which the bounds are kept by the penalty.
    """
    from monodyn.optimize import bounded_bfgs

    free = held.mechanism.torque == "free"
    turned = np.array([free and ".torque." in name for name in held.unknowns.names])
    turn = held.change[:, None] * _modes(held, x, turned)
    low, high = (
        np.where(turned, side, (end - x) / held.change)
        for side, end in zip((-np.inf, np.inf), bounds, strict=True)
    )
    cost = 0.5 * float(np.sum(held.residuals_at(x) ** 2))

    def residuals(z: np.ndarray) -> np.ndarray:
        at = x + turn @ z
        if ((at < bounds[0]) | (at > bounds[1]))[turned].any():
            return np.full(1, np.nan)
        return held.residuals_at(np.clip(at, *bounds)).ravel()

    tolerance = float(np.clip(FINE * _noise_cost(held) / max(cost, 1e-300), 1e-10, 1e-4))
    end = bounded_bfgs(residuals, np.zeros(len(x)), low, high, most=most, tolerance=tolerance)
    best = x + turn @ end.x
    for bound in bounds:
        best = np.where(np.abs(best - bound) < 1e-9 * held.change, bound, best)
    return replace(end, x=np.clip(best, *bounds))


def _modes(held: Held, x: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Directions of the unknowns, in scales, with those of ``turned`` made to move the motion alike.

    A torque early in a record moves all that follows and a late one hardly anything, and neighbours do
    nearly the same: without this a quasi-Newton search takes thousands of steps. (param, param).
    """
    modes = np.eye(len(x))
    if turned.any():
        _, jacobian = held.rows(x, held.states(x), held.pieces, held.substeps)
        along = jacobian.reshape(-1, len(x))[:, turned] * held.change[turned]
        _, sizes, vectors = np.linalg.svd(along)
        sizes = np.append(sizes, np.zeros(len(vectors) - len(sizes)))
        modes[np.ix_(turned, turned)] = vectors.T / np.hypot(sizes, WEAKEST * sizes[0])
    return modes


def _noise_cost(held: Held) -> float:
    """Cost that the stated noise of the poses alone would make."""
    if held.white is not None:
        return 0.5 * float(np.isfinite(held.target).sum())
    return 0.5 * float(np.nansum(held.data.std**2))


def _ranged(held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> tuple[Held, np.ndarray]:
    """Choose scales and bounds of the unknowns about a start; bounds are (2, param)."""
    load, rate = _loads(held, x, smoothed)
    unknowns = held.unknowns
    scale, low, high = np.full(len(x), TYPICAL), x - REACH, x + REACH
    for p, name in enumerate(unknowns.names):
        if unknowns.log[p]:
            continue
        joint = next((i for i, j in enumerate(held.mechanism.joints) if name.startswith(f"{j.name}.")), None)
        kind = kind_of(name)
        if joint is not None and ".torque." in name:
            scale[p], low[p], high[p] = 0.1 * load[joint], -10.0 * load[joint], 10.0 * load[joint]
        elif joint is not None and kind in ("damping", "friction"):
            most = load[joint] / (rate[joint] if kind == "damping" else 1.0)
            scale[p], low[p], high[p] = 0.01 * most, 0.0, max(most, 10.0 * x[p])
        else:
            scale[p], low[p], high[p] = max(abs(x[p]), 1e-2), -np.inf, np.inf
    low, high = np.maximum(low, unknowns.lower), np.minimum(high, unknowns.upper)
    return replace(held, change=scale), np.stack((np.minimum(low, high), high))


def _loads(held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Typical torque of weight and inertia [N m or N] and rate [rad/s or m/s] of each joint, (dof,)."""
    mechanism = held.mechanism_at(x)
    bare = mechanism.tree.links.copy()
    bare[:, [DAMPING, FRICTION, STIFFNESS]] = 0.0
    squares, rates, rows = np.zeros(len(bare)), np.zeros(len(bare)), 0
    for k, found in enumerate(smoothed):
        q, v, a = _true_motion(held, x, k, found)
        still = np.zeros_like(v)
        weight = inverse_dynamics(mechanism, q, still, still, links=bare)
        inertia = inverse_dynamics(mechanism, q, v, a, links=bare, gravity=np.zeros(2))
        squares += (weight**2 + inertia**2).sum(axis=0)
        rates += (v**2).sum(axis=0)
        rows += len(q)
    return np.maximum(np.sqrt(squares / rows), 1e-12), np.maximum(np.sqrt(rates / rows), 1e-6)
