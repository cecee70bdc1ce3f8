"""The first seconds of a stream: watched until enough has moved, then searched for the mechanism.

What was watched is a clip in memory, so that the search is the one of a whole run: background and colours,
camera and sizes, poses, parameters.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monodyn.checks import camera_choices, left_out
from monodyn.doubtful import doubtful_sight
from monodyn.errors import MonodynError, VideoError
from monodyn.estimation.fit import Doubt, Fit
from monodyn.live.estimate import Estimate
from monodyn.live.horizon import Horizon, horizon_of
from monodyn.live.record import joined
from monodyn.live.settings import LiveSettings
from monodyn.live.tracker import Tracker
from monodyn.mechanism import Mechanism
from monodyn.redrawn import redrawn
from monodyn.results.sight import Sight
from monodyn.settings import RunSettings
from monodyn.stages import identify, locate, segment, track_freely
from monodyn.types import Frame, Poses
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.soft import SoftMasks
from monodyn.vision.foreground.thumbnails import Window
from monodyn.vision.locating.scene import Scene

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
FEW, ROUNDS = 2, 10
"""Frames that are left to whoever takes the next ones, and how often it is looked how many came meanwhile."""
MOST_HELD = 256_000_000
"""Bytes of pictures that are held at most; then the oldest give way."""


@dataclass(frozen=True, eq=False)
class Found:
    """What the first seconds show.

    Attributes:
        scene: Mechanism and camera; its masks cover the whole picture, wherever the mechanism goes.
        poses: The poses of those of the frames in which nothing holds the mechanism.
        fit: The mechanism as identified from these.
        notes: What people should know, in sentences.
        until: Number in the stream of the last frame that was watched.
    """

    scene: Scene
    poses: Poses
    fit: Fit
    notes: tuple[str, ...]
    until: int


class Beginning:
    """What has been watched so far.

    Args:
        seconds: Of motion that are watched before the first search.

    Attributes:
        frames: The frames, in the order of time.
        moving: Seconds of motion among them.
        needed: Seconds of motion that the next search waits for.
        left_out: Frames for which there was no room while the mechanism was looked for.
    """

    def __init__(self, seconds: float) -> None:
        self.frames: list[Frame] = []
        self.moving, self.needed, self.left_out = 0.0, seconds, 0
        self._held, self._holds = 0, False
        self._before: deque[tuple[float, np.ndarray]] = deque()

    @property
    def ready(self) -> bool:
        """True where enough has moved for a search."""
        return self.moving >= self.needed

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
            if int(np.sum(change > level)) >= LEAST_MOVED:
                self.moving += frame.time - before[-1][0]
        before.append((frame.time, small))
        if self._holds and self._held > MOST_HELD:
            self.left_out += 1
            return
        self.frames.append(frame)
        self._held += _size(frame)
        while not self._holds and self._too_many():
            self._held -= _size(self.frames.pop(0))

    def hold(self) -> None:
        """Keep what is there while it is looked at; what there is no room for is left out."""
        self._holds = True

    def in_vain(self) -> None:
        """Wait for more motion after a search that found nothing."""
        self.needed, self._holds = AGAIN * self.moving, False

    def _too_many(self) -> bool:
        """Return whether the oldest frame gives way: nothing moved since, or there is no room."""
        first, last = self.frames[0], self.frames[-1]
        still = self.moving == 0.0 and last.time - first.time > STILL_KEPT
        return still or (self._held > MOST_HELD and len(self.frames) > 2)


class Setup(NamedTuple):
    """What is looked for, and how.

    Attributes:
        mechanism: The mechanism with the user's choices.
        live: How the stream is followed.
        settings: How each stage goes.
    """

    mechanism: Mechanism
    live: LiveSettings
    settings: RunSettings


class Begun(NamedTuple):
    """What the first seconds have shown, and what goes on from it.

    Attributes:
        found: Scene, poses and fit.
        tracker: Follows from the last frame on.
        later: Poses of what came while the mechanism was looked for; None for nothing.
        horizon: What goes on from the fit; None where nothing does.
        estimate: What was identified with these poses; None without any.
        count: How many of the frames that were watched have been followed.
    """

    found: Found
    tracker: Tracker
    later: Poses | None
    horizon: Horizon | None
    estimate: Estimate | None
    count: int


def begin(watched: Beginning, name: str, setup: Setup) -> Begun | MonodynError:
    """Look for the mechanism in the first seconds, and follow it through what comes meanwhile.

    Args:
        watched: What was watched; more frames may come to it while it is looked at.
        name: Name of the stream.
        setup: What is looked for, and how.

    Returns:
        What was found, or why nothing was.
    """
    frames = tuple(watched.frames)
    try:
        found = search(frames, name, setup.mechanism, setup.settings)
    except MonodynError as error:
        return error
    horizon = horizon_of(found.fit, found.scene.mechanism, found.poses, setup.live)
    tracker, count, rows = Tracker(found.scene, setup.settings.track, frames), len(frames), list[Poses]()
    rounds = 0
    # what came meanwhile is followed faster than frames come, or it never ends
    while len(watched.frames) - count > FEW and rounds < ROUNDS:
        rounds += 1
        for frame in watched.frames[count:]:
            rows.append(tracker.follow(frame))
            count += 1
    later = joined(rows) if rows else None
    estimate = horizon.add(later) if horizon is not None and later is not None else None
    return Begun(found, tracker, later, horizon, estimate, count)


def search(frames: Sequence[Frame], name: str, mechanism: Mechanism, settings: RunSettings) -> Found:
    """Look for the mechanism in what was watched, follow it there and identify it.

    Args:
        frames: The frames.
        name: Name of the stream.
        mechanism: The mechanism with the user's choices.
        settings: How each stage goes.

    Returns:
        What was found; its fit says how far it can be relied on.

    Raises:
        VideoError: the camera moves; from deeper down: the mechanism is not found.
    """
    video = as_clip(frames, name)
    masks = segment(video, settings.segment, background=settings.background)
    if masks.video.camera_path is not None:
        raise VideoError(f"{name}: expected a camera that stands still, got one that moves; fasten it.")
    fix, free = camera_choices(settings)
    scene = locate(masks, mechanism, settings.locate, camera=settings.camera, fix=fix, free=free)
    poses, span = track_freely(scene.masks, scene, settings.track)
    part = poses[slice(*np.searchsorted(poses.frame, span[:2]))]
    sight = Sight(video, masks=masks, scene=scene, poses=poses, fit_frames=span[:2], free_frames=span[:2])
    fit = redrawn(identify(part, scene.mechanism, settings.identify), scene, part)
    if why := doubtful_sight(sight, part):
        fit = replace(fit, doubts=(), advice=()).doubted([Doubt("refused", why)])
    part = replace(part, frame=np.array([frames[number].index for number in part.frame]))
    others = left_out(scene.masks.background, given=settings.segment.roi is not None)
    return Found(_everywhere(scene), part, fit, (*scene.advice, *others, *span.notes), frames[-1].index)


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
