"""A plan as plain arrays, the form in which kernels take it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from monodyn.mechanism.plan import Plan


class Packed(NamedTuple):
    """A plan as arrays.

    Attributes:
        template: As in ``Plan``, (dof, column).
        forms: As in ``Plan``, (row, param + 1).
        joints: As in ``Plan``, (dof, term).
        columns: Column of ``Tree.links`` of each of its terms, int64 (term,).
        ties: Rows that follow a form, int64 (tie,).
        tie_forms: The forms, (tie, param + 1).
        owned: Rows of mass, com_x, com_y and inertia, -1 for a massless link, int64 (dof, 4).
        first: First solid of each link, and one past the last, int64 (dof + 1,).
        solids: Kind, first row in ``forms``, row of the weight, whether that is a density, int64
            (solid, 4).
        shapes: Volume and the two factors of the gyration, (solid, 3).
    """

    template: np.ndarray
    forms: np.ndarray
    joints: np.ndarray
    columns: np.ndarray
    ties: np.ndarray
    tie_forms: np.ndarray
    owned: np.ndarray
    first: np.ndarray
    solids: np.ndarray
    shapes: np.ndarray


def pack(plan: Plan, columns: Sequence[int]) -> Packed:
    """Return a plan in the form that the kernel takes.

    Args:
        plan: The plan.
        columns: Column of ``Tree.links`` of each parameter of a joint.
    """
    pairs = [
        (solid, row, weight)
        for of_link, weights in zip(plan.solids, plan.weights, strict=True)
        for (solid, row), weight in zip(of_link, weights, strict=True)
    ]
    width = plan.forms.shape[1]
    return Packed(
        template=np.ascontiguousarray(plan.template, dtype=float),
        forms=np.ascontiguousarray(plan.forms, dtype=float),
        joints=np.ascontiguousarray(plan.joints, dtype=np.int64),
        columns=np.array(columns, dtype=np.int64),
        ties=np.array([row for row, _ in plan.ties], dtype=np.int64),
        tie_forms=np.array([form for _, form in plan.ties], dtype=float).reshape(-1, width),
        owned=np.array([rows or (-1,) * 4 for rows in plan.owned], dtype=np.int64),
        first=np.concatenate(([0], np.cumsum([len(of_link) for of_link in plan.solids]))).astype(np.int64),
        solids=np.array(
            [(solid.kind, row, weight, solid.dense) for solid, row, weight in pairs], dtype=np.int64
        ).reshape(-1, 4),
        shapes=np.array([(solid.volume, *solid.gyration) for solid, _, _ in pairs], dtype=float).reshape(
            -1, 3
        ),
    )
