"""The first seconds of a stream: watched until enough has moved, then searched for the mechanism.

What was watched is a clip in memory, so that the search is that of a whole run: background and colours,
camera and sizes, poses. Its first step, which takes half of the time and needs little motion, is done while
more is watched; what it finds is followed from then on, and refined in all frames that have come by the time
of the search.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monodyn.checks import camera_choices, left_out
from monodyn.doubtful import doubtful_sight
from monodyn.errors import MonodynError, VideoError
from monodyn.estimation.wording import listed
from monodyn.live.record import joined
from monodyn.live.tracker import Tracker
from monodyn.mechanism import Mechanism
from monodyn.results.sight import Sight
from monodyn.settings import RunSettings
from monodyn.stages import locate, segment, track_freely
from monodyn.types import Frame, Poses
from monodyn.vision.clip.video import Video
from monodyn.vision.drawing.outline import covered_pixels
from monodyn.vision.foreground.masks import Masks
from monodyn.vision.foreground.soft import SoftMasks
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.locating.advice import UNEXPLAINED_SHARE
from monodyn.vision.locating.locate import Sought, first_scene
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.search import SceneGuess

CELL_PX, AGO = 4, 0.1
"""Every so many pixels along a side one is looked at for motion, and for how long it has to move [s]: what
moves slowly shows in few pixels from one frame to the next."""
MOVED_GREY = 10.0
"""Change from one frame to the next by which a pixel moved [grey levels] ..."""
MOVED_NOISE = 6.0
"""... in standard deviations of what all of them change by."""
LEAST_MOVED = 3
"""Pixels that have to move for a frame to count as motion."""
STILL_KEPT = 1.0
"""Seconds before the first motion that are kept: they show the background."""
AGAIN = 1.5
"""Factor by which more motion is watched after a search in vain."""
FIRST = 0.2
"""Share of the motion to be watched after which it is first guessed where the mechanism is: so early that the
guess is there by the end of it. It led straight to the scene in 14 of 17 drawn clips; in the others, which
are slow, faint or show much else that moves, the whole search followed. With 0.33 it did in all of 8."""
HARDLY_TURNED, BEHIND = np.deg2rad(10.0), 0.5
"""What a guess says is lacking: turns of a hinge below this [rad], a sixth of which the far end of its link
moves to the side; a share of the mechanism behind which nothing was seen above that, which is several times
that of a link about its pivot."""
MOST_HELD = 256_000_000
"""Bytes of pictures that are held at most; then the oldest give way."""


@dataclass(frozen=True, eq=False)
class Found:
    """What the first seconds show.

    Attributes:
        scene: Mechanism and camera; its masks cover the whole picture, wherever the mechanism goes.
        poses: The poses of those of the frames in which nothing holds the mechanism.
        sight: What was seen up to there, by the numbers of the frames watched.
        notes: What people should know, in sentences.
        until: Number in the stream of the last frame that was watched.
    """

    scene: Scene
    poses: Poses
    sight: Sight
    notes: tuple[str, ...]
    until: int

    @cached_property
    def doubt(self) -> str | None:
        """Why no fit to poses of this scene is to be trusted, a sentence; None without a reason."""
        assert self.sight.poses is not None
        return doubtful_sight(self.sight, self.sight.poses)


class Beginning:
    """What has been watched so far.

    Args:
        seconds: Of motion that are watched before the mechanism is looked for.

    Attributes:
        frames: The frames, in the order of time.
        moving: Seconds of motion among them.
        still: Whether nothing moves at the last of them.
        needed: Seconds of motion that the next step of the search waits for.
        guessed: Whether the first step has been taken.
        guess: What it found; None where that explains too little of what moves.
        why: What the last step lacked, a sentence, or nothing.
        holds: Whether it is looked at: what is there is kept, and what there is no room for is left out.
    """

    def __init__(self, seconds: float) -> None:
        self.frames: list[Frame] = []
        self.moving, self.needed, self._seconds = 0.0, FIRST * seconds, seconds
        self.still, self.guessed, self.why = True, False, ""
        self.guess: SceneGuess | None = None
        self.holds, self._held = False, 0
        self._before: deque[tuple[float, np.ndarray]] = deque()

    @property
    def ready(self) -> bool:
        """True where enough has moved for the next step of the search."""
        return self.moving >= self.needed

    @property
    def lacks(self) -> str:
        """What the next step of the search waits for, in sentences."""
        tenths = max(0.0, np.ceil(10.0 * (self.needed - self.moving) - 1e-6))
        more = f"{0.1 * tenths:.1f} s {'more ' if self.moving else ''}of motion"
        said = [self.why, "Nothing is seen to move." if self.still else "", f"The search needs {more}."]
        return " ".join(filter(None, said))

    def add(self, frame: Frame) -> None:
        """Take the next frame.

        Args:
            frame: The frame, on the stream's clock.
        """
        small = frame.luma[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX].astype(np.float32)
        before = self._before
        while len(before) > 1 and before[1][0] <= frame.time - AGO:
            before.popleft()
        if before:
            change = np.abs(small - before[0][1])
            # most of a picture stands still: its median change is that of noise
            level = max(MOVED_GREY, MOVED_NOISE * float(np.median(change)) / 0.67)
            self.still = int(np.sum(change > level)) < LEAST_MOVED
            self.moving += 0.0 if self.still else frame.time - before[-1][0]
        before.append((frame.time, small))
        if self.holds and self._held > MOST_HELD:
            return
        self.frames.append(frame)
        self._held += _size(frame)
        while not self.holds and self._too_many():
            self._held -= _size(self.frames.pop(0))

    def go_on(self, outcome: Guessed | MonodynError) -> None:
        """Go on watching after a step of the search that has not found the mechanism yet.

        Args:
            outcome: A guess where it is, or why there is none.
        """
        self.needed = AGAIN * self.moving if self.guessed else self._seconds
        self.guessed, self.holds, self.guess = True, False, None
        if isinstance(outcome, Guessed):
            self.guess, self.why = outcome.guess, hardly_shown(outcome.guess)
        else:
            self.why = str(outcome)

    def _too_many(self) -> bool:
        """Return whether the oldest frame gives way: nothing moved since, or there is no room."""
        first, last = self.frames[0], self.frames[-1]
        still = self.moving == 0.0 and last.time - first.time > STILL_KEPT
        return still or (self._held > MOST_HELD and len(self.frames) > 2)


class Guessed(NamedTuple):
    """What a fifth of the motion has shown.

    Attributes:
        guess: About where the mechanism is.
        tracker: Follows it from there until the search in all that was watched has found it.
    """

    guess: SceneGuess
    tracker: Tracker


class Begun(NamedTuple):
    """What the first seconds have shown, and what goes on from it.

    Attributes:
        found: Scene and poses.
        tracker: Follows from the last frame on.
        later: Poses of what came while the mechanism was looked for; None for nothing.
        count: How many of the frames that were watched have been followed.
    """

    found: Found
    tracker: Tracker
    later: Poses | None
    count: int


def begin(
    watched: Beginning, name: str, mechanism: Mechanism, settings: RunSettings
) -> Begun | Guessed | MonodynError:
    """Look for the mechanism in the first seconds, and follow it through what comes meanwhile.

    The first time it is only guessed where the mechanism is; a guess that leaves much unexplained says
    nothing.

    Args:
        watched: What was watched; more frames may come to it while it is looked at.
        name: Name of the stream.
        mechanism: The mechanism with the user's choices.
        settings: How each stage goes.

    Returns:
        What was found or guessed, or why nothing was.
    """
    frames, choices = tuple(watched.frames), camera_choices(settings)
    try:
        masks = segment(as_clip(frames, name), settings.segment, background=settings.background)
        if masks.video.camera_path is not None:
            return VideoError(f"{name}: expected a camera that stands still, got one that moves; fasten it.")
        if not watched.guessed:
            guess, scene = first_scene(Sought(masks, mechanism, settings.locate, *choices, lambda *_: None))
            if guess.score >= UNEXPLAINED_SHARE:
                return VideoError(f"So far a first guess explains {1.0 - guess.score:.0%} of what moves.")
            return Guessed(guess, Tracker(_everywhere(scene), settings.track, watched.frames))
        found = search(frames, masks, mechanism, settings, watched.guess)
    except MonodynError as error:
        return error
    tracker, count = Tracker(found.scene, settings.track, frames), len(frames)
    # more come while these are followed; where that is no faster than they come it ends all the same
    meanwhile = islice(watched.frames, count, 2 * len(watched.frames))
    rows = [tracker.follow(frame) for frame in meanwhile]
    return Begun(found, tracker, joined(rows) if rows else None, count + len(rows))


def search(
    frames: Sequence[Frame], masks: Masks, mechanism: Mechanism, settings: RunSettings,
    guess: SceneGuess | None,
) -> Found:  # fmt: skip
    """Look for the mechanism in what was watched, and follow it there.

    Args:
        frames: The frames.
        masks: Their masks.
        mechanism: The mechanism with the user's choices.
        settings: How each stage goes.
        guess: About where it is; None where nothing is known.

    Returns:
        What was found.

    Raises:
        VideoError: No frame shows what was found; from deeper down: the mechanism is not found.
    """
    fix, free = camera_choices(settings)
    scene = locate(masks, mechanism, settings.locate, camera=settings.camera, fix=fix, free=free, guess=guess)
    poses, span = track_freely(scene.masks, scene, settings.track)
    part = poses[slice(*np.searchsorted(poses.frame, span[:2]))]
    sight = Sight(scene.video, scene.masks, scene, part)
    part = replace(part, frame=np.array([frames[number].index for number in part.frame]))
    others = left_out(scene.masks.background, given=settings.segment.roi is not None)
    notes = (*scene.advice, *others, *span.notes)
    found = Found(_everywhere(scene), part, sight, notes, frames[-1].index)
    if not part.measured.any():
        raise VideoError(found.doubt or "")
    return found


def hardly_shown(guess: SceneGuess) -> str:
    """Return what a guess has hardly seen of the mechanism, a sentence, or nothing.

    Args:
        guess: The guess.
    """
    mechanism, turned = guess.mechanism, guess.positions - guess.positions[0]
    turned = np.ptp((turned + np.pi) % (2.0 * np.pi) - np.pi, axis=0)
    pairs = zip(mechanism.joints, turned, strict=True)
    joints = [joint.name for joint, turn in pairs if joint.kind == "hinge" and turn < HARDLY_TURNED]
    said = [f"less than 10 deg of turning at {listed(joints)}"] if joints else []
    covered = [covered_pixels(mechanism, guess.camera, q, margin=0.0) for q in guess.positions]
    behind = np.all(covered, axis=0).sum() / max(np.mean([pixels.sum() for pixels in covered]), 1.0)
    said += [f"nothing of what is behind {behind:.0%} of the mechanism"] if behind > BEHIND else []
    return f"So far a first guess shows {', and '.join(said)}." if said else ""


def as_clip(frames: Sequence[Frame], name: str) -> Video:
    """Return frames in memory as a clip.

    Args:
        frames: The frames, in the order of time.
        name: Its name.
    """
    first = frames[0].luma
    numbered = [replace(frame, index=number) for number, frame in enumerate(frames)]
    times = np.array([frame.time for frame in frames])
    height, width = first.shape
    return Video(Path(name), width, height, times, lambda start, stop: iter(numbered[start:stop]), held=True)


def numbered(poses: Poses, times: np.ndarray) -> Poses:
    """Return poses of a stream by the numbers of the frames of a clip of it, the first one 0.

    Args:
        poses: Poses from its first frame on.
        times: Times of the frames of the clip [s], (frame,); later poses have higher numbers than these.
    """
    rows, count = np.searchsorted(times, poses.time), len(times)
    shown = times[np.minimum(rows, count - 1)] == poses.time
    return replace(poses, frame=np.where(shown, rows, count + np.arange(len(poses))))


def _everywhere(scene: Scene) -> Scene:
    """Return the scene with masks of the whole picture: what did not move yet may do so later."""
    masks = scene.masks
    if not isinstance(masks, SoftMasks):
        return scene
    height, width = masks.background.luma.shape
    whole = replace(masks.background, window=Window(0, height, 0, width))
    return replace(scene, masks=replace(masks, background=whole))


def on_clip(scene: Scene, video: Video) -> Scene:
    """Return a scene whose masks are those of another clip of the same stream.

    Args:
        scene: The scene.
        video: The clip.
    """
    masks = scene.masks
    return replace(scene, masks=replace(masks, video=video)) if isinstance(masks, SoftMasks) else scene


def _size(frame: Frame) -> int:
    """Return how many bytes a frame takes."""
    return frame.luma.nbytes + sum(plane.nbytes for plane in frame.chroma or ())
