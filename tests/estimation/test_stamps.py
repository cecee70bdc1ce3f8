"""The error of the time stamps, found again in records with a known one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from monodyn.estimation.record.samples import Data
from monodyn.estimation.verdict.regression import not_negative
from monodyn.estimation.verdict.stamps import stamp_error
from monodyn.estimation.verdict.uncertainty import noise_factors
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record, sigmas

TIMES = np.arange(120) / 30.0
RATES = np.column_stack([6.0 * np.cos(5.0 * TIMES), 9.0 * np.sin(8.3 * TIMES)])
STATED = np.array([3e-4, 6e-4])


def residuals(seed: int, error: float, *, stated: float = 1.0, slow: float = 0.0) -> tuple[Data, np.ndarray]:
    """Return samples and their residuals: noise, an error of the stamps and a fault that changes slowly."""
    rng = np.random.default_rng(seed)
    white = np.broadcast_to(np.diag(1.0 / STATED), (120, 2, 2))
    samples = Data(
        TIMES, np.zeros((120, 2)), white, np.ones((120, 2), bool), np.array([0, 120]), np.arange(120),
        np.zeros((1, 2), bool), np.zeros((1, 2)),
    )  # fmt: skip
    noise = stated * STATED * rng.normal(size=(120, 2)) + error * RATES * rng.normal(size=(120, 1))
    return samples, noise + slow * np.sin(2.0 * TIMES)[:, None]


@pytest.mark.parametrize("error", [0.5e-3, 1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("slow", [0.0, 2e-3])
def test_the_error_of_the_stamps_is_found(error: float, slow: float) -> None:
    found = [stamp_error(*residuals(seed, error, slow=slow), RATES) for seed in range(12)]
    # 120 rows: a standard deviation of the standard deviation of about 10 %, over twelve records 3 %
    assert np.mean(found) == pytest.approx(error, rel=0.12)


@pytest.mark.parametrize("stated", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("slow", [0.0, 2e-3])
def test_exact_stamps_have_none(stated: float, slow: float) -> None:
    assert [stamp_error(*residuals(seed, 0.0, stated=stated, slow=slow), RATES) for seed in range(40)] == [
        0.0
    ] * 40


def test_too_few_samples_show_none() -> None:
    samples, difference = residuals(1, 5e-3)
    few = samples.without(np.arange(120) >= 7)
    assert stamp_error(few, np.where(few.measured, difference, np.nan), RATES) == 0.0


@pytest.mark.parametrize("rate", [0.0, 3.0])
@pytest.mark.parametrize("joints", [1, 2])
def test_rates_that_are_even_tell_nothing_of_the_stamps(rate: float, joints: int) -> None:
    """The scatter of the stamps is as even as that of the picture then."""
    for seed in range(12):
        samples, difference = residuals(seed, 3e-3)
        if joints == 1:
            one = np.array([True, False])
            samples, difference = (
                replace(samples, measured=samples.measured & one),
                np.where(one, difference, np.nan),
            )
        assert stamp_error(samples, difference, np.full((120, 2), rate)) == 0.0


def test_columns_that_are_alike_share_what_they_explain() -> None:
    rng = np.random.default_rng(3)
    for zero in (0.0, 1.0):
        one = rng.uniform(0.5, 2.0, 40)
        design, squares = np.column_stack([one, one, zero * rng.random(40)]), rng.exponential(size=40)
        expected = np.linalg.lstsq(design, squares, rcond=None)[0]
        if expected.min() >= 0.0:
            np.testing.assert_allclose(not_negative(design, squares), expected, atol=1e-9)
        explained = design @ not_negative(design, squares)
        best = design @ nnls(design, squares)[0]
        np.testing.assert_allclose(explained, best, atol=1e-9)


def test_picture_and_stamps_have_their_shares_of_the_noise() -> None:
    sizes = []
    for seed in range(12):
        samples, difference = residuals(seed, 2e-3, stated=1.5)
        noise = noise_factors(samples, difference, 0, RATES)
        np.testing.assert_allclose(noise.shift, noise.stamps * RATES)
        sizes.append(noise.size)
    # where the stamps move a joint by ten times its noise only the turning points show that noise
    np.testing.assert_allclose(np.median(sizes, axis=0), [1.5, 1.5], rtol=0.25)


def test_the_weights_are_those_of_the_whole_covariance() -> None:
    samples, difference = residuals(3, 2e-3)
    noise = noise_factors(samples, difference, 0, RATES)
    white = noise.weighted(samples).white[17]
    picture = np.diag((noise.size * STATED) ** 2)
    whole = picture + np.outer(noise.shift[17], noise.shift[17])
    expected = whole * np.outer(noise.correlation, noise.correlation)
    np.testing.assert_allclose(np.linalg.inv(white.T @ white), expected, rtol=1e-9)


@pytest.mark.parametrize("error", [2e-3, 5e-3])
def test_intervals_of_a_record_with_uneven_stamps_cover(error: float) -> None:
    double = load("double")
    rng = np.random.default_rng(8)
    times = np.arange(70) / 30.0
    shown = np.sort(times + 0.02 + error * rng.normal(size=70))
    truth = motion(double, np.concatenate([[0.0], shown]), [0.3, 0.5], [0.0, 1.0])[1:]
    fit = identify(record(double, times, truth, noise=5e-4), double)
    assert fit.ok
    assert fit.stamp_error == pytest.approx(error, rel=0.4)
    for name in ("link1.length", "link2.length"):
        assert sigmas(fit.parameter(name), double.values[name]) < 3.0
    assert any("as if the time stamps were off by about " in text for text in fit.advice)


def test_variances_below_zero_are_left_out_as_a_library_does_it() -> None:
    rng = np.random.default_rng(0)
    for joints in (1, 2, 4):
        for _ in range(40):
            design = np.zeros((60, joints + 1))
            design[np.arange(60), rng.integers(joints, size=60)] = rng.uniform(0.5, 2.0, 60)
            design[:, -1] = rng.exponential(size=60)
            parts = np.where(rng.random(joints + 1) < 0.4, 0.0, rng.random(joints + 1))
            squares = (design @ parts) * rng.normal(size=60) ** 2
            np.testing.assert_allclose(not_negative(design, squares), nnls(design, squares)[0], atol=1e-12)
