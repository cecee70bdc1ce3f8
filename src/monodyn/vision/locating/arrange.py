"""Where the further geoms of a body are, how large and how turned: a search in the picture of the body.

Each further geom is tried at every place, turn and size at once, whatever the file says of them, one after
the other. Where a geom follows other parts by the file, it does so afterwards only if that explains the masks
as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.solids import SPHERE, Solid
from monodyn.vision.drawing.mismatch import covered_area
from monodyn.vision.drawing.rig import rig_of
from monodyn.vision.locating.body import BodyView, best_bar, best_disc, left_over
from monodyn.vision.locating.grow import SceneStart, Structure
from monodyn.vision.locating.keyframes import KeyFrames
from monodyn.vision.locating.search import SceneGuess, as_thick, thinned
from monodyn.vision.locating.settle import frames_cost, settled
from monodyn.vision.locating.unit import drawn

BETTER = 0.01
"""Share of the foreground that has to be explained in addition for a geom to stand elsewhere."""
LEFT_SHARE = 0.05
"""The same as a share of what is left unexplained: faint and blurred parts leave much."""
LEFT_OVER = 0.5 * BETTER
"""Share of the foreground right beside a body below which no other place of its geoms is looked for."""
ROUNDS = 2
"""How often each geom is placed among the others."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A further geom of a body, with the parameters that place it.

    Attributes:
        geom: Its row among the shapes.
        link: Row of its link.
        along: Name of its place along the axis of the body.
        across: Name of its place across it.
        width: Name of its width.
        length: Name of its length, empty for what is round.
        turn: Name of its turn, empty where it has none.
        axis: Direction of the axis in the link's frame, (2,).
        capped: True where round ends reach beyond its length.
    """

    geom: int
    link: int
    along: str
    across: str
    width: str
    length: str
    turn: str
    axis: np.ndarray
    capped: bool

    @property
    def names(self) -> list[str]:
        """Names of its parameters."""
        return [n for n in (self.along, self.across, self.width, self.length, self.turn) if n]


def arranged(frames: KeyFrames, guess: SceneGuess, start: SceneStart) -> SceneGuess:
    """Place the further geoms of every body where the masks show them.

    Args:
        frames: The key frames of the guess.
        guess: A mechanism with its poses.
        start: What may not change.

    Returns:
        The guess with its geoms where they explain more of the masks, and free there; else as it is.
    """
    geoms = further_geoms(guess.mechanism, start.pinned)
    as_filed = replace(guess, mechanism=_lengthwise(guess.mechanism, geoms))
    # where the outlines leave nothing over that moves along there is nothing to place
    if not geoms or max(left_over(frames, guess).values()) < LEFT_OVER:
        return as_filed
    # in masks that are made thicker every geom is looked for as thick as these
    thick = replace(guess, mechanism=as_thick(frames, guess.mechanism, guess.camera))
    found = _placed_anew(frames, thick, start, geoms)
    if found is None:
        return as_filed
    held = {p.name: p.value for p in drawn(guess.mechanism) if p.name in start.pinned}
    return replace(found, mechanism=thinned(frames, found.mechanism, found.camera).with_values(held))


def _placed_anew(
    frames: KeyFrames, guess: SceneGuess, start: SceneStart, geoms: list[Placed]
) -> SceneGuess | None:
    """Return a guess with its geoms where they explain more of the masks, None where they do so nowhere."""
    tied = followers(guess.mechanism, geoms, start.pinned)
    free = guess.mechanism.with_following(tied, follow=False)
    # what the same search of sizes reaches while every geom stays with the parts that it follows
    kept = resettled(frames, guess, start)
    tried = [
        _in_rounds(frames, replace(guess, mechanism=free), start, geoms, anew=anew) for anew in (False, True)
    ]
    best = min(tried, key=lambda one: frames_cost(frames, one.mechanism, one.camera, one.positions))
    # A faint part is cheaper to leave out than to draw: only what covers more of the foreground is believed,
    # and the less of the masks is explained at all, the more of it.
    left = frames_cost(frames, kept.mechanism, kept.camera, kept.positions)
    drop = left - frames_cost(frames, best.mechanism, best.camera, best.positions)
    if min(drop, _covered(frames, best) - _covered(frames, kept)) < max(BETTER, LEFT_SHARE * left):
        return None
    best = replace(best, mechanism=_named(_lengthwise(best.mechanism, geoms), geoms))
    return replace(best, mechanism=_tied_again(frames, best, tied, start.pinned))


def further_geoms(mechanism: Mechanism, pinned: frozenset[str]) -> list[Placed]:
    """List the visible geoms that have a place of their own which may change.

    Args:
        mechanism: The mechanism.
        pinned: Parameters that may not change.

    Returns:
        The geoms in the order of the shapes.
    """
    found = []
    for g, solid in enumerate(mechanism.plan.drawn):
        geom = _placed_of(mechanism, g, solid)
        if geom is not None and not pinned.intersection(geom.names):
            found.append(geom)
    return found


def followers(mechanism: Mechanism, geoms: list[Placed], pinned: frozenset[str]) -> list[str]:
    """Name the parameters of geoms that follow other sizes and that the user did not choose.

    Args:
        mechanism: The mechanism.
        geoms: The geoms.
        pinned: Parameters that may not change.

    Returns:
        The names.
    """
    kept = mechanism.chosen | pinned
    return [n for geom in geoms for n in geom.names if mechanism.parameter(n).follows and n not in kept]


def freed(mechanism: Mechanism, file: Mechanism) -> list[str]:
    """Name the parameters that follow others in the file and have values of their own here.

    Args:
        mechanism: The mechanism.
        file: The same as in the file.

    Returns:
        The names.
    """
    follows = {p.name for p in file.parameters if p.follows}
    return [p.name for p in mechanism.parameters if p.name in follows and not p.follows]


def _placed_of(mechanism: Mechanism, g: int, solid: Solid) -> Placed | None:
    """Return a geom with the names of its parameters, None where it has no place along its body."""
    assert solid.look is not None
    x, y = solid.look.middle[:2]
    names = list(dict.fromkeys([*x, *y]))
    along = next((n for n in names if n.endswith(".along")), "")
    across = next((n for n in names if n.endswith(".across")), "")
    width = next((n for n in solid.across if n.endswith(".width")), "")
    if not (along and across and width):
        return None
    length = next((n for n in solid.along if n.endswith(".length")), "") if solid.kind != SPHERE else ""
    axis = np.array([x.get(along, 0.0), y.get(along, 0.0)])
    link = int(mechanism.shapes.link[g])
    return Placed(g, link, along, across, width, length, solid.turn, axis, bool(solid.radius))


def _in_rounds(
    frames: KeyFrames, guess: SceneGuess, start: SceneStart, geoms: list[Placed], *, anew: bool
) -> SceneGuess:
    """Place geoms one after the other, settle all sizes, and again.

    One of them may stand in for a part of another: ``anew`` first hides all of them at their joints and lets
    the rest of the body take its size.
    """
    absent: set[int] = set()
    if anew:
        absent = {geom.geom for geom in geoms}
        guess = resettled(frames, replace(guess, mechanism=_hidden(frames, guess, geoms)), start)
    for _ in range(ROUNDS):
        before = frames_cost(frames, guess.mechanism, guess.camera, guess.positions)
        for geom in geoms:
            guess = replace(guess, mechanism=_placed_best(frames, guess, geom, absent))
            absent.discard(geom.geom)
        guess = resettled(frames, guess, start)
        if frames_cost(frames, guess.mechanism, guess.camera, guess.positions) > before - BETTER:
            break
    return guess


def _hidden(frames: KeyFrames, guess: SceneGuess, geoms: list[Placed]) -> Mechanism:
    """Return the mechanism with geoms as small as a reduced pixel, at their joints."""
    least = frames.shrink * guess.camera.depth / guess.camera.focal
    sizes: dict[str, float] = {}
    for geom in geoms:
        sizes |= {geom.along: 0.0, geom.across: 0.0, geom.width: least}
        sizes |= {geom.length: least} if geom.length else {}
    return guess.mechanism.with_values(sizes)


def _placed_best(frames: KeyFrames, guess: SceneGuess, geom: Placed, absent: Collection[int]) -> Mechanism:
    """Return the mechanism with one geom at its best place, as it is where no other place is better."""
    mechanism, axis = guess.mechanism, geom.axis
    view = BodyView(frames, guess, geom.link)
    picture, cell = view.gain.copy(), view.cell
    picture[view.covered([g for g in view.geoms if g != geom.geom and g not in absent])] = 0.0
    now = 0.0 if geom.geom in absent else float(picture[view.covered([geom.geom])].sum())
    bar = best_bar(picture) if geom.turn else best_disc(picture)
    if bar.gain < now + BETTER * view.area:
        return mechanism
    along, across = bar.x * axis[0] + bar.y * axis[1], bar.y * axis[0] - bar.x * axis[1]
    values = {geom.along: along * cell, geom.across: across * cell, geom.width: bar.width * cell}
    if geom.length:
        length = bar.length - bar.width if geom.capped else bar.length
        values[geom.length] = max(length, 1.0) * cell
    if geom.turn:
        turn = bar.angle - math.atan2(axis[1], axis[0])
        values[geom.turn] = _nearest_turn(turn, mechanism.values[geom.turn])
    return mechanism.with_values(values)


def _nearest_turn(turn: float, near: float) -> float:
    """Return the angle nearest to ``near`` that is a whole number of half turns from ``turn`` [rad]."""
    return turn + math.pi * round((near - turn) / math.pi)


def resettled(frames: KeyFrames, guess: SceneGuess, start: SceneStart) -> SceneGuess:
    """Improve sizes, places and turns one by one, poses and camera held.

    Args:
        frames: The key frames of the guess.
        guess: A mechanism with its poses.
        start: What may not change.

    Returns:
        The guess with the sizes at which its outlines explain most of the frames.
    """
    beams = tuple(q[np.newaxis] for q in guess.positions)
    begun = Structure(guess.mechanism, guess.camera, 0, (), None, beams, (), ())
    better = settled(frames, begun, replace(start, pinned=start.pinned | {"camera.x", "camera.y"}))
    return replace(guess, mechanism=better.mechanism, camera=better.camera)


def _tied_again(frames: KeyFrames, guess: SceneGuess, tied: list[str], pinned: frozenset[str]) -> Mechanism:
    """Let those parameters follow other sizes again with which the masks are explained as well."""
    mechanism = guess.mechanism
    least = frames_cost(frames, mechanism, guess.camera, guess.positions)
    for name in tied:
        ways = [
            (frames_cost(frames, tried, guess.camera, guess.positions), i, tried)
            for i, tried in enumerate(_ways_to_follow(mechanism, name, pinned))
        ]
        cost, _, tried = min(ways)
        if cost < least + 0.5 * BETTER:
            mechanism, least = tried, min(cost, least)
    return mechanism


def _ways_to_follow(mechanism: Mechanism, name: str, pinned: frozenset[str]) -> Iterator[Mechanism]:
    """Return the mechanism with a parameter that follows others: as they are, or with one of them changed so
    that it stays where it is.

    What it follows may be hidden and anywhere, such as the end of a rod inside of its head.
    """
    table, before = mechanism.plan.table, mechanism.values
    following = mechanism.with_following([name], follow=True)
    yield following
    missing = before[name] - following.values[name]
    for other, factor in (table.tie[table.names.index(name)] or {}).items():
        if other and factor and other not in pinned and not following.parameter(other).follows:
            value = before[other] + missing / factor
            if value > 0.0:
                yield following.with_values({other: value})


def _lengthwise(mechanism: Mechanism, geoms: list[Placed]) -> Mechanism:
    """Name the longer side of a block as the file does: a quarter turn and exchanged sides look the same."""
    table, values = mechanism.plan.table, mechanism.values
    start = dict(zip(table.names, table.start, strict=True))
    changed: dict[str, float] = {}
    for geom in geoms:
        if not (geom.length and geom.turn) or geom.capped or mechanism.parameter(geom.turn).follows:
            continue
        long, wide = values[geom.length], values[geom.width]
        if (long - wide) * (start[geom.length] - start[geom.width]) < 0.0:
            turn = _nearest_turn(values[geom.turn] + 0.5 * math.pi, start[geom.turn])
            changed |= {geom.length: wide, geom.width: long, geom.turn: turn}
    return mechanism.with_values(changed) if changed else mechanism


def _covered(frames: KeyFrames, guess: SceneGuess) -> float:
    """Return the mean share of the foreground inside of the outlines."""
    rig = rig_of(guess.mechanism, guess.camera, shrink=frames.shrink)
    shares = [
        covered_area(frame.sums, rig, q) / max(frame.area, 1.0)
        for frame, q in zip(frames.frames, guess.positions, strict=True)
    ]
    return float(np.mean(shares))


def _named(mechanism: Mechanism, geoms: list[Placed]) -> Mechanism:
    """Exchange the names of geoms of a body where the file's arrangement is nearer to that."""
    table = mechanism.plan.table
    start = dict(zip(table.names, table.start, strict=True))
    for one, other in itertools.combinations(geoms, 2):
        if one.link != other.link or one.capped != other.capped or len(one.names) != len(other.names):
            continue
        values, scale = mechanism.values, _scale(mechanism, one)
        as_named = _apart(one, one, values, start, scale) + _apart(other, other, values, start, scale)
        exchanged = _apart(one, other, values, start, scale) + _apart(other, one, values, start, scale)
        if exchanged < as_named:
            pairs = [*zip(one.names, other.names, strict=True)]
            mechanism = mechanism.with_values(
                {a: values[b] for a, b in pairs} | {b: values[a] for a, b in pairs}
            )
    return mechanism


def _scale(mechanism: Mechanism, geom: Placed) -> float:
    """Return by how much the body of a geom has grown against the file."""
    table, against = mechanism.plan.table, mechanism.parameter(geom.along).against
    return mechanism.values[against] / table.start[table.names.index(against)] if against else 1.0


def _apart(
    geom: Placed, named: Placed, values: dict[str, float], start: dict[str, float], scale: float
) -> float:
    """Return how far place and size of a geom are from those that the file gives to ``named`` [m^2]."""
    lengths = [(a, b) for a, b in zip(geom.names, named.names, strict=True) if a != geom.turn]
    return sum((values[a] - scale * start[b]) ** 2 for a, b in lengths)
