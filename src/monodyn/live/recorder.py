"""The frames of a stream written as a clip while they come, on a thread of their own."""

from __future__ import annotations

import queue
import threading
from fractions import Fraction
from pathlib import Path

from monodyn.errors import SettingsError
from monodyn.results.overlay import Drawing, draw, encoded_picture
from monodyn.types import Frame

TICKS = 90_000
"""Time stamps are whole multiples of 1 / TICKS seconds."""
WAITING = 60
"""Frames that may wait to be written; what comes faster than it can be written is left out."""
QUALITY = {"preset": "ultrafast", "crf": "16"}
"""How much is kept of the pictures: their edges are what poses are measured by."""


class Recorder:
    """Writes frames into a clip that can be read up to wherever it was stopped.

    Args:
        path: The clip, mp4.

    Attributes:
        numbers: Number in the clip of each recorded frame, by its number in the stream.
        left_out: Frames that came faster than they could be written.
    """

    def __init__(self, path: Path) -> None:
        self.numbers: dict[int, int] = {}
        self.left_out = 0
        self._path, self._error = path, ""
        self._waiting: queue.Queue[Frame | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._write, name="record", daemon=True)
        self._thread.start()

    def take(self, frame: Frame) -> None:
        """Take the next frame; one for which there is no time is left out and counted.

        Args:
            frame: The frame, on the stream's clock.
        """
        try:
            self._waiting.put_nowait(frame)
        except queue.Full:
            self.left_out += 1
            return
        self.numbers[frame.index] = len(self.numbers)

    def finish(self) -> None:
        """Write what waits, and end the clip.

        Raises:
            SettingsError: it could not be written.
        """
        self._waiting.put(None)
        self._thread.join()
        if self._error:
            raise SettingsError(
                f"'{self._path}': cannot write the clip ({self._error}); free some space, or give another "
                "folder with --out."
            )

    def _write(self) -> None:
        import av
        import av.error

        try:
            self._encode(av)
        except (av.error.FFmpegError, OSError) as error:
            self._error = getattr(error, "strerror", None) or str(error)
            # whoever puts frames must not wait for a thread that has ended
            while self._waiting.get() is not None:
                pass

    def _encode(self, av: object) -> None:
        """Encode frames until there are no more."""
        from av import open as opened

        # in fragments: whatever ends the program, what was written can be read
        options = {"movflags": "frag_keyframe+empty_moov+default_base_moof"}
        with opened(str(self._path), "w", format="mp4", options=options) as container:
            stream, last = None, -1
            while (frame := self._waiting.get()) is not None:
                picture = encoded_picture(draw(frame, Drawing(())))
                if stream is None:
                    stream = container.add_stream("libx264", rate=30, options=QUALITY)
                    stream.width, stream.height = picture.width, picture.height
                    stream.pix_fmt = "yuv420p"
                    stream.codec_context.time_base = Fraction(1, TICKS)
                last = max(last + 1, round(frame.time * TICKS))
                picture.pts, picture.time_base = last, Fraction(1, TICKS)
                container.mux(stream.encode(picture))
            if stream is not None:
                container.mux(stream.encode())
