"""The published way from masks to the scene: one binary silhouette and the sequential framework."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace

import numpy as np

from monodyn.errors import VideoError
from monodyn.mechanism import Measured
from monodyn.paper.ambiguity import (
    ACCEPTED,
    DrawingBudget,
    Interpretation,
    cross_mismatch,
    drawings_of,
    interpret,
)
from monodyn.paper.assumptions import failed_advice
from monodyn.paper.sequential import FRAMEWORKS, RoundSchedule, camera_round
from monodyn.paper.settings import PaperLocateSettings
from monodyn.paper.silhouettes import ClipSilhouettes, SilhouetteFrame
from monodyn.paper.start_model import StartModel
from monodyn.paper.starts import pose_by_beam
from monodyn.paper.subproblems import History, mismatch
from monodyn.paper.view import CAMERA_HELD, ModelView, model_view, silhouette_image
from monodyn.types import Frame, Progress
from monodyn.vision.drawing.camera import DEPTH, FOCAL
from monodyn.vision.drawing.outline import covered_pixels, outline
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.scene import Scene

MOST_DRAWN = 1_500_000
"""Silhouettes after which no further part of the search begins; one that passes the number still ends."""
COARSE_SIDE_PX = 150
"""Largest side of the moving part in the reduced picture that starts are ranked in [px]."""
MISREAD = 0.5
"""Share of mismatch in the other frames from which an interpretation cannot show the background."""
MOST_COVERED = 36
"""Sample frames from which the mechanism is taken out, at most."""
POSED = 0.3
"""Share of mismatch up to which the pose in a sample frame is trusted."""
POOR_MISMATCH = 0.25
"""Share of mismatch above which the user is advised."""
SIZE_SHARE, SIZE_PX = 0.04, 0.5
"""Standard deviation of a size from one silhouette: a share of it, and pixels."""
SETTLING = RoundSchedule(pose_px=3.0, sizes=0.03, least=0.2)
"""From a state that is known to within a pixel."""
CAMERA_ROUNDS = 3
"""Rounds of depth and place behind a known pose: the place shifts with the depth."""


@dataclass(frozen=True, eq=False, repr=False)
class PaperScene(Scene):
    """A scene found by drawing silhouettes; ``rms_px`` is the mismatch by length of the outline.

    Attributes:
        mismatch_px2: Sum of ``|I_a - I_m|`` over the picture of ``frame`` [px^2], what (3) and (4) minimize.
        evaluations: Silhouettes drawn.
        history: The sub-problems in the order in which they were solved.
        level: Threshold that the user set for the silhouettes [grey levels], or 0.
    """

    mismatch_px2: float = field(kw_only=True)
    evaluations: int = field(kw_only=True)
    history: tuple[History, ...] = field(repr=False, kw_only=True)
    level: float = field(kw_only=True)


def locate_published(
    masks: Masks,
    model: StartModel,
    settings: PaperLocateSettings,
    *,
    most: int = MOST_DRAWN,
    progress: Progress | None = None,
) -> PaperScene:
    """Find camera, pose and aspect ratios by the published framework.

    Args:
        masks: The soft foreground of the clip; its background is subtracted.
        model: The mechanism and the camera that the search starts with.
        settings: ``start``, ``framework``, ``seed`` and ``level``.
        most: Silhouettes after which no further part of the search begins; one that passes the number still
            ends.
        progress: Called with the number of starts, finalists and frames that are done.

    Returns:
        The scene; where the silhouettes were used up, the best so far with advice.

    Raises:
        VideoError: the drawn mechanism is not that in the picture.
    """
    first, budget = next(iter(masks.video.frames())), DrawingBudget(most, progress)
    silhouettes = ClipSilhouettes(masks, settings.level)
    top, bottom, left, right = masks.background.window
    shrink = max(1, round(max(bottom - top, right - left) / COARSE_SIDE_PX))
    best = interpret(silhouettes.witnesses(first), model, settings, budget, shrink=shrink)
    # a background that still holds a part of the mechanism leaves a mismatch in between: a good
    # interpretation does not need another background, and a wrong one would take away the wrong pixels
    if ACCEPTED < best.cross_mismatch < MISREAD and not masks.background.given and not budget.over():
        silhouettes, best = _uncovered(silhouettes, first, best, model, settings.framework, budget)
    budget.expect(1)
    view, drawings = model.released(best.view), 0
    opening = silhouettes.find(first) if best.frame.index != first.index else None
    if opening is None:
        shown = silhouettes.of(best.frame)
    else:
        # the scene's pose is that of the first frame wherever the mechanism is seen in it
        shown = opening
        view, _, drawings = pose_by_beam(shown.image, view)
    budget.step(drawings)
    scene = _scene(model, silhouettes, shown, view, best.history, budget.drawn)
    share = scene.mismatch_px2 / shown.image.area
    if share > MISREAD:
        raise VideoError(
            f"{masks.video.path}: expected a silhouette of the mechanism in frame {shown.frame.index}, found "
            f"one that differs from the drawn mechanism by {share:.0%} of its area; check the mechanism "
            f"file, or use the default method.{''.join(f' {said}' for said in failed_advice(silhouettes))}"
        )
    return replace(scene, advice=(*_cut_short(budget), *scene.advice))


def pose_before(
    scene: Scene, pinned: Collection[str], *, level: float = 0.0, framework: str = "strict"
) -> PaperScene:
    """Find pose (3) and aspect ratios (4) before a camera that is known.

    Args:
        scene: Camera and start sizes.
        pinned: ``camera.*`` parameters that the user gave.
        level: Threshold of the silhouettes [grey levels]; 0 takes Otsu's.
        framework: ``strict`` or ``interleaved``, of ``FRAMEWORKS``; before a camera that stays they differ in
            when they end alone.

    Returns:
        The scene with the pose in the first frame; the camera stays.
    """
    silhouettes = ClipSilhouettes(scene.masks, level)
    shown = silhouettes.of(next(iter(scene.masks.video.frames())))
    view = model_view(scene.mechanism, scene.camera, scene.position, CAMERA_HELD)
    view, _, drawings = pose_by_beam(shown.image, view)
    view, history = FRAMEWORKS[framework](shown.image, view, SETTLING)
    model = StartModel(scene.mechanism, scene.camera, pinned)
    found = _scene(model, silhouettes, shown, view, history, drawings + drawings_of(history))
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
    # area and centroid would shift with patches that are only guessed to be the mechanism's
    image = silhouette_image(ClipSilhouettes(scene.masks, level).picture(frame, settle=False))
    model = StartModel(scene.mechanism, scene.camera, pinned)
    view = model_view(scene.mechanism, scene.camera, scene.position, model.camera_free(slide=True))
    history: list[History] = []
    for _ in range(CAMERA_ROUNDS):
        view, own = camera_round(image, view)
        history += own
    kept = {part.name: getattr(scene, part.name) for part in fields(Scene)}
    # the standard deviations were those of the other method's camera
    kept |= {"camera": model.placed(view), "camera_std": {}}
    return PaperScene(
        **kept, mismatch_px2=float(mismatch(image, view.rig, view.position)),
        evaluations=drawings_of(history), history=tuple(history), level=level,
    )  # fmt: skip


def size_ratios(view: ModelView, model: StartModel) -> Measured:
    """Return what one silhouette determines of the sizes that were found with it.

    Each logarithm has a standard deviation of a share and of half a pixel. The mismatch has a kink at its
    least value, so it gives no curvature to take them from; the errors found in clips with a known truth are
    from 0.2 to 6 %.

    Args:
        view: The mechanism as it was found.
        model: Its sizes in the start scale, and what is pinned.

    Returns:
        Information matrix on the logarithms of the sizes, the reference among them, (param, param).
    """
    names, sizes = view.names, view.sizes
    if view.reference is not None and view.reference not in view.searched:
        name = view.reference.name
        names, sizes = (*names, name), np.append(sizes, model.mechanism.values[name])
    px = sizes * float(view.base.camera[FOCAL] / view.base.camera[DEPTH])
    known = px**2 / ((SIZE_SHARE * px) ** 2 + SIZE_PX**2)
    information = np.diag(known)
    if model.scale_free and known.any():
        # nothing is known along a common factor, the vector of ones: its projection is taken out, and what
        # remains is the information on ratios with the common scale eliminated
        information = information - np.outer(known, known) / known.sum()
    return Measured(names, information)


def _cut_short(budget: DrawingBudget) -> tuple[str, ...]:
    """Advise where the search ended early."""
    if not budget.cut:
        return ()
    return (
        f"The search for the scene ended after {budget.drawn:,} silhouettes, before all starts were tried: "
        "what was found is the best so far. Check the overlay; give sizes that are known with --fix, or use "
        "the default method, which is fast with many joints.",
    )


def _uncovered(
    silhouettes: ClipSilhouettes, first: Frame, best: Interpretation, model: StartModel, framework: str,
    budget: DrawingBudget,
) -> tuple[ClipSilhouettes, Interpretation]:  # fmt: skip
    """Take the background again without the mechanism and settle; keep what explains other frames better."""
    other = replace(silhouettes, masks=_refined(silhouettes, best, model, budget))
    again = other.find(best.frame)
    if again is None:
        return silhouettes, best
    found, history = FRAMEWORKS[framework](again.image, best.view, SETTLING)
    budget.step(drawings_of(history))
    others = [witness for witness in other.witnesses(first) if witness.frame is not best.frame]
    share, drawings = cross_mismatch(model.released(found), others)
    budget.step(drawings)
    # against another background the silhouettes differ too, so only the shares can be compared
    if share >= best.cross_mismatch:
        return silhouettes, best
    return other, Interpretation(best.frame, found, share, (*best.history, *history))


def _refined(
    silhouettes: ClipSilhouettes, best: Interpretation, model: StartModel, budget: DrawingBudget
) -> Masks:
    """Return masks whose background comes from the sample frames without the mechanism's pixels."""
    masks, view = silhouettes.masks, model.released(best.view)
    sized, camera = model.sized(view), model.placed(view)
    # a frame whose pose is not known lends no pixel at all: all of it counts as covered
    everything = np.ones(masks.background.known.shape, dtype=bool)
    covered = []
    step = max(1, len(masks.samples.frames) // MOST_COVERED)
    budget.expect(2 + len(masks.samples.frames[::step]))
    for i, frame in enumerate(masks.samples.frames):
        shown = None if i % step else silhouettes.find(frame)
        if shown is None:
            covered.append(everything)
            continue
        pose, left, drawings = pose_by_beam(shown.image, view)
        budget.step(drawings)
        posed = left < POSED * shown.image.area
        covered.append(covered_pixels(sized, camera, pose.position, margin=1.0) if posed else everything)
    return masks.refined(covered)


def _scene(
    model: StartModel, silhouettes: ClipSilhouettes, shown: SilhouetteFrame, view: ModelView,
    history: tuple[History, ...], drawings: int,
) -> PaperScene:  # fmt: skip
    """Collect the result."""
    sized, camera = model.sized(view).with_measured(size_ratios(view, model)), model.placed(view)
    left, index = mismatch(shown.image, view.rig, view.position), shown.frame.index
    length = sum(
        float(np.hypot(*np.diff(polygon, axis=0, append=polygon[:1]).T).sum())
        for _, polygon in outline(sized, camera, view.position)
    )
    advice = ()
    if left > POOR_MISMATCH * shown.image.area:
        advice = (
            f"The drawn mechanism and the silhouette of frame {index} differ by "
            f"{left / shown.image.area:.0%} of its area: check the overlay; --locate.start evolution, "
            "another --locate.level, or --background may help, or the default method.",
            *failed_advice(silhouettes),
        )
    return PaperScene(
        mechanism=sized,
        camera=camera,
        masks=silhouettes.masks,
        frame=index,
        position=view.position,
        key_frames=(index,),
        key_positions=view.position[np.newaxis],
        camera_std={},
        rms_px=left / max(length, 1.0),
        advice=advice,
        mismatch_px2=float(left),
        evaluations=drawings,
        history=history,
        level=silhouettes.level,
    )
