"""A mechanism whose bodies end otherwise than in its file: flat or round, and beyond their hinges.

How far a body reaches beyond its last hinge depends on the shape of its end, and so does where its mass is.
Flat ends are those of a box, round ones those of a capsule that may be flatter than it is wide: a thickness
nobody sees. A body that ends at a hinge has an overhang there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from monodyn.mechanism.axis import TINY, Profile, caps_of, long_axis, profile
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.mounted import grown
from monodyn.mechanism.parts import Geom, Link
from monodyn.mechanism.places import half_across, main_ends
from monodyn.mechanism.read import assembled

ROUND = ("capsule", "ellipsoid")
"""Kinds of geoms that end round."""
SIDES, RINGS = 12, 9
"""Sides by which half of a circle is drawn, their middles 1 % of the radius inside of it, and circles from
the back of a round end to its front."""


def plain_bodies(mechanism: Mechanism) -> dict[str, bool]:
    """Name the bodies that may end otherwise: of one geom along their axis, its ends on nothing but hinges.

    Args:
        mechanism: The mechanism.

    Returns:
        Whether each ends round, by name.
    """
    links = mechanism.plan.links
    bars = {link.joint.body: _bar(links, i) for i, link in enumerate(links) if link.carries}
    return {body: bar[0].geom.kind in ROUND for body, bar in bars.items() if bar is not None}


def with_ends(mechanism: Mechanism, ends: Mapping[str, float]) -> Mechanism:
    """Return a mechanism with bodies that end otherwise, its values and choices as they are.

    Args:
        mechanism: The mechanism as in its file.
        ends: For each of these bodies the share of its whole length that a round end takes; 0 for flat ends.
    """
    new = {body: share for body, share in ends.items() if mechanism.ends.get(body) != share}
    if not new:
        return mechanism
    old = mechanism.plan.links
    links = [
        replace(link, geoms=(_exchanged(old, i, new[link.joint.body]),)) if link.joint.body in new else link
        for i, link in enumerate(old)
    ]
    made = grown(mechanism, assembled(mechanism.name, links, mechanism.values["gravity"]))
    return replace(made, source=mechanism.source, ends={**mechanism.ends, **ends})


def _bar(links: tuple[Link, ...], i: int) -> tuple[Profile, np.ndarray, float, float] | None:
    """Return the only geom of a link, the direction of its axis, and where it begins and ends along it [m];
    None where it has others, or ends at what is no hinge."""
    link = links[i]
    if len(link.geoms) != 1 or link.sites or link.geoms[0].body != link.joint.body:
        return None
    shape, anchors = profile(link.geoms[0]), [other.anchor for other in links if other.parent == i]
    along, length = long_axis(link, anchors, [shape])
    flat = shape.geom.kind != "capsule" or abs(shape.deep) < TINY * length
    if shape.long is None or shape.geom.kind == "mesh" or not shape.geom.drawn or not flat:
        return None
    ends = main_ends(shape, along, caps_of(link, anchors, [shape], along))
    if not ends or abs(float(shape.centre @ [-along[1], along[0]])) > TINY * length:
        return None
    low, high = ends
    if link.joint.kind == "hinge":
        beyond = half_across(shape, along)
        low -= beyond * (abs(low) < TINY * length)
        high += beyond * any(abs(high - float(anchor @ along)) < TINY * length for anchor in anchors)
    return shape, along, low, high


def _exchanged(links: tuple[Link, ...], i: int, share: float) -> Geom:
    """Return the geom of a link with other ends."""
    bar = _bar(links, i)
    assert bar is not None, f"body '{links[i].joint.body}' has no plain ends."
    shape, along, low, high = bar
    geom, wide = shape.geom, half_across(shape, along)
    deep = wide if geom.kind in ("capsule", "cylinder") else 0.5 * abs(shape.deep)
    size = np.array([0.5 * (high - low), wide, deep])
    # an affine image of a capsule: round once the body has the proportions that the share is of
    turn, rise = np.meshgrid(np.linspace(-0.5, 0.5, SIDES + 1) * np.pi, np.linspace(-0.5, 0.5, RINGS) * np.pi)
    cap = np.column_stack(
        [
            (np.cos(turn) * np.cos(rise)).ravel(),
            (np.sin(turn) * np.cos(rise)).ravel(),
            np.sin(rise).ravel(),
        ]
    )
    cap[:, 0] = 1.0 - 2.0 * share * (1.0 - cap[:, 0])
    corners = np.unique(np.round(np.vstack([cap, cap * [-1.0, 1.0, 1.0]]), 9), axis=0) * size
    return replace(
        geom,
        name=geom.name or geom.kind,
        kind="mesh" if share else "box",
        centre=np.array([*(0.5 * (low + high) * along), geom.centre[2]]),
        axes=np.array([[*along, 0.0], [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]]).T,
        size=size,
        vertices=corners if share else np.zeros((0, 3)),
    )
