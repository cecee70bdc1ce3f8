"""The published way from masks to the scene: one binary silhouette, the sequential framework, several starts.

One picture of a chain reads from either end, so the starts that explain the picture equally well are told
apart by the pose problem (3) in a few other frames: the first hinge has to stay where it is.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Mechanism
from monodyn.types import Camera, Frame
from monodyn.vision.camera import camera_array, shrunk
from monodyn.vision.outline import covered_pixels, outline
from monodyn.vision.problems import History, mismatch
from monodyn.vision.rig import rig_of
from monodyn.vision.scene import Scene
from monodyn.vision.segment import Masks
from monodyn.vision.sequential import Effort, camera_round, reach_of, sequential
from monodyn.vision.spread import evolved_starts, spread_pose, spread_starts
from monodyn.vision.threshold import holds, otsu_level, silhouette
from monodyn.vision.view import DEPTH, Seen, View, X, Y, seen, view_of

COARSE_PX = 150
"""Largest side of the moving part in the reduced picture that starts are ranked in [px]."""
STARTS, FINALISTS = 6, 4
"""Starts of the local search in the reduced picture by joint, and those that go on in the whole one."""
ALIKE = 0.05
"""Finalists explain the picture but for this share of its area more than the best."""
WITNESSES = 8
"""Further frames that tell the finalists apart."""
ACCEPTED = 0.06
"""Mean share of mismatch in the further frames with which neither another picture nor a background without
the mechanism is tried."""
UNLIKE = 0.5
"""Share of mismatch in the further frames from which a reading says nothing of the background."""
MOST_COVERED = 36
"""Sample frames from which the mechanism is taken out, at the most."""
LIES = 0.3
"""Share of mismatch up to which a pose lies on its silhouette."""
PICTURES = 4
"""Pictures that the framework is tried on at the most, the first frame before others."""
UNEXPLAINED = 0.25
"""Share of mismatch from which the user is told."""
ROUGH = Effort(rounds=10, least=0.2, gain=2e-3)
"""For starts in the reduced picture."""
SETTLING = Effort(pose_px=3.0, sizes=0.03, least=0.2)
"""From a state that is known but for a pixel."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture of the clip and its silhouette.

    Attributes:
        frame: The picture.
        image: Its silhouette.
        drawn: The silhouette as a picture, uint8 (height, width).
    """

    frame: Frame
    image: Seen
    drawn: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading of a picture.

    Attributes:
        view: Mechanism, camera and pose.
        strange: Mean share of mismatch in other frames.
        history: The sub-problems that led to it.
        evaluations: Silhouettes drawn to get it.
    """

    view: View
    strange: float
    history: tuple[History, ...]
    evaluations: int


def locate_published(
    masks: Masks,
    mechanism: Mechanism,
    camera: Camera,
    pinned: Collection[str],
    *,
    start: str = "spread",
    level: float = 0.0,
) -> Scene:
    """Find camera, pose and aspect ratios by the published framework.

    Args:
        masks: The soft foreground of the clip; its background is subtracted.
        mechanism: Topology and start sizes; parameters that are not free stay.
        camera: Start camera.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
        start: Where the local search starts: ``spread`` or ``evolution``.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Returns:
        The scene; its mechanism carries no size information (``measured``).

    Raises:
        VideoError: the mechanism stands out from the background in no frame.
    """
    first = next(iter(masks.video.frames()))
    held = _start_view(mechanism, camera, pinned)
    reading, chosen = _read(_shots(masks, first, level), masks, held, mechanism, camera, start)
    if ACCEPTED < reading.strange < UNLIKE and not masks.given:
        masks, reading = _uncovered(masks, first, chosen, reading, mechanism, camera, level)
    view, drawings = _released(reading.view, mechanism, camera), reading.evaluations
    shot = _shot(chosen, masks, level)
    opening = silhouette(first, masks.background, level_of(masks, level))
    if chosen.index != first.index and holds(opening):
        shot = Shot(first, seen(opening), opening)
        view, _, more = spread_pose(shot.image, view)
        drawings += more
    return _scene(masks, mechanism, camera, view, shot, reading.history, drawings, level)


def pose_before(scene: Scene, *, level: float = 0.0) -> Scene:
    """Find pose (3) and aspect ratios (4) before a camera that is known.

    Args:
        scene: Camera and start sizes.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Returns:
        The scene with the pose in the first frame; the camera stays.
    """
    shot = _shot(next(iter(scene.masks.video.frames())), scene.masks, level)
    view = view_of(scene.mechanism, scene.camera, scene.position, (False, False, False))
    view, _, drawings = spread_pose(shot.image, view)
    view, history = sequential(shot.image, view, SETTLING)
    found = _scene(
        scene.masks, scene.mechanism, scene.camera, view, shot, history, drawings + _drawings(history), level
    )
    return replace(found, advice=(*scene.advice, *found.advice))


def camera_behind(scene: Scene, pinned: Collection[str], *, level: float = 0.0) -> Scene:
    """Find the camera's depth (1) and place (2) behind a pose and sizes that are known.

    Args:
        scene: Pose and sizes.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Returns:
        The scene before that camera.
    """
    frame = next(frame for frame in scene.masks.video.frames() if frame.index == scene.frame)
    drawn = silhouette(frame, scene.masks.background, level_of(scene.masks, level), settle=False)
    image = seen(drawn)
    view = view_of(
        scene.mechanism, scene.camera, scene.position, _moves(scene.mechanism, pinned, gauge=False)
    )
    history: list[History] = []
    for _ in range(3):  # the place shifts with the depth
        view, fell = camera_round(image, view)
        history += fell
    return replace(
        scene,
        camera=_camera_of(view, scene.camera),
        spread={},
        evaluations=_drawings(history),
        history=tuple(history),
        level=level,
    )


def level_of(masks: Masks, level: float = 0.0) -> float:
    """Return the threshold of a clip's silhouettes [grey levels].

    Args:
        masks: The masks of the clip.
        level: The user's; 0 takes Otsu's over the sample frames.
    """
    return level or otsu_level(masks.samples.frames, masks.background)


def _shots(masks: Masks, first: Frame, level: float) -> list[Shot]:
    """Return the first frame, then sample frames spread over the motion, those with a silhouette alone."""
    level = level_of(masks, level)
    frames = [first, *(frame for frame in masks.samples.frames if frame.index != first.index)]
    picks = [0, *np.unique(np.linspace(1, len(frames) - 1, WITNESSES).round().astype(int))]
    shots = []
    for i in picks:
        drawn = silhouette(frames[i], masks.background, level)
        if holds(drawn):
            shots.append(Shot(frames[i], seen(drawn), drawn))
    if not shots:
        raise VideoError(
            f"{masks.video.path}: expected the mechanism to stand out by {level:.0f} grey levels, found it "
            "in no frame; set --locate.level lower, or use another method."
        )
    return shots


def _shot(frame: Frame, masks: Masks, level: float) -> Shot:
    drawn = silhouette(frame, masks.background, level_of(masks, level))
    return Shot(frame, seen(drawn), drawn)


def _start_view(mechanism: Mechanism, camera: Camera, pinned: Collection[str]) -> View:
    """Put the mechanism before the camera, its first joint in the middle of the picture.

    Where a root's slide and the camera's place mean the same, the camera moves and the slide stays.
    """
    moves = _moves(mechanism, pinned, gauge=True)
    reach = reach_of(rig_of(mechanism, camera))
    if moves[2]:
        camera = replace(camera, depth=camera.focal * reach / (0.3 * min(camera.width, camera.height)))
    x, y = (float(value) for value in mechanism.tree.links[0, :2])
    camera = replace(camera, x=x if moves[0] else camera.x, y=y if moves[1] else camera.y)
    view = view_of(mechanism, camera, np.zeros(len(mechanism.joints)), moves)
    limits = view.limits.copy()
    gauge = _gauge(mechanism)
    if gauge is not None and moves[gauge[1] - X]:
        limits[:, gauge[0]] = 0.0
    position = np.clip(np.zeros(limits.shape[1]), limits[0], limits[1])
    return replace(view, limits=limits, position=position)


def _gauge(mechanism: Mechanism) -> tuple[int, int] | None:
    """Return the row of a sliding root and the camera's column that means the same, or None."""
    for i, parent in enumerate(mechanism.tree.parent):
        if parent < 0 and mechanism.tree.kind[i] == 1:
            direction = np.abs(mechanism.tree.links[i, 3:5])
            return i, X if direction[0] >= direction[1] else Y
    return None


def _moves(mechanism: Mechanism, pinned: Collection[str], *, gauge: bool) -> tuple[bool, bool, bool]:
    """Return which of the camera's x, y and depth are estimated; ``gauge`` where the slide stays instead."""
    x, y, depth = (name not in pinned for name in ("camera.x", "camera.y", "camera.depth"))
    slide = _gauge(mechanism)
    if slide is not None and not gauge:
        x, y = x and slide[1] != X, y and slide[1] != Y
    return x, y, depth


def _released(view: View, mechanism: Mechanism, camera: Camera) -> View:
    """Return the same picture with the joints' own limits, a root's slide for the camera's place along it."""
    limits = np.array([[j.lower for j in mechanism.joints], [j.upper for j in mechanism.joints]], dtype=float)
    out = replace(view, limits=limits)
    gauge = _gauge(mechanism)
    if gauge is None or view.limits[1, gauge[0]] > view.limits[0, gauge[0]]:
        return out
    row, column = gauge
    angle, along = float(view.base.links[row, 2]), view.base.links[row, 3:5]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    direction = turn @ along
    packed = view.base.camera.copy()
    slide = float(camera_array(camera)[column] - packed[column]) / float(direction[column - X])
    position = view.position.copy()
    position[row] += slide
    packed[X : Y + 1] += slide * direction
    return replace(out, position=position).before(packed)


def _read(
    shots: list[Shot], masks: Masks, held: View, mechanism: Mechanism, camera: Camera, start: str
) -> tuple[Reading, Frame]:
    """Return the reading of one picture that explains the others best; the first that serves is taken."""
    top, bottom, left, right = masks.background.reach
    shrink = max(1, round(max(bottom - top, right - left) / COARSE_PX))
    every = max(1, (len(shots) - 1) // (PICTURES - 1))
    best, chosen, drawings = None, shots[0].frame, 0
    for shot in [shots[0], *shots[1::every]][:PICTURES]:
        others = [other for other in shots if other is not shot]
        for reading in _readings(shot, held, start, shrink):
            strange, more = _strangeness(_released(reading.view, mechanism, camera), others)
            drawings += reading.evaluations + more
            if best is None or strange < best.strange:
                best, chosen = replace(reading, strange=strange), shot.frame
        if best is not None and best.strange < ACCEPTED:
            break
    assert best is not None, "every picture has a reading"
    return replace(best, evaluations=drawings), chosen


def _readings(shot: Shot, held: View, start: str, shrink: int) -> list[Reading]:
    """Return the readings of one picture that explain it about as well as the best."""
    small = seen(shot.drawn, shrink=shrink)
    whole = held.base.camera
    coarse = held.before(shrunk(whole, shrink))
    if start == "evolution":
        starts, drawings = evolved_starts(small, coarse)
    else:
        starts, drawings = spread_starts(small, coarse, STARTS * len(coarse.position))
    rough: list[tuple[float, View]] = []
    for candidate in starts:
        view, history = sequential(small, candidate, ROUGH)
        rough.append((mismatch(small, view.rig, view.position), view))
        drawings += _drawings(history)
    readings: list[tuple[float, Reading]] = []
    for value, candidate in _different(sorted(rough, key=lambda pair: pair[0]))[:FINALISTS]:
        camera = whole.copy()
        camera[X : DEPTH + 1] = candidate.base.camera[X : DEPTH + 1]
        view, history = sequential(shot.image, candidate.before(camera))
        value = mismatch(shot.image, view.rig, view.position)
        readings.append((value, Reading(view, np.inf, history, drawings + _drawings(history))))
        drawings = 0
    least = min(value for value, _ in readings)
    return [reading for value, reading in readings if value <= least + ALIKE * shot.image.area]


def _different(rough: list[tuple[float, View]]) -> list[tuple[float, View]]:
    """Leave out what came to the same pose as a better one."""
    kept: list[tuple[float, View]] = []
    for value, view in rough:
        hinge = view.base.kind == 0
        turns = [(view.position - other.position + np.pi) % (2.0 * np.pi) - np.pi for _, other in kept]
        if all(np.any(np.abs(turn[hinge]) > 0.1) for turn in turns):
            kept.append((value, view))
    return kept


def _strangeness(view: View, others: list[Shot]) -> tuple[float, int]:
    """Return the mean share of mismatch of the better three quarters of other frames, and the drawings."""
    shares, drawings = [], 0
    for other in others:
        _, left, more = spread_pose(other.image, view)
        shares.append(left / other.image.area)
        drawings += more
    better = np.sort(shares)[: max(1, (3 * len(shares) + 3) // 4)]
    return (float(np.mean(better)) if shares else 0.0), drawings


def _uncovered(
    masks: Masks, first: Frame, chosen: Frame, reading: Reading, mechanism: Mechanism, camera: Camera,
    level: float,
) -> tuple[Masks, Reading]:  # fmt: skip
    """Take the background again without the mechanism and settle; keep what explains other frames better."""
    view = _released(reading.view, mechanism, camera)
    sized, behind = _mechanism_of(view, mechanism), _camera_of(view, camera)
    everything = np.ones(masks.background.known.shape, dtype=bool)
    covered, drawings = [], reading.evaluations
    step = max(1, len(masks.samples.frames) // MOST_COVERED)
    for i, frame in enumerate(masks.samples.frames):
        drawn = silhouette(frame, masks.background, level_of(masks, level)) if i % step == 0 else everything
        if i % step or not holds(drawn):
            covered.append(everything)
            continue
        image = seen(drawn)
        pose, left, more = spread_pose(image, view)
        drawings += more
        lies = left < LIES * image.area
        covered.append(covered_pixels(sized, behind, pose.position, grow=1.0) if lies else everything)
    other = masks.refined(covered)
    again = silhouette(chosen, other.background, level_of(other, level))
    if not holds(again):
        return masks, replace(reading, evaluations=drawings)
    found, history = sequential(seen(again), reading.view, SETTLING)
    others = [witness for witness in _shots(other, first, level) if witness.frame is not chosen]
    strange, more = _strangeness(_released(found, mechanism, camera), others)
    drawings += more + _drawings(history)
    if strange >= reading.strange:
        return masks, replace(reading, evaluations=drawings)
    return other, Reading(found, strange, (*reading.history, *history), drawings)


def _mechanism_of(view: View, mechanism: Mechanism) -> Mechanism:
    return mechanism.with_values(dict(zip(view.names, view.sizes.tolist(), strict=True)))


def _camera_of(view: View, camera: Camera) -> Camera:
    x, y, depth = (float(value) for value in view.base.camera[X : DEPTH + 1])
    return replace(camera, x=x, y=y, depth=depth)


def _drawings(history: tuple[History, ...] | list[History]) -> int:
    """Return how many silhouettes the sub-problems drew."""
    return int(sum(int(part.evaluations[-1]) for part in history))


def _scene(
    masks: Masks, mechanism: Mechanism, camera: Camera, view: View, shot: Shot, history: tuple[History, ...],
    drawings: int, level: float,
) -> Scene:  # fmt: skip
    """Collect the result."""
    sized, behind = replace(_mechanism_of(view, mechanism), measured=None), _camera_of(view, camera)
    left = mismatch(shot.image, view.rig, view.position)
    length = sum(
        float(np.hypot(*np.diff(polygon, axis=0, append=polygon[:1]).T).sum())
        for _, polygon in outline(sized, behind, view.position)
    )
    advice = ()
    if left > UNEXPLAINED * shot.image.area:
        advice = (
            f"The drawn mechanism and the silhouette of frame {shot.frame.index} differ by "
            f"{left / shot.image.area:.0%} of its area: check the overlay; --locate.start evolution, another "
            "--locate.level, or --background may help, or the default method.",
        )
    return Scene(
        sized, behind, masks, shot.frame.index, view.position, (shot.frame.index,), view.position[np.newaxis],
        {}, left / max(length, 1.0), advice, drawings, history, level,
    )  # fmt: skip
