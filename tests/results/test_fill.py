"""Gap filling: close to the truth within the stated error, in both directions of time."""

from dataclasses import replace

import numpy as np
import pytest

from fits import made_fit
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Estimate
from monodyn.results.fill import carried_from, fill
from monodyn.stages import identify
from support import refuses
from swings import record

ALL = np.arange(120) / 30.0
NOISE = 0.002


@pytest.mark.slow
def test_the_error_is_as_large_as_stated(truth):
    """Mean square of error over std of positions and of rates, before, within and after the fitted frames:
    one, up to chance.

    The errors of one record follow from a few unknowns and move together. Each joint counts as one
    independent error a third, so that six records have twelve: the quantiles of chi-square / 12 at one and at
    999 in a thousand are 0.185 and 2.74.
    """
    mechanism, q, v = truth
    squares = []
    for seed in range(6):
        poses = replace(record(mechanism, ALL[40:80], q[40:80], seed=seed), frame=np.arange(40, 80))
        states = fill(identify(poses, mechanism).check(), ALL)
        for found, right, std in (
            (states.position, q, states.std),
            (states.velocity, v, states.velocity_std),
        ):
            squares.append(np.mean(((found - right) / std).reshape(3, -1) ** 2, axis=1))
    mean = np.mean(np.reshape(squares, (6, 2, 3)), axis=0)
    assert np.all((mean > 0.185) & (mean < 2.74)), mean


def test_rates_follow_the_positions(fit, truth):
    dense = np.arange(0.0, 3.9, 0.001)
    states = fill(fit, dense)
    slope = np.gradient(states.position, dense, axis=0)
    # central differences leave h^2/6 of the third derivative: 2e-7 s^2 of up to 3e4 rad/s^3
    np.testing.assert_allclose(slope[1:-1], states.velocity[1:-1], atol=0.01)
    np.testing.assert_allclose(fill(fit, ALL).velocity[41:79], truth[2][41:79], atol=0.1)


def test_std_within_the_fit_is_below_the_noise_and_grows_after_it(fit):
    states = fill(fit, ALL)
    assert np.all(states.std[45:75] < NOISE)
    assert np.all(states.std[100:].mean(axis=0) > states.std[45:75].mean(axis=0))
    assert np.isfinite(states.std).all()


def test_the_std_of_the_rates_is_the_slope_of_the_motion_by_what_is_unknown(fit):
    """By central differences, one unknown at a time; the clock's stretch is one of them."""
    names = ("link1.length", "time_scale")
    dofs = len(fit.mechanism.joints)
    std = np.concatenate(([1e-3, 2e-3], [0.0, 0.0, 0.03, 0.0]))
    rows = tuple(
        Estimate(name, fit.mechanism.values[name], s, 0.0, np.inf, "", True, True, False)
        for name, s in zip(names, std, strict=False)
    )
    made = replace(fit, parameters=rows, tied=(), covariance=np.diag(std**2), unmodelled=None)
    stated, start, variance = fill(made, ALL), fit.starts[0], 0.0
    for k in np.flatnonzero(std):
        sides = []
        for step in (1e-5, -1e-5):
            if k < len(names):
                values = {names[k]: fit.mechanism.values[names[k]] + step}
                moved = replace(made, mechanism=fit.mechanism.with_values(values))
            else:
                rates = start.velocity + step * np.eye(2 * dofs)[k - len(names), dofs:]
                moved = replace(made, starts=(replace(start, velocity=rates),))
            sides.append(fill(moved, ALL))
        slopes = [(getattr(sides[0], w) - getattr(sides[1], w)) / 2e-5 for w in ("position", "velocity")]
        variance = variance + std[k] ** 2 * np.square(slopes)
    # the integration's error over the step of the differences
    np.testing.assert_allclose(stated.std, np.sqrt(variance[0]), rtol=2e-3, atol=1e-4)
    np.testing.assert_allclose(stated.velocity_std, np.sqrt(variance[1]), rtol=2e-3, atol=1e-3)


def test_a_motion_is_as_exact_as_is_asked(fit):
    exact = fill(fit, ALL, error_bound=1e-10).position
    off = [np.abs(fill(fit, ALL, error_bound=bound).position - exact).max() for bound in (1e-2, 1e-5, 1e-8)]
    assert 1e-6 < off[0] < 1e-2
    assert off[1] < 1e-5
    assert off[2] < 1e-8


def test_bad_input_is_refused(fit):
    with refuses(SettingsError, "fill: expected a record from 0 to 0, got 2."):
        fill(fit, np.array([0.0, 1.0]), record=2)
    with refuses(SettingsError, "fill: times: must increase, but sample 1 is 0.5 s after 1 s."):
        fill(fit, np.array([1.0, 0.5]))
    for bound in (0.0, -1e-6, np.nan, np.inf):
        said = f"fill: expected an error bound above 0 and finite [rad or m], got {bound:g}; give another."
        with refuses(SettingsError, said):
            fill(fit, ALL, error_bound=bound)
    said = "fill: expected an identified mechanism, got a fit without one: Too few frames."
    with refuses(SettingsError, said):
        fill(made_fit(starts=(), status="Too few frames."), ALL)


def test_times_far_from_the_record_are_refused():
    fit = made_fit()
    with refuses(
        SettingsError,
        "fill: expected times within 3.33e+04 s of 0 s, got 0 to 1e+300 s; give times nearer to those of the "
        "record.",
    ):
        fill(fit, np.array([0.0, 1e300]))


def test_a_variance_is_no_smaller_than_what_rounding_leaves_of_its_terms(fit):
    """As along a chaotic motion: the unknowns make up for one another, and their sum is lost in its terms."""
    time = np.array([fit.time[0][-1] + 1.0])
    slopes = carried_from(fit, fit.starts[0], 0, time).slopes[-1, :2]
    off = 1e3 * np.random.default_rng(0).standard_normal(slopes.shape[1])
    # in these unknowns together the position there does not change
    off -= slopes.T @ np.linalg.solve(slopes @ slopes.T, slopes @ off)
    assert np.all(np.abs(slopes @ off) < 1e-9)
    lost = replace(fit, covariance=np.outer(off, off), unmodelled=None)
    terms = np.abs(slopes) @ np.abs(off)
    std = fill(lost, time).std[0]
    assert np.all(std > 1e-8 * terms)
    # and hardly more: twenty unknowns, 2e-16 each
    assert np.all(std < 1e-7 * terms)
