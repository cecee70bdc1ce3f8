"""Numba kernel of the smoothing: a weighted cubic through the neighbours of each time. Plain arrays only."""

from __future__ import annotations

import numpy as np
from numba import njit

RIDGE = 1e-12
"""Share of the trace that is added to the normal equations: it decides where several samples at one time
leave the cubic open."""


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


@njit(cache=True, nogil=True, error_model="numpy")
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
