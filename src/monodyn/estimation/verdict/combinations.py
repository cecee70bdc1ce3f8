"""What the motion fixes even where single parameters stay open: products of powers, regrouped inertias."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from monodyn.estimation.fit import Combination
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.unknowns import kind_of
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, COM_X, COM_Y, DAMPING, HINGE, INERTIA, MASS, Tree

REFERENCE = ("thickness", "density", "mass", "inertia", "length", "gravity", "time_scale")
"""Kinds by which the others are divided, the most welcome first."""


def combinations(problem: Problem, x: np.ndarray, known: Knowledge) -> tuple[Combination, ...]:
    """List what the data fix although parameters in it are open.

    Args:
        problem: The problem.
        x: Coordinates of the optimum, (param,).
        known: What the data know.

    Returns:
        Products of powers of parameters, dampings over the inertia they act on, and for bodies with free
        inertia the regrouped inertial parameters.
    """
    powers = _powers(problem, x, known)
    return (*powers, *_regrouped(problem, x, known))


def _powers(problem: Problem, x: np.ndarray, known: Knowledge) -> list[Combination]:
    """Products p_i p_f^e that no open direction changes, with f as few reference parameters as there are
    directions.

    Along an open direction N the logarithm of the product changes by N_i + e.N_f, so e = -N_i N_f^-1.
    """
    names, values = problem.unknowns.names, problem.unknowns.values(x)
    usable = (values > 0) & np.isin([kind_of(name) for name in names], ("com_x", "com_y"), invert=True)
    moved = np.linalg.norm(known.open, axis=1) > 1e-3 if known.open.size else np.zeros(len(names), dtype=bool)
    if not moved.any():
        return []
    reference = _reference(names, known.open, usable & moved)
    if len(reference) < known.open.shape[1]:
        return []
    found = []
    for i in np.flatnonzero(usable & moved):
        if i in reference:
            continue
        exponents = -known.open[i] @ np.linalg.inv(known.open[reference])
        simple = [Fraction(float(e)).limit_denominator(6) for e in exponents]
        if max(abs(float(s) - e) for s, e in zip(simple, exponents, strict=True)) > 1e-3:
            continue
        # lengths go with the square of the time scale: length / time_scale^2 reads better than its root
        whole = Fraction(-2 if kind_of(names[i]) == "time_scale" else 1)
        powers = [(i, whole), *((f, whole * e) for f, e in zip(reference, simple, strict=True))]
        if all(e <= 0 for _, e in powers):
            powers = [(k, -e) for k, e in powers]
        terms = [(names[k], e) for k, e in powers]
        gradient = np.zeros(len(names))
        for k, e in powers:
            gradient[k] += float(e) * known.relative[k]
        value = float(np.prod([values[k] ** float(e) for k, e in powers]))
        std = value * float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0)))
        found.append(Combination(_product(terms), float(value), std))
    return found


def _reference(names: tuple[str, ...], unfixed: np.ndarray, usable: np.ndarray) -> list[int]:
    """Pick as many reference parameters as there are open directions, each of which one direction moves."""
    usual = {kind: i for i, kind in enumerate(REFERENCE)}
    rank = dict(usual)
    if any(kind_of(names[i]) == "time_scale" for i in np.flatnonzero(usable)):
        rank["length"] = -1
    order = sorted(np.flatnonzero(usable), key=lambda i: (rank.get(kind_of(names[i]), len(rank)), i))
    picked: list[int] = []
    for i in order:
        trial = unfixed[[*picked, int(i)]]
        if np.linalg.svd(trial, compute_uv=False)[-1] > 1e-3:
            picked.append(int(i))
        if len(picked) == unfixed.shape[1]:
            break
    return sorted(picked, key=lambda i: (usual.get(kind_of(names[i]), len(usual)), i))


def _product(terms: list[tuple[str, Fraction]]) -> str:
    """Write a product of powers: ``a * b^2 / c``."""
    above = [_power(name, e) for name, e in terms if e > 0]
    below = [_power(name, -e) for name, e in terms if e < 0]
    return " / ".join([" * ".join(above), *below])


def _power(name: str, exponent: Fraction) -> str:
    if exponent == 1:
        return name
    return f"{name}^{exponent}" if exponent.denominator == 1 else f"{name}^({exponent})"


def _regrouped(problem: Problem, x: np.ndarray, known: Knowledge) -> list[Combination]:
    """Inertial ratios with their standard deviations, where no open direction changes them."""
    point = problem.at(x)
    mechanism = problem.mechanism
    free = any(kind_of(name) == "inertia" for name in problem.unknowns.names)
    values = inertial_ratios(mechanism, point.tree, full=free)
    slopes = []
    for p in range(len(x)):
        step = inertial_ratios(mechanism, point.tree.along(point.directions, p, 1e-30j), full=free)
        slopes.append([step[name].imag * 1e30 for name in values])
    slope = np.array(slopes).T.reshape(len(values), len(x))
    found = []
    for (name, value), gradient in zip(values.items(), slope, strict=True):
        along = np.abs(known.open.T @ (gradient / known.relative)) if known.open.size else np.zeros(1)
        if value == 0 or along.max() > 1e-3 * abs(value):
            continue
        std = float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0)))
        found.append(Combination(name, float(value.real), std))
    return found


def inertial_ratios(mechanism: Mechanism, tree: Tree, *, full: bool) -> dict[str, complex]:
    """Regroup the inertial parameters of a planar tree into ratios that the motion can fix.

    With M_j the mass of everything that hangs on joint j and a_j its place on the body:
    ``<body>.J`` = I + m c.c + sum_j M_j a_j.a_j about the body's own hinge, ``<body>.mx`` = m c_x + sum_j M_j
    a_jx and ``.my`` alike, ``<body>.M`` = M of a slide. Everything is divided by J of the last hinged body,
    dampings by J (or M) of the body at the joint.

    Args:
        mechanism: Gives the names.
        tree: The joint tree; complex for a derivative.
        full: All ratios; otherwise only dampings over inertias.

    Returns:
        Values by name [SI].

    Source:
        Gautier and Khalil, Direct calculation of minimum set of inertial parameters of serial robots, 1990,
        in the plane.
    """
    parent, kind, links, gravity = tree.parent, tree.kind, tree.links, tree.gravity
    dofs = len(parent)
    total = links[:, MASS].copy()
    for i in range(dofs - 1, -1, -1):
        if parent[i] >= 0:
            total[parent[i]] += total[i]
    hinges = [i for i in range(dofs) if kind[i] == HINGE and not _carries_slide(parent, kind, i)]
    about, first_x, first_y = {}, {}, {}
    for i in hinges:
        mass, cx, cy = links[i, MASS], links[i, COM_X], links[i, COM_Y]
        children = np.flatnonzero(parent == i)
        ax, ay = links[children, ANCHOR_X], links[children, ANCHOR_Y]
        about[i] = links[i, INERTIA] + mass * (cx**2 + cy**2) + np.sum(total[children] * (ax**2 + ay**2))
        first_x[i] = mass * cx + np.sum(total[children] * ax)
        first_y[i] = mass * cy + np.sum(total[children] * ay)
    body = [joint.body for joint in mechanism.joints]
    ratios: dict[str, complex] = {}
    for i in range(dofs):
        over = about.get(i, total[i] if kind[i] != HINGE else 0.0)
        if over != 0 and links[i, DAMPING] != 0:
            label = "J" if i in about else "M"
            ratios[f"{mechanism.joints[i].name}.damping / {body[i]}.{label}"] = links[i, DAMPING] / over
    if full and hinges:
        last, fall = hinges[-1], np.sqrt(gravity[0] ** 2 + gravity[1] ** 2)
        under = f"{body[last]}.J"
        for i in hinges:
            if i != last:
                ratios[f"{body[i]}.J / {under}"] = about[i] / about[last]
            ratios[f"{body[i]}.mx * gravity / {under}"] = first_x[i] * fall / about[last]
            ratios[f"{body[i]}.my * gravity / {under}"] = first_y[i] * fall / about[last]
            if parent[i] >= 0 and kind[parent[i]] == HINGE:
                arm = np.sqrt(links[i, ANCHOR_X] ** 2 + links[i, ANCHOR_Y] ** 2)
                ratios[f"{body[parent[i]]}.length * {body[i]}.mx / {under}"] = arm * first_x[i] / about[last]
            if i != last and links[i, DAMPING] != 0:
                ratios[f"{mechanism.joints[i].name}.damping / {under}"] = links[i, DAMPING] / about[last]
        for i in range(dofs):
            if kind[i] != HINGE:
                ratios[f"{body[last]}.mx / {body[i]}.M"] = first_x[last] / total[i]
    return {name: complex(value) for name, value in ratios.items()}


def _carries_slide(parent: np.ndarray, kind: np.ndarray, i: int) -> bool:
    return any(kind[j] != HINGE for j in np.flatnonzero(parent == i))
