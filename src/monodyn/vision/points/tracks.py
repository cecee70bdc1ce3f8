"""Named points in the pictures of a clip as another tool measured them: what stands in place of masks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from monodyn.arrays import Frozen, freeze, increasing
from monodyn.errors import VideoError
from monodyn.markup import brief, counted, stretch
from monodyn.vision.clip.video import Video


@dataclass(frozen=True, eq=False)
class PointTracks(Frozen):
    """Places of named points in the pictures of a clip.

    Attributes:
        path: The table.
        names: Names of the points.
        frame: Frame numbers, int (frame,).
        time: Time stamps [s], (frame,).
        px: Column and row of each point [px], (frame, point, 2); NaN where it was not found.
        likelihood: How sure the tool is of each place, 0 to 1, (frame, point).
        width: Picture width [px].
        height: Picture height [px].
        in_picture: False where the table has lengths of a scene in place of pixels, which were brought into
            a picture of their own.
        tick: Unit to which the stamps are rounded [s]; 0 where they are exact.
        notes: What was assumed, in sentences.
        told_apart: True where no two of the points can have exchanged names.
        clip: The clip in whose pictures they were found, which knows its times; None for points of a table.
    """

    path: Path
    names: tuple[str, ...]
    frame: np.ndarray
    time: np.ndarray
    px: np.ndarray
    likelihood: np.ndarray
    width: int
    height: int
    in_picture: bool = True
    tick: float = 0.0
    notes: tuple[str, ...] = field(default=())
    told_apart: bool = False
    clip: Video | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        frames, points = len(self.time), len(self.names)
        freeze(self, (frames,), "frame", dtype=np.int64, error=VideoError)
        freeze(self, (frames,), "time", error=VideoError)
        freeze(self, (frames, points, 2), "px", error=VideoError)
        freeze(self, (frames, points), "likelihood", error=VideoError)
        increasing("PointTracks.time", self.time, error=VideoError)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        times = stretch(self.time.tolist())
        return f"<PointTracks of {brief(self.names, 'points')}: {counted(len(self), 'frame')}, {times}>"

    @property
    def found(self) -> np.ndarray:
        """True where a point was found, bool (frame, point)."""
        return np.isfinite(self.px).all(axis=2) & (self.likelihood > 0.0)

    def of(self, names: tuple[str, ...]) -> PointTracks:
        """Return some of the points.

        Args:
            names: Their names, in the new order.
        """
        rows = [self.names.index(name) for name in names]
        return replace(self, names=names, px=self.px[:, rows], likelihood=self.likelihood[:, rows])


def without_pictures(tracks: PointTracks) -> Video:
    """Return a clip of the frames of tracked points that has no pictures.

    Args:
        tracks: The points.
    """
    count = int(tracks.frame[-1]) + 1
    line = np.polyfit(tracks.frame, tracks.time, 1) if len(tracks) > 1 else np.array([1.0, tracks.time[0]])
    times = np.polyval(line, np.arange(count))
    # a frame that the table lacks has the time that the others make likely
    times[tracks.frame] = tracks.time
    if np.any(np.diff(times) <= 0):
        times = np.interp(np.arange(count), tracks.frame, tracks.time)
        times[: tracks.frame[0]] = tracks.time[0] + line[0] * (np.arange(tracks.frame[0]) - tracks.frame[0])
    return Video(tracks.path, tracks.width, tracks.height, times, lambda start, stop: iter(()))
