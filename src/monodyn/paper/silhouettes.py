"""The binary silhouettes of a clip: one threshold for all of its frames."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from monodyn.errors import VideoError
from monodyn.paper.threshold import Threshold, holds, otsu_threshold, silhouette
from monodyn.paper.view import SilhouetteImage, silhouette_image
from monodyn.types import Frame
from monodyn.vision.foreground.masks import Masks

WITNESSES = 8
"""Further frames that decide between the interpretations of one."""


@dataclass(frozen=True, eq=False)
class SilhouetteFrame:
    """A frame of the clip and its silhouette.

    Attributes:
        frame: The frame.
        image: Its silhouette as the problems need it.
        silhouette: The same as a picture, uint8 (height, width).
    """

    frame: Frame
    image: SilhouetteImage
    silhouette: np.ndarray = field(repr=False)


@dataclass(frozen=True, eq=False)
class ClipSilhouettes:
    """The silhouettes of a clip.

    Attributes:
        masks: The soft foreground of the clip; its background is subtracted.
        level: Threshold that the user set [grey levels]; 0 takes Otsu's over the sample frames.
    """

    masks: Masks
    level: float = 0.0

    @cached_property
    def threshold(self) -> Threshold:
        """The threshold; a level that the user set holds for grey or colour, as Otsu's would."""
        best = otsu_threshold(self.masks.samples.frames, self.masks.background)
        return replace(best, level=self.level or best.level)

    def picture(self, frame: Frame, *, settle: bool = True) -> np.ndarray:
        """Return the silhouette of a frame, uint8 (height, width).

        Args:
            frame: The frame.
            settle: Give patches without a known background to the mechanism where it borders them.
        """
        return silhouette(frame, self.masks.background, self.threshold, settle=settle)

    def find(self, frame: Frame) -> SilhouetteFrame | None:
        """Return a frame with its silhouette, or None where no part of the mechanism is seen.

        Args:
            frame: The frame.
        """
        picture = self.picture(frame)
        return SilhouetteFrame(frame, silhouette_image(picture), picture) if holds(picture) else None

    def of(self, frame: Frame) -> SilhouetteFrame:
        """Return a frame with its silhouette.

        Args:
            frame: The frame.

        Returns:
            The frame and its silhouette, which holds something of the mechanism.
        """
        picture = self.picture(frame)
        return SilhouetteFrame(frame, silhouette_image(picture), picture)

    def witnesses(self, first: Frame) -> list[SilhouetteFrame]:
        """Return the first frame, then sample frames spread over the motion, those with a silhouette alone.

        Args:
            first: The first frame of the clip.

        Raises:
            VideoError: the mechanism stands out from the background in no frame.
        """
        # samples are spread over the motion, so even steps among them show the mechanism in unlike poses
        frames = [first, *(frame for frame in self.masks.samples.frames if frame.index != first.index)]
        picks = [0, *np.unique(np.linspace(1, len(frames) - 1, WITNESSES).round().astype(int))]
        found = [shown for i in picks if (shown := self.find(frames[i])) is not None]
        if not found:
            raise VideoError(
                f"{self.masks.video.path}: expected the mechanism to stand out by "
                f"{self.threshold.level:.0f} grey levels, found it in no frame; set --locate.level lower, or "
                "use another method."
            )
        return found
