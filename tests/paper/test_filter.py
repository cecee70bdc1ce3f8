"""The alpha-beta-gamma filter against scipy's transfer function, exact motion and scattered samples."""

import numpy as np
import pytest
from scipy.signal import lfilter, ss2tf

from monodyn.errors import SettingsError, VideoError
from monodyn.paper.filter import Gains, filter_response, filtered
from support import refuses

GAINS = Gains(0.4, 0.1, 0.05)
UNEVEN = np.cumsum(np.random.default_rng(4).uniform(0.02, 0.06, 40))


def kalata(gains, step):
    """State space of the steady filter: s(k) = (I - K H) A s(k-1) + K z(k), written down from eq. (6)."""
    predict = np.array([[1.0, step, step**2 / 2], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
    gain = np.array([gains.alpha, gains.beta / step, gains.gamma / step**2])
    return (np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])) @ predict, gain


def test_even_stamps_against_transfer_function():
    """From zeros the parabola is at rest, and the filter is the transfer function of its state space."""
    step, rng = 1 / 30, np.random.default_rng(0)
    samples = np.concatenate((np.zeros(3), rng.normal(size=80)))
    found = filtered(np.arange(83) * step, samples[:, None], GAINS)
    transition, gain = kalata(GAINS, step)
    # the update uses the sample of its own step: x(k+1) = A x(k) + K z(k+1) is one sample ahead
    for row, states in enumerate((found.position, found.velocity, found.acceleration)):
        numerator, denominator = ss2tf(transition, gain[:, None], np.eye(3)[[row]], np.zeros((1, 1)))
        ahead = lfilter(numerator[0], denominator, np.append(samples, 0.0))[1:]
        scale = np.abs(ahead).max()
        np.testing.assert_allclose(states[:, 0], ahead, atol=1e-11 * scale)


def test_the_consistent_reading_takes_half_of_gamma():
    """Stable all the way to the bound of eq. (7), where the printed one has long begun to grow."""
    samples = np.random.default_rng(8).normal(size=(40, 2))
    consistent = filtered(UNEVEN, samples, Gains.of((0.4, 0.1, 0.05), "consistent"))
    halved = filtered(UNEVEN, samples, Gains(0.4, 0.1, 0.025))
    np.testing.assert_allclose(consistent.acceleration, halved.acceleration, rtol=1e-12)
    most = 4.0 * 0.4 * 0.1 / (2.0 - 0.4)
    for gains, grows in ((Gains(0.4, 0.1, 0.999 * most, "consistent"), False), (Gains(0.4, 0.1, 0.06), True)):
        read = Gains(gains.alpha, gains.beta, gains.acceleration)
        assert (np.abs(np.linalg.eigvals(kalata(read, 1.0)[0])).max() > 1.0) == grows
        assert gains.stable == (not grows)
    with refuses(SettingsError, "gains.reading: expected one of 'printed', 'consistent', got 'other'."):
        Gains.of((0.4, 0.1, 0.05), "other")


def test_constant_acceleration_is_exact():
    motion = np.stack((1.0 - 2.0 * UNEVEN + 4.9 * UNEVEN**2, 0.3 + UNEVEN), axis=1)
    motion[[5, 6, 20], 0] = np.nan
    motion[:4, 1] = np.nan
    found = filtered(UNEVEN, motion, GAINS)
    np.testing.assert_allclose(found.position[:, 0], 1.0 - 2.0 * UNEVEN + 4.9 * UNEVEN**2, atol=1e-12)
    np.testing.assert_allclose(found.velocity[:, 0], -2.0 + 9.8 * UNEVEN, atol=1e-10)
    np.testing.assert_allclose(found.acceleration[:, 0], 9.8, atol=1e-8)
    assert np.isnan(found.position[:4, 1]).all()
    np.testing.assert_allclose(found.velocity[4:, 1], 1.0, atol=1e-10)


def test_unseen_frames_are_predicted_only():
    """Frames that are not seen leave the others as if they had not been in the record."""
    samples = np.random.default_rng(1).normal(size=(40, 1))
    keep = np.ones(40, dtype=bool)
    keep[[1, 7, 8, 9, 30]] = False
    whole = filtered(UNEVEN, np.where(keep[:, None], samples, np.nan), GAINS)
    part = filtered(UNEVEN[keep], samples[keep], GAINS)
    np.testing.assert_allclose(whole.position[keep], part.position, rtol=1e-9)
    np.testing.assert_allclose(whole.velocity[keep], part.velocity, rtol=1e-9)
    step = UNEVEN[7] - UNEVEN[6]
    straight = whole.position[6] + step * whole.velocity[6] + step**2 / 2 * whole.acceleration[6]
    np.testing.assert_allclose(whole.position[7], straight)


def test_covariance_is_the_response_to_every_sample():
    """Against the Jacobian of the filter, one sample moved at a time: linear, so exact."""
    rng = np.random.default_rng(2)
    time, frames, dofs = UNEVEN[:12], 12, 2
    samples = rng.normal(size=(frames, dofs))
    samples[4, 0] = samples[7] = samples[0, 1] = np.nan
    root = rng.normal(size=(frames, dofs, dofs))
    noise = root @ root.transpose(0, 2, 1)
    found = filtered(time, samples, GAINS, np.where(np.isnan(samples)[:, :, None], np.nan, noise))
    base = np.concatenate((found.position, found.velocity), axis=1)
    jacobian = np.zeros((frames, 2 * dofs, frames, dofs))
    for frame, dof in np.argwhere(np.isfinite(samples)):
        moved = samples.copy()
        moved[frame, dof] += 1.0
        other = filtered(time, moved, GAINS)
        jacobian[:, :, frame, dof] = np.concatenate((other.position, other.velocity), axis=1) - base
    begun = slice(1, None)
    assert found.covariance is not None
    jacobian = np.nan_to_num(jacobian)
    expected = np.einsum("faec,ecd,fbed->fab", jacobian, noise, jacobian)
    np.testing.assert_allclose(found.covariance[begun], expected[begun], rtol=1e-8, atol=1e-8)
    assert np.isnan(found.covariance[0, 1]).all()
    assert np.isfinite(found.covariance[0, 0, 0])


def test_the_filter_as_a_matrix():
    samples = np.random.default_rng(6).normal(size=(40, 2))
    samples[:3, 1] = samples[9:12] = np.nan
    seen = np.isfinite(samples)
    found = filtered(UNEVEN, samples, GAINS)
    response = filter_response(UNEVEN, seen, GAINS)
    states = np.einsum("fsde,ed->fsd", response, np.where(seen, samples, 0.0))
    np.testing.assert_allclose(states[:, 0, 0], found.position[:, 0], atol=1e-11)
    np.testing.assert_allclose(states[3:, 1, 1], found.velocity[3:, 1], atol=1e-9)
    assert not response[:3, :, 1].any()


@pytest.mark.slow
def test_covariance_against_scattered_samples():
    """2000 draws: a variance is known to 1 / sqrt(1000), five of them are 16 %."""
    rng = np.random.default_rng(3)
    draws = 0.01 * rng.normal(size=(40, 2000))
    found = filtered(UNEVEN, draws, GAINS)
    one = filtered(UNEVEN, draws[:, :1], GAINS, np.full((40, 1, 1), 1e-4))
    assert one.covariance is not None
    np.testing.assert_allclose(found.position.var(axis=1), one.covariance[:, 0, 0], rtol=0.16)
    np.testing.assert_allclose(found.velocity.var(axis=1), one.covariance[:, 1, 1], rtol=0.16)


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        ((0.0, 0.1, 0.05), "gains: expected alpha above 0 and up to 1 (eq. 7), got 0."),
        ((1.1, 0.1, 0.05), "gains: expected alpha above 0 and up to 1 (eq. 7), got 1.1."),
        ((0.4, 1.0, 0.05), "gains: expected beta between 0 and 1 (eq. 7), got 1."),
        (
            (0.4, 0.1, 0.11),
            "gains: expected gamma between 0 and 4 alpha beta / (2 - alpha) = 0.1 (eq. 7) with alpha 0.4 and "
            "beta 0.1, got 0.11.",
        ),
        ((0.4, 0.1), "gains: expected alpha, beta and gamma, got 2 numbers."),
        ((0.4, float("nan"), 0.1), "gains: expected beta between 0 and 1 (eq. 7), got nan."),
    ],
)
def test_gains_outside_their_range(gains, message):
    with refuses(SettingsError, message):
        Gains.of(gains)


def test_half_of_the_printed_range_is_stable():
    """Eq. (7) is the limit for gamma / (2 T^2); eq. (6) has gamma / T^2: stable in half of the range."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        alpha, beta, share = rng.uniform(0.01, 1.0), rng.uniform(0.01, 0.99), rng.uniform(0.01, 0.99)
        gains = Gains(alpha, beta, share * 4 * alpha * beta / (2 - alpha))
        transition, _ = kalata(gains, 1.0)
        assert gains.stable == (np.abs(np.linalg.eigvals(transition)).max() < 1.0), gains
    ringing, _ = kalata(GAINS, 1.0)
    assert np.abs(np.linalg.eigvals(ringing)).max() == pytest.approx(1.0, abs=1e-9)


def test_bad_records():
    with refuses(
        VideoError, "filter: joint 0 was measured in 2 frames, expected at least 3; give more frames."
    ):
        filtered(UNEVEN[:4], np.array([[0.0], [np.nan], [np.nan], [1.0]]), GAINS)
    with refuses(SettingsError, "filter: time: must increase, but sample 1 is 0 s after 0 s."):
        filtered(np.zeros(5), np.zeros((5, 1)), GAINS)
    with refuses(SettingsError, "filter: expected positions (frame, dof), got shape (5,)."):
        filtered(UNEVEN[:5], np.zeros(5), GAINS)
