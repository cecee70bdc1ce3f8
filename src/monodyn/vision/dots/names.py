"""Tracklets and a first guess in, a name for each tracklet of the clip out.

From the frames of the guess the names go on outward, in both directions: a thing that appears takes the name
of a dot that is not in the picture, or none, whichever the mechanism explains better.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.mechanism.tree import ANCHOR_X, ANCHOR_Y, ANGLE, AXIS_X, AXIS_Y, HINGE
from monodyn.vision.dots.begin import Guess, seen_in
from monodyn.vision.dots.tracklets import Tracklet
from monodyn.vision.points.adjust import REDESCENDS, Adjustment, Fitted, Seen, cost, refine
from monodyn.vision.points.poses import solved
from monodyn.vision.points.shown import in_plane, project, turned

OFF = 2.0
"""Noise of the dots while they are named, in that of the frames that the names begin with."""
OFF_SHARE = (0.01, 0.004)
"""The same as a share of the extent of the mechanism in the picture, at least: with a scene of the first
frames, and with one of all."""
NOTHING = REDESCENDS**2
"""Cost of a spot that is no dot: as much as that of one that is nowhere near its mark."""
CONTINUES = 6.0
"""Cost of a dot that appears again far from where its motion led."""
SOON = 12
"""Frames after which nothing is known of where a motion led."""
JUDGED = 30
"""Frames of a tracklet from which it is named, at most."""
MOST_NEW = 4
"""Tracklets that are named together, at most."""
MOST_FITTED = 150
"""Frames from which the scene is found anew, at most."""
DOUBTFUL = 2.0
"""Cost of a spot from which the name of its tracklet is doubted."""
REVISIONS = 2
"""Times that doubtful names are revised at most."""
NONE = -1
"""Stands for the name of a tracklet that is no dot."""


@dataclass(frozen=True, eq=False)
class Naming:
    """A name for each tracklet.

    Attributes:
        tracklets: What moves.
        names: Number of the dot of each, ``NONE`` for what is none, int (row,).
        adjustment: What is refined.
        scene: The mechanism before the camera, with the noise at which names were compared.
    """

    tracklets: Sequence[Tracklet]
    names: np.ndarray
    adjustment: Adjustment
    scene: Fitted


def named_best(guesses: Sequence[Guess], tracklets: Sequence[Tracklet]) -> Naming:
    """Name all tracklets of a clip, from the guess that explains most of them.

    Args:
        guesses: Names of some of them, at least one.
        tracklets: What moves.

    Returns:
        Names for all.
    """
    found = [_named(guess, tracklets) for guess in guesses]
    # one noise for all: at its own each would be explained alike
    noise = np.min([naming.scene.noise for naming in found], axis=0)
    return min(found, key=lambda naming: _unexplained(naming, noise))


def _named(guess: Guess, tracklets: Sequence[Tracklet]) -> Naming:
    """Return names for all tracklets that go on from a guess."""
    scene = replace(guess.fitted, noise=_noise(guess, guess.fitted, OFF_SHARE[0]))
    found = _Names.begun(guess, tracklets)
    for share in OFF_SHARE:
        found = _Names.begun(guess, tracklets)
        for k in found.outward(guess.rows):
            found.name(k, guess.adjustment, scene)
        found.revise(guess.adjustment, scene)
        scene = _anew(guess, found, scene)
        scene = replace(scene, noise=_noise(guess, scene, share))
    return Naming(tracklets, found.names, guess.adjustment, scene)


def _unexplained(naming: Naming, noise: np.ndarray) -> float:
    """Return what a naming leaves unexplained of all spots at a noise [px], (point,)."""
    tracklets, names = naming.tracklets, naming.names
    rows = np.unique(np.concatenate([t.row for t in tracklets]))
    found = _Names(tracklets, names, np.ones(len(names), dtype=bool), len(noise))
    return found._total(rows, naming.adjustment, replace(naming.scene, noise=noise))


def _noise(guess: Guess, scene: Fitted, share: float) -> np.ndarray:
    """Return the noise with which names are compared [px], (point,)."""
    px = project(guess.adjustment.shown(scene), scene.position)
    extent = float(np.nanmax(np.nanmax(px, axis=(0, 1)) - np.nanmin(px, axis=(0, 1))))
    return np.maximum(OFF * float(np.sqrt(np.mean(scene.noise**2))), share * extent) * np.ones(px.shape[1])


def _anew(guess: Guess, found: _Names, scene: Fitted) -> Fitted:
    """Return the scene refined on frames of the whole clip."""
    rows = np.unique(
        np.concatenate([t.row for t, n in zip(found.tracklets, found.names, strict=True) if n >= 0])
    )
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_FITTED)).astype(int)]
    seen = found.seen(rows)
    begun = replace(scene, position=reached(guess.adjustment, scene, seen))
    begun = replace(begun, position=solved(guess.adjustment, begun, seen, begun.position))
    with np.errstate(all="ignore"):
        refined = refine(guess.adjustment, begun, seen)
    return refined if np.all(np.isfinite(refined.position)) else scene


@dataclass(eq=False)
class _Names:
    """Names so far, and of which tracklets they are known."""

    tracklets: Sequence[Tracklet]
    names: np.ndarray
    known: np.ndarray
    dots: int

    @classmethod
    def begun(cls, guess: Guess, tracklets: Sequence[Tracklet]) -> _Names:
        """Return the names of a guess."""
        names, known = np.full(len(tracklets), NONE), np.zeros(len(tracklets), dtype=bool)
        for dot, k in enumerate(guess.tracklets):
            names[k], known[k] = dot, True
        return cls(tracklets, names, known, len(guess.tracklets))

    def outward(self, rows: np.ndarray) -> list[int]:
        """Return the tracklets without a name, those next to some rows first."""
        first, last = int(rows[0]), int(rows[-1])
        gaps = [max(first - int(t.row[-1]), int(t.row[0]) - last, 0) for t in self.tracklets]
        return [int(k) for k in np.argsort(gaps, kind="stable") if not self.known[k]]

    def seen(self, rows: np.ndarray, more: Sequence[tuple[int, int]] = ()) -> Seen:
        """Return the points in some rows, with names for further tracklets."""
        px, weight = np.full((len(rows), self.dots, 2), np.nan), np.zeros((len(rows), self.dots))
        named = [(int(k), int(self.names[k])) for k in np.flatnonzero(self.names >= 0)]
        for k, dot in (*named, *more):
            if dot < 0:
                continue
            own = seen_in([self.tracklets[k]], rows)
            here = own.weight[:, 0] > 0.0
            px[here, dot], weight[here, dot] = own.px[here, 0], 1.0
        return Seen(px, weight)

    def explained(
        self, rows: np.ndarray, adjustment: Adjustment, scene: Fitted, more: Sequence[tuple[int, int]] = ()
    ) -> float:
        """Return the cost of all named points in some rows."""
        seen = self.seen(rows, more)
        begun = replace(scene, position=reached(adjustment, scene, seen))
        position = solved(adjustment, begun, seen, begun.position)
        return float(np.sum(cost(seen, project(adjustment.shown(begun), position), begun.noise)))

    def name(self, k: int, adjustment: Adjustment, scene: Fitted) -> None:
        """Name a tracklet, together with those that begin or end next to it."""
        if self.known[k]:
            return
        together = [k, *self._beside(k)]
        rows = self._judged(k)
        ways = [[NONE, *(d for d in range(self.dots) if self._free(j, d))] for j in together]
        best, least = [(j, NONE) for j in together], np.inf
        for way in itertools.product(*ways):
            more = list(zip(together, way, strict=True))
            if any(a == b >= 0 and self._meet(i, j) for (i, a), (j, b) in itertools.combinations(more, 2)):
                continue
            nothing = sum(self._count(j, rows) for j, dot in more if dot == NONE)
            found = NOTHING * nothing + sum(self._astray(j, dot, scene) for j, dot in more if dot >= 0)
            if found < least:
                found += self.explained(rows, adjustment, scene, more)
            if found < least:
                best, least = more, found
        for j, dot in best:
            self.names[j], self.known[j] = dot, True

    def revise(self, adjustment: Adjustment, scene: Fitted) -> None:
        """Give doubtful tracklets other names as long as that explains more; what has that name loses it
        where both are seen at once."""
        for _ in range(REVISIONS):
            before = self.names.copy()
            for k in np.argsort([-len(t.row) for t in self.tracklets], kind="stable").tolist():
                if self._doubtful(k, adjustment, scene):
                    self._revise(k, adjustment, scene)
            if np.array_equal(before, self.names):
                break

    def _doubtful(self, k: int, adjustment: Adjustment, scene: Fitted) -> bool:
        """Return whether a tracklet has no name, or one that explains little."""
        rows = self.tracklets[k].row
        return self.names[k] == NONE or self.explained(rows, adjustment, scene) > DOUBTFUL * len(rows)

    def _revise(self, k: int, adjustment: Adjustment, scene: Fitted) -> None:
        """Give a tracklet the name with which most is explained."""
        best, least = self.names, np.inf
        begun = self.names
        for dot in (int(begun[k]), *(d for d in range(NONE, self.dots) if d != begun[k])):
            names = begun.copy()
            names[k] = dot
            if dot >= 0:
                for j in np.flatnonzero(begun == dot):
                    names[j] = NONE if j != k and self._meet(k, int(j)) else dot
            # only the frames of what changes count
            changed = [k, *np.flatnonzero(names != begun).tolist()]
            changed += [int(j) for j in np.flatnonzero(begun >= 0) if self._meet(k, int(j))]
            rows = np.unique(np.concatenate([self.tracklets[j].row for j in changed]))
            self.names = names
            found = self._total(rows, adjustment, scene) - self._of(begun, rows, adjustment, scene)
            if found < least - 1e-6:
                best, least = names, found
        self.names = best

    def _of(self, names: np.ndarray, rows: np.ndarray, adjustment: Adjustment, scene: Fitted) -> float:
        """Return what other names leave unexplained in some rows."""
        other = _Names(self.tracklets, names, self.known, self.dots)
        return other._total(rows, adjustment, scene)

    def _total(self, rows: np.ndarray, adjustment: Adjustment, scene: Fitted) -> float:
        """Return what the names leave unexplained in some rows."""
        nothing = sum(self._count(int(k), rows) for k in np.flatnonzero(self.names == NONE))
        return NOTHING * nothing + self.explained(rows, adjustment, scene)

    def _beside(self, k: int) -> list[int]:
        """Return unnamed tracklets that share rows with one, as many as can be named together."""
        rows = self._judged(k)
        others = [j for j in np.flatnonzero(~self.known) if j != k and self._count(int(j), rows) >= 1]
        others.sort(key=lambda j: -self._count(int(j), rows))
        return [int(j) for j in others[: min(MOST_NEW, self.dots) - 1]]

    def _judged(self, k: int) -> np.ndarray:
        """Return the rows in which a tracklet is judged: those next to what has names already."""
        rows, known = self.tracklets[k].row, np.flatnonzero(self.known & (self.names >= 0)).tolist()
        before = any(int(self.tracklets[j].row[0]) < int(rows[0]) for j in known)
        return rows[:JUDGED] if before else rows[-JUDGED:]

    def _count(self, k: int, rows: np.ndarray) -> int:
        return int(np.isin(self.tracklets[k].row, rows).sum())

    def _meet(self, i: int, j: int) -> bool:
        return bool(np.isin(self.tracklets[i].row, self.tracklets[j].row).any())

    def _free(self, k: int, dot: int) -> bool:
        """Return whether a dot is not seen elsewhere in the rows of a tracklet."""
        return not any(self._meet(k, int(j)) for j in np.flatnonzero(self.names == dot))

    def _astray(self, k: int, dot: int, scene: Fitted) -> float:
        """Return the cost of a tracklet's begin or end by how far it is from where its dot's motion led."""
        own, worst = self.tracklets[k], 0.0
        for j in np.flatnonzero(self.names == dot):
            other = self.tracklets[int(j)]
            first, second = (other, own) if other.row[-1] < own.row[0] else (own, other)
            gap = int(second.row[0]) - int(first.row[-1])
            if not 0 < gap <= SOON or min(len(first.row), len(second.row)) < 2:
                continue
            ahead = (first.px[-1] - first.px[-2]) / (first.row[-1] - first.row[-2])
            behind = (second.px[1] - second.px[0]) / (second.row[1] - second.row[0])
            off = second.px[0] - first.px[-1] - 0.5 * gap * (ahead + behind)
            usual = 3.0 * scene.noise[dot] + 0.25 * gap * float(np.hypot(*ahead) + np.hypot(*behind))
            worst = max(worst, CONTINUES * min(1.0, float(np.hypot(*off)) / usual))
        return worst


def reached(adjustment: Adjustment, fitted: Fitted, seen: Seen) -> np.ndarray:
    """Return poses in which each link points at its first point that is seen, (frame, dof).

    Args:
        adjustment: The marks.
        fitted: The mechanism with its sizes before the camera.
        seen: The points; a link without one stays on the line between the frames around.
    """
    camera, tree, marks = fitted.camera, fitted.mechanism.tree, adjustment.places.marks
    place, _ = adjustment.places.at(fitted.mechanism, fitted.own)
    plane = in_plane(camera, seen.px) * camera.depth + [camera.x, camera.y]
    count, dofs = len(plane), len(tree.parent)
    origin, angle = np.zeros((dofs, count, 2)), np.zeros((dofs, count))
    position = np.zeros((count, dofs))
    for i, parent in enumerate(tree.parent):
        base, turn = (
            (origin[parent], angle[parent]) if parent >= 0 else (np.zeros((count, 2)), np.zeros(count))
        )
        at = base + turned(tree.links[i, [ANCHOR_X, ANCHOR_Y]], turn)
        shown = [row for row, mark in enumerate(marks) if mark.link == i]
        own = np.full(count, np.nan)
        direction = turned(tree.links[i, [AXIS_X, AXIS_Y]], turn + tree.links[i, ANGLE])
        for row in sorted(shown, key=lambda row: -float(np.hypot(*place[row]))):
            away = plane[:, row] - at
            if tree.kind[i] == HINGE:
                value = np.arctan2(away[:, 1], away[:, 0]) - np.arctan2(place[row, 1], place[row, 0])
                value = tree.links[i, AXIS_X] * (value - turn - tree.links[i, ANGLE])
            else:
                value = np.sum(away * direction, axis=1)
            own = np.where(np.isnan(own), value, own)
        position[:, i] = _between(own, hinge=tree.kind[i] == HINGE)
        angle[i] = turn + tree.links[i, ANGLE]
        if tree.kind[i] == HINGE:
            angle[i], origin[i] = angle[i] + tree.links[i, AXIS_X] * position[:, i], at
        else:
            origin[i] = at + position[:, i, np.newaxis] * direction
    return position


def _between(values: np.ndarray, *, hinge: bool) -> np.ndarray:
    """Return values whose gaps are filled on straight lines, (frame,)."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.zeros(len(values))
    path = np.unwrap(values[known]) if hinge else values[known]
    return np.interp(np.arange(len(values)), known, path)
