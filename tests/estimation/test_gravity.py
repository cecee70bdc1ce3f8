"""How well gravity is known, and every length with it."""

import numpy as np
import pytest

from driven import DOUBLE, THICKNESS, started
from monodyn.estimation.verdict.gravity import GRAVITY_STD
from monodyn.stages import identify


@pytest.fixture(scope="module")
def double_of(passive, tmp_path_factory):
    """Identify a record with some choices."""
    start = started(DOUBLE, tmp_path_factory.mktemp("gravity"), 0.5)

    def found(free=(), **fix):
        return identify(passive[0], start.with_choices(fix=fix, free=free))

    return found


def test_a_length_is_known_no_better_than_gravity(double_of):
    """What gravity of another value changes is what its interval gets; the given one is exact."""
    taken, given = double_of(), double_of(gravity=9.81)
    other = double_of(gravity=9.81 * (1.0 + GRAVITY_STD))
    for name in ("link1.length", "link2.length", "link1.com_x"):
        one, exact = taken.parameter(name), given.parameter(name)
        moved = other.parameter(name).value - exact.value
        assert moved == pytest.approx(GRAVITY_STD * exact.value, rel=0.02)
        assert one.value == pytest.approx(exact.value, rel=1e-9)
        assert one.std == pytest.approx(np.hypot(exact.std, moved), rel=1e-3)
        assert one.lower < exact.lower
        assert one.upper > exact.upper


def test_what_is_relative_to_masses_or_not_known_stays(double_of):
    taken, given = double_of(), double_of(gravity=9.81)
    for one, exact in zip(taken.combinations, given.combinations, strict=True):
        assert one.std == pytest.approx(exact.std, rel=1e-6)
    assert np.isinf(taken.parameter("link1.thickness").std)
    np.testing.assert_allclose(taken.covariance, given.covariance, rtol=1e-6)


def test_masses_that_a_thickness_fixes_follow_it_too(double_of):
    """A damping is a mass times the square of a length, and the mass grows with an area: the fourth power."""
    one, exact, other = (
        double_of(**THICKNESS, **more)
        for more in ({}, {"gravity": 9.81}, {"gravity": 9.81 * (1.0 + GRAVITY_STD)})
    )
    name = "joint1.damping"
    moved = other.parameter(name).value - exact.parameter(name).value
    assert moved == pytest.approx(4.0 * GRAVITY_STD * exact.parameter(name).value, rel=0.05)
    assert one.parameter(name).std == pytest.approx(np.hypot(exact.parameter(name).std, moved), rel=0.05)


def test_a_given_length_or_an_open_clock_leaves_gravity_nothing_to_tell(double_of):
    one, exact = double_of(**{"link1.length": 0.23}), double_of(**{"link1.length": 0.23}, gravity=9.81)
    assert one.parameter("link2.length").std == pytest.approx(exact.parameter("link2.length").std)
    one, exact = double_of(free=["time_scale"]), double_of(free=["time_scale"], gravity=9.81)
    assert one.parameter("link1.length").std == exact.parameter("link1.length").std
