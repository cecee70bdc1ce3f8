"""Parts of the picture that move apart from one another."""

from __future__ import annotations

import numpy as np

from monodyn.vision.foreground.parts import Parts, moving_cells, moving_parts, window_around
from monodyn.vision.foreground.thumbnails import Thumbnails, Window

SIZE = (320, 240)
FRAMES = range(40)


def thumbnails(curve: bool = True, speck: bool = False) -> Thumbnails:
    """A square swings in the left half; a bar grows in the right half."""
    planes = np.full((40, 1, 60, 80), 160, np.uint8)
    for i in FRAMES:
        x = round(16 + 12 * np.sin(0.3 * i))
        planes[i, 0, 20:26, x : x + 6] = 60
        if curve:
            planes[i, 0, 50:56, 45 : 46 + i // 2] = 90
    if speck:
        planes[7, 0, 5, 70] = 220
    return Thumbnails(np.arange(40), planes, 4.0)


def test_one_moving_place_is_no_choice() -> None:
    assert moving_parts(thumbnails(curve=False), FRAMES, SIZE) is None
    assert moving_parts(thumbnails(curve=False, speck=True), FRAMES, SIZE) is None


def test_what_covers_as_much_in_every_frame_comes_first() -> None:
    parts = moving_parts(thumbnails(), FRAMES, SIZE)
    assert parts is not None
    assert parts.count == 2
    # the square sweeps columns 4 to 34 of the thumbnails, rows 20 to 26, the bar columns 46 to 65 after one
    # that is always covered; the margin is 16 px
    assert parts.window([1]) == Window(64, 120, 0, 152)
    assert parts.window([2]) == Window(184, 240, 168, 276)
    assert parts.window([1, 2]) == Window(64, 240, 0, 276)


def test_the_others_of_a_part_are_where_the_rest_moves() -> None:
    parts = moving_parts(thumbnails(), FRAMES, SIZE)
    assert parts is not None
    others = parts.others([1])
    assert others.shape == (240, 320)
    assert others[200:224, 180:256].all()
    assert not others[80:104].any()
    assert not parts.others([1, 2]).any()


def test_the_window_holds_all_motion_but_specks() -> None:
    assert window_around(moving_cells(thumbnails(curve=False, speck=True)), SIZE) == Window(64, 120, 0, 152)
    still = Thumbnails(np.arange(3), np.full((3, 1, 60, 80), 99, np.uint8), 4.0)
    assert window_around(moving_cells(still), SIZE) == Window(0, 240, 0, 320)


def test_a_part_that_reaches_another_keeps_its_own_cells() -> None:
    labels = np.zeros((6, 8), dtype=np.int64)
    labels[2, 1:4], labels[2, 4:7] = 1, 2
    others = Parts(labels, 2, (8, 6)).others([1])
    assert not others[2, 1:4].any()
    assert others[2, 4:8].all()
