"""Masks whose pictures stay in the clip when they are pickled.

The sample frames and the thumbnails are most of what masks hold, and all of it is in the file. So a pickle
has the numbers of the frames alone; they are read again when somebody asks for them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from monodyn.types import Frame
from monodyn.vision.clip.repeats import NO_REPEATS
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.background import Samples
from monodyn.vision.foreground.sampling import own_copy
from monodyn.vision.foreground.thumbnails import ThumbnailStore


@dataclass(frozen=True, eq=False)
class Unread:
    """Samples without their pictures.

    Attributes:
        numbers: Numbers of the sample frames.
        bare: The samples, no frame and no thumbnail among them.
        reduced: Whether there are thumbnails.
    """

    numbers: frozenset[int]
    bare: Samples
    reduced: bool

    def read(self, video: Video) -> Samples:
        """Return the samples with their pictures.

        Args:
            video: The clip, which may have moved since; its frames are as they were.
        """
        span = self.bare.span or (0, video.count)
        store = ThumbnailStore(video.width, video.height, video.count)
        first, stop = span if self.reduced else (min(self.numbers), max(self.numbers) + 1)
        frames = []
        for frame in replace(video, repeats=NO_REPEATS).frames(first, stop):
            if self.reduced:
                store.add(frame)
            if frame.index in self.numbers:
                frames.append(own_copy(frame))
        thumbnails = store.finished() if self.reduced else None
        return replace(self.bare, frames=tuple(frames), thumbnails=thumbnails)


def unread(samples: Samples) -> Unread:
    """Return samples without their pictures.

    Args:
        samples: The samples.
    """
    numbers = frozenset(frame.index for frame in samples.frames)
    return Unread(numbers, replace(samples, frames=(), thumbnails=None), samples.thumbnails is not None)


class Sampled:
    """Base of masks with samples: what comes back from a pickle reads them from the clip when they are asked
    for."""

    video: Video
    samples: Samples

    def __getstate__(self) -> dict[str, Any]:
        held = self.__dict__
        names = {field.name for field in fields(self)}  # type: ignore[arg-type]
        state = {name: value for name, value in held.items() if name in names and name != "samples"}
        return state | {"_unread": unread(held["samples"]) if "samples" in held else held["_unread"]}

    def _lit(self, frame: Frame) -> Frame:
        """Return a frame in the light of the background."""
        return frame

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Read the samples that a pickle left in the clip; nothing else is missing."""
            left = self.__dict__.get("_unread")
            if name != "samples" or left is None:
                raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'.")
            samples = left.read(self.video)
            samples = replace(samples, frames=tuple(map(self._lit, samples.frames)))
            self.__dict__["samples"] = samples
            return samples
