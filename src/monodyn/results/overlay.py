"""The clip with the mechanism drawn over it, as a film and as stills.

The one idea: everything is drawn straight into the luma and chroma planes that the decoder gives and the
encoder takes, so no picture is ever converted to RGB and back.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.arrays import usual_step
from monodyn.results.sight import Sight, outlines_of
from monodyn.types import FULL, Camera, Frame, Poses, Progress
from monodyn.vision.clip.colour import split, stacked
from monodyn.vision.clip.steady import displaced
from monodyn.vision.drawing.shown import pose_row

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism
    from monodyn.vision.clip.video import Video
    from monodyn.vision.foreground.masks import Masks

TICKS = 90_000
"""Time stamps of the film are whole multiples of 1 / TICKS seconds."""
FASTEST = 1000.0
"""Most frames a second [Hz] of the film; a faster clip is shown slower, its own time in the caption."""
LATEST = 86_400.0
"""Latest time stamp of the first picture of a film [s]: stamps that are a date begin anew."""


@dataclass(frozen=True)
class Ink:
    """How an outline is drawn: its colour in video range, and its width.

    Attributes:
        luma: Grey level, from 16 to 235.
        blue: Blue difference, 128 for grey.
        red: Red difference, 128 for grey.
        width: Line width on a picture that is 480 px high [px].
    """

    luma: int
    blue: int
    red: int
    width: float


FITTED = Ink(luma=173, blue=42, red=26, width=2.0)
PREDICTED = Ink(luma=131, blue=165, red=212, width=2.0)
FILLED = Ink(luma=168, blue=54, red=186, width=2.0)
TRACKED = Ink(luma=225, blue=128, red=128, width=1.0)
LOCATED = Ink(luma=210, blue=16, red=146, width=1.0)
TINT = Ink(luma=150, blue=190, red=70, width=0.0)
JPEG = 82
"""Quality of a picture for the report, of 100."""
TINTED = 0.6
"""Share of the tint where the foreground covers a whole pixel."""
LETTER, LINE = 9.5, 22.0
"""Width of a letter and height of a line of a caption, in a picture of 480 lines [px]."""
SMALLER = 0.9
"""Size of the letters over that of the last try, where not all lines have their place."""
QUALITY = {"preset": "ultrafast", "qp": "24"}
"""How the film is encoded: one step for all pictures takes a third less time than a rate that the encoder
works out for each picture (``crf``), and this one a quarter to a third less, and half of the room, of one of
20, at 46 to 48 dB in place of 48.5 to 49 (mean PSNR of three clips)."""
ONE_THREAD_PX = 1_000_000
"""Size of the largest picture that one thread draws and encodes about as fast as it is decoded [px]."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What is drawn over one frame.

    Attributes:
        outlines: Polygons [px], each (point, 2), with the ink of each.
        caption: One short line in the corner.
        reason: A sentence above it, in as many lines as it takes.
        tint: Coverage that is tinted, uint8 (height, width), ``FULL`` for a whole pixel; or None.
    """

    outlines: Sequence[tuple[np.ndarray, Ink]]
    caption: str = ""
    reason: str = ""
    tint: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """The motion to draw: the identified mechanism at every frame of a clip.

    Attributes:
        mechanism: The identified mechanism.
        camera: Camera in metres of the identified scale.
        position: Joint positions at every frame of the clip [rad or m], (frame, dof); NaN is not drawn.
        fit_frames: First frame of the fit and the one after its last.
        tracked: Measured joint positions in metres of the identified scale, drawn thin where they differ.
        sight: What was seen of the clip, which knows how a camera moves; None for one that stands still.
        filled: Joint positions at every frame with its gaps filled [rad or m], (frame, dof), drawn in another
            colour where something was hidden: the bodies that it moves; None fills nothing.
    """

    mechanism: Mechanism
    camera: Camera
    position: np.ndarray
    fit_frames: tuple[int, int]
    tracked: Poses | None = None
    sight: Sight | None = None
    filled: np.ndarray | None = None

    def drawing(self, frame: Frame) -> Drawing:
        """Return what to draw over a frame.

        Args:
            frame: The frame.
        """
        index, (first, stop) = frame.index, self.fit_frames
        kind = "predicted" if index >= stop else "fitted" if index >= first else "before the fit"
        model = self._outlines(index, self.position[index])
        inks: list[tuple[np.ndarray, Ink]] = []
        # the tracked outline would cover the model where both agree
        tracked = self._tracked(index)
        if tracked and (not model or _apart(model, tracked)):
            inks += [(polygon, TRACKED) for polygon in tracked]
        predicted, filled = index >= stop, [(polygon, FILLED) for polygon in self._filled(index)]
        drawn = [(polygon, PREDICTED if predicted else FITTED) for polygon in model]
        # a prediction has not used what is filled after it: where both agree the prediction is on top
        inks += [*filled, *drawn] if predicted else [*drawn, *filled]
        kind = kind if model else "tracked" if tracked else "not seen"
        return Drawing(inks, f"{frame.time:.2f} s  {kind}{', filled' if filled else ''}")

    def _filled(self, index: int) -> list[np.ndarray]:
        """Return the outlines of the bodies that what was hidden moves."""
        if self.filled is None or self.tracked is None:
            return []
        row = int(np.searchsorted(self.tracked.frame, index))
        if row >= len(self.tracked) or self.tracked.frame[row] != index or self.tracked.measured[row].all():
            return []
        moved, hidden = [], ~self.tracked.measured[row]
        for dof, parent in enumerate(self.mechanism.tree.parent.tolist()):
            # parents come first
            hidden[dof] |= parent >= 0 and hidden[parent]
            moved += [self.mechanism.joints[dof].body] if hidden[dof] else []
        # what cannot be seen is drawn as a whole
        bodies = moved if self.mechanism.plan.drawn else None
        return self._outlines(index, self.filled[index], bodies)

    def _tracked(self, index: int) -> list[np.ndarray]:
        row = pose_row(self.tracked, index)
        return (
            [] if self.tracked is None or row is None else self._outlines(index, self.tracked.position[row])
        )

    def _outlines(
        self, index: int, position: np.ndarray, bodies: Collection[str] | None = None
    ) -> list[np.ndarray]:
        outlines = outlines_of(self.mechanism, self.camera, position, bodies)
        return outlines if self.sight is None else self.sight.as_filmed(index, outlines)


@dataclass(frozen=True, eq=False)
class DrawnSearch:
    """What was seen where nothing was tracked: the foreground, and the outline as it was located.

    Attributes:
        sight: What the run saw.
    """

    sight: Sight

    def drawing(self, frame: Frame) -> Drawing:
        """Return what to draw over a frame: the foreground, the outline of the nearest key frame, the reason.

        Args:
            frame: The frame.
        """
        sight, masks = self.sight, self.sight.shown_masks
        tint = None if masks is None else _tint_of(masks, frame)
        caption = f"{frame.time:.2f} s  {sight.stage}"
        if sight.scene is None:
            return Drawing([], caption, sight.reason, tint)
        key, position = sight.scene.located(frame.index)
        outlines = outlines_of(sight.scene.mechanism, sight.scene.camera, position)
        outlines = sight.as_filmed(frame.index, outlines)
        return Drawing(
            [(polygon, LOCATED) for polygon in outlines],
            f"{caption}; outline as in frame {key}",
            sight.reason,
            tint,
        )


def _tint_of(masks: Masks, frame: Frame) -> np.ndarray | None:
    """Return the coverage of a frame as it was filmed, uint8 (height, width); None where it is not known."""
    path = masks.video.camera_path
    if path is None:
        return masks.of(frame).coverage
    at, steady = path.at(frame.index), path.steady(frame)
    if at is None or steady is None:
        return None
    import cv2

    away = masks.away(frame.index)
    shown = displaced(masks.of(steady).coverage[np.newaxis], away)[0]
    return cv2.warpPerspective(shown, at.matrix, path.size, flags=cv2.INTER_LINEAR)


def _apart(model: list[np.ndarray], tracked: list[np.ndarray], least_px: float = 2.0) -> bool:
    """Return whether two sets of outlines differ by more than ``least_px`` in a box corner."""
    # a body that is behind the camera has no outline
    return len(model) != len(tracked) or any(
        np.max(np.abs(a.min(0) - b.min(0))) > least_px or np.max(np.abs(a.max(0) - b.max(0))) > least_px
        for a, b in zip(model, tracked, strict=True)
    )


def write_overlay(
    path: str | Path,
    video: Video,
    drawing_of: Callable[[Frame], Drawing],
    *,
    begin: float = 0.0,
    progress: Progress | None = None,
) -> list[tuple[bytes, str]]:
    """Write the clip with the mechanism drawn over it, H.264 with the steps of the clip's own time stamps.

    A clip of more than ``FASTEST`` frames a second is shown at that rate.

    Args:
        path: The film to write (mp4).
        video: The clip.
        drawing_of: Returns what to draw over a frame.
        begin: Time stamp of the first picture of the film [s]: that of the clip puts film, clip and tables of
            a run on one clock. Below 0, and beyond ``LATEST``, where no player goes, the film begins at 0.
        progress: Called with the number of frames written.

    Returns:
        The first, middle and last frame as JPEG files, each with a caption.

    Raises:
        OSError: the film cannot be written.
    """
    import av
    import av.error

    stills: list[tuple[bytes, str]] = []
    slower = max(1.0, 1.0 / (FASTEST * _step(video)))
    try:
        with av.open(
            str(Path(path).absolute()), "w", format="mp4", options={"movflags": "faststart"}
        ) as container:
            stream = _film_stream(container, video)
            last, pictures = -1, _pictures(video, drawing_of, stills)
            offset = begin if 0.0 <= begin <= LATEST else 0.0
            for done, (time, planes) in enumerate(pictures, start=1):
                picture = encoded_picture(planes)
                # the encoder takes increasing stamps only: two frames in one tick are put one tick apart
                last = max(last + 1, round(((time - video.times[0]) * slower + offset) * TICKS))
                picture.pts, picture.time_base = last, Fraction(1, TICKS)
                container.mux(stream.encode(picture))
                if progress is not None:
                    progress("overlay", done, video.count)
            # what the encoder still holds back
            container.mux(stream.encode())
    except av.error.FFmpegError as error:
        raise OSError(error.errno, error.strerror or str(error)) from error
    return stills


def encoded_picture(planes: np.ndarray) -> Any:
    """Return stacked planes as a picture that an encoder takes, without a copy where PyAV can do without.

    Args:
        planes: Luma above the two chroma planes, uint8 (1.5 height, width); not to be changed afterwards.

    Returns:
        The ``av.VideoFrame``.
    """
    from av import VideoFrame

    # where chroma has an odd number of rows its buffer would be cut in the wrong places
    make = VideoFrame.from_ndarray if len(planes) % 6 else VideoFrame.from_numpy_buffer
    return make(planes, format="yuv420p")


def _pictures(
    video: Video, drawing_of: Callable[[Frame], Drawing], stills: list[tuple[bytes, str]]
) -> Generator[tuple[float, np.ndarray]]:
    """Make the time and the planes of each picture; ``stills`` takes the first, middle and last one."""
    kept = {0, (video.count - 1) // 2, video.count - 1}
    for frame in video.frames():
        drawing = drawing_of(frame)
        planes = draw(frame, drawing)
        if frame.index in kept:
            stills.append((_jpeg(planes, frame), f"Frame {frame.index}, {drawing.caption}"))
        yield frame.time, planes


def _film_stream(container: Any, video: Video) -> Any:
    """Add the stream of the film: H.264 with even sizes, in ticks fine enough for every clip."""
    stream: Any = container.add_stream("libx264", rate=_rate(video), options=QUALITY)
    stream.width, stream.height = video.width + video.width % 2, video.height + video.height % 2
    stream.pix_fmt = "yuv420p"
    stream.codec_context.time_base = Fraction(1, TICKS)
    if video.width * video.height <= ONE_THREAD_PX:
        stream.codec_context.thread_count = 1
    return stream


def _rate(video: Video) -> Fraction:
    return Fraction(min(max(1.0 / _step(video), 1e-3), FASTEST)).limit_denominator(1001)


def _step(video: Video) -> float:
    """Return the usual time between two frames [s]."""
    return usual_step(video.times)


def still(frame: Frame, drawing: Drawing) -> bytes:
    """Return one frame with its drawing as a JPEG file.

    Args:
        frame: The frame.
        drawing: What to draw over it.
    """
    return _jpeg(draw(frame, drawing), frame)


def _jpeg(planes: np.ndarray, frame: Frame) -> bytes:
    """Return a drawn frame as a JPEG file, without what made its sizes even."""
    import cv2

    picture = cv2.cvtColor(planes, cv2.COLOR_YUV2BGR_I420)
    height, width = frame.luma.shape
    return cv2.imencode(".jpg", picture[:height, :width], [cv2.IMWRITE_JPEG_QUALITY, JPEG])[1].tobytes()


def draw(frame: Frame, drawing: Drawing) -> np.ndarray:
    """Return a frame with its drawing as stacked planes (I420), sizes made even.

    Args:
        frame: The frame; it is not changed.
        drawing: What to draw over it.

    Returns:
        Luma above the two chroma planes, uint8 (1.5 height, width).
    """
    import cv2

    planes = stacked(frame)
    luma, blue, red = split(planes)
    scale = len(luma) / 480.0
    if drawing.tint is not None:
        _tint((luma, blue, red), drawing.tint)
    # OpenCV takes fixed-point vertices: 4 fractional bits are sixteenths of a pixel; the chroma planes have
    # half the resolution, and their pixel centres lie half a luma pixel further
    for polygon, ink in drawing.outlines:
        thick = max(1, round(ink.width * scale))
        fine = [np.round(polygon * 16).astype(np.int32)]
        coarse = [np.round((polygon - 0.5) * 8).astype(np.int32)]
        cv2.polylines(luma, fine, True, 24, thick + 2, cv2.LINE_AA, 4)
        cv2.polylines(luma, fine, True, ink.luma, thick, cv2.LINE_AA, 4)
        cv2.polylines(blue, coarse, True, ink.blue, max(1, (thick + 1) // 2), cv2.LINE_8, 4)
        cv2.polylines(red, coarse, True, ink.red, max(1, (thick + 1) // 2), cv2.LINE_8, 4)
    if drawing.caption or drawing.reason:
        _write_captions(luma, drawing, scale)
    return planes


def _tint(planes: tuple[np.ndarray, np.ndarray, np.ndarray], coverage: np.ndarray) -> None:
    """Mix the tint into luma and chroma planes where something covers them."""
    import cv2

    for plane, value in zip(planes, (TINT.luma, TINT.blue, TINT.red), strict=True):
        height, width = plane.shape
        size = (min(width, coverage.shape[1]), min(height, coverage.shape[0]))
        share = coverage if plane is planes[0] else cv2.resize(coverage, size, interpolation=cv2.INTER_AREA)
        share = np.minimum(share, FULL).astype(np.float32) * (TINTED / FULL)
        part = plane[: share.shape[0], : share.shape[1]]
        part[:] = (part + share * (np.float32(value) - part)).astype(np.uint8)


def _write_captions(luma: np.ndarray, drawing: Drawing, scale: float) -> None:
    """Write caption and reason into the lower left corner, the caption last."""
    import textwrap

    lines = []
    # all of it is read: what to do stands at the end
    while not lines or LINE * scale * (len(lines) + 1) > len(luma):
        scale *= SMALLER if lines else 1.0
        columns = max(20, int((luma.shape[1] / scale - 24.0) / LETTER))
        lines = [drawing.caption, *reversed(textwrap.wrap(drawing.reason, columns))]
    for i, line in enumerate(lines):
        _write_caption(luma, line, scale, round(LINE * scale * i))


def _write_caption(luma: np.ndarray, text: str, scale: float, above: int) -> None:
    """Write a line at the left, so far above the lowest one [px], light on dark."""
    import cv2

    x, y = round(12 * scale), luma.shape[0] - round(14 * scale) - above
    thick, edge = max(1, round(scale)), max(1, round(scale))
    for dx, dy, grey in [(-edge, 0, 20), (edge, 0, 20), (0, -edge, 20), (0, edge, 20), (0, 0, 232)]:
        cv2.putText(
            luma, text, (x + dx, y + dy), cv2.FONT_HERSHEY_SIMPLEX, 0.55 * scale, grey, thick, cv2.LINE_AA
        )
