"""A frame as a picture for showing: its planes stacked as encoders take them, or in colour."""

from __future__ import annotations

import numpy as np

from monodyn.types import Frame


def stacked(frame: Frame) -> np.ndarray:
    """Return the planes of a frame below one another (I420), sizes made even.

    Args:
        frame: The frame.

    Returns:
        Luma above the two chroma planes, uint8 (1.5 height, width); its own copy.
    """
    height, width = (n + n % 2 for n in frame.luma.shape)
    planes = np.empty((height * 3 // 2, width), np.uint8)
    luma, blue, red = split(planes)
    _copy_plane(luma, frame.luma)
    for target, plane in zip((blue, red), frame.chroma or (), strict=False):
        _copy_plane(target, plane)
    # 128 is no colour
    if frame.chroma is None:
        planes[height:] = 128
    return planes


def split(planes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return luma and the two chroma planes of stacked planes, as views.

    Args:
        planes: As of ``stacked``, uint8 (1.5 height, width).

    Returns:
        uint8 (height, width), and twice (row, column) of half that size.
    """
    height, width = planes.shape[0] * 2 // 3, planes.shape[1]
    blue, red = planes[height:].reshape(2, height // 2, width // 2)
    return planes[:height], blue, red


def rgb(frame: Frame) -> np.ndarray:
    """Return a frame in colour, red first.

    Args:
        frame: The frame, in video range.

    Returns:
        The picture, uint8 (height, width, 3).
    """
    import cv2

    height, width = frame.luma.shape
    return cv2.cvtColor(stacked(frame), cv2.COLOR_YUV2RGB_I420)[:height, :width]


def _copy_plane(target: np.ndarray, plane: np.ndarray) -> None:
    """Copy a plane and repeat its last row and column where the target is larger."""
    rows, columns = min(target.shape[0], plane.shape[0]), min(target.shape[1], plane.shape[1])
    target[:rows, :columns] = plane[:rows, :columns]
    target[rows:, :columns] = target[rows - 1, :columns]
    target[:, columns:] = target[:, columns - 1 : columns]
