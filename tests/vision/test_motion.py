"""The motion of each joint so far, against parabolas and straight lines."""

import numpy as np
import pytest

from monodyn.mechanism.turning import TURN
from monodyn.vision.tracking.motion import PREDICTED_FRAMES, TURNS_KNOWN_FRAMES, Motion

STEP = 0.1
BOTH = np.array([True, True])


def parabola(time):
    return np.array([1.0 + 2.0 * time - 3.0 * time**2, -0.5 * time])


def after(times, motion=None):
    found = motion or Motion(np.array([np.pi, np.pi]), STEP)
    for time in times:
        found.add(time, parabola(time), BOTH)
    return found


def test_a_parabola_is_continued_exactly():
    by_curve, by_line, there = after([0.0, 0.1, 0.25]).predictions(0.3)
    np.testing.assert_allclose(by_curve, parabola(0.3), rtol=1e-12)
    rate = (parabola(0.25) - parabola(0.1)) / 0.15
    np.testing.assert_allclose(by_line, parabola(0.25) + 0.05 * rate, rtol=1e-12)
    np.testing.assert_array_equal(there, parabola(0.25))


def test_each_joint_has_its_own_past():
    found = after([0.0, 0.1, 0.2])
    found.add(0.3, np.array([parabola(0.3)[0], 99.0]), np.array([True, False]))
    np.testing.assert_allclose(found.predictions(0.4)[0], parabola(0.4), rtol=1e-12)
    np.testing.assert_allclose(found.frames_since(0.4), [1.0, 2.0])


def test_no_extrapolation_invents_turns():
    """A pose that is several turns off makes a rate of many turns a frame."""
    found = after([0.0, 0.1, 0.2])
    found.add(0.3, np.array([40.0, 40.0]), BOTH)
    for time in np.arange(0.4, 3.0, 0.1):
        for ahead in found.predictions(time):
            assert np.abs(ahead - 40.0).max() <= np.pi + 1e-9


def test_the_spread_grows_as_a_parabola_goes_astray():
    """By n (n + 1) (n + 2) / 6, the error of a parabola through 0, -1, -2 for a cubic."""
    found = after(np.arange(0.0, 3.0, STEP))
    one = found.spread(3.0)
    n = 3
    cubic = np.poly1d([1 / 6, 0.0, 0.0, 0.0])
    through = np.polyfit([0, -1, -2], cubic([0, -1, -2]), 2)
    gone = cubic(n) - np.polyval(through, n)
    np.testing.assert_allclose(found.spread(2.9 + n * STEP) / one, gone, rtol=1e-6)
    np.testing.assert_array_equal(found.spread(100.0), np.pi)


def test_after_a_long_time_the_last_position_is_all_that_is_known():
    found = after([0.0, 0.1, 0.2])
    late = 0.2 + (TURNS_KNOWN_FRAMES + 1) * STEP
    np.testing.assert_array_equal(found.expected(late), parabola(0.2))
    assert found.predictions(0.2 + (PREDICTED_FRAMES + 1) * STEP) == []


def test_nothing_is_known_before_every_joint_was_measured():
    found = Motion(np.full(2, np.pi), STEP)
    assert found.predictions(0.0) == []
    found.add(0.0, np.array([0.3, 7.0]), np.array([True, False]))
    assert not found.begun
    found.add(0.1, np.array([0.3, 7.0]), BOTH)
    assert found.begun
    for ahead in found.predictions(0.2):
        assert ahead == pytest.approx([0.3, 7.0])


def test_turns_are_those_of_the_smallest_step_or_of_the_last_rate_after_a_gap():
    """A parabola, which is off by more than half a turn soon, has no say."""
    found = Motion(np.array([np.pi]), STEP)
    shown = np.array([-1.0])
    # before the first measurement there is no motion
    np.testing.assert_array_equal(found.turned(shown, 0.0), shown)
    for time, angle in ((0.0, 0.0), (0.1, 2.0), (0.2, 2.6)):
        found.add(time, np.array([angle]), np.ones(1, bool))
    np.testing.assert_allclose(found.turned(np.array([2.4 - TURN]), 0.3), 2.4)
    # 0.6 rad a frame over three frames: 4.4, of which -1 rad shows
    np.testing.assert_allclose(found.turned(shown, 0.5), TURN - 1.0)
    np.testing.assert_allclose(found.turned(shown, 0.3), TURN - 1.0)
    # after long it may be anywhere
    np.testing.assert_allclose(found.turned(np.array([2.4 - TURN]), 0.2 + 2 * TURNS_KNOWN_FRAMES * STEP), 2.4)
