"""Covariance and noise, as the residuals show them."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.search import Search
from monodyn.estimation.verdict.uncertainty import NoiseFactors, knowledge_at, noise_factors
from monodyn.stages import identify
from swings import motion, record, scaled, sigmas


@pytest.mark.slow
def test_correlated_noise_is_judged_by_joint(truth, double):
    """Joints that err together, two and three times as much as stated: that is what comes out."""
    stated, share = np.array([0.001, 0.003]), np.array([[1.0, -0.98], [-0.98, 1.0]])
    covariance = np.outer(stated, stated) * share
    times = np.arange(200) / 30.0
    clean = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]), noise=0.0)
    rng = np.random.default_rng(4)
    noise = 2.0 * rng.multivariate_normal(np.zeros(2), covariance, size=200)
    noise[:, 1] *= 1.5
    noisy = replace(clean, position=clean.position + noise, covariance=np.tile(covariance, (200, 1, 1)))
    data = prepare([noisy], double)
    np.testing.assert_allclose(data.std, np.tile(stated, (200, 1)), rtol=1e-9)
    size = noise_factors(data, noise, 0).size
    np.testing.assert_allclose(size, [2.0, 3.0], rtol=0.2)  # 200 samples: 1/sqrt(400) = 5 %, four times that
    fit = identify(noisy, double)
    assert fit.ok
    assert sigmas(fit.parameter("link1.length"), truth.values["link1.length"]) < 4.0


@pytest.mark.slow
def test_what_looks_like_another_length_makes_it_as_uncertain(truth, double):
    """Against a first link that is longer: nothing tells a shift by the difference of the motions."""
    times = np.arange(60) / 30.0
    plain = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    step, name = 2e-4, "link1.length"
    longer = scaled(truth, link1=1.0 + step)
    shift = motion(longer, times, [0.3, 0.5], [0.0, 1.0]) - motion(truth, times, [0.3, 0.5], [0.0, 1.0])
    before, after = (identify(one, double) for one in (plain, replace(plain, shifts=shift[None])))
    common = after.common_of(0)
    assert common is not None
    assert common.covariance[0, 0] == pytest.approx(1.0, abs=0.05)
    more = np.sqrt(after.parameter(name).std ** 2 - before.parameter(name).std ** 2)
    assert more == pytest.approx(step * truth.values[name], rel=0.1)
    # start states are as they were: the shift begins at nothing
    at = after.names.index("record0.joint1")
    assert after.covariance[at, at] == pytest.approx(before.covariance[at, at], rel=0.2)


def test_shifts_keep_to_their_record_and_joints(truth, double):
    times = np.arange(30) / 30.0
    plain = record(truth, times, motion(truth, times, [0.3, 0.5], [0.0, 1.0]))
    shifts = np.random.default_rng(1).normal(size=(2, 30, 2))
    swapped = replace(
        plain, joints=plain.joints[::-1], position=plain.position[:, ::-1], shifts=shifts[:, :, ::-1]
    )
    data = prepare([plain, swapped, replace(plain, shifts=shifts[:1])], double)
    assert data.shifts.shape == (3, 90, 2)
    np.testing.assert_array_equal(data.shifts[:2, 30:60], shifts)
    np.testing.assert_array_equal(data.shifts[2, 60:], shifts[0])
    assert not data.shifts[:2, :30].any()
    assert not data.shifts[:2, 60:].any()
    assert prepare([plain], double).shifts is None
    np.testing.assert_array_equal(swapped[3:9].shifts, swapped.shifts[:, 3:9])


def test_noise_stays_where_all_of_it_does():
    one = NoiseFactors(np.array([2.0, 0.5]), np.array([1.0, 1.4]), 1e-4)
    assert one.is_about(one)
    assert one.is_about(one._replace(size=one.size * 1.0005))
    for other in (
        one._replace(size=one.size * [1.0, 1.002]),
        one._replace(correlation=one.correlation * [1.0, 0.998]),
        one._replace(stamps=1.1e-4),
        one._replace(stamps=0.0),
    ):
        assert not one.is_about(other)
        assert not other.is_about(one)


def test_a_row_that_depends_on_the_state_beyond_all_numbers_tells_nothing(truth, double, poses):
    """As without it: what is known of the others stays."""
    problem = posed(double, prepare([poses], double))
    optimum, _ = Search(problem, (smooth(poses),), IdentifySettings(), None).from_starts()
    _, jacobian = problem.rows(optimum.trial)
    wild, without = jacobian.copy(), jacobian.copy()
    wild[-1, 1], without[-1, 1] = [np.inf, np.nan, *jacobian[-1, 1, 2:]], 0.0
    found, wanted = (
        knowledge_at(problem, optimum.x, one, optimum.trial.pieces).covariance for one in (wild, without)
    )
    np.testing.assert_array_equal(found, wanted)
