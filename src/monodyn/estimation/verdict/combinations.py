"""What the motion fixes even where single parameters stay open: products of powers, regrouped inertias."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from monodyn.estimation.parts import Combination
from monodyn.estimation.shooting.prior import size_ratios
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.unknowns import CENTRE_KINDS, Unknowns
from monodyn.estimation.verdict.posterior import Posterior
from monodyn.estimation.verdict.regrouped import Regrouped, Trees, carried_mass, regroup
from monodyn.estimation.verdict.uncertainty import Knowledge
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import Dimensions, dimensions
from monodyn.mechanism.tree import AIR, ANCHOR_X, ANCHOR_Y, DAMPING, DRAG, FRICTION, HINGE, STIFFNESS, Tree

MOVED = 1e-3
"""An open direction of length one moves a parameter when its relative change along it is above this."""
SIMPLE = 1e-3
"""Exponents are written as fractions when they are this near to them."""
COMPLEX_STEP = 1e-30
"""Step of the derivatives of the regrouped parameters, exact because no difference is taken."""
REGROUPED = {
    "J": Dimensions(mass=1, length=2),
    "mx": Dimensions(mass=1, length=1),
    "my": Dimensions(mass=1, length=1),
    "M": Dimensions(mass=1),
}
"""Dimensions of the regrouped inertial parameters."""
JOINT_TERMS = {
    "damping": DAMPING, "friction": FRICTION, "drag": DRAG, "air": AIR, "stiffness": STIFFNESS
}  # fmt: skip
"""Kinds of a joint's own terms, and their columns; each acts on an inertia."""
REFERENCE = ("thickness", "density", "mass", "inertia", "length", "gravity", "time_scale")
"""Kinds by which the others are divided, the first of them that serves."""


def combinations(
    problem: Problem, x: np.ndarray, known: Knowledge, quantile: float, drawn: Posterior | None = None
) -> tuple[Combination, ...]:
    """List what the data fix although parameters in it are open.

    Args:
        problem: The problem.
        x: Coordinates of the optimum, (param,).
        known: What the data know.
        quantile: Half width of an interval in standard deviations.
        drawn: Draws of the posterior, from which intervals are taken where there are any.

    Returns:
        Products of powers of parameters, what joints add over the inertia it acts on, and for bodies with
        free inertia the regrouped inertial parameters, in ratios or, under known torques,
        themselves.
    """
    found = [*_powers(problem, x, known, drawn), *_regrouped(problem, x, known, drawn)]
    return tuple(one.combination(quantile, drawn, unit_of(problem.mechanism, one.name)) for one in found)


class _Found(NamedTuple):
    """A combination without its interval: its value in every draw, (draw,), where there are any."""

    name: str
    value: float
    std: float
    draws: np.ndarray | None

    def combination(self, quantile: float, drawn: Posterior | None, unit: str) -> Combination:
        low, high = self.value - quantile * self.std, self.value + quantile * self.std
        if drawn is not None and self.draws is not None and self.std > 0.0:
            low, high = drawn.interval(self.draws)
        return Combination(self.name, self.value, self.std, min(low, self.value), max(high, self.value), unit)


def unit_of(mechanism: Mechanism, name: str) -> str:
    """Return the unit of a combination.

    Args:
        mechanism: Gives the kinds of its parameters.
        name: Its name, a product of powers as written here.

    Returns:
        The unit in powers of kg, m and s; empty for a plain number.

    Example:
        >>> import monodyn.mechanism
        >>> unit_of(monodyn.mechanism.load("double"), "link1.mx * gravity / link2.J")
        '1/s^2'
    """
    kinds = {p.name: (p.kind, p.owner) for p in mechanism.parameters}
    joints = {joint.name: joint.kind for joint in mechanism.joints}
    powers = np.zeros(3)
    for k, part in enumerate(name.split(" / ")):
        for factor in part.split(" * "):
            quantity, _, exponent = factor.partition("^")
            power = float(Fraction(exponent.strip("()") or 1)) * (-1.0 if k else 1.0)
            if quantity in kinds:
                kind, owner = kinds[quantity]
                of = dimensions(kind, joints.get(owner, "hinge"))
            else:
                of = REGROUPED[quantity.rpartition(".")[2]]
            # the line of sight is a length like any other here
            powers += power * np.array([of.mass, of.length + of.thickness, of.time])
    named = list(zip(("kg", "m", "s"), powers.tolist(), strict=True))
    above, below = (
        " ".join(unit if e * sign == 1.0 else f"{unit}^{e * sign:g}" for unit, e in named if e * sign > 0.0)
        for sign in (1.0, -1.0)
    )
    return f"{above or '1'}/{below}" if below else above


def _powers(problem: Problem, x: np.ndarray, known: Knowledge, drawn: Posterior | None) -> list[_Found]:
    """Products p_i p_f^e that no open direction changes, with f as few reference parameters as there are
    directions.

    Along an open direction N the logarithm of the product changes by N_i + e.N_f, so e = -N_i N_f^-1.
    """
    unknowns, values = problem.unknowns, problem.unknowns.values(x)
    # a product needs logarithms: what may be zero or negative is no factor of it
    usable = (values > 0) & ~unknowns.of_kind(*CENTRE_KINDS)
    usable &= unknowns.ratio | (unknowns.against < 0)
    moved = np.linalg.norm(known.open, axis=1) > MOVED
    if not moved.any():
        return []
    reference = _reference(unknowns, known.open, usable & moved)
    if len(reference) < known.open.shape[1]:
        return []
    found = []
    for i in np.flatnonzero(usable & moved):
        if i in reference:
            continue
        exponents = -known.open[i] @ np.linalg.inv(known.open[reference])
        # dimensions have simple fractions as exponents; others are a coincidence of the record, and no law
        simple = [Fraction(float(e)).limit_denominator(6) for e in exponents]
        if max(abs(float(s) - e) for s, e in zip(simple, exponents, strict=True)) > SIMPLE:
            continue
        # lengths go with the square of the time scale: length / time_scale^2 reads better than its root
        whole = Fraction(-2 if unknowns.kinds[i] == "time_scale" else 1)
        powers = [(int(i), whole), *((f, whole * e) for f, e in zip(reference, simple, strict=True))]
        if all(e <= 0 for _, e in powers):
            powers = [(k, -e) for k, e in powers]
        found.append(_product_of(unknowns, values, powers, known, drawn))
    return found


def _product_of(
    unknowns: Unknowns, values: np.ndarray, powers: list[tuple[int, Fraction]], known: Knowledge,
    drawn: Posterior | None,
) -> _Found:  # fmt: skip
    """Value and standard deviation of a product of powers (unknown, exponent)."""
    gradient = np.zeros(len(unknowns))
    for k, e in powers:
        gradient[k] += float(e) * known.relative[k]
    value = float(np.prod([values[k] ** float(e) for k, e in powers]))
    std = value * float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0)))
    draws = None
    if drawn is not None:
        draws = np.prod([drawn.unknowns[:, k] ** float(e) for k, e in powers], axis=0)
    return _Found(_product([(unknowns.names[k], e) for k, e in powers]), value, std, draws)


def _reference(unknowns: Unknowns, unfixed: np.ndarray, usable: np.ndarray) -> list[int]:
    """Pick as many reference parameters as there are open directions, each of which one direction moves."""
    # with an open clock lengths come first: everything else is then a product with a power of a length
    usual = {kind: i for i, kind in enumerate(REFERENCE)}
    kinds, rank = unknowns.kinds, dict(usual)
    if any(kinds[i] == "time_scale" for i in np.flatnonzero(usable)):
        rank["length"] = -1
    order = sorted(np.flatnonzero(usable), key=lambda i: (rank.get(kinds[i], len(rank)), i))
    picked: list[int] = []
    for i in order:
        # the block of the references is inverted later: each further one must add a direction to it
        block = unfixed[[*picked, int(i)]]
        if np.linalg.svd(block, compute_uv=False)[-1] > MOVED:
            picked.append(int(i))
        if len(picked) == unfixed.shape[1]:
            break
    return sorted(picked, key=lambda i: (usual.get(kinds[i], len(usual)), i))


def _product(terms: list[tuple[str, Fraction]]) -> str:
    """Write a product of powers: ``a * b^2 / c``."""
    above = [_power(name, e) for name, e in terms if e > 0]
    below = [_power(name, -e) for name, e in terms if e < 0]
    return " / ".join([" * ".join(above), *below])


def _power(name: str, exponent: Fraction) -> str:
    if exponent == 1:
        return name
    return f"{name}^{exponent}" if exponent.denominator == 1 else f"{name}^({exponent})"


def _regrouped(problem: Problem, x: np.ndarray, known: Knowledge, drawn: Posterior | None) -> list[_Found]:
    """Inertial ratios with their standard deviations, where no open direction changes them."""
    instance = problem.at(x)
    mechanism = problem.mechanism
    # of uniform bodies the ratios follow from sizes that are known one by one, but for the dampings; where
    # their sizes are assumed in part the motion knows the ratios far better than these
    free = not problem.unknowns.uniform or bool(size_ratios(mechanism, problem.unknowns))
    absolute = bool(problem.data.torques)

    def regrouped(tree: Tree | Trees) -> dict[str, np.ndarray]:
        found = inertial_ratios(mechanism, tree, full=free and not absolute)
        return found | (inertial_values(mechanism, tree) if free and absolute else {})

    values, tree, steps = regrouped(instance.tree), instance.tree, instance.directions
    # trees of one step each, and one without a step where there may be no unknown at all
    links, gravity = (
        np.concatenate((value[..., None] + 1j * COMPLEX_STEP * slopes, value[..., None]), axis=-1)
        for value, slopes in ((tree.links, steps.links), (tree.gravity, steps.gravity))
    )
    moved = regrouped(Trees(tree.parent, tree.kind, links, gravity))
    slope = np.array([np.imag(moved[name][:-1]) / COMPLEX_STEP for name in values])
    slope = slope.reshape(len(values), len(x))
    draws = {} if drawn is None else regrouped(drawn.trees)
    found = []
    for (name, value), gradient in zip(values.items(), slope, strict=True):
        along = np.abs(known.open.T @ (gradient / known.relative)) if known.open.size else np.zeros(1)
        if value == 0 or along.max() > 1e-3 * abs(value):
            continue
        std = float(np.sqrt(max(gradient @ known.covariance @ gradient, 0.0)))
        found.append(_Found(name, float(np.real(value)), std, draws.get(name)))
    return found


def inertial_ratios(mechanism: Mechanism, tree: Tree | Trees, *, full: bool) -> dict[str, np.ndarray]:
    """Regroup the inertial parameters of a planar tree into ratios that the motion can fix.

    With M_j the mass of everything that hangs on joint j and a_j its place on the body:
    ``<body>.J`` = I + m c.c + sum_j M_j a_j.a_j about the body's own hinge, ``<body>.mx`` = m c_x + sum_j M_j
    a_jx and ``.my`` likewise, ``<body>.M`` = M of a slide. All is divided by J of the last hinged body,
    what each joint adds of its own (dampings, frictions, drags, stiffnesses) by J (or M) of its body.

    Args:
        mechanism: Gives the names.
        tree: The joint tree, complex for a derivative; or many.
        full: All ratios; otherwise only what joints add over inertias.

    Returns:
        Values by name [SI], () or (draw,).

    Source:
        Gautier and Khalil, Direct calculation of minimum set of inertial parameters of serial robots, 1990,
        in the plane.
    """
    about, carried = regroup(tree), carried_mass(tree)
    ratios: dict[str, np.ndarray] = {}
    for i, joint in enumerate(mechanism.joints):
        if i in about.inertia:
            over, label = about.inertia[i], "J"
        else:
            over, label = (0.0 if tree.kind[i] == HINGE else carried[i]), "M"
        for kind, column in JOINT_TERMS.items():
            term = tree.links[i, column]
            if np.all(over != 0) and np.any(term != 0):
                ratios[f"{joint.name}.{kind} / {joint.body}.{label}"] = term / over
    if full and about.inertia:
        ratios |= _over_the_last(mechanism, tree, about, carried)
    return {name: np.asarray(value) for name, value in ratios.items()}


def inertial_values(mechanism: Mechanism, tree: Tree | Trees) -> dict[str, np.ndarray]:
    """Return the regrouped inertial parameters themselves, which the motion fixes under a known torque.

    Args:
        mechanism: Gives the names.
        tree: The joint tree, complex for a derivative; or many.

    Returns:
        ``<body>.J``, ``.mx`` and ``.my`` of hinged bodies, ``.M`` of slides, as in `inertial_ratios` but for
        the division, by name [SI], () or (draw,).
    """
    about, carried = regroup(tree), carried_mass(tree)
    values: dict[str, np.ndarray] = {}
    for i, joint in enumerate(mechanism.joints):
        if i in about.inertia:
            values[f"{joint.body}.J"] = np.asarray(about.inertia[i])
            values[f"{joint.body}.mx"] = np.asarray(about.first_x[i])
            values[f"{joint.body}.my"] = np.asarray(about.first_y[i])
        elif tree.kind[i] != HINGE:
            values[f"{joint.body}.M"] = np.asarray(carried[i])
    return values


def _over_the_last(
    mechanism: Mechanism, tree: Tree | Trees, about: Regrouped, carried: np.ndarray
) -> dict[str, np.ndarray]:
    """Ratios of everything to J of the last hinged body, which fixes the scale of masses."""
    links, joints, last = tree.links, mechanism.joints, max(about.inertia)
    unit, fall = about.inertia[last], np.sqrt(tree.gravity[0] ** 2 + tree.gravity[1] ** 2)
    under = f"{joints[last].body}.J"
    ratios: dict[str, np.ndarray] = {}
    for i in about.inertia:
        body, parent = joints[i].body, tree.parent[i]
        if i != last:
            ratios[f"{body}.J / {under}"] = about.inertia[i] / unit
        ratios[f"{body}.mx * gravity / {under}"] = about.first_x[i] * fall / unit
        ratios[f"{body}.my * gravity / {under}"] = about.first_y[i] * fall / unit
        if parent >= 0 and tree.kind[parent] == HINGE:
            # the coupling of two bodies in the mass matrix: arm of the one times first moment of the other
            arm = np.sqrt(links[i, ANCHOR_X] ** 2 + links[i, ANCHOR_Y] ** 2)
            ratios[f"{joints[parent].body}.length * {body}.mx / {under}"] = arm * about.first_x[i] / unit
        if i != last and np.any(links[i, DAMPING] != 0):
            ratios[f"{joints[i].name}.damping / {under}"] = links[i, DAMPING] / unit
    for i, joint in enumerate(joints):
        if tree.kind[i] != HINGE:
            ratios[f"{joints[last].body}.mx / {joint.body}.M"] = about.first_x[last] / carried[i]
    return ratios
