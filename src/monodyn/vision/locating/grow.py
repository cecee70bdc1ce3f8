"""Structures that grow link by link: places, proportions and poses at once, from the masks alone.

A structure is a mechanism of which the first links have sizes and, in every key frame, a beam of poses. Each
link is added with every length of a grid that spans the foreground's reach and with the widths that the
foreground has; the structures that explain most of the frames go on. The file's own sizes enter only where
they may not change.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.mechanism import Mechanism
from monodyn.mechanism.parts import PLACE_KINDS, Parameter
from monodyn.types import FULL, Camera
from monodyn.vision.drawing.mismatch import pose_balance
from monodyn.vision.drawing.rig import SIZE_KINDS, Rig, longest_reach, rig_of
from monodyn.vision.locating.beam import Beam, extended
from monodyn.vision.locating.keyframes import KeyFrame, KeyFrames
from monodyn.vision.locating.roots import Root
from monodyn.vision.locating.unit import drawn, growth, scaled

LONGEST, RATIO, LENGTHS = 0.97, 1.2, 13
"""The longest length of a link that is tried, as a share of the reach; ratio of one length to the next; how
many are tried."""
NARROW = Beam(8, 60, 144)
"""Poses kept per link and frame, positions tried per hinge and per slide, while structures grow."""
KEPT, KEPT_A_ROOT = 12, 5
"""Structures kept per link, and most of them with the same root; twice as many of more than ``ALL_TRIED``
links."""
THIN, THICK = 30.0, 1.35
"""Percentile of the widths of the foreground that counts as thin; wider parts are tried besides where they
are wider than that by this factor."""
GROWN_PX = 45
"""Reach of the mechanism in the picture in which structures grow [px]."""
FIRST_FRAMES, LEFT, LEFT_SHARE = 2, 40, 0.25
"""Frames after which most structures are given up; how many are left, or which share of them."""
THREAD_PX = 0.2
"""Width of a part of a body that the masks do not show [px]: wherever it is, it costs next to nothing."""
END = 0.5
"""How far a body reaches beyond its hinges before it is known, in its widths."""
ALL_TRIED = 2
"""Links up to which about all lengths are tried with all others; of more links only the best go on."""


@dataclass(frozen=True, eq=False)
class SceneStart:
    """What the search starts from, in units of the distance from the camera.

    Attributes:
        mechanism: With start sizes.
        camera: Start camera: its focal length and turns are kept.
        pinned: Parameters that may not change.
    """

    mechanism: Mechanism
    camera: Camera
    pinned: frozenset[str]


@dataclass(frozen=True, eq=False)
class Structure:
    """A mechanism before a camera whose first links have been laid into the frames.

    Attributes:
        mechanism: Sizes of the first links as tried, of the others as they grow with these.
        camera: The camera, with the root in its place.
        root: Number of its root.
        steps: Which length of the grid each link has; between two for one that was measured.
        scale: Factor on the sizes that are held; None until the first of them is met.
        beams: The best poses in each frame, (pose, dof).
        shares: Share of the foreground of each frame that is not explained.
        near: Share of the foreground of each frame that the links laid so far could reach.
    """

    mechanism: Mechanism
    camera: Camera
    root: int
    steps: tuple[float, ...]
    scale: float | None
    beams: tuple[np.ndarray, ...]
    shares: tuple[float, ...]
    near: tuple[float, ...]

    @property
    def score(self) -> float:
        """Mean share of the better frames that is not explained."""
        return better_mean(np.array(self.shares))

    @property
    def is_measured(self) -> bool:
        """Whether it is a first link alone whose length was measured."""
        return len(self.steps) == 1 and self.steps[0] % 1.0 > 0.0

    @property
    def strict_score(self) -> float:
        """The same where what is not explained counts twice if the links laid so far could reach it.

        Later links explain what is farther away. What is near and left over tells that a long link was laid
        over several short ones, which explains more of the foreground than the first of these alone.
        """
        shares, near = np.array(self.shares), np.array(self.near)
        return better_mean(shares + (shares + near - 1.0))


def grown(frames: KeyFrames, start: SceneStart, roots: list[Root]) -> list[Structure]:
    """Grow structures from roots.

    Args:
        frames: The key frames, all of which count.
        start: The mechanism, the camera, and what may not change.
        roots: Where the first joint may be.

    Returns:
        The best structures of different proportions, the best first.
    """
    widths, structures = typical_widths(frames), []
    quick = frames.reduced(max(1, int(max(root.reach for root in roots) / frames.shrink / GROWN_PX)))
    shown = [np.nonzero(frame.coarse) for frame in quick.frames]
    amounts = [
        [_amounts_within(*pair, root, quick.shrink) for pair in zip(quick.frames, shown, strict=True)]
        for root in roots
    ]
    tried = [seed for i, root in enumerate(roots) for seed in _seeds(start, i, root, widths)]
    for link in range(len(start.mechanism.joints)):
        if link:
            reaches = [(one, roots[one.root].reach) for one in structures]
            tried = [longer for one, reach in reaches for longer in _lengthened(one, start, link, reach)]
        wide = [list(_widened(one, start, link, widths)) for one in tried]
        structures = _raced(wide, quick, amounts)
    return structures


def typical_widths(frames: KeyFrames) -> list[float]:
    """Return the widths that the foreground has: that of its thin parts, that of its widest, and that of its
    widest together with what is not known of the background, as far as they differ.

    Args:
        frames: The key frames.

    Returns:
        One to three widths [px].
    """
    thin, thick = _inscribed(frames, hidden=False)
    # where all is about as wide, the widest place of each frame is what a body without others shows
    widths = [thin, thick] if thick > THICK * thin else [thick]
    hidden = _inscribed(frames, hidden=True)[1]
    return [width * frames.shrink for width in (*widths, *([hidden] if hidden > THICK * thick else []))]


def _inscribed(frames: KeyFrames, *, hidden: bool) -> tuple[float, float]:
    """Return the diameters of circles inside of the foreground that touch it on both sides: of those in thin
    places, and of the largest [reduced px]; with ``hidden`` this may reach into what is not known, too."""
    import cv2

    ridges, widest = [], []
    for frame in frames.frames:
        shown = (frame.coarse > FULL // 2) & ~frames.unknown
        # a part that lies before edges of the scene is cut by what is not known there, and no thinner for it
        inside = (shown | frames.unknown).astype(np.uint8)
        depth = cv2.distanceTransform(inside, cv2.DIST_L2, 5)
        top = depth >= cv2.dilate(depth, np.ones((3, 3), np.uint8))
        if not (top & shown).any():
            continue
        ridges.append(depth[top & shown])
        alone = cv2.distanceTransform(shown.astype(np.uint8), cv2.DIST_L2, 5)
        widest.append(float((depth if hidden else alone)[shown].max()))
        if hidden:
            # what lies before its own picture shows its ends alone: it is as wide as what they belong to
            number = cv2.connectedComponents(inside, connectivity=4)[1]
            belongs = np.isin(number, number[shown]) & frames.unknown & top
            widest[-1] = max(widest[-1], float(np.median(depth[belongs])) if belongs.any() else 0.0)
    if not ridges:
        return 2.0, 2.0
    # a distance is counted to the middle of the next pixel outside
    thin, thick = float(np.percentile(np.concatenate(ridges), THIN)), float(np.median(widest))
    return 2.0 * max(thin - 0.5, 0.5), 2.0 * max(thick - 0.5, 0.5)


def whole(structure: Structure, start: SceneStart) -> Structure:
    """Give a grown structure what its pictures do not show.

    Args:
        structure: With all its links.
        start: What may not change, and the file's proportions.

    Returns:
        The structure with held sizes at one scale, thicknesses and offsets in proportion to the lengths.
    """
    grew = growth(structure.mechanism, start.mechanism)
    scale = grew if structure.scale is None else structure.scale
    sizes = {}
    for p in drawn(start.mechanism):
        if p.kind in (*SIZE_KINDS, *PLACE_KINDS) and p.name in start.pinned:
            sizes[p.name] = p.value * scale
        elif p.kind in ("offset", "thickness"):
            sizes[p.name] = p.value * (scale if p.name in start.pinned else grew)
    free = [p for p in drawn(start.mechanism) if p.name not in start.pinned]
    sizes |= _believed(structure.mechanism.values | sizes, free)
    return replace(structure, mechanism=structure.mechanism.with_values(sizes), scale=scale)


def _seeds(start: SceneStart, number: int, root: Root, widths: list[float]) -> Iterator[Structure]:
    """Return the mechanism at a root at each scale that is to be tried: the first link has a length of the
    grid, or one that was measured, or where it has none the whole mechanism has it."""
    mechanism, camera = start.mechanism, start.camera
    known, name = mechanism.values, f"{mechanism.joints[0].body}.length"
    at_once = "camera.depth" in start.pinned
    size = known.get(name) or longest_reach(rig_of(mechanism, camera))
    longest = LONGEST * root.reach
    # what hangs on one hinge reaches beyond its length by half its width: for a ball that is much
    extents = root.extents or [root.reach - 0.5 * width for width in widths if len(mechanism.joints) == 1]
    shown = [
        float(np.log(longest / extent) / np.log(RATIO)) for extent in extents if name in known and extent > 0
    ]
    for step in (*range(LENGTHS), *shown):
        factor = longest * camera.depth / camera.focal / RATIO**step / size
        held = name in start.pinned or name not in known
        scale = 1.0 if at_once else factor if held else None
        tried = scaled(mechanism, factor if scale is None else scale)
        if not (at_once and held):
            free = [p for p in drawn(mechanism) if p.name not in start.pinned]
            tried = tried.with_values({p.name: p.value * factor for p in free})
        yield Structure(tried, _before(start, root), number, (step,), scale, (), (), ())
        if at_once and held:
            break


def _before(start: SceneStart, root: Root) -> Camera:
    """Return the camera that sees the first joint, the origin of the plane, at a root."""
    camera = start.camera
    centre = (camera.width - 1) / 2.0, (camera.height - 1) / 2.0
    per_px = camera.depth / camera.focal
    if "camera.x" not in start.pinned and np.isfinite(root.x):
        camera = replace(camera, x=(centre[0] - root.x) * per_px)
    if "camera.y" not in start.pinned and np.isfinite(root.y):
        camera = replace(camera, y=(root.y - centre[1]) * per_px)
    return camera


def _lengthened(structure: Structure, start: SceneStart, link: int, reach: float) -> Iterator[Structure]:
    """Return a structure with each length of a further link that is to be tried."""
    body, known = start.mechanism.joints[link].body, start.mechanism.values
    name, scale = f"{body}.length", structure.scale
    is_first = all(joint.body != body for joint in start.mechanism.joints[:link])
    if not is_first or name not in known or (name in start.pinned and scale is not None):
        yield replace(structure, steps=(*structure.steps, 0))
        return
    for step in range(LENGTHS):
        length = LONGEST * reach * structure.camera.depth / structure.camera.focal / RATIO**step
        grew = length / known[name]
        # what else the body has keeps its proportion to the length, until its own turn comes
        sizes = {p.name: p.value * grew for p in drawn(start.mechanism) if p.owner == body}
        sizes = {n: value for n, value in sizes.items() if n not in start.pinned}
        if name in start.pinned:
            scale = grew
            sizes |= {p.name: p.value * scale for p in drawn(start.mechanism) if p.name in start.pinned}
        mechanism = structure.mechanism.with_values(sizes)
        yield replace(structure, mechanism=mechanism, scale=scale, steps=(*structure.steps, step))


def _widened(structure: Structure, start: SceneStart, link: int, widths: list[float]) -> Iterator[Structure]:
    """Return a structure with each of the widths for the geoms of a link, and ends to match."""
    body, per_px = start.mechanism.joints[link].body, structure.camera.depth / structure.camera.focal
    own = [p for p in drawn(start.mechanism) if p.owner == body and p.name not in start.pinned]
    names = [p.name for p in own if p.kind == "width"]
    ends = [p.name for p in own if p.kind in ("tail", "tip")]
    # further geoms of a body share the second width: all combinations of many would be too many
    tried = list(itertools.product(widths, repeat=min(len(names), 2)))
    if len(names) > 1:
        # the masks may show one part of the body alone; which of them the file takes for its main part
        # depends on its sizes
        tried += [pair for width in widths for pair in ((THREAD_PX, width), (width, THREAD_PX))]
    for chosen in tried:
        sizes = {name: chosen[min(i, 1)] * per_px for i, name in enumerate(names)}
        sizes |= dict.fromkeys(ends, END * (chosen[0] if chosen else widths[0]) * per_px)
        sizes |= _believed(structure.mechanism.values | sizes, own)
        yield replace(structure, mechanism=structure.mechanism.with_values(sizes))


def _believed(values: dict[str, float], sizes: list[Parameter]) -> dict[str, float]:
    """Return the thicknesses among some sizes, by name: what is thicker than wide would show its depth, and a
    file that says so is not believed."""
    return {
        p.name: min(values[p.name], values.get(p.name.removesuffix("thickness") + "width", np.inf))
        for p in sizes
        if p.kind == "thickness"
    }


def _raced(
    tried: list[list[Structure]], frames: KeyFrames, amounts: list[list[np.ndarray]]
) -> list[Structure]:
    """Lay the last link, of structures that differ in its widths alone the best, into a few frames, and where
    that goes best into the others."""
    every = range(len(frames.frames))
    begun = on_all_cores(lambda alike: _begun(alike, frames, amounts[alike[0].root]), tried)
    most = max(LEFT, round(LEFT_SHARE * len(begun)))
    left = _alternately(begun)
    left = left[:most] + [one for one in left[most:] if one.is_measured]
    return _best(on_all_cores(lambda one: _laid(one, frames, amounts[one.root], every[FIRST_FRAMES:]), left))


def _begun(alike: list[Structure], frames: KeyFrames, amounts: list[np.ndarray]) -> Structure:
    """Lay the last link into the first frames with the widths that explain most of them.

    Bodies of other widths lie where one lies: directions are tried for the first of them alone.
    """
    rows = range(len(frames.frames))[:FIRST_FRAMES]
    first = _laid(alike[0], frames, amounts, rows)
    rest = [_laid(replace(one, beams=first.beams), frames, amounts, rows, is_set=True) for one in alike[1:]]
    return min([first, *rest], key=lambda one: one.score)


def _laid(
    structure: Structure, frames: KeyFrames, amounts: list[np.ndarray], rows: range, *, is_set: bool = False
) -> Structure:
    """Lay the last link into some of the frames; with ``is_set`` it stays where the beams have it."""
    rig = rig_of(structure.mechanism, structure.camera, shrink=frames.shrink)
    beams = list(structure.beams) or [np.zeros((1, len(rig.parent)))] * len(frames.frames)
    shares, near = list(structure.shares[: rows.start]), list(structure.near[: rows.start])
    link = len(structure.steps) - 1
    reach, geoms = _reach_px(structure, link) / frames.shrink, int(np.sum(rig.link <= link))
    for row in rows:
        frame, poses = frames.frames[row], beams[row]
        if is_set:
            costs = pose_balance(frame.balance, rig, poses, geoms)
        else:
            poses, costs = extended(frame, rig, structure.mechanism, link, poses, NARROW)
        order = np.argsort(costs, kind="stable")
        beams[row] = poses[order]
        shares.append(unexplained(frame, float(costs[order[0]])))
        near.append(float(amounts[row][int(min(reach, len(amounts[row]) - 1))]))
    return replace(structure, beams=tuple(beams), shares=tuple(shares), near=tuple(near))


def _reach_px(structure: Structure, link: int) -> float:
    """Return how far the links up to one reach from the root, stretched out [px]; without end where one of
    them slides or has no length."""
    values, reach = structure.mechanism.values, 0.0
    for joint in structure.mechanism.joints[: link + 1]:
        length = values.get(f"{joint.body}.length") if joint.kind == "hinge" else None
        reach += np.inf if length is None else length
    return reach * structure.camera.focal / structure.camera.depth


def _amounts_within(frame: KeyFrame, shown: tuple[np.ndarray, ...], root: Root, shrink: int) -> np.ndarray:
    """Return the share of a frame's foreground, which shows in the rows and columns ``shown``, (cell,) each,
    within each whole distance from a root [reduced px], ending in 1, (distance,); 1 alone for a root that
    slides."""
    if not np.isfinite(root.x + root.y):
        return np.ones(1)
    y, x = shown
    column, row = ((place + 0.5) / shrink - 0.5 for place in (root.x, root.y))
    away = np.hypot(x - column, y - row).astype(np.int64)
    amount = np.cumsum(np.bincount(away, frame.coarse[y, x] / FULL)) / max(frame.area, 1.0)
    return np.append(np.minimum(amount, 1.0), 1.0)


def _alternately(tried: list[Structure]) -> list[Structure]:
    """Return structures by their two scores in turn, the best of each first."""
    orders = [sorted(tried, key=key) for key in (lambda one: one.score, lambda one: one.strict_score)]
    return list({id(one): one for pair in zip(*orders, strict=True) for one in pair}.values())


def _best(tried: list[Structure]) -> list[Structure]:
    """Choose the best structures; of neighbouring lengths at one root only the best one."""
    chosen: list[Structure] = []
    more = 2 if tried and len(tried[0].mechanism.joints) > ALL_TRIED else 1
    for one in _alternately(tried):
        same = [np.subtract(other.steps, one.steps) for other in chosen if other.root == one.root]
        if len(same) >= more * KEPT_A_ROOT or any(np.all(np.abs(apart) <= 1) for apart in same):
            continue
        chosen.append(one)
        if len(chosen) == more * KEPT:
            break
    # a body before its own picture explains next to nothing, and the others hang on it all the same
    roots = {one.root for one in chosen if one.is_measured}
    for one in tried:
        if one.is_measured and one.root not in roots:
            chosen.append(
                min((o for o in tried if o.is_measured and o.root == one.root), key=lambda o: o.score)
            )
            roots.add(one.root)
    return chosen


def unexplained(frame: KeyFrame, cost: float) -> float:
    """Return the share of a frame's foreground that is not explained.

    Args:
        frame: The frame.
        cost: Mismatch of a pose less the area of the mask [reduced px^2].
    """
    return (frame.area + cost) / max(frame.area, 1.0)


def left_share(frame: KeyFrame, rig: Rig, pose: np.ndarray) -> float:
    """Return the share of a frame's foreground that a pose leaves unexplained.

    Args:
        frame: The frame.
        rig: The mechanism in its reduced picture.
        pose: Joint positions, (dof,).
    """
    return unexplained(frame, float(pose_balance(frame.balance, rig, pose[np.newaxis], len(rig.radius))[0]))


def better_mean(shares: np.ndarray) -> float:
    """Return the mean of the better three quarters of some frames' mismatches.

    Args:
        shares: Mismatch of each frame, (key frame,).

    Returns:
        Their mean.
    """
    ordered = np.sort(shares)
    return float(np.mean(ordered[: max(1, (3 * len(ordered) + 3) // 4)]))
