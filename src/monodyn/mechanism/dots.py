"""A mechanism in, the dots that it shows out: balls, or sites, on links that cannot be seen.

A mechanism shows dots alone where everything of it that can be seen is round and apart from its hinge: then
no picture shows the way from one hinge to the next, nor what shape the bodies have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from monodyn.errors import MechanismError
from monodyn.mechanism.axis import RODS, TOUCHING, profile
from monodyn.mechanism.parts import Geom, Link, Site

if TYPE_CHECKING:
    from monodyn.mechanism.model import Mechanism

ROD = ("com_x", "com_y", "inertia")
"""Parameters of a body that say where its mass is."""
ROD_COM, ROD_INERTIA = 0.75, 5.0 / 48.0
"""Centre of mass over the length, and inertia about it over mass and squared length, of a rod as heavy as
what is at its end."""


@dataclass(frozen=True, eq=False)
class Dot:
    """A dot on a link.

    Attributes:
        name: Name of its geom or site; of a geom without one, that of its body and ``dot``.
        link: Row of the link that it moves with.
        place: Its place in the link's frame by the file [m], (2,).
        ahead: How far it stands before the plane of the link's body, toward the camera [m].
    """

    name: str
    link: int
    place: np.ndarray
    ahead: float


def dots_of(mechanism: Mechanism) -> tuple[Dot, ...]:
    """List the dots that are all of a mechanism that can be seen.

    Args:
        mechanism: The mechanism.

    Returns:
        The dots that move, root first; none where more than dots can be seen.
    """
    links, found = mechanism.plan.links, []
    drawn = any(geom.drawn for link in links for geom in link.geoms)
    for row, link in enumerate(links):
        seen = [geom for geom in link.geoms if geom.drawn]
        if not all(_is_dot(geom, link) for geom in seen):
            return ()
        parts = [_part(geom) for geom in seen] if drawn else list(link.sites)
        for part, name in zip(parts, _names(parts, link), strict=True):
            found += _at(links, Dot(name, row, part.place, part.ahead))
    return tuple(_named_once(found, mechanism))


def shows_dots(mechanism: Mechanism) -> bool:
    """Return whether a mechanism is followed by its dots and not by its outline.

    A single ball has an outline that shows its size, and nothing that it could be taken for.

    Args:
        mechanism: The mechanism.
    """
    dots = dots_of(mechanism)
    return len(dots) > 1 or (len(dots) == 1 and not mechanism.plan.drawn)


def check_dots(mechanism: Mechanism) -> None:
    """Refuse a mechanism that shows dots alone, and none on a link and what hangs on it.

    Args:
        mechanism: The mechanism.

    Raises:
        MechanismError: nothing would show where a link is.
    """
    parent, shown = mechanism.tree.parent, {dot.link for dot in dots_of(mechanism)}
    for row in reversed(range(len(parent))):
        if row not in shown:
            raise MechanismError(
                f"mechanism '{mechanism.name}': expected a dot on '{mechanism.joints[row].body}' or on a "
                "body that it carries, as nothing else of it can be seen, got none; add a site."
            )
        shown.add(int(parent[row]))


def chosen_bodies(mechanism: Mechanism, bodies: str) -> str:
    """Return what the bodies of a mechanism are taken to be: free where nothing shows their shape.

    Dots mark a body whose mass is elsewhere. A single ball may well be all there is of its body.

    Args:
        mechanism: The mechanism.
        bodies: ``uniform``, ``free``, or ``auto``, which leaves the choice to the mechanism.
    """
    if bodies != "auto":
        return bodies
    return "free" if shows_dots(mechanism) else "uniform"


def _is_dot(geom: Geom, link: Link) -> bool:
    """Return whether a geom is round in the plane and apart from its hinge, or about it and still."""
    # nothing else is round, and to find its extents takes a while: this is asked for every picture of a film
    shape = profile(geom) if geom.kind in RODS else None
    if shape is None or shape.long is not None:
        return False
    away = float(np.hypot(*shape.centre))
    return link.joint.kind == "slide" or away > shape.half[0] or away <= TOUCHING * shape.half[0]


def _part(geom: Geom) -> Site:
    return Site(geom.name, geom.centre[:2], float(geom.centre[2]))


def _names(parts: Sequence[Site], link: Link) -> list[str]:
    """Return the names of dots on a link, new ones for those without."""
    stem = f"{link.joint.body}_dot"
    return [part.name or (stem if len(parts) == 1 else f"{stem}{i + 1}") for i, part in enumerate(parts)]


def _at(links: Sequence[Link], dot: Dot) -> list[Dot]:
    """Return a dot on the farthest link toward the root that it moves with; none where it does not move."""
    link = links[dot.link]
    lengths = [float(np.hypot(*part.anchor)) for part in links]
    if link.joint.kind == "slide" or np.hypot(*dot.place) > TOUCHING * max([*lengths, 1e-9]):
        return [dot]
    # a dot about a hinge moves as a point of the link before
    if link.parent < 0:
        return []
    return _at(links, Dot(dot.name, link.parent, link.anchor, link.offset + dot.ahead))


def _named_once(dots: Sequence[Dot], mechanism: Mechanism) -> list[Dot]:
    """Return the dots with names that nothing else of the mechanism has."""
    taken = {part for joint in mechanism.joints for part in (joint.name, joint.body)}
    found: list[Dot] = []
    for dot in dots:
        name = dot.name
        while name in taken:
            name += "_dot"
        taken.add(name)
        found.append(Dot(name, dot.link, dot.place, dot.ahead))
    return found


def as_rods(mechanism: Mechanism) -> Mechanism:
    """Return a mechanism whose bodies, where nothing but dots stands for their mass, start as weighted rods.

    Half of the mass is in a rod along the body, half at its end, between what either alone would be. With all
    of it in a dot a search would begin, and end, where no inertia can be taken away: next to that bound the
    motion seems to determine what it does not.

    Args:
        mechanism: The mechanism, its bodies free.
    """
    if not shows_dots(mechanism):
        return mechanism
    known, values = mechanism.values, {}
    for link in mechanism.plan.links:
        body = link.joint.body
        free = all(mechanism.parameter(f"{body}.{what}").free for what in ROD) if link.carries else False
        if not free or link.givens or f"{body}.length" not in known:
            continue
        far = np.array([known[f"{body}.com_x"], known[f"{body}.com_y"]])
        if not np.hypot(*far):
            continue
        length = known[f"{body}.length"]
        com = ROD_COM * length * far / np.hypot(*far)
        inertia = ROD_INERTIA * known[f"{body}.mass"] * length**2
        values |= {f"{body}.com_x": com[0], f"{body}.com_y": com[1], f"{body}.inertia": inertia}
    return mechanism.with_values(values)


def mass_notes(mechanism: Mechanism, bodies: str) -> list[str]:
    """Return a note where a ball is all that is seen of a body and taken for all that weighs; nothing
    otherwise.

    Args:
        mechanism: The mechanism.
        bodies: What its bodies are taken to be, ``uniform`` or ``free``.
    """
    dots = dots_of(mechanism)
    if bodies != "uniform" or not dots or any(link.givens for link in mechanism.plan.links):
        return []
    names = ", ".join(dict.fromkeys(f"'{mechanism.joints[dot.link].body}'" for dot in dots))
    return [
        f"All of the mass of {names} is taken to be in what is seen of it, as the file has it; where a rod "
        "that cannot be seen weighs as well, lengths come out too short: give the file its mass, or a length "
        "with --fix."
    ]
