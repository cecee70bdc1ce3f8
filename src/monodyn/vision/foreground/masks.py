"""What a segmentation method returns: the interface through which the later stages see the foreground.

A mask has one plane or several; each gives the share of a pixel that the mechanism covers. The edges are
found by integrating a plane along the outline's normals, so a plane must be linear in the picture: where the
mechanism covers a third of a pixel its value is a third of ``FULL``, not one of two levels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from monodyn.types import Frame, Mask
from monodyn.vision.clip.steady import Parallax
from monodyn.vision.clip.video import Video
from monodyn.vision.foreground.background import Background, Samples
from monodyn.vision.foreground.thumbnails import Window

NOT_SHOWN, VARIED = -2, -1
"""Stand for the colour of a geom that the camera does not see, and of one that has no single colour."""
FRONT, BACK = 1, -1
"""A geom that lies in front of another, and one that lies behind it."""
LEFT_OUT = -1
"""Stands for the plane of a geom that is hidden or that the camera does not see."""
PLANE, ROW, LEFT, RIGHT = range(4)
"""Columns of a stretch of pixels: plane of the mask, row, first column, and the column past the last."""
EVERY_PLANE = -1
"""Stands for the plane of a stretch that counts in all of them."""


class Wanted(NamedTuple):
    """A part of a mask.

    Attributes:
        rows: Stretches of its rows in the columns named above, int64 (row, column); the plane of any
            difference is wanted in all of them.
        window: A rectangle in which they lie.
    """

    rows: np.ndarray
    window: Window


class View(NamedTuple):
    """How the planes of a mask are to be read; the edge kernels take it whole.

    Attributes:
        trust: How reliably each pixel distinguishes the mechanism from the background in each plane, 0 to 1,
            float32 (plane, height, width).
        part: Plane of each geom, int64 (geom,); ``LEFT_OUT`` for one at which no edge is looked for.
        shaded: True for geoms whose edges are taken against their own level, bool (geom,).
        order: Which geoms lie in front of which, int8 (geom, geom): ``FRONT`` where the row's geom does and
            its edges show before the column's, ``BACK`` where that one covers it, else 0.
        border: Plane of any difference, in which edges are looked for where a geom's own plane is not
            trusted; -1 for none.
    """

    trust: np.ndarray
    part: np.ndarray
    shaded: np.ndarray
    order: np.ndarray
    border: int = -1

    @property
    def least(self) -> np.ndarray:
        """Trust in the least distinct plane of a colour, float32 (height, width)."""
        return (
            np.delete(self.trust, self.border, axis=0).min(axis=0)
            if self.border >= 0
            else self.trust.min(axis=0)
        )


@dataclass(frozen=True, eq=False)
class GeomColours:
    """Colours measured on the geoms of a located mechanism.

    Attributes:
        colours: Grey level, blue and red difference of each colour, (colour, 3).
        part: Colour of each geom, int64 (geom,); ``VARIED`` for one without a single colour, ``NOT_SHOWN``
            for one that looks like what is behind it everywhere.
        shaded: True for geoms that show it at many levels, or that have no single colour, bool (geom,).
        camouflaged: True where a geom often has the colour of what is behind it, so that at most its
            borders show.
        light: Standard deviation of the light on each colour, as a share of it, (colour,); None where
            it is even.
        order: Which geoms lie in front of which, int8 (geom, geom): ``FRONT`` where the row's geom does,
            ``BACK`` where the column's does, 0 where neither is known; None where nothing is.
    """

    colours: np.ndarray
    part: np.ndarray
    shaded: np.ndarray
    camouflaged: bool = False
    light: np.ndarray | None = None
    order: np.ndarray | None = None


class Masks(Protocol):
    """The foreground of a clip, as ``locate``, ``track`` and the published method use it.

    A segmentation method returns an object of this shape; it need not inherit from this class. Such objects
    are not changed: ``over``, ``refined`` and ``coloured`` return new ones, and may return ``self``.
    """

    @property
    def video(self) -> Video:
        """The clip."""
        ...

    @property
    def samples(self) -> Samples:
        """Frames spread over the motion; key frames are chosen among them, in the order of time."""
        ...

    @property
    def background(self) -> Background:
        """What the pixels show without the mechanism; ``background.given`` is true if the user gave it."""
        ...

    @property
    def varied(self) -> bool:
        """True where any difference from the background counts as foreground.

        Then what is outside of the located mechanism is no sign of a wrong place.
        """
        ...

    @property
    def parallax(self) -> Parallax:
        """By how much more the mechanism moves than the registered scene before a camera that moves."""
        ...

    def of(self, frame: Frame, wanted: Wanted | None = None) -> Mask:
        """Return the mask of one frame.

        Args:
            frame: A frame of the clip, or of another clip of the same camera and background.
            wanted: Part of the mask that is wanted; outside of it the planes may hold anything. None for all
                of it.

        Returns:
            Its soft foreground, with the planes that ``view`` describes, or any number of planes where
            ``view`` describes one: then the largest coverage counts.
        """
        ...

    def __iter__(self) -> Iterator[Mask]:
        """Stream the masks of the clip in the order of time."""
        ...

    def view(self, geoms: int) -> View:
        """Return how the planes of the masks are to be read.

        Args:
            geoms: Number of geoms of the mechanism.

        Returns:
            Trust of the planes and the plane of each geom.
        """
        ...

    def over(self, samples: Samples) -> Masks:
        """Return the masks found anew from other samples.

        Args:
            samples: Some of the sample frames, or a part of the picture.

        Returns:
            Masks of the same clip, without measured colours.
        """
        ...

    def refined(self, covered: Sequence[np.ndarray]) -> Masks:
        """Return the masks found anew, given where the mechanism is.

        Args:
            covered: For each of the sample frames the pixels that the mechanism covers, bool (height, width).

        Returns:
            Masks of the same clip, without measured colours.
        """
        ...

    def nearer(self, parallax: Parallax) -> Masks:
        """Return the masks that follow a mechanism nearer to a moving camera than the scene behind it.

        Args:
            parallax: By how much more it moves in the pictures than the registered scene.

        Returns:
            Masks of the same clip.
        """
        ...

    def away(self, frame: int) -> np.ndarray:
        """Return where the mechanism is in a frame of the clip against where its masks show it.

        Args:
            frame: Frame number.

        Returns:
            To the right and down [px], (2,); zero for a camera that stands still.
        """
        ...

    def coloured(self, colours: GeomColours | None) -> Masks:
        """Return the masks by colours that were measured on the located mechanism.

        Args:
            colours: The colours, or None where none could be measured.

        Returns:
            Masks of the same clip over the same background.
        """
        ...


def plain_view(trust: np.ndarray, geoms: int) -> View:
    """Return the view of masks with one plane for all geoms.

    Args:
        trust: How reliably each pixel distinguishes mechanism and background, float32 (height, width).
        geoms: Number of geoms of the mechanism.

    Returns:
        The view.
    """
    return View(trust[np.newaxis], np.zeros(geoms, np.int64), np.zeros(geoms, np.bool_), no_order(geoms))


def no_order(geoms: int) -> np.ndarray:
    """Return that of no geom it is known whether it lies in front of another, int8 (geom, geom).

    Args:
        geoms: Number of geoms of the mechanism.
    """
    return np.zeros((geoms, geoms), np.int8)


def planes_for(mask: Mask, view: View) -> np.ndarray:
    """Return the planes of a mask as a view reads them.

    Args:
        mask: A mask of the clip.
        view: How its planes are to be read.

    Returns:
        The planes; for a view of one plane the largest coverage, uint8 (plane, height, width).
    """
    return mask.planes if len(mask.planes) == len(view.trust) else mask.coverage[np.newaxis]
