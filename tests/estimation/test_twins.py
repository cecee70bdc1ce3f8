"""Other parameters with the same motion: Kater's pendulum, and fits that have none."""

from dataclasses import replace

import numpy as np
import pytest

from fits import estimates
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.verdict.twins import apart, told
from monodyn.mechanism import load
from monodyn.stages import identify
from swings import motion, record

RADIUS2 = 4e-4
"""Inertia over mass [m^2]: distances whose product it is swing alike."""
TIMES = np.arange(60) / 30.0


def kater(**given: float):
    """Return a pendulum of given mass and inertia whose centre of mass is open along its length."""
    held = {"link1.length": 0.2, "link1.mass": 1.0, "link1.inertia": RADIUS2, "link1.com_y": 0.0}
    return (
        load("single")
        .with_bodies("free")
        .with_choices(
            fix={**held, "camera.roll": 0.0, **given},
            free=[] if "link1.com_x" in given else ["link1.com_x"],
            bounds={"link1.com_x": (1e-3, 1.0)},
        )
    )


@pytest.mark.parametrize("begin", [0.007, 0.06])
def test_a_pendulum_that_swings_alike_about_two_points_is_not_trusted(begin):
    truth = kater().with_values({"link1.com_x": 0.05})
    poses = record(truth, TIMES, motion(truth, TIMES, [0.5], [0.0]), noise=1e-4)
    fit = identify(poses, kater().with_values({"link1.com_x": begin}), IdentifySettings(bodies="free"))
    (other,) = fit.alternatives
    found = sorted([fit.parameter("link1.com_x").value, other["link1.com_x"]])
    np.testing.assert_allclose(found, [RADIUS2 / 0.05, 0.05], rtol=5e-3)
    assert fit.grade == "approximate"
    assert fit.status.startswith("Approximate. Other values move as close to the record: link1.com_x ")


def test_where_it_is_given_nothing_else_moves_alike():
    truth = kater(**{"link1.com_x": 0.05})
    poses = record(truth, TIMES, motion(truth, TIMES, [0.5], [0.0]), noise=1e-4)
    fit = identify(poses, truth, IdentifySettings(bodies="free"))
    assert fit.alternatives == ()
    assert fit.grade == "trusted"


def test_bounds_leave_one_of_two():
    truth = kater().with_values({"link1.com_x": 0.05})
    poses = record(truth, TIMES, motion(truth, TIMES, [0.5], [0.0]), noise=1e-4)
    bounded = truth.with_choices(bounds={"link1.com_x": (0.02, 1.0)})
    assert identify(poses, bounded, IdentifySettings(bodies="free")).alternatives == ()


def test_a_double_pendulum_has_none(fit):
    assert fit.alternatives == ()


def test_what_is_said_of_other_values(double):
    found = [
        replace(p, lower=p.value - 2.0 * p.std, upper=p.value + 2.0 * p.std)
        for p in estimates(double, {"link1.length": 0.001, "link2.length": 0.002})
    ]
    rows = {p.name: p.value for p in found}
    assert told([], found) == []
    other = {"link1.length": 2.0 * rows["link1.length"], "link2.length": 1.1 * rows["link2.length"]}
    assert [p.name for p in apart(other, found)] == ["link1.length", "link2.length"]
    assert told([other], found) == [
        f"Other values move as close to the record: link1.length {other['link1.length']:.3g} in place of "
        f"{rows['link1.length']:.3g} m and link2.length {other['link2.length']:.3g} in place of "
        f"{rows['link2.length']:.3g} m. Nothing in the record prefers either; a measured value, given with "
        "--fix, does."
    ]
    # within what the intervals leave open nothing is another mechanism
    assert apart({"link1.length": rows["link1.length"] + 0.001}, found) == []
