"""First coordinates of the published search: the default search's or the given ones, and torques for them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.record.smooth import Smoothed
from monodyn.estimation.shooting.accelerations import smooth_motion
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Route
from monodyn.estimation.shooting.starts import starts
from monodyn.mechanism.simulate import rollout
from monodyn.optimize import SearchSettings
from monodyn.paper.fit_bounds import centred, true_motion
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.pose_series import PoseSeries
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.paper.torque import fourier_coefficients, inverse_dynamics, torque_of_series

LED_STEPS = 16
"""Integration steps between stamps while torques lead the motion along the poses."""
LEAD_RATE = 0.2
"""Rate by the time step at which a simulated state is led back to the poses for a start."""
SAMPLES_A_WAVE = 8
"""Times in the shortest wave of a torque at which it is computed."""
MOST_STARTS = {"fourier": 2, "free": 1}
"""Starts, at most, with a torque over time, whose many unknowns compensate for a start that is off."""


def fit_starts(
    fixed: FixedStart,
    smoothed: tuple[Smoothed, ...],
    series: PoseSeries | None,
    settings: PaperIdentifySettings,
) -> Iterator[np.ndarray]:
    """Yield starts: those of the default search without a torque, or the given values alone.

    One whose torques cannot be computed is left out; the values of the file take the place of the last.

    A Fourier series starts as that of the torque that the series of the poses requires there, eq. (10) to
    (13); free torques as those that lead the motion of the file's bodies, in the scale of the start, along
    the poses.

    Args:
        fixed: The problem.
        smoothed: Smooth motion of each record.
        series: The Fourier series of the poses, or None.
        settings: Where to begin, how many starts, and their seed.

    Yields:
        Coordinates, (param,).

    Source:
        Eq. (10) to (13) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    given = fixed.problem.unknowns.x0
    for x in [] if settings.begin == "given" else _matched(fixed, smoothed, settings):
        driven = _driven(fixed, x, smoothed, series)
        if driven is not None:
            yield driven
            given = None
    if given is not None and (driven := _driven(fixed, given, smoothed, series)) is not None:
        yield driven


def _matched(
    fixed: FixedStart, smoothed: tuple[Smoothed, ...], settings: PaperIdentifySettings
) -> Iterator[np.ndarray]:
    """Yield the starts of the default search without a torque, (param,) each."""
    count = min(settings.starts, MOST_STARTS.get(fixed.problem.mechanism.torque, settings.starts))
    undriven = posed(fixed.problem.mechanism.with_torque("friction"), fixed.problem.data)
    place = fixed.problem.unknowns.index(undriven.unknowns.names)
    route = Route(settings.piece, settings.error_bound, SearchSettings(evaluations=settings.evaluations))
    for x, _ in starts(undriven, smooth_motion(undriven, smoothed), smoothed, route, count, settings.seed):
        whole = fixed.problem.unknowns.x0.copy()
        whole[place] = x
        if fixed.problem.mechanism.torque == "free":
            whole = centred(fixed, whole)[0]
        yield whole


def _driven(
    fixed: FixedStart, x: np.ndarray, smoothed: tuple[Smoothed, ...], series: PoseSeries | None
) -> np.ndarray | None:
    """Put the torques that the poses require into ``x`` (param,); None where they are not finite."""
    if fixed.problem.mechanism.torque == "free":
        return led(fixed, x, smoothed[0])
    return x if series is None else required(fixed, x, series)


def required(fixed: FixedStart, x: np.ndarray, series: PoseSeries) -> np.ndarray | None:
    """Put in the Fourier coefficients of the torque that periodic poses require.

    The motion of the series and the torque that it requires repeat, so one period of both is taken.

    Args:
        fixed: The problem, of one record under a Fourier series.
        x: Coordinates, (param,).
        series: The series of the poses.

    Returns:
        Coordinates with the coefficients, (param,); None where the torque is not finite.

    Source:
        Eq. (11) to (13) of "Estimating dynamics on-the-fly using monocular video", 2012.
    """
    problem = fixed.problem
    mechanism = problem.mechanism_at(x)
    entries, x = mechanism.torques.entries_of(problem.unknowns.names), x.copy()
    terms, period = entries.shape[1] // 2, mechanism.values["torque.period"]
    time = np.arange(SAMPLES_A_WAVE * terms) * period / (SAMPLES_A_WAVE * terms)
    metres = np.where(problem.data.slide[0], problem.size(x), 1.0)
    torque = torque_of_series(mechanism, series.coefficients * metres, period, time)
    if not np.isfinite(torque).all():
        return None
    coefficients = fourier_coefficients(time, torque, period, terms)
    x[entries[entries >= 0]] = coefficients.T[entries >= 0]
    return x


def led(fixed: FixedStart, x: np.ndarray, smoothed: Smoothed, first: int = 0) -> np.ndarray | None:
    """Put in the torques that lead the simulated motion along the smoothed poses.

    At each stamp the torque is that of the smoothed acceleration and of how far the simulated state is off.
    Without the latter a chaotic motion is lost within a second.

    Args:
        fixed: The problem, of one record under free torques.
        x: Coordinates, (param,).
        smoothed: Smooth motion of the record.
        first: Row before which torques are not changed.

    Returns:
        Coordinates with the torques, (param,); None where the simulated motion diverges.
    """
    problem = fixed.problem
    mechanism, stretch = problem.mechanism_at(x), problem.stretch(x)
    times, stamps = problem.data.times * stretch, smoothed.time * stretch
    tree, entries = mechanism.tree, mechanism.torques.entries_of(problem.unknowns.names)
    wanted = [
        np.stack([np.interp(times, stamps, column) for column in table.T], axis=1)
        for table in true_motion(fixed, x, 0, smoothed)
    ]
    rate, (q, v) = LEAD_RATE / usual_step(times), np.split(fixed.states(x)[0], 2)
    # the error obeys e'' + 2 r e' + r^2 e = 0: it dies out without overshoot, in a few time steps
    off, x = np.zeros_like(q), x.copy()
    fixed.rollouts.add()
    for k in range(len(times)):
        if k >= first:
            goal = (wanted[0][k], wanted[1][k], wanted[2][k] + off)
            torque = inverse_dynamics(mechanism, *(part[None] for part in goal))[0]
            # strong damping makes few integration steps unstable: the motion leaves all bounds
            if not np.isfinite(torque).all():
                return None
            x[entries[:, k]] = torque
        if k:
            drive, step = problem.mechanism_at(x).drive, times[k - 1 : k + 1]
            q, v = (part[1] for part in rollout(tree, step, q, v, substeps=LED_STEPS, drive=drive))
        off = 2.0 * rate * (wanted[1][k] - v) + rate**2 * (wanted[0][k] - q)
    return x
