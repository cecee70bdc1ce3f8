"""The default segmentation: from frames to soft foreground coverage per pixel, streamed.

A pixel that the mechanism covers by a share c shows ``I = (1 - c) B + c F``. With the background B of the
pixel and the colour F of the mechanism, c is the projection of ``I - B`` on ``F - B``, weighted by the
noise of each channel: linear in the picture, so the edge of the mechanism keeps its sub-pixel place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from monodyn.errors import VideoError
from monodyn.markup import counted
from monodyn.types import Frame, Mask, Progress
from monodyn.vision.clip.steady import NO_PARALLAX, Parallax, displaced
from monodyn.vision.clip.video import Video, read
from monodyn.vision.foreground.background import Background, Samples, background_of, within
from monodyn.vision.foreground.covered import covered_whole
from monodyn.vision.foreground.light import Light, in_one_light, light_of
from monodyn.vision.foreground.masks import GeomColours, View, Wanted
from monodyn.vision.foreground.moving_colours import lingering, moving_colours
from monodyn.vision.foreground.palette import Palette, measured_palette, palette_of, with_wall
from monodyn.vision.foreground.sampling import sample_frames
from monodyn.vision.foreground.unread import Sampled
from monodyn.vision.registration.register import onto_scene, steadied
from monodyn.vision.settings import SegmentSettings

FEW_LINGER = 0.01
"""Share of the part in which anything moves that may linger in the first background before the colours, found
from what differs from that, are in doubt: a mechanism covers some ten times as much."""


@dataclass(frozen=True, eq=False)
class SoftMasks(Sampled):
    """The soft foreground of a clip; iterate over it for one ``Mask`` a frame.

    Attributes:
        video: The clip.
        background: What the pixels show without the mechanism.
        palette: Colours of the mechanism and each pixel's gain.
        samples: Frames spread over the motion, from which the background was taken.
        settings: How the foreground was found.
        parallax: By how much more the mechanism moves than the registered scene before a camera that moves;
            the masks follow the mechanism.
    """

    video: Video
    background: Background
    palette: Palette
    samples: Samples = field(repr=False)
    settings: SegmentSettings
    parallax: Parallax = NO_PARALLAX

    @property
    def varied(self) -> bool:
        """True where the colours leave much of the mechanism unexplained, so that any difference counts."""
        return self.palette.varied

    @cached_property
    def light(self) -> Light:
        """The light of the background, into which every frame is brought."""
        return light_of(self.background.luma)

    def _lit(self, frame: Frame) -> Frame:
        """Return a frame in the light of the background."""
        return self.light.evened(frame)

    def __repr__(self) -> str:
        colours = counted(len(self.palette.colours), "colour")
        return f"<SoftMasks of {self.video.path.name}: {colours}, noise {self.background.noise:.1f}>"

    def __iter__(self) -> Iterator[Mask]:
        """Stream the masks in the order of time."""
        for frame in self.video.frames():
            yield self.of(frame)

    def of(self, frame: Frame, wanted: Wanted | None = None) -> Mask:
        """Return the mask of one frame of the clip.

        Args:
            frame: A frame of ``video``.
            wanted: Part of the mask that is wanted; None for all of it.

        Returns:
            Its soft foreground; outside of the part that is wanted the planes hold anything.
        """
        from monodyn.vision.foreground.coverage import coverage_of

        even = self.light.evened(frame)
        if self.parallax == NO_PARALLAX:
            return Mask(frame.index, frame.time, coverage_of(even, self.background, self.palette, wanted))
        # what is displaced comes from elsewhere, of which the whole is taken
        planes = coverage_of(even, self.background, self.palette)
        return Mask(frame.index, frame.time, displaced(planes, -self.away(frame.index)))

    def view(self, geoms: int) -> View:
        """Return how the planes of the masks are to be read.

        Args:
            geoms: Number of geoms of the mechanism.

        Returns:
            Trust of the planes and the plane of each geom.
        """
        return self.palette.view(geoms)

    def coloured(self, colours: GeomColours | None) -> SoftMasks:
        """Return the masks with colours measured on the located mechanism.

        Args:
            colours: The colours, or None to keep those found without it.

        Returns:
            New masks of the same clip over the same background.
        """
        if colours is None:
            return self
        background = with_wall(self.background, colours.colours, grey_only=self.palette.grey_only)
        palette = measured_palette(self.palette, background, colours)
        return replace(self, background=background, palette=palette)

    def over(self, samples: Samples) -> SoftMasks:
        """Return the masks found anew from other samples.

        Args:
            samples: Some of the sample frames, or a part of the picture.

        Returns:
            New masks of the same clip.

        Raises:
            VideoError: nothing moves there.
        """
        given = None
        if self.background.given:
            given = within(self.background, samples.window, samples.others)
        return replace(_masks_over(self.video, samples, self.settings, given), parallax=self.parallax)

    def nearer(self, parallax: Parallax) -> SoftMasks:
        """Return the masks that follow a mechanism nearer to a moving camera than the scene behind it.

        Args:
            parallax: By how much more it moves in the pictures.

        Returns:
            New masks of the same clip.
        """
        return replace(self, parallax=parallax)

    def away(self, frame: int) -> np.ndarray:
        """Return where the mechanism is in a frame of the clip against where its masks show it.

        Args:
            frame: Frame number.

        Returns:
            To the right and down [px], (2,).
        """
        path = self.video.camera_path
        return np.zeros(2) if path is None else path.sway(frame, self.parallax)

    def refined(self, covered: Sequence[np.ndarray]) -> SoftMasks:
        """Return the masks over a background from which the mechanism is taken out.

        Args:
            covered: For each of the sample frames the pixels that the mechanism covers, bool (height, width).

        Returns:
            New masks of the same clip, the colours looked for anew; a background that was given stays.
        """
        if self.parallax != NO_PARALLAX:
            covered = [
                displaced(one[np.newaxis].astype(np.uint8), self.away(frame.index))[0] > 0
                for frame, one in zip(self.samples.frames, covered, strict=True)
            ]
        background, settings = self.background, self.settings
        if not background.given:
            background = background_of(self.samples, covered_whole(covered), fallback=background)
        found = moving_colours(self.samples.frames, background, settings.colour, settings.contrast)
        return replace(self, background=background, palette=palette_of(found, background))


def soft_masks(
    video: Video, settings: SegmentSettings, background: str | Path | None, progress: Progress | None
) -> SoftMasks:
    """Find background and colours of a clip; its masks follow from them frame by frame.

    Args:
        video: The clip, from ``read``.
        settings: How the foreground is found.
        background: A picture of the scene without the mechanism, of the clip's size; else it is taken from
            the clip.
        progress: Called with the number of frames read.

    Returns:
        The masks, computed frame by frame as they are iterated over.
    """
    samples = sample_frames(video, settings, progress=progress)
    steady = steadied(video, samples.frames, progress)
    if steady.camera_path is not None:
        # what moved in the pictures was the camera: where and when the mechanism moves shows only afterwards
        samples = sample_frames(steady, settings, progress=progress)
    video = steady.without(samples.repeats)
    samples = replace(samples, frames=in_one_light(samples.frames))
    given = None if background is None else _given(background, video, samples)
    if given is not None:
        samples = replace(samples, frames=in_one_light(samples.frames, given.luma))
    return _masks_over(video, samples, settings, given)


def _masks_over(
    video: Video, samples: Samples, settings: SegmentSettings, given: Background | None
) -> SoftMasks:
    """Return the masks by background and colours of samples; a background that is given stays."""
    background = background_of(samples) if given is None else given
    found = moving_colours(samples.frames, background, settings.colour, settings.contrast)
    # a mechanism that rests most of the time is part of the first background: it is taken out of it once
    covered = None if background.given else lingering(samples.frames, background, found)
    if covered is not None:
        top, bottom, left, right = background.window
        few = np.count_nonzero(covered.anywhere) < FEW_LINGER * (bottom - top) * (right - left)
        background = background_of(samples, covered, fallback=background)
        if not few:
            found = moving_colours(samples.frames, background, settings.colour, settings.contrast)
    return SoftMasks(video, background, palette_of(found, background), samples, settings)


def _given(picture: str | Path, video: Video, samples: Samples) -> Background:
    """Take the background from a picture and its noise from the clip."""
    frame = next(iter(read(picture, still=True).frames()))
    if frame.luma.shape != (video.height, video.width):
        height, width = frame.luma.shape
        raise VideoError(
            f"{picture}: expected a background of {video.width}x{video.height} like the clip, "
            f"got {width}x{height}; give a frame of the same camera without the mechanism."
        )
    frame = frame if video.straight is None else video.straight(frame)
    if video.camera_path is not None:
        frame = onto_scene(frame, str(picture), video.camera_path)
    measured = background_of(samples)
    chroma = None
    if frame.chroma is not None and measured.chroma is not None:
        chroma = (frame.chroma[0].astype(np.float32), frame.chroma[1].astype(np.float32))
    known = np.ones(frame.luma.shape, dtype=np.bool_)
    luma = frame.luma.astype(np.float32)
    return replace(measured, luma=luma, chroma=chroma, known=known, given=True)
