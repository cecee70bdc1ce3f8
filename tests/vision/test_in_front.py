"""What thumbnails show in front of the background."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.in_front import changed, changed_area, still_cells
from monodyn.vision.foreground.thumbnails import Thumbnails, Window


@pytest.mark.parametrize("coloured", [True, False])
@pytest.mark.parametrize("level", [3.0, 104.0, 252.0])
def test_what_is_in_front_differs_in_any_channel_that_the_background_has(
    *, coloured: bool, level: float
) -> None:
    """A background that is given may be grey, of a clip in colour."""
    rng = np.random.default_rng(5)
    planes = np.clip(rng.integers(-4, 12, (7, 3, 12, 16)) + int(level), 0, 255).astype(np.uint8)
    luma, small = np.full((48, 64), level, np.float32), np.full((24, 32), level, np.float32)
    known, window = np.ones((48, 64), dtype=bool), Window(8, 40, 0, 40)
    # within the window something else moves in some cells
    others = np.zeros((48, 64), dtype=bool)
    others[16:24, 8:20] = True
    chroma = (small, small) if coloured else None
    background = Background(luma, chroma, 1.0, known, window, others=others)
    thumbnails = Thumbnails(np.arange(7), planes, 4.0)
    still = still_cells(thumbnails, background)
    found = [changed(shown, still) for shown in planes]
    away = np.abs(planes[:, : 3 if coloured else 1] - level) > thumbnails.still
    counts = np.zeros((12, 16), dtype=bool)
    counts[2:10, :10] = True
    counts[4:6, 2:5] = False
    assert np.array_equal(found, away.any(axis=1) & counts)
    assert np.array_equal(still.inside, counts)
    assert changed_area(planes, still).tolist() == np.sum(found, axis=(1, 2)).tolist()
    assert (0 < np.sum(found) < np.size(found)) or level > 250.0
