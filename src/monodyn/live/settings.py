"""How a stream is read and followed; the command line is made from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from monodyn.choices import check_choice
from monodyn.errors import SettingsError
from monodyn.typed import check_fields
from monodyn.vision.settings import LEAST_SIDE, MOST_SIDE

Pace = Literal["fast", "real"]
"""Whether a file is read as fast as it goes, or at the pace of its time stamps."""
Pixels = Literal["gray", "rgb24", "bgr24", "yuv420p"]
"""How the pixels of raw frames are stored, in the words of FFmpeg."""


@dataclass(frozen=True)
class LiveSettings:
    """How a stream is read and followed.

    Attributes:
        pace: How a file is read: ``fast``: as fast as it goes, none of its frames skipped; ``real``: at the
            pace of its time stamps, as a camera would show it.
        begin: Seconds of motion that are watched before the mechanism is looked for; longer ones are waited
            for where these do not show it.
        ahead: How far ahead the motion is predicted at every frame [s].
        window: Seconds of motion that are fitted again at every frame; what was before them is carried by
            what it said of parameters and state.
        review: Seconds of motion, at most, that are identified anew from nothing every now and then, while
            frames go on, for the verdict.
        queue: Frames that may wait to be followed; of a camera that is faster some are skipped and counted.
        patience: Seconds without a frame after which a camera or a stream counts as gone; a pipe is waited
            for until it ends.
        size: Width and height of raw frames [px], e.g. 640,480.
        pixels: How raw frames store their pixels: ``gray``: one byte of grey; ``rgb24`` or ``bgr24``: three
            bytes, red or blue first; ``yuv420p``: a plane of grey, then two of colour of half its sides.
    """

    pace: Pace = "fast"
    begin: float = field(default=1.5, metadata={"metavar": "S"})
    ahead: float = field(default=1.0, metadata={"metavar": "S"})
    window: float = field(default=1.0, metadata={"metavar": "S"})
    review: float = field(default=10.0, metadata={"metavar": "S"})
    queue: int = 60
    patience: float = field(default=10.0, metadata={"metavar": "S"})
    size: tuple[int, int] | None = None
    pixels: Pixels = "gray"

    def __post_init__(self) -> None:
        check_fields(self, "live")
        check_choice("live.pace", self.pace, get_args(Pace))
        check_choice("live.pixels", self.pixels, get_args(Pixels))
        ranges = {
            "begin": (0.2, 60.0), "ahead": (0.0, 60.0), "window": (0.2, 10.0), "review": (1.0, 60.0),
            "patience": (0.1, 3600.0),
        }  # fmt: skip
        for name, (least, most) in ranges.items():
            if not least <= getattr(self, name) <= most:
                raise SettingsError(
                    f"live.{name}: expected {least:g} to {most:g} s, got {getattr(self, name):g}; give a "
                    "number in between."
                )
        if not 1 <= self.queue <= 10_000:
            raise SettingsError(f"live.queue: expected 1 to 10000 frames, got {self.queue}.")
        if self.size is not None and not LEAST_SIDE <= min(self.size) <= max(self.size) <= MOST_SIDE:
            raise SettingsError(
                f"live.size: expected W,H of {LEAST_SIDE} to {MOST_SIDE} px, got {self.size[0]},"
                f"{self.size[1]}; give width and height of the frames."
            )
