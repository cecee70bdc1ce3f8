"""A joint tree in, what its motion depends on out: masses and inertias regrouped, of one tree or of many.

The motion of a planar tree depends on its sizes and masses through few numbers. A record is nearly linear in
them where it is far from linear in the sizes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.arrays import plain
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, COM_X, COM_Y, HINGE, INERTIA, MASS, Tree


class Trees(NamedTuple):
    """Many joint trees of one mechanism; fields as in `Tree`, with a last axis for which of them.

    Attributes:
        parent: Row of the parent link, int (dof,).
        kind: Kind of the joint, int (dof,).
        links: Columns of the links, (dof, column, draw).
        gravity: Acceleration of free fall, (2, draw).
    """

    parent: np.ndarray
    kind: np.ndarray
    links: np.ndarray
    gravity: np.ndarray


class Regrouped(NamedTuple):
    """Inertial parameters of the hinged bodies about their own hinge, those that hang on them included.

    Attributes:
        inertia: J of each, by row of the tree, () or (draw,).
        first_x: First moment along the body, () or (draw,).
        first_y: First moment across it, () or (draw,).
    """

    inertia: dict[int, np.ndarray]
    first_x: dict[int, np.ndarray]
    first_y: dict[int, np.ndarray]


def carried_mass(tree: Tree | Trees) -> np.ndarray:
    """Return the mass of everything that hangs on each joint.

    Args:
        tree: The tree, or many.

    Returns:
        Masses, (dof,) or (dof, draw).
    """
    total = tree.links[:, MASS].copy()
    for i in range(len(total) - 1, -1, -1):  # children stand after their parents
        if tree.parent[i] >= 0:
            total[tree.parent[i]] += total[i]
    return total


def regroup(tree: Tree | Trees) -> Regrouped:
    """Move the mass of everything that hangs on a body to the joint it hangs on.

    Args:
        tree: The tree, or many.

    Returns:
        The inertial parameters of hinged bodies on which nothing slides.
    """
    links, total = tree.links, carried_mass(tree)
    found = Regrouped({}, {}, {})
    for i in range(len(total)):
        # what slides on a hinged body changes its inertia with the motion: it cannot be regrouped
        if np.any(tree.kind[(tree.parent == i) | (np.arange(len(total)) == i)] != HINGE):
            continue
        mass, cx, cy = links[i, MASS], links[i, COM_X], links[i, COM_Y]
        children = np.flatnonzero(tree.parent == i)
        ax, ay = links[children, ANCHOR_X], links[children, ANCHOR_Y]
        own = links[i, INERTIA] + mass * (cx**2 + cy**2)
        found.inertia[i] = own + np.sum(total[children] * (ax**2 + ay**2), axis=0)
        found.first_x[i] = mass * cx + np.sum(total[children] * ax, axis=0)
        found.first_y[i] = mass * cy + np.sum(total[children] * ay, axis=0)
    return found


def features(trees: Trees, *, absolute: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return numbers on which the motion depends.

    They are the factors of the equations of motion: inertias or carried masses, frictions and springs,
    weights of the first moments and what couples two bodies in the mass matrix. The equations are linear in
    them, so that none is a logarithm: what changes all of them alike may change them far. Without known
    torques only ratios count; all are divided by J of the last hinged body, or the mass on the last slide.

    Args:
        trees: The trees.
        absolute: The motion depends on the numbers themselves.

    Returns:
        The numbers, (feature, draw), and J or the mass by which ratios are divided, (draw,).
    """
    from monodyn.estimation.verdict.factors import factors

    number = np.result_type(trees.links, trees.gravity)
    return factors(
        plain(trees.parent, np.int64), plain(trees.kind, np.int64), plain(trees.links, number),
        plain(trees.gravity, number), absolute,
    )  # fmt: skip
