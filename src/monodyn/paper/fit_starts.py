"""First coordinates of the published search: the default search's, and torques that follow the poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.accelerations import smooth_motion
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Route
from monodyn.estimation.shooting.starts import starts
from monodyn.mechanism.simulate import rollout
from monodyn.optimize import SearchSettings
from monodyn.paper.fit_bounds import centred, true_motion
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.torque import fourier_coefficients, inverse_dynamics

LED_STEPS = 16
"""Integration steps between stamps while torques lead the motion along the poses."""
LEAD_RATE = 0.2
"""Rate by the time step at which a simulated state is led back to the poses for a start."""
MOST_STARTS = {"fourier": 2, "free": 1}
"""Starts, at most, with a torque over time, whose many unknowns compensate for a start that is off."""


def fit_starts(
    fixed: FixedStart, smoothed: tuple[Smoothed, ...], start: np.ndarray | None, settings: IdentifySettings
) -> Iterator[np.ndarray]:
    """Yield starts: that of the guessed period, then those of the default search without a torque.

    A Fourier series starts as that of the torque that the smoothed poses require there, eq. (12) and (13);
    free torques as those that lead the motion of the file's bodies, in the scale of the start, along the
    poses.

    Args:
        fixed: The problem.
        smoothed: Smooth motion of each record.
        start: Coordinates at which a torque of the period explains the accelerations, (param,), or None.
        settings: How many starts, and their seed.

    Yields:
        Coordinates, (param,).

    Source:
        Eq. (12) and (13) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    count = min(settings.starts, MOST_STARTS.get(fixed.problem.mechanism.torque, settings.starts))
    if start is not None:
        yield _driven(fixed, start, smoothed)
        count -= 1
    if count < 1:
        return
    undriven = posed(fixed.problem.mechanism.with_torque("friction"), fixed.problem.data)
    place = fixed.problem.unknowns.index(undriven.unknowns.names)
    route = Route(settings.piece, settings.error_bound, SearchSettings(evaluations=settings.evaluations))
    for x, _ in starts(undriven, smooth_motion(undriven, smoothed), smoothed, route, count, settings.seed):
        whole = fixed.problem.unknowns.x0.copy()
        whole[place] = x
        if fixed.problem.mechanism.torque == "free":
            whole = centred(fixed, whole)[0]
        yield _driven(fixed, whole, smoothed)


def _driven(fixed: FixedStart, x: np.ndarray, smoothed: tuple[Smoothed, ...]) -> np.ndarray:
    """Put the coefficients of the torque that smoothed poses require into ``x`` (param,)."""
    if fixed.problem.mechanism.torque == "free":
        return led(fixed, x, smoothed[0])
    if fixed.problem.mechanism.torque != "fourier":
        return x
    mechanism, stretch, parts = fixed.problem.mechanism_at(x), fixed.problem.stretch(x), []
    for k, found in enumerate(smoothed):
        q, v, a = true_motion(fixed, x, k, found)
        # at the ends smoothing has neighbours on one side only
        parts.append((found.time[2:-2] * stretch, inverse_dynamics(mechanism, q, v, a)[2:-2]))
    time, torque = (np.concatenate(part) for part in zip(*parts, strict=True))
    entries = mechanism.drive_entries(fixed.problem.unknowns.names)
    x = x.copy()
    period = mechanism.values["torque.period"]
    coefficients = fourier_coefficients(time, torque, period, entries.shape[1] // 2)
    x[entries[entries >= 0]] = coefficients.T[entries >= 0]
    return x


def led(fixed: FixedStart, x: np.ndarray, smoothed: Smoothed, first: int = 0) -> np.ndarray:
    """Put in the torques that lead the simulated motion along the smoothed poses.

    At each stamp the torque is that of the smoothed acceleration and of how far the simulated state is off.
    Without the latter a chaotic motion is lost within a second.

    Args:
        fixed: The problem, of one record under free torques.
        x: Coordinates, (param,).
        smoothed: Smooth motion of the record.
        first: Row before which torques are not changed.

    Returns:
        Coordinates with the torques, (param,).
    """
    problem = fixed.problem
    mechanism, stretch = problem.mechanism_at(x), problem.stretch(x)
    times, stamps = problem.data.times * stretch, smoothed.time * stretch
    tree, entries = mechanism.tree, mechanism.drive_entries(problem.unknowns.names)
    wanted = [
        np.stack([np.interp(times, stamps, column) for column in table.T], axis=1)
        for table in true_motion(fixed, x, 0, smoothed)
    ]
    rate, (q, v) = LEAD_RATE / np.median(np.diff(times)), np.split(fixed.states(x)[0], 2)
    # the error obeys e'' + 2 r e' + r^2 e = 0: it dies out without overshoot, in a few time steps
    off, x = np.zeros_like(q), x.copy()
    for k in range(len(times)):
        if k >= first:
            goal = (wanted[0][k], wanted[1][k], wanted[2][k] + off)
            x[entries[:, k]] = inverse_dynamics(mechanism, *(part[None] for part in goal))[0]
        if k:
            drive, step = problem.mechanism_at(x).drive, times[k - 1 : k + 1]
            q, v = (part[1] for part in rollout(tree, step, q, v, substeps=LED_STEPS, drive=drive))
        off = 2.0 * rate * (wanted[1][k] - v) + rate**2 * (wanted[0][k] - q)
    return x
