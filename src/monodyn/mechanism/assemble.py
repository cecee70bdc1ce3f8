"""From parameter values to the tree and the shapes: the formulas of masses and inertias.

Written once for numbers and for arrays of complex steps, so that ``derivatives`` differentiates exactly what
``links_of`` computes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from monodyn.arrays import plain
from monodyn.mechanism import tree
from monodyn.mechanism.plan import JOINT_COLUMNS, Plan
from monodyn.mechanism.solids import BLOCK, CYLINDER, SPHERE, Solid

STEP = 1e-30
"""Complex step; its square vanishes next to any value, so the derivative is exact to rounding."""


def links_of(plan: Plan, values: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Compute the columns of ``Tree.links``.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, (param,), or (param, step) for many at once.
        own: True (param,) where a mass, centre of mass or inertia has its own value instead of following.

    Returns:
        (dof, column), or (dof, column, step).
    """
    rest, values = values.shape[1:], settled(plan, values, own)
    rows: Any = plan.forms[:, :-1] @ values + plan.forms[:, -1].reshape(-1, *(1,) * len(rest))
    numbers: Any = values
    # Plain floats are several times as fast as numpy scalars in the formulas below.
    if not rest:
        rows, numbers = rows.tolist(), values.tolist()
    links = np.empty((*plan.template.shape, *rest), dtype=values.dtype)
    links[...] = plan.template.reshape(*plan.template.shape, *(1,) * len(rest))
    links[:, JOINT_COLUMNS] = values[plan.joints]
    for i in range(len(plan.links)):
        links[i, tree.ANCHOR_X], links[i, tree.ANCHOR_Y] = rows[2 * i], rows[2 * i + 1]
        owned = plan.owned[i]
        if owned is not None:
            mass, x, y, inertia = _body(plan, i, rows, numbers)
            m, cx, cy, j = owned
            # A mass that does not follow keeps the shape's radius of gyration, unless the inertia is given as
            # well.
            if own[m]:
                inertia = inertia * (numbers[m] / mass)
                mass = numbers[m]
            links[i, tree.MASS] = mass
            links[i, tree.COM_X] = numbers[cx] if own[cx] else x
            links[i, tree.COM_Y] = numbers[cy] if own[cy] else y
            links[i, tree.INERTIA] = numbers[j] if own[j] else inertia
    return links


def settled(plan: Plan, values: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the values with every size and place that follows by a form filled in.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, (param,), or (param, step) for many at once.
        own: As in ``links_of``, (param,).

    Returns:
        The values, (param,) or (param, step).
    """
    following = [(row, form) for row, form in plan.ties if not own[row]]
    if following:
        values = values.copy()
    # the rows come in an order in which each form needs only values that have been filled in
    for row, form in following:
        values[row] = form[:-1] @ values + form[-1]
    return values


def following_slopes(plan: Plan, own: np.ndarray) -> np.ndarray:
    """Differentiate the settled values by the values.

    Args:
        plan: The mechanism's plan.
        own: As in ``links_of``, (param,).

    Returns:
        The derivatives, (param, param): the identity but for the rows of what follows by a form.
    """
    count = len(plan.table.names)
    nothing = settled(plan, np.zeros((count, 1)), own)
    return settled(plan, np.eye(count), own) - nothing


def _body(plan: Plan, i: int, rows: Any, numbers: Any) -> tuple[Any, Any, Any, Any]:
    """Return mass, centre of mass and inertia about it of a body as its solids make it up."""
    parts = []
    for (solid, row), weight in zip(plan.solids[i], plan.weights[i], strict=True):
        along, across, deep, x, y = rows[row : row + 5]
        volume, gyration = _solid(solid, along, across, deep)
        mass = numbers[weight] * volume if solid.dense else numbers[weight]
        parts.append((mass, x, y, gyration))
    # The general formula gives the same for one part, at the price of a division by its own mass.
    if len(parts) == 1:
        mass, x, y, gyration = parts[0]
        return mass, x, y, mass * gyration
    # Parallel axes: every part turns about its own centre and moves with it about the common one.
    mass = sum(part[0] for part in parts)
    x = sum(part[0] * part[1] for part in parts) / mass
    y = sum(part[0] * part[2] for part in parts) / mass
    inertia = sum(m * (g + (px - x) * (px - x) + (py - y) * (py - y)) for m, px, py, g in parts)
    return mass, x, y, inertia


def _solid(solid: Solid, along: Any, across: Any, deep: Any) -> tuple[Any, Any]:
    """Return volume [m^3] and inertia about z per mass [m^2] of a uniform solid.

    Source: the paper's I = m (l^2 + w^2) / 12 for boxes; textbook moments of sphere, cylinder and hemisphere,
        an axis that leaves the plane by its direction cosines.
    """
    if solid.kind == BLOCK:
        a, b = solid.gyration
        return solid.volume * along * across * deep, a * along * along + b * across * across
    square = across * across
    if solid.kind == SPHERE:
        return np.pi / 6 * across * square, square / 10
    # A rod whose axis leaves the plane: moments about the axis and square to it, mixed by the squares of the
    # direction cosines, which are flat and rise over their sum.
    flat, rise = along * along, deep * deep
    length = np.sqrt(flat + rise)
    bar = np.pi / 4 * square * length
    about, beside = square / 8, length * length / 12 + square / 16
    volume = bar
    if solid.kind != CYLINDER:
        caps = np.pi / 6 * across * square
        volume = bar + caps
        reach = square / 10 + length * length / 4 + 3 / 16 * length * across
        about = (bar * about + caps * square / 10) / volume
        beside = (bar * beside + caps * reach) / volume
    return volume, (beside * flat + about * rise) / (flat + rise)


def tree_of(plan: Plan, values: np.ndarray, own: np.ndarray) -> tree.Tree:
    """Return the joint tree at these parameter values.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, (param,).
        own: As in ``links_of``, (param,).
    """
    links, gravity = links_of(plan, values, own), np.array([0.0, -values[plan.index["gravity"]]])
    # nobody else has them, so that the tree needs no copies
    links.flags.writeable = gravity.flags.writeable = False
    return tree.Tree(plan.parent, plan.kind, links, gravity)


def shapes_of(plan: Plan, values: np.ndarray) -> tree.Shapes:
    """Return the shapes that the camera sees at these parameter values.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, those that follow by a form filled in, (param,).
    """
    points, radius = outlines_of_many(plan, values[np.newaxis])
    bodies = tuple(solid.body for solid in plan.drawn)
    return tree.Shapes(plan.shape_link, bodies, plan.first, points[0], radius[0])


def outlines_of_many(plan: Plan, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what is drawn of the geoms at many parameter values.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, those that follow by a form filled in, (step, param).

    Returns:
        Points of ``Shapes`` [m], (step, point, 3), and the radius around them [m], (step, geom).
    """
    # there may be no step at all, so the number of points is not left open
    points = values @ plan.outline[:, :-1].T + plan.outline[:, -1]
    points = points.reshape(len(values), len(plan.outline) // 3, 3)
    # about its own middle a geom is turned as it is: its mass, its extents and its inertia stay
    for shape, row, start, middle in plan.turns:
        c, s = np.cos(values[:, row] - start), np.sin(values[:, row] - start)
        turn = np.stack([np.stack([c, s], axis=1), np.stack([-s, c], axis=1)], axis=1)
        own = slice(plan.first[shape], plan.first[shape + 1])
        centre = (values @ middle[:, :-1].T + middle[:, -1])[:, np.newaxis]
        points[:, own, :2] = centre + (points[:, own, :2] - centre) @ turn
    return points, values @ plan.radius[:, :-1].T + plan.radius[:, -1]


def drawn_of_many(
    plan: Plan, values: np.ndarray, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what a picture depends on at many parameter values.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, (step, param).
        own: As in ``links_of``, (param,).

    Returns:
        The columns of ``Tree.links``, (step, dof, column), and as in ``outlines_of_many``.
    """
    links = np.ascontiguousarray(np.moveaxis(links_of(plan, values.T, own), -1, 0))
    return links, *outlines_of_many(plan, settled(plan, values.T, own).T)


def derivatives(
    plan: Plan, values: np.ndarray, own: np.ndarray, rows: np.ndarray, chain: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate ``Tree.links`` and gravity by variables on which parameters depend, with complex steps.

    Args:
        plan: The mechanism's plan.
        values: Parameter values, (param,).
        own: As in ``links_of``, (param,).
        rows: Rows of the parameters that depend on the variables, int (row,).
        chain: Their derivatives by them, (row, variable).

    Returns:
        Derivatives of the links, (dof, column, variable), and of gravity, (2, variable).

    Source: complex-step differentiation; Squire and Trapp, Using complex variables to estimate derivatives of
        real functions, 1998.
    """
    from monodyn.mechanism.assembled import links_of_many

    # One column of values for each variable, stepped in that variable alone.
    steps = np.repeat(values[:, None].astype(complex), chain.shape[1], axis=1)
    steps[rows] += 1j * STEP * chain
    links = np.imag(links_of_many(plan.packed, steps, plain(own))) / STEP
    gravity = np.zeros((2, chain.shape[1]))
    gravity[1] = -chain[rows == plan.index["gravity"]].sum(axis=0)
    return links, gravity
