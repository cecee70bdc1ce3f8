"""What a model lacks: accelerations at random, found in residuals and carried on."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from monodyn.estimation.verdict.unmodelled import Wander
from monodyn.mechanism import load
from monodyn.mechanism.simulate import rollout
from monodyn.results.predict import predict
from monodyn.stages import identify
from swings import record

TIMES = np.arange(0.0, 4.0, 0.02)
DENSITY = 0.02
"""Of the random accelerations of the records made here [rad^2/s^3]."""
NOISE = 2e-4


def pushed(seed: int, times: np.ndarray = TIMES) -> np.ndarray:
    """Return positions of a single pendulum that random accelerations push, (time, 1)."""
    truth, rng, parts = load("single"), np.random.default_rng(seed), 10
    state, found = (np.array([1.0]), np.zeros(1)), [np.array([1.0])]
    for start, stop in pairwise(times):
        # a kick at the end of each tenth of a step: the variance of a rate grows by the density
        for part in np.linspace(start, stop, parts + 1)[:-1]:
            step = (stop - start) / parts
            q, v = rollout(truth.tree, np.array([part, part + step]), *state, substeps=1)
            state = q[1], v[1] + np.sqrt(DENSITY * step) * rng.normal(size=1)
        found.append(state[0])
    return np.array(found)


@pytest.mark.slow
def test_random_accelerations_are_found_and_carried_on():
    single, bands, found = load("single"), [], []
    for seed in range(6):
        whole = record(single, TIMES, pushed(seed), noise=NOISE, seed=seed)
        fit = identify(whole[:150], single)
        assert fit.unmodelled is not None
        found.append(fit.unmodelled.density[0])
        future = predict(fit, times=TIMES[150:])
        bands.append((whole.position[150:] - future.position) / future.std)
        # without it the band is that of a fit whose model is right
        narrow = predict(replace(fit, unmodelled=None), times=TIMES[150:])
        assert np.all(narrow.std < 0.9 * future.std)
    # 150 rows determine a variance to 12 %, with grid and noise within a factor of two
    assert np.median(found) == pytest.approx(DENSITY, rel=1.0)
    assert 0.4 < np.sqrt(np.mean(np.square(bands))) < 1.6


def test_noise_alone_lacks_nothing(fit):
    assert fit.unmodelled is None


def test_the_likelihood_is_that_of_all_rows_together():
    """Against the density of all residuals at once, from their covariance."""
    step, rows = 0.1, 6
    move = np.array([[1.0, step], [-0.3, 0.95]])
    rng = np.random.default_rng(2)
    residual, variance = rng.normal(size=(rows, 1)), np.full((rows, 1), 0.3)
    residual[2], variance[2] = np.nan, np.nan
    carried, steps = np.tile(move, (rows, 1, 1)), np.full(rows, step)
    begins = np.arange(rows) == 0
    about, values = Wander(variance, carried, steps, begins, np.array([4.0, 4.0])), []
    for density in (0.5, 2.0):
        ours, _ = about.error(residual, np.array([density]))
        push = density * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
        # the state at each row is a sum of the first one and of all pushes, carried on
        sources = np.zeros((2 * rows, 2 * rows))
        sources[:2, :2] = 4.0 * np.eye(2)
        for row in range(1, rows):
            sources[2 * row : 2 * row + 2, 2 * row : 2 * row + 2] = push
        carry = np.zeros((2 * rows, 2 * rows))
        for row in range(rows):
            for source in range(row + 1):
                power = np.linalg.matrix_power(move, row - source)
                carry[2 * row : 2 * row + 2, 2 * source : 2 * source + 2] = power
        whole = (carry @ sources @ carry.T)[::2, ::2] + 0.3 * np.eye(rows)
        use = np.isfinite(residual[:, 0])
        theirs = multivariate_normal(np.zeros(int(use.sum())), whole[np.ix_(use, use)]).logpdf(
            residual[use, 0]
        )
        values.append(ours - theirs)
    assert values[0] == pytest.approx(values[1], abs=1e-9)


def test_a_motion_that_settles_and_then_runs_away_leaves_noise():
    """What has settled is known far better than rounding allows a covariance to say; running away, it is to
    be found again."""
    rows, noise = 400, 1e-3
    rng = np.random.default_rng(5)
    turn, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    settling, leaving = np.diag([0.6, 0.7, 0.8, 0.9]), np.diag([1.6, 1.4, 1.2, 1.1])
    carried = np.stack([turn @ (settling if row < rows // 2 else leaving) @ turn.T for row in range(rows)])
    about = Wander(
        np.full((rows, 2), noise**2),
        carried,
        np.full(rows, 0.02),
        np.arange(rows) == 0,
        np.full(4, 1e-2),
    )
    new, logarithm = about.innovations(noise * rng.normal(size=(rows, 2, 1)), np.zeros(2))
    assert np.sqrt(np.mean(new**2)) == pytest.approx(1.0, abs=0.1)
    # no row is better known than its noise leaves it
    assert logarithm <= -rows * 2 * np.log(noise)
