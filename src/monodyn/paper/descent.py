"""Starts and bounds of the published least squares in, the best end of its search out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed, smooth_motion
from monodyn.estimation.shooting.shoot import Route, choose_substeps
from monodyn.estimation.shooting.starts import starts
from monodyn.estimation.shooting.unknowns import kind_of
from monodyn.estimation.verdict.trust import motion_sizes
from monodyn.mechanism.tree import PASSIVE
from monodyn.optimize import Minimum, SearchSettings
from monodyn.paper.fixed_start import Held
from monodyn.paper.torque import fourier_coefficients, inverse_dynamics
from monodyn.types import Progress

REACH = float(np.log(10.0))
"""Positive parameters are looked for within a factor of ten of what file or picture say of them."""
REACH_FREE = float(np.log(3.0))
"""Lengths beside free torques within a factor of three: any of them would do."""
MOST_LOADS = {"fourier": 10.0, "free": 3.0}
"""Torques up to so many times that of weight and inertia."""
TYPICAL = 0.1
"""Typical change of a logarithm, by which the search scales it."""
FINE = 1e-3
"""The search ends when the cost falls by less than this share of what the stated noise alone costs."""
WEAKEST = 0.01
"""Modes of free torques below this share of the strongest are taken as that strong."""
LEAD = 0.2
"""Rate by the time step at which a simulated state is led back to the poses for a start."""
GROWN = 8
"""Samples by which the part of a record that free torques are fitted to grows."""
MOST_GROWN = 2500
"""Rollouts for each of those parts at the most."""
LED = 16
"""Integration steps between stamps for that."""
MOST_STARTS = {"fourier": 2, "free": 1}
"""Starts at the most with a torque over time, whose many unknowns make up for a start that is off."""
EACH = 4
"""Evaluations of a quasi-Newton search for one of Gauss and Newton."""
MOST_ROLLOUTS = 20000
"""Rollouts from all starts at the most."""
SHOWN = 500
"""Progress is shown every so many rollouts."""
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
        progress: Called as ``progress("identify", rollouts, None)`` every few hundred rollouts.

    Returns:
        The best end, or None where no start can be simulated.
    """
    motion = motion_sizes(held.data)
    best: Descent | None = None
    evaluations, tried, tick = 0, 0, _ticker(progress)
    for x in _starts(held, smoothed, start, settings):
        found = _search(held, x, smoothed, settings, MOST_ROLLOUTS - evaluations, tick)
        tried += 1
        if found is not None:
            evaluations += found.evaluations
            best = found if best is None or found.size < best.size else best
        if evaluations >= MOST_ROLLOUTS or (found is not None and (_rms(found) < CLOSE * motion).all()):
            break
    return None if best is None else replace(best, evaluations=evaluations, tried=tried)


def _ticker(progress: Progress | None) -> Callable[[], None]:
    """Return what counts rollouts and shows every few hundred of them."""
    count = 0

    def tick() -> None:
        nonlocal count
        count += 1
        if progress is not None and count % SHOWN == 0:
            progress("identify", count, None)

    return tick


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
    free torques as those that lead the motion of the file's bodies, in the scale of the start, along the
    poses.
    """
    count = min(settings.starts, MOST_STARTS.get(held.mechanism.torque, settings.starts))
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
        if held.mechanism.torque == "free":
            whole = _centre(held, whole)[0]
        yield _driven(held, whole, smoothed)


def _driven(held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> np.ndarray:
    """Put the coefficients of the torque that smoothed poses ask for into ``x`` (param,)."""
    if held.mechanism.torque == "free":
        return _led(held, x, smoothed[0])
    if held.mechanism.torque != "fourier":
        return x
    mechanism, parts = held.mechanism_at(x), []
    for k, found in enumerate(smoothed):
        q, v, a = _true_motion(held, x, k, found)
        parts.append((found.time[2:-2] * held.stretch(x), inverse_dynamics(mechanism, q, v, a)[2:-2]))
    time, torque = (np.concatenate(part) for part in zip(*parts, strict=True))
    ways = mechanism.drive_entries(held.unknowns.names)
    x = x.copy()
    period = mechanism.values["torque.period"]
    coefficients = fourier_coefficients(time, torque, period, ways.shape[1] // 2)
    x[ways[ways >= 0]] = coefficients.T[ways >= 0]
    return x


def _led(held: Held, x: np.ndarray, smoothed: Smoothed, first: int = 0) -> np.ndarray:
    """Put the torques into ``x`` (param,) that lead the simulated motion along the smoothed poses.

    At each stamp the torque is that of the smoothed acceleration and of how far the simulated state is off.
    Without the latter a chaotic motion is lost within a second. Torques before the row ``first`` stay.
    """
    from monodyn.mechanism.simulate import rollout

    mechanism, times = held.mechanism_at(x), held.data.times * held.stretch(x)
    stamps, tree, ways = (
        smoothed.time * held.stretch(x),
        mechanism.tree,
        mechanism.drive_entries(held.unknowns.names),
    )
    wanted = [
        np.stack([np.interp(times, stamps, column) for column in table.T], axis=1)
        for table in _true_motion(held, x, 0, smoothed)
    ]
    rate, (q, v) = LEAD / np.median(np.diff(times)), np.split(held.states(x)[0], 2)
    off, x = np.zeros_like(q), x.copy()
    for k in range(len(times)):
        if k >= first:
            asked = (wanted[0][k], wanted[1][k], wanted[2][k] + off)
            x[ways[:, k]] = inverse_dynamics(mechanism, *(part[None] for part in asked))[0]
        if k:
            drive = held.mechanism_at(x).drive
            q, v = (part[1] for part in rollout(tree, times[k - 1 : k + 1], q, v, substeps=LED, drive=drive))
        off = 2.0 * rate * (wanted[1][k] - v) + rate**2 * (wanted[0][k] - q)
    return x


def _true_motion(
    held: Held, x: np.ndarray, record: int, found: Smoothed
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smoothed positions, rates and accelerations in metres and true time, each (frame, dof)."""
    unit, stretch = np.where(held.data.slide[record], held.size(x), 1.0), held.stretch(x)
    return found.position * unit, found.velocity * unit / stretch, found.acceleration * unit / stretch**2


def _search(
    held: Held,
    x: np.ndarray,
    smoothed: tuple[Smoothed, ...],
    settings: IdentifySettings,
    most: int,
    tick: Callable[[], None],
) -> Descent | None:
    """Search from one start; again where the end needs more integration steps than the start did."""
    held, bounds = _ranged(held, x, smoothed)
    x = np.clip(x, *bounds)
    evaluations, converged = 0, False
    if held.mechanism.torque == "free":
        x, evaluations = _grown(held, x, bounds, smoothed[0], most // 2, tick)
    error = np.inf
    for _ in range(3):
        substeps, error = choose_substeps(held, x, held.states(x), held.pieces, settings.error_bound)
        if evaluations and substeps <= held.substeps:
            break
        held = replace(held, substeps=max(substeps, held.substeps))
        allowed = min(EACH * settings.evaluations * (len(x) + 1), most - evaluations)
        if allowed <= len(x):
            break
        end = _minimum(held, x, bounds, allowed, tick)
        evaluations += end.evaluations
        if not np.isfinite(end.value):
            return None
        x, converged = end.x, end.converged
    return Descent(held, x, bounds, evaluations, converged, 1, error)


def _grown(
    held: Held, x: np.ndarray, bounds: np.ndarray, smoothed: Smoothed, most: int, tick: Callable[[], None]
) -> tuple[np.ndarray, int]:
    """Fit free torques to the first samples, then to more, each time led on from the end of what fits."""
    rows, evaluations = len(held.data.times), 0
    for stop in range(GROWN, rows - 1, GROWN):
        late = (np.arange(rows) >= stop)[:, None]
        part = replace(held, substeps=LED, target=np.where(late, np.nan, held.target))
        if not np.isfinite(part.residuals_at(x)).all() or evaluations >= most:
            break
        end = _minimum(part, x, bounds, min(MOST_GROWN, most - evaluations), tick)
        evaluations += end.evaluations
        x = np.clip(_led(held, end.x, smoothed, stop), *bounds)
    return x, evaluations


def _minimum(held: Held, x: np.ndarray, bounds: np.ndarray, most: int, tick: Callable[[], None]) -> Minimum:
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
        tick()
        at = x + turn @ z
        if ((at < bounds[0]) | (at > bounds[1]))[turned].any():
            return np.full(1, np.nan)
        return held.residuals_at(np.clip(at, *bounds)).ravel()

    tolerance = float(np.clip(FINE * _noise_cost(held) / max(cost, 1e-300), 1e-10, 1e-4))
    end = bounded_bfgs(residuals, np.zeros(len(x)), (low, high), most=most, tolerance=tolerance)
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
    """Choose scales and bounds of the unknowns for a start; bounds are (2, param)."""
    centre, reach = _centre(held, x)
    load, rate = _loads(held, centre, smoothed)
    unknowns, loads = held.unknowns, MOST_LOADS.get(held.mechanism.torque, 0.0)
    scale, low, high = np.full(len(x), TYPICAL), centre - reach, centre + reach
    for p, name in enumerate(unknowns.names):
        if unknowns.log[p]:
            continue
        joint = next((i for i, j in enumerate(held.mechanism.joints) if name.startswith(f"{j.name}.")), None)
        kind = kind_of(name)
        if joint is not None and ".torque." in name:
            scale[p], low[p], high[p] = 0.1 * load[joint], -loads * load[joint], loads * load[joint]
        elif joint is not None and kind in ("damping", "friction"):
            most = load[joint] / (rate[joint] if kind == "damping" else 1.0)
            scale[p], low[p], high[p] = 0.01 * most, 0.0, max(most, 10.0 * x[p])
        else:
            scale[p], low[p], high[p] = max(abs(x[p]), 1e-2), -np.inf, np.inf
    low, high = np.maximum(low, unknowns.lower), np.minimum(high, unknowns.upper)
    return replace(held, change=scale), np.stack((np.minimum(low, high), high))


def _centre(held: Held, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle of the bounds of logarithms and their half width, both (param,).

    Sizes are looked for about those of file or picture, lengths in the common scale of the start ``x``: a
    start that matches accelerations may have bodies that are a tenth or a thousand times as thick.
    """
    unknowns = held.unknowns
    kinds = [kind_of(name) for name in unknowns.names]
    length, thickness = (np.array([kind == which for kind in kinds]) for which in ("length", "thickness"))
    sized = unknowns.x0 + np.where(length, np.log(held.size(x)), 0.0)
    centre = np.where((length | thickness) & unknowns.log, sized, x)
    free = held.mechanism.torque == "free"
    return centre, np.where(length & free, REACH_FREE, REACH)


def _loads(held: Held, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Typical torque of weight and inertia [N m or N] and rate [rad/s or m/s] of each joint, (dof,)."""
    mechanism = held.mechanism_at(x)
    links = mechanism.tree.links.copy()
    links[:, PASSIVE] = 0.0
    bare = replace(mechanism.tree, links=links)
    floating = replace(bare, gravity=np.zeros(2))
    squares, rates, rows = np.zeros(len(links)), np.zeros(len(links)), 0
    for k, found in enumerate(smoothed):
        q, v, a = _true_motion(held, x, k, found)
        still = np.zeros_like(v)
        weight = inverse_dynamics(mechanism, q, still, still, tree=bare)
        inertia = inverse_dynamics(mechanism, q, v, a, tree=floating)
        squares += (weight**2 + inertia**2).sum(axis=0)
        rates += (v**2).sum(axis=0)
        rows += len(q)
    return np.maximum(np.sqrt(squares / rows), 1e-12), np.maximum(np.sqrt(rates / rows), 1e-6)
