"""Which of the bundled mechanisms a clip shows: they are tried one after the other, the evidence decides.

The picture comes first. A mechanism with a link too few leaves foreground unexplained; one with a link too
many explains no more than without it. Every joint and every geom that a mechanism has more than another must
take ``CHARGE`` off what is unexplained: Schwarz's criterion, n ln(unexplained) + k / 2 ln(n), for the n
independent places of an outline and the k unknowns of a picture, with a charge above that of noise alone,
because bodies are no exact boxes. What the picture leaves open is followed and identified: then the grade of
the fit decides, then how far its prediction is off, and between those that are alike the picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monodyn.checks import camera_choices, drawn_mechanism, free_range
from monodyn.doubtful import LEAST_SEEN, doubtful_sight
from monodyn.errors import FitError, MechanismError, MonodynError, SettingsError
from monodyn.estimation.fit import GRADES, Doubt, Fit
from monodyn.job import Job
from monodyn.mechanism import load
from monodyn.mechanism.bundled import LONGEST_CHAIN
from monodyn.mechanism.dots import dots_of
from monodyn.results.heldout import held_out, heldout_doubts
from monodyn.results.log import Compared
from monodyn.results.predict import predict
from monodyn.results.sight import Sight
from monodyn.results.trace import trace_of
from monodyn.settings import RunSettings
from monodyn.stages import identify, locate, track_freely
from monodyn.types import Poses, under
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.locating.advice import LEAST_FITTING, LEAST_INSIDE, LEAST_MATCHED
from monodyn.vision.locating.region import EXPLAINED, agreement
from monodyn.vision.locating.scene import Scene

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

FIRST = (("single", "bob", "ball"), ("cartpole", "double"), ("triple",))
"""The mechanisms that are tried, by their number of joints; chains of more links come after them."""
CHARGE = 0.1
"""Share of what is unexplained that each further joint and each further geom must take off it. A joint is
an unknown of each picture: noise alone, at a hundred independent places of an outline, would charge 0.04."""
NEAR = 1.5
"""Factor on what the best one leaves unexplained, parts charged, up to which the motion has to decide."""
LITTLE = 0.08
"""Unexplained share of the foreground, as soft edges leave it, below which no mechanism of more joints is
tried."""
QUICK = 12
"""Key frames of a quick look, at most."""
BENT = 0.02
"""Standard deviation of a joint over the key frames below which it does not move: of a hinge [rad], of a
slide as a share of the mechanism's longest length."""
ALIKE, EXACT = 1.5, 0.02
"""Factor between the errors of two predictions, and error as a share of the motion, up to which they count as
equally good."""


@dataclass(frozen=True, eq=False)
class Tried:
    """One mechanism, as far as it was tried.

    Attributes:
        model: Its name.
        mechanism: The mechanism with the user's choices.
        scene: Where it was located; None where it was not.
        mismatch: Mismatch of outline and mask as a share of the mask's area in the usual key frame.
        lies: Key frames in which it does.
        frames: Key frames in which it was looked for.
        fit: The fit to its motion, with what is against it; None where the picture was enough.
        off: Largest error of its prediction as a share of the motion; None where nothing was predicted.
        refusal: Why it could not be tried to the end; empty where it could.
    """

    model: str
    mechanism: Mechanism
    scene: Scene | None = None
    mismatch: float = np.inf
    lies: int = 0
    frames: int = 0
    fit: Fit | None = None
    off: float | None = None
    refusal: str = ""

    @property
    def parts(self) -> int:
        """Number of joints and geoms."""
        return len(self.mechanism.joints) + len(self.mechanism.shapes.radius)

    @property
    def unexplained(self) -> float:
        """The mismatch over the share of the key frames in which it lies on its mask; infinite where it never
        does: next to an outline in the wrong place there may be nothing that could differ from it."""
        return self.mismatch * self.frames / self.lies if self.lies else np.inf

    @property
    def charged(self) -> float:
        """What is unexplained, with a charge for every part."""
        return self.unexplained / (1.0 - CHARGE) ** self.parts

    @property
    def order(self) -> tuple[float, float]:
        """Less of it comes first: what is unexplained, and between those that lie nowhere the mismatch."""
        return self.charged, self.mismatch

    @property
    def explains(self) -> bool:
        """Whether next to nothing is left for further joints to explain."""
        return self.unexplained < LITTLE and self.scene is not None and agreement(self.scene) >= EXPLAINED

    @property
    def still(self) -> str:
        """Name of a joint that does not move; empty where all do."""
        if self.scene is None or len(self.scene.key_frames) < 2:
            return ""
        lengths = [p.value for p in self.scene.mechanism.parameters if p.kind == "length"]
        for joint, places in zip(self.mechanism.joints, self.scene.key_positions.T, strict=True):
            unit = 1.0 if joint.kind == "hinge" else max(lengths, default=1.0)
            if np.std(places) < BENT * unit:
                return joint.name
        return ""


def candidates(settings: RunSettings) -> dict[str, Mechanism]:
    """Return the bundled mechanisms that have what the user chose, with these choices, by name.

    Args:
        settings: The user's choices.

    Raises:
        SettingsError: points or masks of another tool take the place of the pictures.
    """
    if settings.points is not None or settings.masks is not None:
        raise SettingsError(
            "model: expected a mechanism file or a bundled name next to --points or --masks, got none; it is "
            "looked for in the pictures of a clip alone, name it with --model."
        )
    found: dict[str, Mechanism] = {}
    first: MechanismError | None = None
    for name in (*(name for group in FIRST for name in group), *map(_chain, range(4, LONGEST_CHAIN + 1))):
        try:
            found[name] = drawn_mechanism(name, settings)
        except MechanismError as error:
            # a parameter that the user names leaves those that have it
            first = first or error
    if not found:
        assert first is not None
        raise first
    return found


def _chain(links: int) -> str:
    return f"chain:{links}"


def choose(job: Job, masks: Masks, models: dict[str, Mechanism]) -> tuple[Mechanism, tuple[Compared, ...]]:
    """Find the mechanism that explains a clip best, with as few parts as do.

    Args:
        job: The run; its sight has the clip.
        masks: The foreground of the clip.
        models: What may be tried, from ``candidates``.

    Returns:
        The mechanism, and what spoke for and against each that was tried, the chosen one first.

    Raises:
        FitError: none of them was located.
    """
    tried = list(_looked_at(job, masks, models))
    left = left_by_picture(tried)
    if not left:
        said = " ".join(f"{one.model}: {one.refusal}" for one in tried[:1])
        raise FitError(
            f"clip '{masks.video.path}': expected one of the bundled mechanisms, found none of "
            f"{', '.join(one.model for one in tried)}; {said} Draw a mechanism file of what the clip shows, "
            "and name it with --model."
        )
    given_up = [one for one in tried if one not in left]
    if all(one.scene is None or agreement(one.scene) < EXPLAINED for one in left):
        # what a look at the key frames does not explain may be explained in a part of the picture
        near = [_looked(job, masks, one, whole=True) for one in left]
        looked = left_by_picture(near)
        # where a longer look locates none of them the quick one counts, and each is listed once
        given_up += [one for one in near if looked and one not in looked]
        left = looked or left
    if len(left) > 1:
        left = [_followed(job, masks, _looked(job, masks, one, whole=True)) for one in left]
    best = left_by_motion(left)
    return best.mechanism, compared([*left, *given_up], best)


def left_by_picture(tried: Sequence[Tried]) -> list[Tried]:
    """Return those between which the picture does not decide, the one that it prefers first.

    Args:
        tried: Mechanisms that were located, or refused.

    Returns:
        Those that leave about as little unexplained as the best one, parts charged, without those of more
        parts than one that does better.
    """
    located = sorted((one for one in tried if one.scene is not None), key=lambda one: one.order)
    return [
        one
        for k, one in enumerate(located)
        if one.charged <= NEAR * located[0].charged
        and all(better.parts >= one.parts for better in located[:k])
    ]


def left_by_motion(left: Sequence[Tried]) -> Tried:
    """Return the one of the best grade and the smallest error of its prediction; of those alike in both the
    one that the picture prefers: whatever hangs on one hinge moves alike.

    Args:
        left: Mechanisms; of more than one the fits.
    """

    def rank(one: Tried) -> int:
        return len(GRADES) if one.fit is None else GRADES.index(one.fit.grade)

    graded = [one for one in left if rank(one) == min(map(rank, left))]
    errors = [np.inf if one.off is None else max(one.off, EXACT) for one in graded]
    alike = [one for one, error in zip(graded, errors, strict=True) if error <= ALIKE * min(errors)]
    return min(alike, key=lambda one: one.order)


def _looked_at(job: Job, masks: Masks, models: dict[str, Mechanism]) -> Iterator[Tried]:
    """Locate one mechanism after the other, of more and more joints, as long as that explains more."""
    chains = [(_chain(links),) for links in range(4, LONGEST_CHAIN + 1)]
    least = np.inf, np.inf
    for group in (*FIRST, *chains):
        found = [_looked(job, masks, Tried(name, models[name])) for name in group if name in models]
        yield from found
        now = min((one.order for one in found), default=least)
        # a parameter that the user names may be one that only mechanisms of more joints have, and what was
        # not located leaves nothing to compare with
        if any(one.explains for one in found) or (found and now >= least and np.isfinite(least[1])):
            return
        least = min(least, now)


def _looked(job: Job, masks: Masks, one: Tried, *, whole: bool = False) -> Tried:
    """Locate a mechanism and compare it with the masks: as a run does, or a quick look at few key frames."""
    settings = job.settings if whole else _quick(job.settings)
    fix, free = camera_choices(settings)
    report = under(job.progress, f"try {one.model}")
    try:
        scene = locate(
            masks, one.mechanism, settings.locate, camera=settings.camera, fix=fix, free=free, once=not whole,
            progress=report,
        )  # fmt: skip
    except MonodynError as refusal:
        return replace(one, refusal=str(refusal))
    judged = Sight(masks.video, masks=masks, scene=scene).judged
    on_mask = [look.matched > LEAST_MATCHED and look.inside > LEAST_INSIDE for look in judged]
    frames = min(settings.locate.refine_frames, len(scene.masks.samples.frames))
    # frames that were left out of the refinement did not fit either
    lies = round(float(np.mean(on_mask)) * min(len(scene.key_frames), frames))
    usual = float(np.median([look.mismatch for look in judged]))
    return replace(one, scene=scene, mismatch=usual, lies=lies, frames=frames)


def _quick(settings: RunSettings) -> RunSettings:
    """Return the settings of a quick look."""
    few = min(settings.locate.refine_frames, QUICK)
    return replace(settings, locate=replace(settings.locate, refine_frames=few))


def _followed(job: Job, masks: Masks, one: Tried) -> Tried:
    """Follow a located mechanism, identify it, and let its prediction be compared with the motion."""
    settings, scene = job.settings, one.scene
    assert scene is not None
    report = under(job.progress, f"follow {one.model}")
    try:
        poses, span = track_freely(scene.masks, scene, settings.track, progress=report)
        known = job.sight and job.sight.fit_frames
        frames = free_range(settings.fit_frames if known else None, known or (0, len(poses)), span)
        first, stop = np.searchsorted(poses.frame, frames).tolist()
        part = poses[first:stop]
        quick = replace(settings.identify, uncertainty="linear")
        fit = identify(part, scene.mechanism, quick, progress=report)
        why = doubtful_sight(Sight(masks.video, masks=masks, scene=scene, poses=poses), part)
    except MonodynError as refusal:
        return replace(one, refusal=str(refusal))
    doubts = [Doubt("refused", why)] if why else []
    return _judged(replace(one, fit=fit.doubted(doubts)), poses, stop)


def _judged(one: Tried, poses: Poses, stop: int) -> Tried:
    """Compare a fit with the frames from row ``stop`` on."""
    fit = one.fit
    if fit is None or not fit.starts or stop >= len(poses):
        return one
    trace = trace_of(fit, poses, predict(fit, times=poses.time[stop:]))
    found = held_out(fit, trace)
    off = None if found is None else float(found.share[-1])
    return replace(one, fit=fit.doubted(heldout_doubts(fit, [trace])), off=off)


def compared(tried: Sequence[Tried], best: Tried) -> tuple[Compared, ...]:
    """Return what spoke for and against each mechanism, the chosen one first.

    Args:
        tried: All that were tried.
        best: The chosen one.
    """
    others = [one for one in tried if one is not best]
    others.sort(key=lambda one: one.order)
    return tuple(
        Compared(
            model=one.model,
            chosen=one is best,
            said=_said(one, best),
            mismatch=None if one.scene is None else one.mismatch,
            key_frames=(one.lies, one.frames) if one.frames else None,
            grade=None if one.fit is None else one.fit.grade,
            prediction=one.off,
        )
        for one in (best, *others)
    )


def _said(one: Tried, best: Tried) -> str:
    """Return what spoke for and against one mechanism, a sentence."""
    if one.scene is None:
        return f"not located: {one.refusal}"
    said = f"off the foreground by {one.mismatch:.1%} of its area, "
    said += f"on it in {one.lies} of {one.frames} key frames"
    if one.still:
        said += f", {one.still} does not move"
    if one.fit is not None:
        said += f", fit {one.fit.grade}"
    if one.off is not None:
        said += f", prediction off by at most {one.off:.0%} of the motion"
    if one is best:
        return f"{said}."
    if one.refusal:
        return f"{said}; {one.refusal}"
    if one.fit is not None:
        return f"{said}; the motion decided."
    if one.parts > best.parts and one.charged <= NEAR * best.charged:
        return f"{said}; it has more parts and explains no more."
    if not one.lies or not best.lies:
        return f"{said}."
    more = one.unexplained / max(best.unexplained, 1e-9)
    return f"{said}; {more:.2g} times as much unexplained as {best.model} leaves."


def ball_alone(job: Job, masks: Masks, mechanism: Mechanism, poses: Poses) -> list[str]:
    """Return a note where a ball alone lies on what moves, and what was to be followed on one hinge does not.

    Args:
        job: The run.
        masks: The foreground of the clip, before anything was located.
        mechanism: What was to be followed.
        poses: Its poses.
    """
    seen, name = int(np.sum(poses.seen)), mechanism.name
    if len(mechanism.joints) > 1 or dots_of(mechanism) or seen >= LEAST_SEEN * len(poses):
        return []
    ball = _looked(job, masks, Tried("ball", load("ball")))
    if ball.lies <= LEAST_FITTING * ball.frames:
        return []
    return [
        f"Only a round thing seems to move: a ball alone, its thread unseen, lies on it in {ball.lies} of "
        f"{ball.frames} key frames, '{name}' was tracked in {seen} of {len(poses)}; take the model 'ball'."
    ]


def nearest(fit: Fit, comparison: Sequence[Compared]) -> list[str]:
    """Return what to do where no bundled mechanism fits; nothing otherwise.

    Args:
        fit: The fit of the chosen one.
        comparison: All that were tried, the chosen one first; none where the user named it.
    """
    if fit.ok or not comparison:
        return []
    return [
        f"'{comparison[0].model}' is the nearest of the bundled mechanisms: where it is not what was filmed, "
        "draw a mechanism file, for example from model.xml of this run, and name it with --model."
    ]
