"""Which pixels of some frames do not show the background, within the part of the picture where that is so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.cores import on_all_cores
from monodyn.vision.foreground.chroma import pixels_of_a_sample, whole_samples
from monodyn.vision.foreground.thumbnails import Window


@dataclass(frozen=True, eq=False)
class Covered:
    """What covers the background in each of some frames.

    Attributes:
        masks: For each frame, at least one, the covered pixels within the window, bool (row, column).
        window: The part of the picture outside of which none is covered. Where frames have colours it is of
            ``whole_samples`` of them.

    Raises:
        ValueError: A mask has another size than the window.
    """

    masks: Sequence[np.ndarray]
    window: Window

    def __post_init__(self) -> None:
        top, bottom, left, right = self.window
        for mask in self.masks:
            if mask.shape != (bottom - top, right - left):
                raise ValueError(f"masks: expected the size of {self.window}, got {mask.shape}; cut them.")

    @cached_property
    def anywhere(self) -> np.ndarray:
        """Where any frame is covered, bool (row, column); the masks are not copied together first."""
        somewhere = np.zeros_like(self.masks[0])
        for mask in self.masks:
            np.logical_or(somewhere, mask, out=somewhere)
        return somewhere

    def cut(self, plane: np.ndarray) -> np.ndarray:
        """Return the window of a plane of the picture, (row, column).

        Args:
            plane: The plane, (height, width).
        """
        top, bottom, left, right = self.window
        return plane[top:bottom, left:right]

    def pixels(self, width: int) -> np.ndarray:
        """Return which pixels of the picture are covered in any frame, counted row by row, int (pixel,).

        Args:
            width: Width of the picture [px].
        """
        rows, columns = np.nonzero(self.anywhere)
        return (self.window.top + rows) * width + self.window.left + columns

    def of_samples(self, shape: tuple[int, ...], small: tuple[int, ...]) -> Covered:
        """Return what covers the samples of the colours: one is covered where any of its pixels is.

        Args:
            shape: Height and width of the picture [px].
            small: The same of the planes of its colours.

        Raises:
            ValueError: The window is not of whole samples.
        """
        if self.window != whole_samples(self.window, shape, small):
            raise ValueError(f"window: expected whole samples of {small} in {shape}, got {self.window}.")
        (down, across), (top, bottom, left, right) = pixels_of_a_sample(shape, small), self.window
        window = Window(round(top / down), round(bottom / down), round(left / across), round(right / across))
        size = window.bottom - window.top, window.right - window.left
        return Covered(on_all_cores(lambda mask: reduced_mask(mask, size), self.masks), window)


def covered_whole(masks: Sequence[np.ndarray]) -> Covered:
    """Return what masks of whole pictures cover.

    Args:
        masks: For each frame, at least one, the covered pixels, bool (height, width).
    """
    height, width = masks[0].shape
    return Covered(masks, Window(0, height, 0, width))


def reduced_mask(mask: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Reduce a mask; a pixel is set where any of its parts is.

    Args:
        mask: The mask, bool (height, width).
        shape: Height and width of the reduced one.

    Returns:
        The reduced mask, bool (row, column).
    """
    import cv2

    full = mask.view(np.uint8) * np.uint8(255)
    return cv2.resize(full, (shape[1], shape[0]), interpolation=cv2.INTER_AREA) > 0
