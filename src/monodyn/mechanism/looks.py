"""What MJCF and URDF files share: the frame, how numbers are written, and the visible geoms of a link.

The frame is MuJoCo's usual one: the plane's x, y, z become x, z, -y, so hinges turn about 0 -1 0.

A reader turns directions into matrices and back, which costs the last digits. So lengths and angles are
written a few digits short of the end: what is read rounds to what was written, and is written the same again.
"""

from __future__ import annotations

import math
import textwrap
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.mechanism.axis import Form
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.solids import Solid
from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, AXIS_X, AXIS_Y, COM_X, COM_Y, HINGE

DIGITS = 13
"""Decimals of an angle [rad], and of a length in units of the mechanism's reach: 100 times what a reader
loses."""
MESH_DIGITS = 6
"""The same of the corners of a mesh, which MuJoCo keeps in single precision."""
WIDE = 104
"""Longest line of a comment."""


@dataclass(frozen=True, eq=False)
class Look:
    """A visible geom at the current values, in its link's frame; z counts from the plane of its body.

    Attributes:
        kind: Kind of the geom, as ``Geom`` has it.
        middle: Its middle [m], (3,).
        direction: Direction of its length in the plane, (2,).
        along: Its length [m].
        across: Its width, or diameter [m].
        deep: Its extent along the line of sight [m].
        points: Corners of its hull [m], (point, 3).
        radius: Growth of the corners [m].
    """

    kind: str
    middle: np.ndarray
    direction: np.ndarray
    along: float
    across: float
    deep: float
    points: np.ndarray
    radius: float


def looks_of(mechanism: Mechanism, link: int) -> list[Look]:
    """Return the visible geoms of a link at the current values.

    Args:
        mechanism: The mechanism.
        link: Row of the link.
    """
    plan, shapes = mechanism.plan, mechanism.shapes
    depth = np.array([0.0, 0.0, depth_of(mechanism, link)])
    looks = []
    for g, solid in enumerate(plan.drawn):
        if plan.shape_link[g] == link:
            points = shapes.points[shapes.first[g] : shapes.first[g + 1]] - depth
            looks.append(_look(mechanism, solid, points, depth, float(shapes.radius[g])))
    return looks


def _look(mechanism: Mechanism, solid: Solid, points: np.ndarray, depth: np.ndarray, radius: float) -> Look:
    """Return a visible geom at the current values."""
    assert solid.look is not None
    middle = np.array([_value(mechanism, form) for form in solid.look.middle]) - depth
    along, across, deep = (_value(mechanism, form) for form in (solid.along, solid.across, solid.deep))
    direction = solid.look.direction
    if solid.turn:
        row = mechanism.plan.index[solid.turn]
        direction = turned(direction, mechanism.plan_numbers[row] - mechanism.plan.table.start[row])
    return Look(solid.look.kind, middle, direction, along, across, deep, points, radius)


def _value(mechanism: Mechanism, form: Form) -> float:
    """Return a form at the current values."""
    index = mechanism.plan.index
    return sum(
        factor * (float(mechanism.plan_numbers[index[name]]) if name else 1.0)
        for name, factor in form.items()
    )


def depth_of(mechanism: Mechanism, link: int) -> float:
    """Return the z of a link's body [m].

    Args:
        mechanism: The mechanism.
        link: Row of the link, -1 for the world.
    """
    return float(mechanism.plan.depths[link] @ np.append(mechanism.plan_numbers, 1.0)) if link >= 0 else 0.0


def place_digits(mechanism: Mechanism) -> int:
    """Return with how many decimals the lengths of a mechanism are written.

    Args:
        mechanism: The mechanism.
    """
    places = mechanism.tree.links[:, [ANCHOR_X, ANCHOR_Y, COM_X, COM_Y]]
    reach = max(np.abs(places).max(initial=0.0), np.abs(mechanism.shapes.points).max(initial=0.0)) or 1.0
    # a reach of 0.1 m may be read as one slightly below: the number of decimals must not change there
    return DIGITS - math.floor(math.log10(1.2345678 * reach))


def axis_text(kind: int, row: np.ndarray) -> str:
    """Return a joint's axis in the file's frame.

    Args:
        kind: ``HINGE`` or ``SLIDE``.
        row: Its row of ``Tree.links``, (column,).
    """
    if kind == HINGE:
        return numbers(0, -row[AXIS_X], 0)
    angle = round(math.atan2(row[AXIS_Y], row[AXIS_X]), DIGITS)
    # one decimal more than the angle: a rounded quarter turn has a cosine of zero
    return numbers(math.cos(angle), 0, math.sin(angle), digits=DIGITS + 1)


def world(points: np.ndarray) -> np.ndarray:
    """Return points of the plane frame in the file's frame (x, z toward up, y away from the camera).

    Args:
        points: Points or directions in the plane frame, (..., 3).

    Returns:
        The same in the file's frame, (..., 3).
    """
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def turned(vector: np.ndarray, angle: float) -> np.ndarray:
    """Return a vector turned counter-clockwise.

    Args:
        vector: The vector, (2,).
        angle: The turn [rad].

    Returns:
        The vector, (2,).
    """
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def numbers(*values: float, digits: int | None = None) -> str:
    """Return numbers as text.

    Args:
        values: The numbers.
        digits: Decimals; None for as many as it takes to read the numbers back exactly.
    """
    exact = (float(value) if digits is None else round(float(value), digits) for value in values)
    return " ".join(repr(value + 0.0) for value in exact)


def significant(value: float) -> float:
    """Return a number without its last two digits, which a reader may change.

    Args:
        value: The number.
    """
    return float(f"{value:.{DIGITS + 1}g}")


def remark(text: str) -> Any:
    """Return a comment, in lines that are not too long.

    Args:
        text: What it says.
    """
    # two hyphens would end an XML comment
    lines = textwrap.wrap(text.replace("--", "- -"), WIDE)
    return ET.Comment(f" {lines[0]} " if len(lines) == 1 else "\n    ".join(["", *lines]) + "\n  ")


def save(root: ET.Element, path: str | Path, remarks: Sequence[str] = ()) -> None:
    """Write an XML file, indented.

    Args:
        root: Its root element.
        path: The file.
        remarks: Comments that come first.
    """
    for k, text in enumerate(remarks):
        root.insert(k, remark(text))
    ET.indent(root)
    Path(path).write_text(ET.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
