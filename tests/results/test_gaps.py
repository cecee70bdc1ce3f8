"""What stands for a record in the run folder where something was hidden, and what is said of it."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.fit import Doubt
from monodyn.estimation.parts import Unmodelled
from monodyn.results.fill import fill
from monodyn.results.findings import Findings
from monodyn.results.gaps import Filled, filled, how_filled, unfollowed
from monodyn.results.page import page_text
from monodyn.results.predict import predict
from monodyn.results.smoother import left_over, smooth
from monodyn.results.trace import trace_of
from monodyn.types import Poses
from swings import record

ALL = np.arange(120) / 30.0


@pytest.fixture
def exact(fit):
    return replace(fit, unmodelled=None, stamp_error=0.0)


def hidden(truth, *rows: slice) -> Poses:
    """Return the whole motion as measured, all of it but some rows."""
    mechanism, q, _ = truth
    poses, seen = record(mechanism, ALL, q, seed=3), np.ones(120, dtype=bool)
    for those in rows:
        seen[those] = False
    return replace(poses, position=np.where(seen[:, None], poses.position, np.nan), seen=seen)


def test_where_nothing_is_lacking_any_simulator_follows(exact, truth):
    """A gap in the fitted frames, or one that is predicted better than measured, changes nothing."""
    for poses in (hidden(truth, slice(50, 60)), hidden(truth, slice(81, 83))):
        rolled = fill(exact, ALL)
        assert np.all(rolled.std[81:83] < [exact.rms[name] for name in poses.joints])
        found = filled(exact, poses)
        np.testing.assert_array_equal(found.position, rolled.position)
        np.testing.assert_array_equal(found.std, rolled.std)


def test_a_gap_that_is_hardly_predicted_is_filled_from_both_sides(exact, truth):
    wide = replace(exact, covariance=400.0 * exact.covariance)
    poses = hidden(truth, slice(100, 110))
    found, rolled = filled(wide, poses), fill(wide, ALL)
    np.testing.assert_array_equal(found.position, smooth(wide, poses).position)
    assert np.all(found.std[100:110] < 0.5 * rolled.std[100:110])
    # what comes after the fitted frames is predicted without it all the same
    ahead = predict(wide, times=ALL[80:])
    np.testing.assert_allclose(ahead.position, rolled.position[80:], atol=1e-6)
    assert np.abs(found.position - rolled.position)[80:].max() > 1e-4


def test_what_the_model_lacks_is_smoothed_and_a_refused_fit_is_not(fit, truth):
    lacking = replace(fit, unmodelled=Unmodelled(np.full(2, 1e-3), 1e-4 * np.eye(4)))
    poses = hidden(truth, slice(50, 60))
    found = filled(lacking, poses)
    np.testing.assert_array_equal(found.position, smooth(lacking, poses).position)
    refused = replace(lacking, doubts=(Doubt("refused", "It is another one."),))
    np.testing.assert_array_equal(filled(refused, poses).position, fill(refused, ALL).position)
    # where nothing was hidden a simulator follows, and the band has what is lacking
    whole, rolled = filled(lacking, hidden(truth)), fill(replace(lacking, unmodelled=None), ALL)
    np.testing.assert_array_equal(whole.position, rolled.position)
    spread = np.diag(lacking.unmodelled.off)
    np.testing.assert_allclose(
        whole.std[40:80] ** 2 - rolled.std[40:80] ** 2,
        spread[:2] + (lacking.stamp_error * rolled.velocity[40:80]) ** 2,
    )
    assert np.all(whole.std[0] ** 2 > rolled.std[0] ** 2 + 2.0 * spread[:2])


def test_how_well_gaps_are_filled(exact, truth):
    poses = hidden(truth, slice(50, 60), slice(70, 71))
    trace, motion = trace_of(exact, poses), filled(exact, poses)
    rows = [*range(50, 60), 70]
    known = how_filled([trace], [motion])
    assert known.frames == 11
    np.testing.assert_allclose(known.band, 1.96 * np.median(motion.std[rows], axis=0))
    lost = replace(motion, std=np.where(np.arange(120)[:, None] < 60, np.inf, motion.std))
    assert how_filled([trace], [lost]).frames == 1
    seen = trace_of(exact, hidden(truth))
    none = how_filled([seen], [motion])
    assert (none.frames, np.isnan(none.band).all()) == (0, True)
    assert isinstance(none, Filled)


def test_what_is_slow_in_residuals_widens_the_band_and_noise_does_not(exact, truth):
    """Of noise plus a wave: the wave's mean square times the cosine of a step; 400 rows give it to 0.1."""
    rng, rows = np.random.default_rng(2), np.arange(400)
    noise, wave = rng.normal(size=(400, 2)), np.sqrt(2.0) * np.sin(0.1 * rows)
    residual = noise + np.column_stack([wave, 0.0 * wave])
    residual[50:60] = np.nan
    found = left_over(residual)
    assert found[0] == pytest.approx(np.cos(0.1), abs=0.3)
    assert found[1] == 0.0
    poses = hidden(truth)
    slow = replace(exact, residual=(1e-3 * residual[:40] + 5e-3,))
    more = filled(slow, poses).std ** 2 - filled(exact, poses).std ** 2
    np.testing.assert_allclose(more, np.tile(left_over(slow.residual[0]), (120, 1)))
    assert more.min() > 1e-5


def test_gaps_that_no_motion_leads_through_are_named(exact, truth):
    trace, motion = trace_of(exact, hidden(truth, slice(50, 60)), name="one"), fill(exact, ALL)
    std = motion.std.copy()
    std[50:60] = np.inf
    lost = replace(motion, std=std)
    assert unfollowed([trace], [motion]) == []
    assert unfollowed([trace], [lost]) == [
        "From 1.67 to 1.97 s the motion is too wild to be followed through what was hidden: states.csv knows "
        "nothing of it there."
    ]
    assert unfollowed([trace, trace], [motion, lost]) == [
        "From 1.67 to 1.97 s of one the motion is too wild to be followed through what was hidden: "
        "states.csv knows nothing of it there."
    ]
    # free torques know nothing after the fitted frames: that is no gap
    outside = replace(motion, std=np.full_like(std, np.inf))
    assert unfollowed([replace(trace, states=outside)], [outside]) == []


@pytest.mark.slow
def test_the_report_says_how_many_frames_were_filled(exact, truth):
    poses = hidden(truth, slice(50, 60))
    findings = Findings(exact, [trace_of(exact, poses)])
    page = page_text(findings)
    assert "<b>10</b><span>frames filled, within " in page
    assert "hidden, filled, with 95 % bars" in page
    assert "frames filled" not in page_text(Findings(exact, [trace_of(exact, hidden(truth))]))
