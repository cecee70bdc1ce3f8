"""Covariance and noise, as the residuals show them."""

from dataclasses import replace

import numpy as np

from monodyn.estimation.record.samples import prepare
from monodyn.estimation.verdict.uncertainty import noise_factors
from monodyn.stages import identify
from swings import motion, record, sigmas


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
