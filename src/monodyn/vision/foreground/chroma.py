"""A window of a picture and the samples of its colours, which are of several pixels, in and around it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from monodyn.vision.foreground.thumbnails import Window


class Enlarged(NamedTuple):
    """How a window is cut out of planes of colours.

    Attributes:
        part: The samples of the planes that show it, rows and columns.
        box: Rows and columns of the picture that these cover.
        inside: Rows and columns of the window in that.
    """

    part: tuple[slice, slice]
    box: tuple[slice, slice]
    inside: tuple[slice, slice]

    def cut(self, plane: np.ndarray) -> np.ndarray:
        """Return the window of a part of a plane at its full size, (row, column).

        Args:
            plane: The part, (row, column).
        """
        import cv2

        rows, columns = self.box
        size = columns.stop - columns.start, rows.stop - rows.start
        return cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)[self.inside]


def enlarged(window: Window, shape: tuple[int, ...], small: tuple[int, ...]) -> Enlarged:
    """Return how a window of a picture is cut out of the planes of its colours.

    Args:
        window: The window, within the picture.
        shape: Height and width of the picture [px].
        small: The same of the planes of its colours.
    """
    (top, bottom, left, right), (down, across) = (
        whole_samples(window, shape, small),
        pixels_of_a_sample(shape, small),
    )
    return Enlarged(
        (slice(round(top / down), round(bottom / down)), slice(round(left / across), round(right / across))),
        (slice(top, bottom), slice(left, right)),
        (slice(window.top - top, window.bottom - top), slice(window.left - left, window.right - left)),
    )


def whole_samples(window: Window, shape: tuple[int, ...], small: tuple[int, ...] | None) -> Window:
    """Return the part of a picture around a window that is of whole samples of its colours.

    Args:
        window: The window; what of it is outside of the picture is left out.
        shape: Height and width of the picture [px].
        small: The same of the planes of its colours, or None without any; where a sample of them is not of
            whole pixels, all of the picture is returned.
    """
    height, width = shape
    down, across = pixels_of_a_sample(shape, small or shape)
    if down % 1 or across % 1:
        return Window(0, height, 0, width)
    down, across = int(down), int(across)
    top, left = max(0, window.top) // down * down, max(0, window.left) // across * across
    bottom, right = -(-min(height, window.bottom) // down), -(-min(width, window.right) // across)
    return Window(top, bottom * down, left, right * across)


def pixels_of_a_sample(shape: tuple[int, ...], small: tuple[int, ...]) -> tuple[float, float]:
    """Return how many rows and columns of a picture a sample of its colours is of.

    Args:
        shape: Height and width of the picture [px].
        small: The same of the planes of its colours.
    """
    return shape[0] / small[0], shape[1] / small[1]
