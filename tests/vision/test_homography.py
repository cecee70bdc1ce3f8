"""Maps between pictures of a scene."""

from __future__ import annotations

import numpy as np
import pytest

from monodyn.vision.clip.homography import at_rest
from scenes import SIZE, moved

POINTS = np.array([[0.0, 0.0], [100.0, 30.0], [239.0, 159.0]])


def test_points_are_turned_and_zoomed_about_the_middle() -> None:
    at = moved((3.0, -2.0), 0.1, 1.2)
    c, s = np.cos(0.1), np.sin(0.1)
    middle = np.array([119.5, 79.5])
    # clockwise as seen, with y down
    expected = middle + 1.2 * (POINTS - middle) @ np.array([[c, -s], [s, c]]).T + [3.0, -2.0]
    assert np.allclose(at.of(POINTS), expected)
    assert at.shift.tolist() == [3.0, -2.0]
    assert at.zoom == pytest.approx(1.2)
    assert at.turn == pytest.approx(-0.1)


def test_one_after_the_other_and_back() -> None:
    first, second = moved((3.0, 1.0), 0.05, bend=1e-4), moved((-7.0, 2.0), -0.02, 1.1)
    assert np.allclose(second.after(first).of(POINTS), second.of(first.of(POINTS)))
    assert np.allclose(first.inverse.of(first.of(POINTS)), POINTS)
    assert first.entries[2, 2] == second.after(first).entries[2, 2] == first.inverse.entries[2, 2] == 1.0


def test_how_far_apart() -> None:
    assert at_rest(SIZE).apart(moved((3.0, 4.0))) == pytest.approx(5.0)
    # halfway to a corner
    assert at_rest(SIZE).apart(moved(zoom=1.01)) == pytest.approx(0.005 * np.hypot(119.5, 79.5))
