"""How long a prediction can be relied on."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.choices import Tolerance
from monodyn.errors import SettingsError
from monodyn.results.fill import fill
from monodyn.results.horizon import (
    EXACT,
    FARTHEST,
    FASTEST,
    Horizon,
    _farther,
    allowed,
    horizon,
    horizon_of,
    horizon_said,
)
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of
from support import refuses
from swings import record

ALL = np.arange(120) / 30.0


def test_it_ends_where_the_band_of_a_joint_leaves_the_tolerance(fit):
    ahead = np.arange(1, 600) / 30.0
    band = 1.96 * fill(fit, fit.time[0][-1] + ahead).std
    rough = 1.96 * fill(fit, fit.time[0][-1] + ahead[:45], error_bound=EXACT * float(band[:20].max())).std
    np.testing.assert_allclose(rough, band[:45], rtol=5e-3)
    for row in (20, 45):
        # the other joint may leave first; a motion is integrated to a thousandth of a tolerance, by which the
        # band changes by less than a hundredth
        angle = float(band[:row].max()) * 1.01
        off = band > angle
        found = horizon(fit, Tolerance(angle))
        first = int(np.argmax(off.any(axis=1)))
        assert found.seconds == pytest.approx(ahead[first - 1])
        assert found.joint == f"joint{1 + int(np.argmax(off[first]))}"
        assert found.seconds >= ahead[row - 1]


def test_a_wide_tolerance_is_kept_and_none_is_left_at_once(fit):
    assert horizon(fit, Tolerance(100.0)) == Horizon(np.inf, "")
    found = horizon(fit, Tolerance(1e-12))
    assert (found.seconds, found.joint) == (0.0, "joint1")
    with refuses(SettingsError, "fill: expected a record from 0 to 0, got 1."):
        horizon(fit, record=1)


@pytest.mark.parametrize("value", [-1.0, 0.0, np.nan, np.inf, "5deg"])
def test_a_tolerance_that_is_none_is_refused(value):
    with refuses(SettingsError, f"tolerance: expected a finite angle above 0 [rad], got {value}; change it."):
        Tolerance(angle=value)
    with refuses(SettingsError, f"tolerance: expected a finite length above 0 [m], got {value}; change it."):
        Tolerance(length=value)


@pytest.mark.slow
def test_what_was_measured_shortens_it(fit, truth):
    mechanism, q, _ = truth
    poses = replace(record(mechanism, ALL, q), frame=np.arange(120))
    tolerance = Tolerance(np.radians(5.0))
    future = predict(fit, times=ALL[80:])
    right = horizon_of(fit, trace_of(fit, poses, future), tolerance)
    assert right == horizon(fit, tolerance)
    moved = poses.position.copy()
    moved[95:, 1] += 0.3
    wrong = horizon_of(fit, trace_of(fit, replace(poses, position=moved), future), tolerance)
    assert wrong == Horizon(pytest.approx(ALL[94] - ALL[79]), "joint2", shown=True)


def test_it_is_said_in_words(fit):
    tolerance = Tolerance()
    assert allowed(fit.mechanism, tolerance) == "5 deg"
    assert horizon_said(fit, Horizon(np.inf, ""), tolerance) == (
        f"Predictions stay within 5 deg over all of the {FARTHEST:g} s that were looked at."
    )
    assert horizon_said(fit, Horizon(0.0, "joint1"), tolerance) == (
        "Predictions leave 5 deg right after the fitted frames."
    )
    for shown, how in ((False, "by their 95 % band"), (True, "as was measured")):
        assert horizon_said(fit, Horizon(1.234, "joint2", shown), tolerance) == (
            f"Predictions stay within 5 deg for 1.2 s after the fitted frames ({how}; joint2 is the first to "
            "leave)."
        )


def test_how_far_is_looked_next_follows_from_how_a_band_grows():
    times = np.arange(100) / 100.0
    # from 1e-3 in the middle to 1e-2 at the end: two more halves until it leaves
    assert _farther(1e-4 * 100.0 ** times[:, None]) == pytest.approx(2.0, abs=0.05)
    assert _farther(1e-6 * 100.0 ** times[:, None]) == pytest.approx(3.0, abs=0.05)
    # twice at least, and not without end
    assert _farther(0.95 * 1.05 ** times[:, None]) == 2.0
    assert _farther(1e-30 * 2.0 ** times[:, None]) == FASTEST
    for band in (np.full((100, 2), 0.1), 0.5 - 0.1 * times[:, None], np.full((1, 2), 0.1), np.zeros((5, 1))):
        assert _farther(band) == FASTEST
