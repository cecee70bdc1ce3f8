"""Numba kernels: the columns of many trees at once, as ``assemble.links_of`` has those of one.

Derivatives by complex steps, and draws of what sizes may be, need the same few formulas at many values; one
after the other they cost less compiled than a numpy call for each operation.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.mechanism.solids import BLOCK, CYLINDER, SPHERE
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, COM_X, COM_Y, INERTIA, MASS
from monodyn.uncounted import UNCOUNTED


@njit(cache=True, nogil=True, error_model="numpy")
def links_of_many(plan, values, own):  # pragma: no cover - compiled
    """Compute the columns of ``Tree.links``, (dof, column, step), for many values, (param, step) of one type.

    ``plan`` is a `Packed` one, ``own`` (param,) that of ``assemble.links_of``.
    """
    dofs, columns = plan.template.shape
    params, steps = values.shape
    links = np.empty((dofs, columns, steps), values.dtype)
    numbers, rows = np.empty(params, values.dtype), np.empty(plan.forms.shape[0], values.dtype)
    for k in range(steps):
        for p in range(params):
            numbers[p] = values[p, k]
        # what follows by a form, in an order in which each needs only what has been filled in
        for t in range(plan.ties.size):
            if not own[plan.ties[t]]:
                numbers[plan.ties[t]] = _linear(plan.tie_forms, t, numbers)
        for r in range(rows.size):
            rows[r] = _linear(plan.forms, r, numbers)
        for i in range(dofs):
            for c in range(columns):
                links[i, c, k] = plan.template[i, c]
            for c in range(plan.columns.size):
                links[i, plan.columns[c], k] = numbers[plan.joints[i, c]]
            links[i, ANCHOR_X, k], links[i, ANCHOR_Y, k] = rows[2 * i], rows[2 * i + 1]
            m, cx, cy, j = plan.owned[i, 0], plan.owned[i, 1], plan.owned[i, 2], plan.owned[i, 3]
            if m < 0:
                continue
            mass, x, y, inertia = _body(plan, i, rows, numbers)
            # a mass that does not follow keeps the shape's radius of gyration, unless the inertia is given
            if own[m]:
                inertia = inertia * over(numbers[m], mass)
                mass = numbers[m]
            links[i, MASS, k] = mass
            links[i, COM_X, k] = numbers[cx] if own[cx] else x
            links[i, COM_Y, k] = numbers[cy] if own[cy] else y
            links[i, INERTIA, k] = numbers[j] if own[j] else inertia
    return links


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def over(number, by):  # pragma: no cover - compiled
    """Return a quotient, no number where it is one by zero, which a complex division refuses.

    A number over itself is one exactly, with a derivative of zero: what nothing changes has to be seen.
    """
    if by.real == 0.0 and by.imag == 0.0:
        return number * np.nan
    # the rounding of a complex division leaves a derivative of 1e-16 here and there
    if number.real == by.real and number.imag == by.imag:
        return number * 0.0 + 1.0
    return number / by


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _linear(forms, row, numbers):  # pragma: no cover - compiled
    total = numbers[0] * 0.0 + forms[row, numbers.size]
    for p in range(numbers.size):
        # most entries are zero, and a zero of what is no number is none
        if forms[row, p] != 0.0:
            total += forms[row, p] * numbers[p]
    return total


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _body(plan, i, rows, numbers):  # pragma: no cover - compiled
    """Return mass, centre of mass and inertia about it of a body, as ``assemble`` does."""
    none = numbers[0] * 0.0
    mass, x, y, inertia = none, none, none, none
    for s in range(plan.first[i], plan.first[i + 1]):
        part, px, py, gyration = _part(plan, s, rows, numbers)
        mass += part
        x += part * px
        y += part * py
    if plan.first[i + 1] - plan.first[i] == 1:
        part, px, py, gyration = _part(plan, plan.first[i], rows, numbers)
        return part, px, py, part * gyration
    x, y = over(x, mass), over(y, mass)
    for s in range(plan.first[i], plan.first[i + 1]):
        part, px, py, gyration = _part(plan, s, rows, numbers)
        inertia += part * (gyration + (px - x) * (px - x) + (py - y) * (py - y))
    return mass, x, y, inertia


@njit(cache=True, error_model="numpy", **UNCOUNTED)
def _part(plan, s, rows, numbers):  # pragma: no cover - compiled
    """Return mass, centre and squared radius of gyration of one solid."""
    kind, row, weight, dense = plan.solids[s, 0], plan.solids[s, 1], plan.solids[s, 2], plan.solids[s, 3]
    along, across, deep = rows[row], rows[row + 1], rows[row + 2]
    square = across * across
    if kind == BLOCK:
        volume = plan.shapes[s, 0] * along * across * deep
        gyration = plan.shapes[s, 1] * along * along + plan.shapes[s, 2] * square
    elif kind == SPHERE:
        volume, gyration = np.pi / 6 * across * square, square / 10
    else:
        flat, rise = along * along, deep * deep
        length = np.sqrt(flat + rise)
        bar = np.pi / 4 * square * length
        about, beside, volume = square / 8, length * length / 12 + square / 16, bar
        if kind != CYLINDER:
            caps = np.pi / 6 * across * square
            volume = bar + caps
            reach = square / 10 + length * length / 4 + 3 / 16 * length * across
            about = over(bar * about + caps * square / 10, volume)
            beside = over(bar * beside + caps * reach, volume)
        gyration = over(beside * flat + about * rise, flat + rise)
    mass = numbers[weight] * volume if dense else numbers[weight]
    return mass, rows[row + 3], rows[row + 4], gyration
