"""Names of tracked points in, what they are on the mechanism out: joints, ends of bodies, sites, the scene.

A mark at a joint or at the end of a body lies where the lengths put it. One at a site lies where the file has
it, in proportion to its body, unless other marks of the body show where it is: then its place is free.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.errors import MechanismError, SettingsError
from monodyn.mechanism import Mechanism
from monodyn.mechanism.axis import long_axis, profile
from monodyn.mechanism.dots import dots_of
from monodyn.names import known, meant, near, quoted

JOINT, END, SITE, FREE, SCENE = "joint", "end", "site", "free", "scene"
"""Kinds of marks: at a joint, at the far end of a body, at a site of the file, anywhere on a body, and in the
scene, which does not move."""
SCENE_NAMES = ("world", "ground", "scene", "background")
"""Names of points of the scene, each with a number after it where there are several."""
NOTHING = "none"
"""What a point is mapped to that is to be left out."""
ANYWHERE = ".marker"
"""What follows the name of a body to which a point is mapped that lies anywhere on it."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A tracked point of the mechanism or of the scene.

    Attributes:
        track: Name of the point in the table.
        target: What it is on the mechanism.
        kind: One of the kinds of this module.
        link: Row of the link that it moves with, -1 for the scene.
        place: Its place in the link's frame by the file [m], (2,); NaN where the file has none.
        ahead: How far it stands before the plane of its link's body [m].
    """

    track: str
    target: str
    kind: str
    link: int
    place: np.ndarray
    ahead: float = 0.0


def marks_of(
    mechanism: Mechanism, names: Sequence[str], mapped: Mapping[str, str] | None = None
) -> list[Mark]:
    """Find what tracked points are on the mechanism.

    Args:
        mechanism: The mechanism.
        names: Names of the points in the table.
        mapped: For some of them what they are: a joint, a body (its far end), a site, ``<body>.marker``,
            ``world`` or ``none``.

    Returns:
        One mark for each point that is not left out, in their order.

    Raises:
        SettingsError: A name is in no table or no mechanism, or two points are the same.
        MechanismError: no point is left.
    """
    mapped, targets = dict(mapped or {}), targets_of(mechanism)
    odd = [name for name in mapped if name not in names]
    if odd:
        raise SettingsError(
            f"points.map: point '{odd[0]}' is not in the table; {known('points', names, odd[0])}"
        )
    found, unknown = [], []
    for name in names:
        wanted = mapped.get(name, name)
        if wanted == NOTHING:
            continue
        mark = _matched(name, wanted, targets, exact=name in mapped)
        if mark is None:
            unknown.append((name, wanted))
        else:
            found.append(mark)
    if unknown:
        said = [wanted if name not in mapped else f"{name}={wanted}" for name, wanted in unknown]
        if alike := near(list(targets), unknown[0][1]):
            raise SettingsError(
                f"point {quoted(said[:1])}: expected a joint, a body (its far end), a site or the scene; "
                f"{meant(alike)}"
            )
        raise SettingsError(
            f"points {quoted(said)}: expected joints, bodies (their far ends), sites or the scene "
            f"({quoted(list(targets))}); say what each is with --points.map NAME=TARGET, or leave it out "
            f"with NAME={NOTHING}."
        )
    _refuse_same(found)
    if not found:
        raise MechanismError("points: expected at least one point of the mechanism, got none; map some.")
    return found


def targets_of(mechanism: Mechanism) -> dict[str, Mark]:
    """List what a point can be by name.

    Args:
        mechanism: The mechanism.

    Returns:
        A mark without a track for each name; ``<body>.marker`` and further points of the scene are not among
        them.
    """
    links, known = mechanism.plan.links, mechanism.values
    targets: dict[str, Mark] = {}
    for row, link in enumerate(links):
        for site in link.sites:
            targets[site.name] = Mark("", site.name, SITE, row, site.place, site.ahead)
    for row, link in enumerate(links):
        name = link.joint.name
        targets.setdefault(name, Mark("", name, JOINT, row, np.zeros(2)))
    for row, link in enumerate(links):
        body = link.joint.body
        if not link.carries or f"{body}.length" not in known or link.joint.kind == "slide":
            continue
        anchors = [links[k].anchor for k in range(len(links)) if links[k].parent == row]
        along, length = long_axis(link, anchors, [profile(g) for g in link.geoms if g.body == body])
        targets.setdefault(body, Mark("", body, END, row, along * length))
    for dot in dots_of(mechanism):
        targets.setdefault(dot.name, Mark("", dot.name, SITE, dot.link, dot.place, dot.ahead))
    targets[SCENE_NAMES[0]] = Mark("", SCENE_NAMES[0], SCENE, -1, np.full(2, np.nan))
    return targets


def _matched(track: str, wanted: str, targets: Mapping[str, Mark], *, exact: bool) -> Mark | None:
    """Return the mark of a point, None where nothing has its name."""
    mark = targets.get(wanted)
    stem = wanted.removesuffix(ANYWHERE)
    if mark is None and stem != wanted:
        body = targets.get(stem)
        if body is not None and body.kind in (END, JOINT):
            return Mark(track, wanted, FREE, body.link, np.full(2, np.nan))
    if mark is None and re.sub(r"\d+$", "", _plain(wanted)) in SCENE_NAMES:
        mark = targets[SCENE_NAMES[0]]
        return Mark(track, wanted, SCENE, mark.link, mark.place)
    if mark is None and not exact:
        # other tools write capitals, blanks and dots differently
        alike = [m for name, m in targets.items() if _plain(name) == _plain(wanted)]
        stem = re.sub(r"(end|tip)$", "", _plain(wanted))
        ends = [m for name, m in targets.items() if m.kind == END and _plain(name) == stem]
        mark = (alike or ends or [None])[0]
    return None if mark is None else Mark(track, mark.target, mark.kind, mark.link, mark.place, mark.ahead)


def _plain(name: str) -> str:
    return re.sub(r"[\s._-]+", "", name).casefold()


def _refuse_same(marks: Sequence[Mark]) -> None:
    """Refuse two points at one place."""
    for i, mark in enumerate(marks):
        for other in marks[:i]:
            if mark.kind in (JOINT, END, SITE) and mark.target == other.target:
                raise SettingsError(
                    f"points '{other.track}' and '{mark.track}': expected one point at '{mark.target}', "
                    f"got two; leave one out with --points.map {mark.track}={NOTHING}."
                )
