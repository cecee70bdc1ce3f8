"""A plan as plain arrays, the form in which kernels take it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monodyn.mechanism.solids import Solid


class Packed(NamedTuple):
    """A plan as arrays.

    Attributes:
        template: As in ``Plan``, (dof, column).
        forms: As in ``Plan``, (row, param + 1).
        joints: As in ``Plan``, (dof, term).
        columns: Column of ``Tree.links`` of each of its terms, int64 (term,).
        ties: Rows that follow a form, int64 (row,).
        tie_forms: The forms, (row, param + 1).
        owned: Rows of mass, com_x, com_y and inertia, -1 for a massless link, int64 (dof, 4).
        first: First solid of each link, and one past the last, int64 (dof + 1,).
        solids: Kind, first row in ``forms``, row of the weight, whether that is a density, int64
            (geom, column).
        shapes: Volume and the two factors of the gyration, (geom, column).
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


def pack(
    tables: tuple[np.ndarray, np.ndarray, np.ndarray],
    columns: Sequence[int],
    ties: Sequence[tuple[int, np.ndarray]],
    owned: Sequence[tuple[int, ...] | None],
    weighing: Sequence[Sequence[tuple[Solid, int, int]]],
) -> Packed:
    """Return a plan in the form that the kernel takes.

    Args:
        tables: ``template`` (dof, column), ``forms`` (row, param + 1) and ``joints`` (dof, term) of a `Plan`.
        columns: Column of ``Tree.links`` of each parameter of a joint.
        ties: As in ``Plan``, each with a form (param + 1,).
        owned: As in ``Plan``.
        weighing: By link, its solids with their first row in the forms and the row of their weight.
    """
    template, forms, joints = tables
    pairs = [solid for of_link in weighing for solid in of_link]
    return Packed(
        template=np.ascontiguousarray(template, dtype=float),
        forms=np.ascontiguousarray(forms, dtype=float),
        joints=np.ascontiguousarray(joints, dtype=np.int64),
        columns=np.array(columns, dtype=np.int64),
        ties=np.array([row for row, _ in ties], dtype=np.int64),
        tie_forms=np.array([form for _, form in ties], dtype=float).reshape(-1, forms.shape[1]),
        owned=np.array([rows or (-1,) * 4 for rows in owned], dtype=np.int64),
        first=np.concatenate(([0], np.cumsum([len(of_link) for of_link in weighing]))).astype(np.int64),
        solids=np.array(
            [(solid.kind, row, weight, solid.dense) for solid, row, weight in pairs], dtype=np.int64
        ).reshape(-1, 4),
        shapes=np.array([(solid.volume, *solid.gyration) for solid, _, _ in pairs], dtype=float).reshape(
            -1, 3
        ),
    )
