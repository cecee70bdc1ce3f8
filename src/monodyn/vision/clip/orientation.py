"""A decoded picture of any format into 8-bit luma and chroma planes in square pixels, upright.

The common case (yuv420p in video range, square pixels, no rotation) costs nothing: the planes of the decoder
are handed on without a copy.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

Planes = tuple[np.ndarray, tuple[np.ndarray, np.ndarray] | None]


@dataclass(frozen=True)
class Turn:
    """The quarter turn and mirroring that bring a stored picture upright: transpose first, then flip.

    Attributes:
        transpose: Rows become columns.
        flip_x: Mirror left and right.
        flip_y: Mirror top and bottom.
        exact: False when the file requires another angle than a quarter turn and this is the nearest one.
    """

    transpose: bool = False
    flip_x: bool = False
    flip_y: bool = False
    exact: bool = True


def turn_of(frame: Any) -> Turn:
    """Read the display matrix of a decoded frame.

    The matrix maps a stored pixel (p, q) to the shown one, p' = a p + c q and q' = b p + d q.

    Args:
        frame: ``av.VideoFrame``.

    Returns:
        The turn; the identity when the frame has no matrix.
    """
    data = bytes(frame.side_data.get("DISPLAYMATRIX", b""))
    if len(data) < 36:
        return Turn()
    # nine numbers row by row, the third of each row for perspective; a picture's rows count downwards
    a, b, _, c, d = np.frombuffer(data, np.int32, 5).astype(float)
    straight, crossed = max(abs(a), abs(d)), max(abs(b), abs(c))
    if straight == crossed == 0.0:
        return Turn()
    exact = min(straight, crossed) < 0.02 * max(straight, crossed)
    if straight >= crossed:
        return Turn(False, a < 0, d < 0, exact)
    return Turn(True, c < 0, b < 0, exact)


def square_size(width: int, height: int, aspect: Fraction | None) -> tuple[int, int]:
    """Return the size [px] in square pixels; the shorter side of the pixel is enlarged, so no detail is lost.

    Args:
        width: Stored width [px].
        height: Stored height [px].
        aspect: Width of a stored pixel over its height; None or 0 when it is not given.

    Returns:
        Width and height [px].
    """
    if not aspect or aspect == 1:
        return width, height
    if aspect > 1:
        return round(width * aspect), height
    return width, round(height / aspect)


def upright_planes(frame: Any, reformatter: Any, size: tuple[int, int], turn: Turn) -> Planes:
    """Return the luma and chroma of a decoded frame in video range, square pixels, upright.

    Args:
        frame: ``av.VideoFrame`` of any pixel format.
        reformatter: ``av.video.reformatter.VideoReformatter`` to reuse between frames.
        size: Size in square pixels before the turn [px].
        turn: Turn to apply last.

    Returns:
        Luma (height, width) and the two chroma planes, or None for a grey frame; read-only uint8.
    """
    # anything but 8-bit 4:2:0 in video range is converted; what is in it already is viewed without a copy
    grey = frame.format.name.startswith("gray")
    if frame.format.name != "yuv420p" or int(frame.color_range) == 2:
        full = grey or frame.format.name.startswith("yuvj") or int(frame.color_range) == 2
        frame = reformatter.reformat(
            frame,
            format="yuv420p",
            src_color_range="JPEG" if full else None,
            dst_color_range="MPEG",
            interpolation="BICUBIC",
        )
    planes = [plane_view(plane) for plane in (frame.planes[:1] if grey else frame.planes[:3])]
    if size != (frame.width, frame.height):
        half = ((size[0] + 1) // 2, (size[1] + 1) // 2)
        planes = [_resize(plane, size if i == 0 else half) for i, plane in enumerate(planes)]
    if turn.transpose or turn.flip_x or turn.flip_y:
        planes = [_turned(plane, turn) for plane in planes]
    for plane in planes:
        plane.flags.writeable = False
    return planes[0], (None if grey else (planes[1], planes[2]))


def plane_view(plane: Any) -> np.ndarray:
    """View one 8-bit plane of a decoded frame without a copy; the view keeps the frame alive.

    Args:
        plane: ``av.video.plane.VideoPlane``.

    Returns:
        The plane, uint8 (height, width).
    """
    step = plane.line_size
    assert step > 0, "the decoder's planes run downward"
    # the decoder pads its lines: only the first ``width`` bytes of each are picture
    rows = np.frombuffer(plane, np.uint8)
    whole = rows[: step * plane.height]
    return whole.reshape(plane.height, step)[:, : plane.width]


def _resize(plane: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    import cv2

    return cv2.resize(plane, size, interpolation=cv2.INTER_CUBIC)


def _turned(plane: np.ndarray, turn: Turn) -> np.ndarray:
    turned = plane.T if turn.transpose else plane
    return np.ascontiguousarray(turned[:: -1 if turn.flip_y else 1, :: -1 if turn.flip_x else 1])
