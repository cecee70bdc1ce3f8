"""The mechanism in units of its distance from the camera, in which it is located, and back in the file's.

A picture knows no scale: sizes and distance grow together unseen. Neither may what finds them: in units of
the distance a size is its angle, whatever the file's metres are, and no step, spring or bound of the search
depends on them. Parameters that have to keep their values set the scale afterwards; without any the mean
length of the file does.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from monodyn.mechanism import Mechanism, Parameter
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.types import Camera
from monodyn.vision.drawing.rig import SIZE_KINDS

DRAWN_KINDS = (*SIZE_KINDS, *PLACE_KINDS, "offset", "thickness")
"""Kinds of the lengths on which the outlines depend."""
CONSTANT = ("forms", "outline", "radius", "depths")
"""Linear maps of a plan that give lengths."""


MOST_EXTENT = 0.5
"""Extent of a further geom, or its distance from the axis, that is usual at most, in lengths of the body."""


def scaled(mechanism: Mechanism, factor: float) -> Mechanism:
    """Return a mechanism as it is drawn in other units of length.

    Masses and everything else that is not drawn keep their numbers.

    Args:
        mechanism: The mechanism.
        factor: New units per old unit.

    Returns:
        The mechanism with all sizes, places and limits of slides multiplied.
    """
    plan, kinds = mechanism.plan, mechanism.plan.table.kind
    # the last column of each map is what no parameter changes: places in metres, but angles of turns
    constant = {name: _scaled_map(getattr(plan, name), factor) for name in CONSTANT}
    ties = tuple((row, _scaled_map(tie, 1.0 if kinds[row] == "turn" else factor)) for row, tie in plan.ties)
    turns = tuple(turn._replace(middle=_scaled_map(turn.middle, factor)) for turn in plan.turns)
    joints = tuple(
        joint
        if joint.kind == "hinge"
        else replace(joint, lower=joint.lower * factor, upper=joint.upper * factor)
        for joint in mechanism.joints
    )
    sizes = {p.name: p.value * factor for p in drawn(mechanism)}
    plan = replace(plan, ties=ties, turns=turns, **constant)
    return replace(mechanism, plan=plan, joints=joints).with_values(sizes)


def in_metres(mechanism: Mechanism, file: Mechanism, metre: float, pinned: Collection[str]) -> Mechanism:
    """Return a located mechanism in metres of its file.

    Args:
        mechanism: The located mechanism.
        file: The mechanism as in the file.
        metre: Units of the located mechanism per metre.
        pinned: Names of the parameters that keep the file's values exactly.

    Returns:
        The mechanism with the file's places and limits; what was found to follow nothing is free in it, too.
    """
    known = file.values
    sizes = {p.name: known[p.name] if p.name in pinned else p.value / metre for p in drawn(mechanism)}
    return replace(mechanism, plan=file.plan, joints=file.joints).with_values(sizes)


def drawn(mechanism: Mechanism) -> list[Parameter]:
    """List the lengths of a mechanism on which its outlines depend and that follow no others.

    Args:
        mechanism: The mechanism.

    Returns:
        The parameters.
    """
    return [p for p in mechanism.parameters if p.kind in DRAWN_KINDS and not p.follows]


def _scaled_map(table: np.ndarray, factor: float) -> np.ndarray:
    """Return a linear map with its constants multiplied, (..., param + 1)."""
    table = table.copy()
    table[..., -1] *= factor
    return table


def in_usual_proportions(mechanism: Mechanism, pinned: Collection[str]) -> Mechanism:
    """Return a mechanism whose bodies have no further part longer for their length than is usual.

    Parts of a body are found together with it, from the file's proportions; with a further part longer than
    the body itself the two may be taken for one another. Widths come from the masks, whatever the file has.

    Args:
        mechanism: As in its file.
        pinned: Parameters that may not change.

    Returns:
        The same mechanism where nothing is unusual, or nothing of that may change.
    """
    known, sizes = mechanism.values, {}
    for p in drawn(mechanism):
        most = MOST_EXTENT * known.get(f"{p.owner}.length", 0.0)
        if p.kind in ("extent", "across") and 0.0 < most < abs(p.value) and p.name not in pinned:
            sizes[p.name] = float(np.copysign(most, p.value))
    return mechanism.with_values(sizes) if sizes else mechanism


def growth(mechanism: Mechanism, start: Mechanism) -> float:
    """Return by how much the sizes of a mechanism have grown.

    Args:
        mechanism: The mechanism.
        start: The same before.

    Returns:
        The mean factor of the lengths, of the other sizes where there are none.
    """
    sizes = [p for p in drawn(start) if p.kind in SIZE_KINDS and p.value > 0.0]
    sizes = [p for p in sizes if p.kind == "length"] or sizes
    now = mechanism.values
    factors = [np.log(now[p.name] / p.value) for p in sizes if now[p.name] > 0.0]
    return float(np.exp(np.mean(factors))) if factors else 1.0


def units_per_metre(
    mechanism: Mechanism, camera: Camera, file: Mechanism, fix: Mapping[str, float], pinned: Collection[str]
) -> float:
    """Return how many units of a located mechanism are a metre of its file.

    Args:
        mechanism: The located mechanism.
        camera: The camera, in the same units.
        file: The mechanism as in the file.
        fix: Camera parameters that have to keep their values.
        pinned: Names of the parameters that have to keep their values.

    Returns:
        The scale at which what is fixed keeps its value; the file's mean length where nothing fixes it.
    """
    if fix.get("camera.depth"):
        return camera.depth / fix["camera.depth"]
    held = [p for p in drawn(file) if p.kind in SIZE_KINDS and p.name in pinned and p.value > 0.0]
    if held:
        return mechanism.values[held[0].name] / held[0].value
    return growth(mechanism, file)
