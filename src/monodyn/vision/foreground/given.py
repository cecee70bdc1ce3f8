"""Masks that another tool made, in place of a segmentation: a folder, a film or an array, one object or a
body.

The masks themselves are the pictures of the clip: white on black. Nothing has to be found in them, so that
the background is black, every pixel is trusted, and each body has a plane of its own where the masks tell the
bodies apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from monodyn.errors import VideoError
from monodyn.markup import counted
from monodyn.mechanism import Mechanism
from monodyn.types import FULL, Frame, Mask, Progress
from monodyn.vision.clip.repeats import NO_REPEATS
from monodyn.vision.clip.steady import NO_PARALLAX, Parallax
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.background import Background, Samples
from monodyn.vision.foreground.mask_files import BLACK, WHITE, OpenedMasks, opened_masks
from monodyn.vision.foreground.masks import GeomColours, View, Wanted, no_order, plain_view
from monodyn.vision.foreground.sampling import sample_frames
from monodyn.vision.foreground.unread import Sampled
from monodyn.vision.settings import SegmentSettings

NOISE = 1.0
"""Noise of the masks as pictures [grey levels]."""
MOST_COVERED = 0.6
"""Share of the picture that a mechanism covers at most."""


@dataclass(frozen=True, eq=False)
class GivenMasks(Sampled):
    """Masks that another tool made; iterate over them for one ``Mask`` a frame.

    Attributes:
        video: The masks as the pictures of a clip, all objects together.
        objects: The same with one object below the other.
        samples: Frames of it spread over the motion.
        background: Black.
        planes: Number of objects that the masks tell apart.
        part: Plane of each geom, int64 (geom,); None for one object.
    """

    video: Video
    objects: Video
    samples: Samples = field(repr=False)
    background: Background = field(repr=False)
    planes: int
    part: np.ndarray | None

    @property
    def varied(self) -> bool:
        """False: what is outside of the mechanism is a sign of a wrong place."""
        return False

    @property
    def parallax(self) -> Parallax:
        """None: masks show no scene that the mechanism could be nearer than."""
        return NO_PARALLAX

    def __repr__(self) -> str:
        return f"<GivenMasks of {self.video.path.name}: {counted(self.planes, 'object')}>"

    def __iter__(self) -> Iterator[Mask]:
        """Stream the masks in the order of time."""
        for frame in self.objects.frames():
            yield self._of(frame)

    def of(self, frame: Frame, wanted: Wanted | None = None) -> Mask:
        """Return the mask of one frame.

        Args:
            frame: A picture of ``video``.
            wanted: Not used: all of it costs little.

        Returns:
            Coverage of every object.
        """
        if self.planes == 1:
            return self._of(frame)
        return self._of(next(iter(self.objects.frames(frame.index, frame.index + 1))))

    def _of(self, frame: Frame) -> Mask:
        """Return the mask of a picture with one object below the other."""
        share = np.clip((frame.luma.astype(np.float32) - BLACK) / (WHITE - BLACK), 0.0, 1.0)
        planes = np.round(share * FULL).astype(np.uint8).reshape(-1, self.video.height, self.video.width)
        return Mask(frame.index, frame.time, planes * self.background.counts)

    def view(self, geoms: int) -> View:
        """Return how the planes are to be read.

        Args:
            geoms: Number of geoms of the mechanism.

        Returns:
            Full trust, and the plane of each geom.
        """
        trust = np.ones(self.background.luma.shape, np.float32)
        if self.part is None or len(self.part) != geoms:
            return plain_view(trust, geoms)
        planes, even = np.repeat(trust[np.newaxis], self.planes, axis=0), np.zeros(geoms, np.bool_)
        return View(planes, self.part, even, no_order(geoms))

    def over(self, samples: Samples) -> GivenMasks:
        """Return the same masks, of other samples and in a part of the picture.

        Args:
            samples: Some of the sample frames, or a part of the picture.
        """
        background = replace(self.background, window=samples.window, others=samples.others)
        return replace(self, samples=samples, background=background)

    def refined(self, covered: Sequence[np.ndarray]) -> GivenMasks:
        """Return the masks as they are.

        Args:
            covered: Not used, bool (height, width) each: nothing has to be found anew.
        """
        return self

    def nearer(self, parallax: Parallax) -> GivenMasks:
        """Return the masks as they are.

        Args:
            parallax: Not used: masks show no scene.
        """
        return self

    def away(self, frame: int) -> np.ndarray:
        """Return zero, (2,): the mechanism is where its masks show it.

        Args:
            frame: Not used.
        """
        return np.zeros(2)

    def coloured(self, colours: GeomColours | None) -> GivenMasks:
        """Return the masks as they are.

        Args:
            colours: Not used: masks have no colours.
        """
        return self


def read_masks(
    path: str | Path,
    mechanism: Mechanism,
    settings: SegmentSettings | None = None,
    *,
    rate: float | None = None,
    clip: Video | None = None,
    progress: Progress | None = None,
) -> GivenMasks:
    """Read masks that another tool made.

    Args:
        path: A folder of numbered pictures, a film, or an NPZ file with an array (frame, height, width), or
            (frame, body, height, width). Values are binary, or go from 0 to 255 (to 1 in floating point);
            small whole numbers are labels, 1 for the first body of the mechanism, 2 for the second.
        mechanism: The mechanism, whose bodies the masks may tell apart.
        settings: Region and time range, where the user gives them.
        rate: Frames a second [Hz]; None takes the clip's stamps, or those of the file.
        clip: The clip that the masks are of, for its time stamps.
        progress: Called with the number of frames read.

    Returns:
        The masks.

    Example:
        >>> monodyn.read_masks("masks/", monodyn.load("double"), rate=30)  # doctest: +SKIP
    """
    return given_masks(opened_masks(path, mechanism, rate=rate, clip=clip), mechanism, settings, progress)


def given_masks(
    opened: OpenedMasks,
    mechanism: Mechanism,
    settings: SegmentSettings | None = None,
    progress: Progress | None = None,
) -> GivenMasks:
    """Look through masks for where and when anything moves.

    Args:
        opened: The masks.
        mechanism: The mechanism, whose bodies they may tell apart.
        settings: Region and time range, where the user gives them.
        progress: Called with the number of frames read.

    Returns:
        The masks.

    Raises:
        VideoError: no mask shows anything, or they show the background.
    """
    video, planes, shown = opened.objects, opened.planes, opened.together
    samples = replace(sample_frames(shown, settings, progress=progress), repeats=NO_REPEATS)
    _check_covered(video.path, [frame.luma > 0.5 * (BLACK + WHITE) for frame in samples.frames])
    dark = np.full((video.height, video.width), float(BLACK), np.float32)
    known = np.ones(dark.shape, np.bool_)
    background = Background(dark, None, NOISE, known, samples.window, given=True, others=samples.others)
    part = None
    if planes > 1:
        bodies = list(dict.fromkeys(mechanism.shapes.body))
        part = np.array([bodies.index(body) for body in mechanism.shapes.body], dtype=np.int64)
    return GivenMasks(shown, video, samples, background, planes, part)


def _check_covered(path: Path, covered: Sequence[np.ndarray]) -> None:
    """Refuse masks of which none covers anything, or the typical one most of the picture."""
    shares = [float(mask.mean()) for mask in covered]
    if not any(shares):
        raise VideoError(
            f"{path}: expected masks of the mechanism, got no pixel that is covered by half; give masks that "
            "are white, 1 or 255 where the mechanism is."
        )
    if np.median(shares) > MOST_COVERED:
        raise VideoError(
            f"{path}: expected masks of the mechanism, which cover at most {MOST_COVERED:.0%} of a picture, "
            f"got {np.median(shares):.0%}; they may be of the background: exchange black and white."
        )
