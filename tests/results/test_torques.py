"""Torques of a fitted drive over time, with the standard deviation of the fit."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.fit import Estimate
from monodyn.mechanism import load
from monodyn.results.torques import torques


def test_a_mean_torque_has_the_deviation_of_its_parameter(fit):
    # one unknown, the mean of a periodic torque of 0.1 N m at the first joint
    mechanism = load("double").with_torque("fourier", terms=1, period=1.0)
    mechanism = mechanism.with_values({"joint1.torque.mean": 0.1})
    dofs = 2 * len(mechanism.joints)
    mean = Estimate("joint1.torque.mean", 0.1, 0.02, 0.06, 0.14, "N m", True, True, False)
    covariance = np.diag([0.02**2, *np.ones(dofs)])
    driven = replace(fit, mechanism=mechanism, parameters=(mean,), covariance=covariance, torque="fourier")
    found = torques(driven, np.arange(5) / 30.0)
    np.testing.assert_allclose(found.torque, np.tile([0.1, 0.0], (5, 1)), atol=1e-15)
    np.testing.assert_allclose(found.std, np.tile([0.02, 0.0], (5, 1)), atol=1e-15)


def test_without_a_drive_nothing_acts(fit):
    found = torques(fit, np.arange(3) / 30.0)
    assert found.torque == pytest.approx(0.0)
    assert found.std == pytest.approx(0.0)
