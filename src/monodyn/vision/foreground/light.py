"""The light of a frame: how its grey levels compare with a reference picture, taken out of it.

A lamp or the camera's exposure changes a whole picture by one gain and one offset. Both follow from a grid of
places: what stands still makes most of them, and the differences there that lie closest together are those of
the light, whatever moves over the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.types import Frame
from monodyn.vision.clip.steady import light_grid

LEAST_GREY = 1.0
"""Difference of the usual grey level below which the light is the same [grey levels]."""
UNCHANGED = 0.5
"""Median difference below which it surely is, in the dark half of the places and in the bright one [grey
levels]."""
LEAST_RANGE = 25.0
"""Range between the mean dark and the mean bright place from which a gain differs from an offset [grey
levels]."""
LEAST_GAIN = 0.1
"""Gain below which nothing of a picture would be left."""
ROUNDS = 3
"""Rounds of the line through dark and bright places."""
NEUTRAL = 128.0
"""Value of a chroma plane without colour."""


@dataclass(frozen=True, eq=False)
class Light:
    """The grey levels of a reference picture at a grid of places, the darkest first.

    Attributes:
        row: Row of each place [px], (point,).
        column: Its column [px], (point,).
        level: Its grey level, float32 (point,).
    """

    row: np.ndarray
    column: np.ndarray
    level: np.ndarray

    def evened(self, frame: Frame) -> Frame:
        """Return a frame in the light of the reference.

        Args:
            frame: The frame, of the reference's size.
        """
        import cv2

        found = self._change(frame.luma)
        if found is None:
            return frame
        gain, offset = found
        values = np.arange(256.0)
        grey = np.clip(np.round((values - offset) / gain), 0, 255).astype(np.uint8)
        tint = np.clip(np.round((values - NEUTRAL) / gain + NEUTRAL), 0, 255).astype(np.uint8)
        chroma = frame.chroma
        if chroma is not None:
            chroma = cv2.LUT(chroma[0], tint), cv2.LUT(chroma[1], tint)
        return replace(frame, luma=cv2.LUT(frame.luma, grey), chroma=chroma)

    def _change(self, luma: np.ndarray) -> tuple[float, float] | None:
        """Return gain and offset of a picture; None where its light is that of the reference."""
        from monodyn.vision.foreground.places import is_unchanged

        # what stands still is most of a picture: where its median has not changed, neither has the light
        if is_unchanged(luma, self.row, self.column, self.level, UNCHANGED):
            return None
        level, values = self.level, luma[self.row, self.column]
        half, gain, offset = len(level) // 2, 1.0, 0.0
        # The first round may take places that happen to have changed alike; about the line through them the
        # places that stand still differ by noise alone.
        for done in range(ROUNDS):
            off = values - (gain * level + offset)
            dark, bright = _usual(off[:half]), half + _usual(off[half:])
            low, high = float(level[dark].mean()), float(level[bright].mean())
            below, above = float(off[dark].mean()), float(off[bright].mean())
            if done == 0 and max(abs(below), abs(above)) < LEAST_GREY:
                return None
            if high - low < LEAST_RANGE:
                # one grey level alone: brightness grows from black
                shown = float(values[dark].mean()) + float(values[bright].mean())
                return max(shown / max(low + high, 1.0), LEAST_GAIN), 0.0
            slope = (above - below) / (high - low)
            gain, offset = max(gain + slope, LEAST_GAIN), offset + below - slope * low
        return gain, offset


def light_of(luma: np.ndarray) -> Light:
    """Take a picture as the reference.

    Args:
        luma: Its grey levels, (height, width).

    Returns:
        Its light.
    """
    row, column = light_grid(*luma.shape)
    order = np.argsort(luma[row, column], kind="stable")
    row, column = row[order], column[order]
    return Light(row, column, luma[row, column].astype(np.float32))


def in_one_light(frames: Sequence[Frame], reference: np.ndarray | None = None) -> tuple[Frame, ...]:
    """Bring frames of one camera into the same light.

    Args:
        frames: The frames.
        reference: A picture in that light, (height, width); None takes the frame of middle brightness.

    Returns:
        The frames; those whose light is the same are kept as they are.
    """
    if reference is None:
        grid = light_of(frames[0].luma)
        brightness = [float(frame.luma[grid.row, grid.column].mean()) for frame in frames]
        reference = frames[int(np.argsort(brightness, kind="stable")[len(frames) // 2])].luma
    light = light_of(reference)
    return tuple(light.evened(frame) for frame in frames)


def _usual(values: np.ndarray) -> np.ndarray:
    """Return which values make the shortest half, which up to a half of others does not move, (point,).

    Source:
        The shorth: Andrews and others, "Robust Estimates of Location", 1972.
    """
    order = np.argsort(values, kind="stable")
    ordered, half = values[order], (len(values) + 1) // 2
    widths = ordered[half - 1 :] - ordered[: len(ordered) - half + 1]
    # whole grey levels make ties, of which the middle one is not biased
    shortest = np.flatnonzero(widths <= widths.min() + 1e-6)
    first = int(shortest[len(shortest) // 2])
    return order[first : first + half]
