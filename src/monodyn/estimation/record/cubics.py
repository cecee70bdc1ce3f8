"""Numba kernels of the smoothing: weighted cubics through the neighbours of each time. Plain arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.uncounted import UNCOUNTED

MOST_ROUNDS = 8
"""Times that weights are taken from residuals and the curve is fitted again, at most."""
RIDGE = 1e-12
"""Share of the trace that is added to the normal equations: it decides where several samples at one time
leave the cubic open."""


@njit(cache=True, nogil=True, error_model="numpy")
def smooth_curve(times, values, at, widths, least, normal, fewest):  # pragma: no cover - compiled
    """Fit with each number of neighbours, keep the one that predicts left-out samples best.

    Args:
        times: Times of the samples [s], (sample,).
        values: Samples, (sample,).
        at: Requested times [s], (frame,).
        widths: Numbers of neighbours, each at most the number of samples, int (width,).
        least: Smallest noise that is believed.
        normal: Median of the absolute value of a standard normal variable.
        fewest: With fewer samples left none counts as far off.

    Returns:
        Value, slope, second derivative and its standard deviation, (4, frame); standard deviation of the
        samples about the curve; and whether a sample is far off, bool (sample,).
    """
    # the error of a width is that of samples predicted by their neighbours alone: more neighbours average out
    # more noise and miss more of the motion, and it is least where the two balance
    width, noise, least_error, far = 0, 0.0, np.inf, np.zeros(times.size, np.bool_)
    for count in widths:
        found, off, error = _robust(times, values, count, least, normal)
        if width == 0 or error < least_error:
            width, noise, least_error, far = count, found, error, off
    if times.size - far.sum() < fewest:
        far[:] = False
    # gross errors are left out of the curve itself; the samples that stay have equal weight
    near = ~far
    times, values = times[near], values[near]
    count = min(width, times.size)
    rows, _ = local_cubics(times, values, np.ones(times.size), at, neighbours(times, at, count), count)
    rows[3] *= noise
    return rows, noise, far


@njit(cache=True, nogil=True, error_model="numpy")
def _robust(times, values, count, least, normal):  # pragma: no cover - compiled
    """Fit at the samples, down-weight those far off, fit again.

    Returns the noise of the samples, whether each is far off, and the mean error of a sample left out.
    """
    first, weight = neighbours(times, times, count), np.ones(times.size)
    left_out, rest, size = np.empty(times.size), np.empty(times.size), 0.0
    for _ in range(MOST_ROUNDS):
        curve, share = local_cubics(times, values, weight, times, first, count)
        # a sample that takes part in its own estimate with share s is s nearer to it than to one without it:
        # residual / (1 - s) is the residual if it were left out
        for k in range(times.size):
            rest[k] = max(1.0 - share[k], 0.05)
            left_out[k] = abs(values[k] - curve[0, k]) / rest[k]
        size = max(np.median(left_out) / normal, least)
        if left_out.max() < 6.0 * size:
            break
        # bisquare weights: a sample six typical residuals off no longer pulls at the curve, however far off;
        # the rest of a weight keeps a curve among such samples alone
        for k in range(times.size):
            far_off = (left_out[k] / (6.0 * size)) ** 2
            weight[k] = max(1.0 - far_off, 0.0) ** 2 + 1e-6 / (1.0 + far_off)
    residual = left_out * np.sqrt(rest)
    noise = max(np.median(residual) / normal, least)
    far = (left_out > 8.0 * size) & (residual > 8.0 * noise)
    return noise, far, np.mean(np.minimum(left_out, 6.0 * size))


@njit(cache=True, nogil=True, error_model="numpy")
def neighbours(times, at, count):  # pragma: no cover - compiled
    """Return the first of the ``count`` samples nearest to each requested time, int (frame,).

    ``times`` (sample,) increase; ``at`` is (frame,).
    """
    first = np.empty(at.size, np.int64)
    for f in range(at.size):
        # from a window centred by rank it slides while the sample that enters is nearer than the one that
        # leaves: times increase, so that a window which no longer moves is the nearest
        begin = min(max(np.searchsorted(times, at[f]) - count // 2, 0), times.size - count)
        while begin + count < times.size and abs(times[begin + count] - at[f]) < abs(times[begin] - at[f]):
            begin += 1
        while begin > 0 and abs(times[begin - 1] - at[f]) < abs(times[begin + count - 1] - at[f]):
            begin -= 1
        first[f] = begin
    return first


@njit(cache=True, nogil=True, error_model="numpy")
def local_cubics(times, values, weight, at, first, count):  # pragma: no cover - compiled
    """Fit a polynomial, cubic where the samples suffice, about each requested time.

    Args:
        times: Times of the samples [s], (sample,).
        values: Samples, (sample,).
        weight: Weight of each sample, (sample,).
        at: Requested times [s], (frame,).
        first: First of the neighbours of each requested time, int (frame,).
        count: Number of neighbours.

    Returns:
        Value, slope, second derivative and its standard deviation for unit noise, (4, frame); and the share
        of the nearest sample in the value, (frame,).
    """
    terms = min(3, count - 2) + 1
    rows, share = np.zeros((4, at.size)), np.zeros(at.size)
    squared, basis, own = np.zeros((terms, terms)), np.ones(terms), np.ones(terms)
    # the normal equations, then what they are solved for: the samples, and the units of value and curvature
    system = np.zeros((terms, terms + 3))
    for f in range(at.size):
        begin = first[f]
        # times are divided by the distance of the farthest neighbour, so that powers stay of one size
        reach, nearest, near = 0.0, np.inf, 0.0
        for k in range(begin, begin + count):
            reach = max(reach, abs(times[k] - at[f]))
        reach *= 1.0 + 1.0 / count
        system[:], squared[:] = 0.0, 0.0
        for k in range(begin, begin + count):
            x = (times[k] - at[f]) / reach
            kernel = (1.0 - abs(x) ** 3) ** 3 * weight[k]
            for i in range(1, terms):
                basis[i] = basis[i - 1] * x
            if abs(x) < nearest:
                nearest, near = abs(x), kernel
                own[:] = basis
            for i in range(terms):
                system[i, terms] += kernel * basis[i] * values[k]
                for j in range(terms):
                    system[i, j] += kernel * basis[i] * basis[j]
                    squared[i, j] += kernel * kernel * basis[i] * basis[j]
        trace = 0.0
        for i in range(terms):
            trace += system[i, i]
        for i in range(terms):
            system[i, i] += RIDGE * trace
        system[0, terms + 1] = 1.0
        if terms > 2:
            system[2, terms + 2] = 1.0
        _eliminate(system, terms)
        second = 2.0 / reach**2
        rows[0, f], rows[1, f] = system[0, terms], system[1, terms] / reach
        variance = 0.0
        for i in range(terms):
            share[f] += near * own[i] * system[i, terms + 1]
            for j in range(terms):
                variance += system[i, terms + 2] * squared[i, j] * system[j, terms + 2]
        if terms > 2:
            rows[2, f], rows[3, f] = system[2, terms] * second, np.sqrt(max(variance, 0.0)) * second
    return rows, share


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _eliminate(system, terms):  # pragma: no cover - compiled
    """Solve in place the square left part of ``system`` for its further columns, by Gauss and Jordan."""
    for i in range(terms):
        pivot = i
        for j in range(i + 1, terms):
            if abs(system[j, i]) > abs(system[pivot, i]):
                pivot = j
        for c in range(system.shape[1]):
            system[i, c], system[pivot, c] = system[pivot, c], system[i, c]
        for c in range(system.shape[1] - 1, i - 1, -1):
            system[i, c] /= system[i, i]
        for j in range(terms):
            if j != i:
                factor = system[j, i]
                for c in range(i, system.shape[1]):
                    system[j, c] -= factor * system[i, c]
