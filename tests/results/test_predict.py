"""Prediction and gap filling: close to the truth within the stated error, in both directions of time."""

import numpy as np
import pytest

from monodyn.errors import SettingsError
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.results.fill import fill
from monodyn.results.predict import predict
from monodyn.stages import identify
from monodyn.types import Poses

ALL = np.arange(120) / 30.0
NOISE = 0.002


@pytest.fixture(scope="module")
def truth():
    """Motion of the bundled double pendulum: what is fitted is its middle third."""
    mechanism = load("double")
    q, v = rollout(mechanism.tree, ALL, np.array([0.3, 0.5]), np.array([0.0, 1.0]), substeps=16)
    return mechanism, q, v


@pytest.fixture(scope="module")
def fit(truth):
    mechanism, q, _ = truth
    rows = slice(40, 80)
    position = q[rows] + NOISE * np.random.default_rng(0).normal(size=(40, 2))
    covariance = np.tile(NOISE**2 * np.eye(2), (40, 1, 1))
    poses = Poses(
        ("joint1", "joint2"), np.arange(40, 80), ALL[rows], position, covariance, np.ones(40, dtype=bool)
    )
    return identify(poses, mechanism).check()


def test_the_error_is_as_large_as_stated(fit, truth):
    """Root mean square of error over std: one on average, and all errors of a record hang together."""
    _, q, _ = truth
    states = fill(fit, ALL)
    for rows in (slice(0, 40), slice(40, 80), slice(80, 120)):
        ratio = (states.position[rows] - q[rows]) / states.std[rows]
        assert 0.05 < np.sqrt(np.mean(ratio**2)) < 3.0


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


def test_prediction_is_fill_after_the_fitted_frames(fit):
    future = predict(fit, until=3.5)
    assert future.time[0] == pytest.approx(ALL[80])
    assert future.time[-1] == pytest.approx(3.5)
    np.testing.assert_allclose(future.position, fill(fit, future.time).position, atol=1e-12)
    assert len(predict(fit).time) == 39  # as long again as the record
    sparse = predict(fit, times=np.array([3.0, 3.9]))
    whole = fill(fit, ALL)
    # the same motion with other steps: the integration errors of 1e-6 grow on the way
    np.testing.assert_allclose(sparse.position, whole.position[[90, 117]], atol=1e-4)
    assert len(predict(fit, until=3.5, times=np.array([3.0, 3.9])).time) == 1


def test_bad_input_has_whole_messages(fit, truth):
    with pytest.raises(SettingsError) as error:
        predict(fit, until=1.0)
    assert str(error.value) == "predict: expected a time after the last fitted frame at 2.63333 s, got 1 s."
    with pytest.raises(SettingsError) as error:
        predict(fit, record=1)
    assert str(error.value) == "predict: expected a record from 0 to 0, got 1."
    with pytest.raises(SettingsError) as error:
        fill(fit, np.array([0.0, 1.0]), record=2)
    assert str(error.value) == "fill: expected a record from 0 to 0, got 2."
    with pytest.raises(SettingsError) as error:
        fill(fit, np.array([1.0, 0.5]))
    assert str(error.value) == "fill: times: must increase, but sample 1 is 0.5 s after 1 s."
    mechanism, q, _ = truth
    poses = Poses(
        ("joint1", "joint2"),
        np.arange(3),
        ALL[:3],
        q[:3],
        np.tile(np.eye(2), (3, 1, 1)),
        np.ones(3, dtype=bool),
    )
    with pytest.raises(
        SettingsError, match=r"^fill: expected an identified mechanism, got a fit without one: 6 "
    ):
        fill(identify(poses, mechanism), ALL)
