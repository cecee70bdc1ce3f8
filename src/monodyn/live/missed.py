"""Frames of a clip that were not followed while it played, followed once it has ended.

A clip at its own pace does not wait: while the mechanism is looked for, and on a slow machine, frames may
give way to newer ones. They are still in the clip.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.live.begin import Found
from monodyn.live.horizon import LONGEST_GAP
from monodyn.live.identifier import Cut, Identifier
from monodyn.live.record import joined
from monodyn.live.settings import LiveSettings
from monodyn.live.tracker import LED_IN, Tracker
from monodyn.settings import RunSettings
from monodyn.types import Poses, Progress
from monodyn.vision.clip.video import Video


def followed_later(
    found: Found, record: Poses, video: Video, stop: int, settings: RunSettings, progress: Progress | None
) -> Poses:
    """Follow the frames of a clip that came after the first seconds and were not followed.

    Args:
        found: What the first seconds have shown.
        record: The poses of the stream, numbered as the clip is.
        video: The clip.
        stop: The frame after the last that came.
        settings: How the mechanism is followed.
        progress: Called with the number of frames done.

    Returns:
        The poses of all frames, without what moves all positions together.
    """
    # a clip whose stamps break off has another clock than the stream
    if not np.array_equal(record.time, video.times[record.frame]):
        return record
    wanted = np.setdiff1d(np.arange(found.until + 1, stop), record.frame)
    parts, done, count = list[Poses](), 0, 0
    for frames in np.split(wanted, np.flatnonzero(np.diff(wanted) > 1) + 1) if len(wanted) else ():
        first, end = int(frames[0]), int(frames[-1]) + 1
        at = int(np.searchsorted(record.frame, first))
        parts.append(record[done:at])
        done = at
        tracker = Tracker(found.scene, settings.track, list(video.frames(max(first - LED_IN, 0), first)))
        for frame in video.frames(first, end):
            parts.append(replace(tracker.follow(frame), shifts=None))
            count += 1
            if progress is not None:
                progress("track", count, len(wanted))
    return joined([*parts, record[done:]]) if parts else record


def cut_with_all(
    found: Found, record: Poses, whole: Poses, cut: Cut, live: LiveSettings, settings: RunSettings
) -> Cut:
    """Return where the motion that goes on without a break begins, now that all frames are known.

    They are identified once more in their order, as far as some were missing for long, as they would have
    been had they been followed at once.

    Args:
        found: What the first seconds have shown.
        record: The poses without the frames that were missed.
        whole: The poses of all frames.
        cut: The last break while frames were missing.
        live: How the stream was followed.
        settings: How each stage goes.
    """
    ends = np.append(record.time, whole.time[-1])
    long = np.flatnonzero(np.diff(ends) > LONGEST_GAP)
    if len(whole) == len(record) or not len(long) or cut.time > ends[long[-1] + 1]:
        return cut
    scene = found.scene
    if scene.doubt is not None:
        whole = scene.doubt.with_shifts(whole, scene.mechanism.slides)
    again = Identifier(live, settings.identify, in_order=True)
    try:
        again.begin(found)
        until = float(ends[long[-1] + 1]) + live.begin
        for row in range(*np.searchsorted(whole.time, [found.poses.time[-1] + 1e-9, until]).tolist()):
            again.take(whole[row : row + 1])
    finally:
        again.close()
    return again.cut
