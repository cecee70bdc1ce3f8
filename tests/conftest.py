"""Fixtures of the whole suite: tiny clips made on the fly."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from monodyn.cli.streams import ENDING
from support import ClipMaker, square

CODECS = {
    ".mp4": ("libx264", "yuv420p", {"crf": "10", "bf": "2"}),
    ".mov": ("libx264", "yuv420p", {"crf": "10"}),
    ".mkv": ("libx264", "yuv420p", {"crf": "10"}),
    ".webm": ("libvpx-vp9", "yuv420p", {"crf": "20", "b": "0", "cpu-used": "8", "deadline": "realtime"}),
    ".avi": ("mpeg4", "yuv420p", {"qscale": "2"}),
    ".gif": ("gif", "rgb8", {}),
    ".h264": ("libx264", "yuv420p", {"crf": "10", "bf": "0"}),
}


def pytest_configure() -> None:
    """Have signals do what they usually do: tests send some that nohup, or a shell, had us ignore."""
    for number, usual in ENDING.items():
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


@pytest.fixture
def make_clip(tmp_path: Path) -> ClipMaker:
    """Return a maker of tiny clips; the arguments say what is odd about them."""

    def make(
        name: str = "clip.mp4",
        *,
        count: int = 12,
        size: tuple[int, int] = (64, 48),
        stamps: Sequence[int] | None = None,
        base: Fraction = Fraction(1, 30),
        pixel: str | None = None,
        aspect: Fraction | None = None,
        rotation: int = 0,
        full_range: bool = False,
        step: int = 1,
        places: Sequence[int] | None = None,
    ) -> Path:
        path = tmp_path / name
        codec, form, options = CODECS[path.suffix]
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=min(30, round(1 / base)), options=dict(options))
            stream.width, stream.height = size
            stream.pix_fmt = pixel or form
            stream.codec_context.time_base = base
            if full_range:
                stream.codec_context.color_range = 2
            if aspect is not None:
                stream.codec_context.sample_aspect_ratio = aspect
            if rotation:
                if not hasattr(stream, "set_display_rotation"):
                    pytest.skip("this version of av reads turns of the picture, but does not write them")
                stream.set_display_rotation(rotation)
            for i in range(count):
                grey = square(step * i if places is None else places[i], *size)
                frame = av.VideoFrame.from_ndarray(np.repeat(grey[..., None], 3, 2), format="rgb24")
                wanted = "JPEG" if full_range else "MPEG"
                frame = frame.reformat(format=stream.pix_fmt, dst_color_range=wanted)
                frame.pts = i if stamps is None else stamps[i]
                frame.time_base = base
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        return path

    return make
