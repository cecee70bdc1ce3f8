"""The settings of the stages from a clip to poses; the command line is made from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from monodyn.choices import METHOD_NAMES, Method, check_choice
from monodyn.errors import SettingsError
from monodyn.typed import check_fields

RATES = (1e-3, 1e6)
"""Least and most frames a second [Hz] that a clip can be given."""
LONGEST = 10.0
"""Longest exposure, and longest readout of a picture [s]."""
LEAST_SIDE = 16
"""Least side of a region of the picture [px]."""
MOST_SIDE = 65_535
"""Most side of a picture [px]; no format has more."""
FOCALS = (10.0, 1e6)
"""Least and most focal length [px]: of a very wide view of the smallest picture, and of no perspective."""
Colour = Literal["auto", "grey", "colour"]
"""Whether the foreground is found by grey level alone or by colour."""
Axis = Literal["auto", "down", "up"]
"""Where the second coordinate of a table of points goes."""
SegmentMethod = Literal["fast"]
"""What the method of the segmentation can be called."""
SEGMENT_METHOD_NAMES: tuple[str, ...] = get_args(SegmentMethod)


@dataclass(frozen=True)
class SegmentSettings:
    """How the foreground is found.

    Attributes:
        method: ``fast``, the only one: each pixel's coverage from its background and the mechanism's colours.
        colour: ``grey``: by the grey level alone; ``colour``: by the colour channels, too, which have half
            the resolution; ``auto``: by colour only where grey alone does not distinguish the mechanism from
            the background.
        contrast: Least difference from the background by which a pixel counts as changed when the
            mechanism's colours are looked for [grey levels]; 0 takes it from the clip: a third of what stands
            out most, above the noise.
        roi: Part of the picture that shows the mechanism: column and row of its upper left corner, width and
            height [px]; found when left out.
        time_range: Begin and end [s] of the frames in which the mechanism moves freely; found when left
            out.
    """

    method: SegmentMethod | None = None
    colour: Colour = "auto"
    contrast: float = 0.0
    roi: tuple[int, int, int, int] | None = None
    time_range: tuple[float, float | None] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "segment")
        check_choice("segment.method", self.method, (*SEGMENT_METHOD_NAMES, None))
        check_choice("segment.colour", self.colour, get_args(Colour))
        if not 0 <= self.contrast <= 255:
            raise SettingsError(f"segment.contrast: expected 0 to 255 grey levels, got {self.contrast}.")
        if self.roi is not None and (min(self.roi[:2]) < 0 or min(self.roi[2:]) < LEAST_SIDE):
            raise SettingsError(
                f"roi: expected X,Y,W,H of 0 or more with sides of at least {LEAST_SIDE} px, got "
                f"{','.join(map(str, self.roi))}; give column and row of the upper left corner, width and "
                "height."
            )
        if self.time_range is not None:
            begin, end = self.time_range[0], math.inf if self.time_range[1] is None else self.time_range[1]
            if not (math.isfinite(begin) and end > begin):
                raise SettingsError(
                    f"time-range: expected A:B with B after A, got {begin:g}:{end:g} s; give seconds of the "
                    "clip."
                )


@dataclass(frozen=True)
class CameraSettings:
    """How the camera is found.

    Attributes:
        method: ``fast``: refined on the edges together with sizes and poses; ``paper``: depth from the
            silhouette's area and place from its centroid, eq. (1) and (2) of the 2012 paper; that of the
            whole run when left out.
        exposure: How long each picture is exposed [s], 0 for pictures of one instant; found from the blur
            that motion leaves when left out.
        readout: From the exposure of the first row of a picture to that of the last [s], of a rolling
            shutter; negative where the last row comes first.
    """

    method: Method | None = None
    exposure: float | None = None
    readout: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "camera")
        check_choice("camera.method", self.method, (*METHOD_NAMES, None))
        if self.exposure is not None and not 0.0 <= self.exposure <= LONGEST:
            raise SettingsError(
                f"camera.exposure: expected 0 to {LONGEST:g} s, got {self.exposure}; give how long each "
                "picture is exposed, in seconds."
            )
        if not -LONGEST <= self.readout <= LONGEST:
            raise SettingsError(
                f"camera.readout: expected {-LONGEST:g} to {LONGEST:g} s, got {self.readout}; give the time "
                "from the first row of a picture to the last, in seconds."
            )


@dataclass(frozen=True)
class LocateSettings:
    """How camera, sizes and first pose are found.

    Attributes:
        method: ``fast``: a global search, then a refinement on sub-pixel edges over key frames; ``paper``:
            pose and aspect ratios from one silhouette, eq. (3) and (4) of the 2012 paper; that of the whole
            run when left out.
        focal: Focal length [px], which is then held; 0 begins with the picture's longer side, which a common
            lens has within a third. A camera square to the plane does not show it.
        search_frames: Key frames of the global search.
        refine_frames: Key frames of the joint refinement.
        seed: Seed of random starts.
    """

    method: Method | None = None
    focal: float = 0.0
    search_frames: int = 7
    refine_frames: int = 32
    seed: int = 0

    def __post_init__(self) -> None:
        check_fields(self, "locate")
        check_choice("locate.method", self.method, (*METHOD_NAMES, None))
        if self.seed < 0:
            raise SettingsError(f"locate.seed: expected 0 or more, got {self.seed}; give a whole number.")
        if self.focal != 0.0 and not FOCALS[0] <= self.focal <= FOCALS[1]:
            raise SettingsError(
                f"locate.focal: expected {FOCALS[0]:g} to {FOCALS[1]:g} px, or 0, got {self.focal:g}; give "
                "it in pixels of the clip, or leave it out."
            )
        for name in ("search_frames", "refine_frames"):
            if not 2 <= getattr(self, name) <= 1000:
                raise SettingsError(
                    f"locate.{name}: expected 2 to 1000 key frames, got {getattr(self, name)}."
                )


@dataclass(frozen=True)
class TrackSettings:
    """How the mechanism is followed.

    Attributes:
        method: ``fast``: Gauss-Newton on sub-pixel edges; ``paper``: least mismatch of the silhouettes within
            move limits, eq. (5) of the 2012 paper; that of the whole run when left out.
        spacing: Distance between outline samples [px].
        reach: Search length along the normals once the pose is near [px].
        first_reach: Search length from the prediction [px].
        move: Most that a hinge may depart from its prediction in a frame [rad]; a slide may depart by this
            share of the mechanism's length.
        matched: Least share of outline samples on an edge in a frame that counts as seen.
        inside: Least coverage just inside of the outline in a frame that counts as seen.
        patience: Frames between two searches of the whole picture while the mechanism is lost.
    """

    method: Method | None = None
    spacing: float = 3.0
    reach: float = 4.0
    first_reach: float = 7.0
    move: float = 0.6
    matched: float = 0.5
    inside: float = 0.6
    patience: int = 3

    def __post_init__(self) -> None:
        check_fields(self, "track")
        check_choice("track.method", self.method, (*METHOD_NAMES, None))
        for name, low, high in (
            ("spacing", 0.5, 100.0),
            ("reach", 1.0, 200.0),
            ("first_reach", 1.0, 200.0),
            ("move", 1e-3, 10.0),
            ("patience", 1, 10_000),
        ):
            if not low <= getattr(self, name) <= high:
                raise SettingsError(f"track.{name}: expected {low:g} to {high:g}, got {getattr(self, name)}.")
        for name in ("matched", "inside"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise SettingsError(f"track.{name}: expected a share from 0 to 1, got {getattr(self, name)}.")
