"""What a record to come tells of the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.parts import Start, Unmodelled
from monodyn.mechanism.simulate import transitions
from monodyn.results.fill import carried_from, random_push
from monodyn.results.information import (
    FREE,
    FREE_RATE,
    information_along,
    noise_of,
    quantities,
    root_of,
    variances,
)

NOISE = np.array([2e-3, 3e-3])


def motion_of(fit, count=25):
    start = Start(0.0, np.array([-0.8, 0.6]), np.zeros(2), np.zeros((4, 4)))
    return carried_from(fit, start, 0, np.arange(count) / 30.0)


def test_standard_deviations_of_what_has_an_interval_follow_from_its_derivatives(fit):
    known, root = quantities(fit), root_of(fit)
    np.testing.assert_allclose(root @ root.T, fit.shared_covariance, rtol=1e-6, atol=1e-12)
    own = np.sqrt(np.sum((known.slopes @ root) ** 2, axis=1))
    stated = {c.name: c.std for c in fit.combinations}
    assert {"link2.thickness / link1.thickness", "joint1.damping / link1.J", "link1.J / link2.J"} <= set(
        known.names
    )
    for name, std, found in zip(known.names, known.std, own, strict=True):
        # the estimation differentiates by other coordinates; a length has gravity's share on top
        if name in stated:
            assert found == pytest.approx(std, rel=1e-6)
        else:
            assert found <= std * (1.0 + 1e-9)


def test_without_random_accelerations_it_is_that_of_least_squares_with_a_free_start(fit):
    motion, count = motion_of(fit), len(fit.shared)
    found = information_along(fit, motion, NOISE)
    rows = (motion.slopes[:, :2] / NOISE[:, None]).reshape(-1, motion.slopes.shape[2])
    for stop in (10, len(found)):
        shared, states = rows[: 2 * stop, :count], rows[: 2 * stop, count:]
        # a start state with a standard deviation of a radian is free but for a part in 1e5
        prior = np.diag(np.repeat([1.0 / FREE**2, 1.0 / FREE_RATE**2], 2))
        inner = np.linalg.inv(states.T @ states + prior)
        expected = shared.T @ shared - shared.T @ states @ inner @ states.T @ shared
        size = np.sqrt(np.outer(np.diag(expected), np.diag(expected))) + 1e-300
        np.testing.assert_allclose(found[stop - 1] / size, expected / size, atol=1e-6)


def test_random_accelerations_are_those_of_generalized_least_squares(fit):
    density = np.array([0.02, 0.05])
    lacking = replace(fit, unmodelled=Unmodelled(density, np.zeros((4, 4))))
    motion, count = motion_of(fit), len(fit.shared)
    found = information_along(lacking, motion, NOISE)[-1]
    steps = transitions(fit.mechanism.tree, motion.stamps, motion.motion, substeps=motion.substeps)
    rows = len(steps)
    # covariance of all positions, written out
    states = np.zeros((rows, rows, 4, 4))
    states[0, 0] = np.diag(np.repeat([FREE**2, FREE_RATE**2], 2))
    for i in range(1, rows):
        push = random_push(density, motion.stamps[i] - motion.stamps[i - 1])
        states[i, i] = steps[i] @ states[i - 1, i - 1] @ steps[i].T + push
        for k in range(i):
            states[i, k] = steps[i] @ states[i - 1, k]
            states[k, i] = states[i, k].T
    whole = states[:, :, :2, :2].transpose(0, 2, 1, 3).reshape(2 * rows, 2 * rows)
    whole += np.diag(np.tile(NOISE**2, rows))
    slopes = motion.slopes[:, :2, :count].reshape(-1, count)
    expected = slopes.T @ np.linalg.solve(whole, slopes)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected))) + 1e-300
    np.testing.assert_allclose(found / size, expected / size, atol=1e-5)
    assert np.all(np.diag(found) <= np.diag(information_along(fit, motion, NOISE)[-1]))


def test_an_error_of_the_stamps_counts_as_noise_where_the_motion_is_fast(fit):
    motion = motion_of(fit)
    exact, late = (information_along(replace(fit, stamp_error=e), motion, NOISE) for e in (0.0, 2e-3))
    used = np.diag(exact[-1]) > 0.0
    assert np.all(np.diag(late[-1])[used] < 0.9 * np.diag(exact[-1])[used])


def test_variances_are_those_of_the_sum_of_both_informations():
    rng = np.random.default_rng(3)
    root, more, slopes = rng.normal(size=(4, 4)), rng.normal(size=(4, 4)), rng.normal(size=(3, 4))
    both = np.linalg.inv(np.linalg.inv(root @ root.T) + more @ more.T)
    np.testing.assert_allclose(variances(slopes, root, more @ more.T), np.diag(slopes @ both @ slopes.T))


def test_noise_is_that_of_the_residuals_before_it_was_fitted(fit):
    # the record has noise of 2 mrad; 40 rows of two joints know that to 8 %
    np.testing.assert_allclose(noise_of(fit), 2e-3, rtol=0.25)
