"""The published way from masks to the scene: one binary silhouette and the sequential framework."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace

import numpy as np

from monodyn.mechanism import Measured, Mechanism
from monodyn.paper.ambiguity import (
    ACCEPTED,
    Meter,
    Reading,
    Shot,
    drawings_of,
    level_of,
    read,
    shot_of,
    shots_of,
    strangeness,
)
from monodyn.paper.sequential import Effort, camera_round, sequential
from monodyn.paper.settings import PaperLocateSettings
from monodyn.paper.slide_gauge import camera_moves, released, start_view
from monodyn.paper.starts import spread_pose
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.threshold import holds, silhouette
from monodyn.paper.view import DEPTH, SIZES, View, X, seen, view_of
from monodyn.types import Camera, Frame, Progress
from monodyn.vision.drawing.camera import FOCAL
from monodyn.vision.drawing.outline import covered_pixels, outline
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene

MOST_DRAWN = 1_500_000
"""Silhouettes that the search draws at the most, but for the part that passes it."""
UNLIKE = 0.5
"""Share of mismatch in the further frames from which a reading says nothing of the background."""
MOST_COVERED = 36
"""Sample frames from which the mechanism is taken out, at the most."""
LIES = 0.3
"""Share of mismatch up to which a pose lies on its silhouette."""
UNEXPLAINED = 0.25
"""Share of mismatch from which the user is told."""
SIZE_SHARE, SIZE_PX = 0.04, 0.5
"""Standard deviation of a size from one silhouette: a share of it, and pixels."""
SETTLING = Effort(pose_px=3.0, sizes=0.03, least=0.2)
"""From a state that is known but for a pixel."""


@dataclass(frozen=True, eq=False)
class PaperScene(Scene):
    """A scene found by drawing silhouettes; ``rms_px`` is the mismatch by length of the outline.

    Attributes:
        evaluations: Silhouettes drawn.
        history: The sub-problems in the order in which they were solved.
        level: Threshold of the silhouettes [grey levels], or 0.
    """

    evaluations: int = field(kw_only=True)
    history: tuple[History, ...] = field(repr=False, kw_only=True)
    level: float = field(kw_only=True)


def locate_published(
    masks: Masks,
    mechanism: Mechanism,
    camera: Camera,
    pinned: Collection[str],
    settings: PaperLocateSettings,
    *,
    most: int = MOST_DRAWN,
    progress: Progress | None = None,
) -> PaperScene:
    """Find camera, pose and aspect ratios by the published framework.

    Args:
        masks: The soft foreground of the clip; its background is subtracted.
        mechanism: Topology and start sizes; parameters that are not free stay.
        camera: Start camera.
        pinned: ``camera.x``, ``camera.y`` and ``camera.depth`` as far as they must stay.
        settings: ``start``, ``seed`` and ``level``.
        most: Silhouettes drawn at the most, but for the part of the search that passes it.
        progress: Called with the starts, finalists and frames that are done.

    Returns:
        The scene; where the silhouettes were used up, the best so far with advice.

    Raises:
        VideoError: the mechanism stands out from the background in no frame.
    """
    first, level, meter = next(iter(masks.video.frames())), settings.level, Meter(most, progress)
    held = start_view(mechanism, camera, pinned)
    top, bottom, left, right = masks.background.window
    reading = read(
        shots_of(masks, first, level), held, mechanism, camera, max(bottom - top, right - left), meter,
        start=settings.start, seed=settings.seed,
    )  # fmt: skip
    if ACCEPTED < reading.strange < UNLIKE and not masks.background.given and not meter.over():
        masks, reading = _uncovered(masks, first, reading, mechanism, camera, level, meter)
    meter.expect(1)
    view, drawings = released(reading.view, mechanism, camera), 0
    shot = shot_of(reading.frame, masks, level)
    opening = silhouette(first, masks.background, level_of(masks, level))
    if reading.frame.index != first.index and holds(opening):
        shot = Shot(first, seen(opening), opening)
        view, _, drawings = spread_pose(shot.image, view)
    meter.step(drawings)
    scene = _scene(
        masks, mechanism, camera, view, shot, reading.history, meter.drawn, level,
        scale_free=_scale_free(mechanism, pinned),
    )  # fmt: skip
    return replace(scene, advice=(*_cut_short(meter), *scene.advice))


def pose_before(scene: Scene, pinned: Collection[str], *, level: float = 0.0) -> PaperScene:
    """Find pose (3) and aspect ratios (4) before a camera that is known.

    Args:
        scene: Camera and start sizes.
        pinned: ``camera.*`` parameters that the user gave.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.

    Returns:
        The scene with the pose in the first frame; the camera stays.
    """
    shot = shot_of(next(iter(scene.masks.video.frames())), scene.masks, level)
    view = view_of(scene.mechanism, scene.camera, scene.position, (False, False, False))
    view, _, drawings = spread_pose(shot.image, view)
    view, history = sequential(shot.image, view, SETTLING)
    found = _scene(
        scene.masks, scene.mechanism, scene.camera, view, shot, history, drawings + drawings_of(history),
        level, scale_free=_scale_free(scene.mechanism, pinned),
    )  # fmt: skip
    return replace(found, advice=(*scene.advice, *found.advice))


def camera_behind(scene: Scene, pinned: Collection[str], *, level: float = 0.0) -> PaperScene:
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
    moves = camera_moves(scene.mechanism, pinned, slide=True)
    view = view_of(scene.mechanism, scene.camera, scene.position, moves)
    history: list[History] = []
    for _ in range(3):  # the place shifts with the depth
        view, fell = camera_round(image, view)
        history += fell
    kept = {part.name: getattr(scene, part.name) for part in fields(Scene)}
    kept |= {"camera": _camera_of(view, scene.camera), "camera_std": {}}
    return PaperScene(**kept, evaluations=drawings_of(history), history=tuple(history), level=level)


def size_ratios(view: View, mechanism: Mechanism, *, scale_free: bool) -> Measured:
    """Return what one silhouette knows of the sizes that were found with it.

    Each logarithm has a standard deviation of a share and of half a pixel. The mismatch has a kink at its
    least value, so it gives no curvature to take them from; the errors found in clips with a known truth are
    from 0.2 to 6 %.

    Args:
        view: The mechanism as it was found.
        mechanism: Its sizes in the start scale.
        scale_free: True where nothing pins the common scale; then nothing is known along it.

    Returns:
        Information matrix on the logarithms of the sizes, that held for scale with them.
    """
    names, sizes = view.names, view.sizes
    if view.reference:
        names, sizes = (*names, view.reference), np.append(sizes, mechanism.values[view.reference])
    px = sizes * float(view.base.camera[FOCAL] / view.base.camera[DEPTH])
    known = px**2 / ((SIZE_SHARE * px) ** 2 + SIZE_PX**2)
    information = np.diag(known)
    if scale_free and known.any():
        information = information - np.outer(known, known) / known.sum()
    return Measured(names, information)


def _scale_free(mechanism: Mechanism, pinned: Collection[str]) -> bool:
    """Return whether nothing pins the common scale of the sizes."""
    sizes = [p.free for p in mechanism.parameters if p.name.endswith(SIZES)]
    return all(sizes) and "camera.depth" not in pinned


def _cut_short(meter: Meter) -> tuple[str, ...]:
    """Say when the search ended before its time."""
    if not meter.cut:
        return ()
    return (
        f"The search for the scene ended after {meter.drawn:,} silhouettes, before all starts were tried: "
        "what was found is the best so far. Check the overlay; give sizes that are known with --fix, or use "
        "the default method, which is fast with many joints.",
    )


def _uncovered(
    masks: Masks, first: Frame, reading: Reading, mechanism: Mechanism, camera: Camera, level: float,
    meter: Meter,
) -> tuple[Masks, Reading]:  # fmt: skip
    """Take the background again without the mechanism and settle; keep what explains other frames better."""
    view = released(reading.view, mechanism, camera)
    sized, behind = _mechanism_of(view, mechanism), _camera_of(view, camera)
    everything = np.ones(masks.background.known.shape, dtype=bool)
    covered = []
    step = max(1, len(masks.samples.frames) // MOST_COVERED)
    meter.expect(2 + len(masks.samples.frames[::step]))
    for i, frame in enumerate(masks.samples.frames):
        drawn = silhouette(frame, masks.background, level_of(masks, level)) if i % step == 0 else everything
        if i % step or not holds(drawn):
            covered.append(everything)
            continue
        image = seen(drawn)
        pose, left, drawings = spread_pose(image, view)
        meter.step(drawings)
        lies = left < LIES * image.area
        covered.append(covered_pixels(sized, behind, pose.position, margin=1.0) if lies else everything)
    other = masks.refined(covered)
    again = silhouette(reading.frame, other.background, level_of(other, level))
    if not holds(again):
        return masks, reading
    found, history = sequential(seen(again), reading.view, SETTLING)
    meter.step(drawings_of(history))
    others = [witness for witness in shots_of(other, first, level) if witness.frame is not reading.frame]
    strange, drawings = strangeness(released(found, mechanism, camera), others)
    meter.step(drawings)
    if strange >= reading.strange:
        return masks, reading
    return other, Reading(reading.frame, found, strange, (*reading.history, *history))


def _mechanism_of(view: View, mechanism: Mechanism) -> Mechanism:
    return mechanism.with_values(dict(zip(view.names, view.sizes.tolist(), strict=True)))


def _camera_of(view: View, camera: Camera) -> Camera:
    x, y, depth = (float(value) for value in view.base.camera[X : DEPTH + 1])
    return replace(camera, x=x, y=y, depth=depth)


def _scene(
    masks: Masks, mechanism: Mechanism, camera: Camera, view: View, shot: Shot, history: tuple[History, ...],
    drawings: int, level: float, *, scale_free: bool,
) -> PaperScene:  # fmt: skip
    """Collect the result."""
    measured = size_ratios(view, mechanism, scale_free=scale_free)
    sized, behind = _mechanism_of(view, mechanism).with_measured(measured), _camera_of(view, camera)
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
    return PaperScene(
        sized, behind, masks, shot.frame.index, view.position, (shot.frame.index,), view.position[np.newaxis],
        {}, left / max(length, 1.0), advice, evaluations=drawings, history=history, level=level,
    )  # fmt: skip
