"""What is to be located from tracked points, and where its refinement begins: geometry, then names."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Progress
from monodyn.vision.drawing.camera import X, with_values
from monodyn.vision.drawing.rig import SHOWN_KINDS, root_slides
from monodyn.vision.locating.variables import scene_variables
from monodyn.vision.points.adjust import Adjustment, Fitted, Seen, cost, refine
from monodyn.vision.points.begin import begin
from monodyn.vision.points.marks import FREE, SITE, Mark
from monodyn.vision.points.poses import Exchange, exchanged
from monodyn.vision.points.shown import (
    Places,
    frames_of,
    in_plane,
    mean_length,
    project,
    shown_by,
    tied_sites,
    turned,
)
from monodyn.vision.points.tracks import PointTracks

START_NOISE = 0.01
"""Standard deviation of a point that a search begins with, as a share of the picture's width."""
START_JITTER_PX = 1.0
"""Shift of the picture from frame to frame that a search begins with where the camera moves [px]."""
USUAL_NOISE = 1e-3
"""Noise of a mark from which the names may be those of other points, as a share of the picture's width."""
BETTER = 0.5
"""Share of the cost that two exchanged names must leave to be believed."""
CHANGED = 1e-9
"""Change of an array from which a parameter moves a mark."""


@dataclass(frozen=True, eq=False)
class SoughtPoints:
    """What is to be located.

    Attributes:
        tracks: The tracked points.
        mechanism: Topology and start sizes; its fixed parameters stay as they are.
        focal: Focal length [px]; 0 takes the picture's longer side.
        fix: Values of ``camera.*`` parameters that must stay.
        free: ``camera.*`` parameters to estimate in addition to x, y and depth.
        mapped: What points are whose names are not those of the mechanism.
        progress: Called as the steps go.
    """

    tracks: PointTracks
    mechanism: Mechanism
    focal: float
    fix: Mapping[str, float]
    free: Sequence[str]
    mapped: Mapping[str, str]
    progress: Progress

    @property
    def start_camera(self) -> Camera:
        """The camera that the search starts from."""
        tracks = self.tracks
        focal = self.focal or float(max(tracks.width, tracks.height))
        return with_values(Camera(tracks.width, tracks.height, focal), dict(self.fix))

    @property
    def pinned(self) -> frozenset[str]:
        """Parameters of the mechanism that may not change."""
        return frozenset(p.name for p in self.mechanism.parameters if not p.free and not p.follows)


def named(
    sought: SoughtPoints, marks: tuple[Mark, ...], seen: Seen, *, moving: bool
) -> tuple[Seen, tuple[Adjustment, Fitted], list[Exchange]]:
    """Return a first refinement, with two tracks exchanged in all frames where only that explains the points.

    Args:
        sought: What is to be located.
        marks: The marks of the mechanism.
        seen: Their points.
        moving: True where the camera moves.

    Returns:
        The points by their names, what is refined and where it stands, and what was exchanged.
    """

    def tried(points: Seen) -> tuple[Adjustment, Fitted]:
        adjustment, fitted = started(sought, marks, points, moving=moving)
        return adjustment, refine(adjustment, fitted, points)

    best = tried(seen)
    if sought.tracks.told_apart or best[1].noise.max() < USUAL_NOISE * sought.tracks.width:
        return seen, best, []
    chosen, exchanges = seen, []
    for pair in itertools.combinations(range(len(marks)), 2):
        other = exchanged(seen, pair)
        start = tried(other)
        # one noise for both: each by its own would be explained alike
        noise = np.full(len(marks), min(float(np.median(fitted.noise)) for _, fitted in (best, start)))
        if unexplained(*start, other, noise) < BETTER * unexplained(*best, chosen, noise):
            best, chosen, exchanges = start, other, [Exchange(pair, 0, len(seen.px))]
    return chosen, best, exchanges


def unexplained(adjustment: Adjustment, fitted: Fitted, seen: Seen, noise: np.ndarray) -> float:
    """Return the robust cost of all points.

    Args:
        adjustment: The marks.
        fitted: Mechanism, camera and poses.
        seen: The points.
        noise: Standard deviation of each mark's points [px], (point,).
    """
    return float(np.sum(cost(seen, project(adjustment.shown(fitted), fitted.position), noise)))


def started(
    sought: SoughtPoints, marks: tuple[Mark, ...], seen: Seen, *, moving: bool
) -> tuple[Adjustment, Fitted]:
    """Return what is refined, and where geometry has it begin.

    Args:
        sought: What is to be located.
        marks: The marks of the mechanism.
        seen: Their points.
        moving: True where the camera moves.

    Returns:
        What is refined, and where it stands.

    Raises:
        VideoError: the points do not show a joint.
    """
    file, camera = sought.mechanism, sought.start_camera
    found = begin(marks, file, in_plane(camera, np.where(seen.weight[..., None] > 0.0, seen.px, np.nan)))
    lost = [j.name for j, q in zip(file.joints, found.position.T, strict=True) if not np.isfinite(q).any()]
    if lost:
        raise VideoError(
            f"{sought.tracks.path.name}: expected points that show joint '{lost[0]}', got none: where it is "
            "not tracked itself, points of its body have to move about it; track the joint."
        )
    mechanism, camera = _sized(sought, found.scale, found.root)
    tied = tied_sites(marks, file)
    free = np.array(
        [i for i, m in enumerate(marks) if m.kind == FREE or (m.kind == SITE and i not in tied)],
        dtype=np.int64,
    )
    places = Places(marks, file, free)
    position = _continued(found.position)
    position = np.where(file.slides, position * camera.depth, position)
    if moving:
        position = np.column_stack([position, np.zeros((len(position), 2))])
    noise = np.full(len(marks), START_NOISE * camera.width)
    fitted = Fitted(mechanism, camera, np.zeros((len(free), 2)), position, noise, np.zeros((0, 0)))
    fitted = replace(fitted, own=_first_places(places, fitted, seen))
    names = _refined_names(sought, places)
    jitter = START_JITTER_PX if moving else 0.0
    variables = replace(scene_variables(file, names), focal=sought.start_camera.focal)
    return Adjustment(places, variables, jitter), fitted


def _sized(sought: SoughtPoints, scale: np.ndarray, root: np.ndarray) -> tuple[Mechanism, Camera]:
    """Return mechanism and camera of the sizes that the marks show, in units of the distance by metre."""
    file, camera, pinned = sought.mechanism, sought.start_camera, sought.pinned
    lengths = {i: f"{joint.body}.length" for i, joint in enumerate(file.joints)}
    known = {i: name for i, name in lengths.items() if name in file.values and np.isfinite(scale[i])}
    flat = [file.joints[i].name for i in known if scale[i] <= 0.0]
    if flat:
        raise VideoError(
            f"{sought.tracks.path.name}: expected the points that show joint '{flat[0]}' apart from it, got "
            "them at one place; give the points of this mechanism."
        )
    held_by = [scale[i] for i, name in known.items() if name in pinned]
    usual = float(np.exp(np.mean(np.log(held_by or [scale[i] for i in known] or [1.0]))))
    depth = camera.depth if "camera.depth" in sought.fix else 1.0 / usual
    sizes = {name: file.values[name] * scale[i] * depth for i, name in known.items() if name not in pinned}
    mechanism = file.with_values(sizes)
    slides = {column for _, column in root_slides(file)}
    x, y = -root * depth
    values = {"camera.depth": depth, "camera.x": float(x), "camera.y": float(y)}
    if slides:
        held_name = {"camera.x" if column == X else "camera.y" for column in slides}
        values = {name: value for name, value in values.items() if name not in held_name}
    return mechanism, with_values(camera, values | dict(sought.fix))


def _continued(position: np.ndarray) -> np.ndarray:
    """Return poses whose gaps are filled on straight lines, (frame, dof)."""
    out, frames = position.copy(), np.arange(len(position))
    for dof in range(position.shape[1]):
        known = np.isfinite(position[:, dof])
        values = np.unwrap(position[known, dof]) if known.any() else np.zeros(1)
        out[:, dof] = np.interp(frames, frames[known] if known.any() else [0], values)
    return out


def _first_places(places: Places, fitted: Fitted, seen: Seen) -> np.ndarray:
    """Return where the free marks typically are on their links, as ratios to the lengths, (point, 2)."""
    camera = fitted.camera
    shown = shown_by(places, fitted.mechanism, camera, fitted.own)
    origin, angle = frames_of(shown, fitted.position[:, : len(fitted.mechanism.joints)])
    plane = in_plane(camera, seen.px) * camera.depth + [camera.x, camera.y]
    own = []
    for row in places.free:
        link = places.marks[row].link
        known = seen.weight[:, row] > 0.0
        local = turned(plane[known, row] - origin[known, link], -angle[known, link])
        own.append(np.median(local, axis=0) / places.length(fitted.mechanism, int(row)))
    return np.array(own).reshape(-1, 2)


def _refined_names(sought: SoughtPoints, places: Places) -> list[str]:
    """List the parameters that the marks depend on, as far as they may change."""
    file, camera = sought.mechanism, sought.start_camera
    own = np.zeros((len(places.free), 2))

    def arrays(mechanism: Mechanism) -> np.ndarray:
        shown = shown_by(places, mechanism, camera, own)
        return np.concatenate([shown.links[:, :2].ravel(), shown.place.ravel(), shown.height])

    base, names, size = arrays(file), [], mean_length(file)
    for p in file.parameters:
        if p.kind in SHOWN_KINDS and not p.follows and p.name not in sought.pinned:
            moved = arrays(file.with_values({p.name: p.value + 0.1 * size}))
            if np.abs(moved - base).max() > CHANGED * size:
                names.append(p.name)
    held_names = {"camera.x" if column == X else "camera.y" for _, column in root_slides(file)}
    cameras = [n for n in ("camera.x", "camera.y", "camera.depth", *sought.free) if n not in held_names]
    return names + [name for name in dict.fromkeys(cameras) if name not in sought.fix]
