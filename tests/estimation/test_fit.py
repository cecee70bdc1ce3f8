"""What an identification returns: its parts fit together, and it says what is not in it."""

import numpy as np
import pytest

from monodyn.errors import FitError
from monodyn.stages import identify
from support import refuses


def test_a_parameter_that_is_not_there(fit):
    first, rest = fit.parameters[:12], len(fit.parameters) - 12
    names = ", ".join(f"'{estimate.name}'" for estimate in first)
    with refuses(FitError, f"parameter 'x' is not in the fit; parameters: {names} and {rest} more."):
        fit.parameter("x")


def test_names_follow_from_parameters_and_starts(fit, poses, double):
    assert fit.shared == tuple(p.name for p in fit.parameters if p.free)
    assert fit.names[: len(fit.shared)] == fit.shared
    assert fit.names[len(fit.shared) :] == (
        "record0.joint1", "record0.joint2", "record0.joint1_vel", "record0.joint2_vel"
    )  # fmt: skip
    assert fit.covariance.shape == (len(fit.names),) * 2
    refused = identify(poses[:4], double)
    assert refused.names == refused.shared == ()


@pytest.mark.slow
def test_parts_of_the_covariance(double, poses):
    fit = identify([poses, poses[5:60]], double)
    count = len(fit.shared)
    np.testing.assert_array_equal(fit.shared_covariance, fit.covariance[:count, :count])
    for record in (0, 1):
        part = fit.motion_covariance(record)
        np.testing.assert_array_equal(part[:count, :count], fit.shared_covariance)
        np.testing.assert_array_equal(part[count:, count:], fit.starts[record].covariance)


@pytest.mark.parametrize("name", ["link1.length", "joint2.damping"])
def test_directions_move_what_is_tied_along(fit, name):
    """Against a central difference: a length carries its width, tail and tip with it."""
    at, value, step = fit.shared.index(name), fit.mechanism.values[name], 1e-7
    ends = []
    for sign in (1.0, -1.0):
        moved = {name: value + sign * step}
        for size, length in fit.tied:
            if length == name:
                moved[size] = fit.mechanism.values[size] * moved[name] / value
        ends.append(fit.mechanism.with_values(moved).tree.links)
    slope = (ends[0] - ends[1]) / (2.0 * step)
    # the step is good to 1e-7 of the largest entry
    np.testing.assert_allclose(
        fit.directions().links[:, :, at], slope, rtol=0, atol=1e-6 * np.abs(slope).max()
    )
