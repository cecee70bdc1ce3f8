"""Sentences on a refused record: its beginning, its halves, its clock."""

from dataclasses import replace

import numpy as np
import pytest

from fits import estimates, made_fit
from monodyn.estimation.verdict import stretches
from monodyn.mechanism import load
from swings import record


def test_a_beginning_that_fits(double):
    rms = {"joint1": np.radians(0.1), "joint2": np.radians(0.25)}
    assert stretches.beginning(double, [10, 11, 12], rms) == (
        "The first 3 frames alone do fit, with rms residual 0.1 deg (joint1) and 0.25 deg (joint2): "
        "--fit-frames 10:13 for a clip, or a table that ends there. Small faults of the model grow along a "
        "long or chaotic record."
    )


def test_a_fit_within_large_noise_does_not_explain_the_motion(poses, double):
    """At most a tenth of the deviation of each joint, of a slide in metres of the identified scale."""
    deviation = poses.position.std(axis=0)

    def left(first, second):
        rms = {"joint1": first * deviation[0], "joint2": second * deviation[1]}
        return made_fit(mechanism=double, rms=rms)

    assert stretches.explained(poses, left(0.09, 0.09))
    assert not stretches.explained(poses, left(0.09, 0.11))
    cart = load("cartpole")
    swing = np.sin(np.arange(60) / 5.0)
    rolling = record(cart, np.arange(60) / 30.0, np.column_stack([swing, swing]))
    rms = {"slide": 0.15 * swing.std(), "joint1": 0.05 * swing.std()}
    assert not stretches.explained(rolling, made_fit(mechanism=cart, rms=rms, scale=1.0))
    assert stretches.explained(rolling, made_fit(mechanism=cart, rms=rms, scale=2.0))


def test_stretches_that_call_for_different_values(double):
    one, other = (
        made_fit(
            mechanism=double,
            parameters=tuple(estimates(double, {"link1.length": 1e-3, "link2.length": 1e-3})),
        )
        for _ in range(2)
    )
    assert stretches.disagreeing(one, other) == []
    rows = [
        replace(row, value=1.3 * row.value) if row.name == "link2.length" else row for row in other.parameters
    ]
    apart = stretches.disagreeing(one, replace(other, parameters=tuple(rows)))
    assert [(a.name, b.value / a.value) for a, b in apart] == [("link2.length", pytest.approx(1.3))]
    before = double.values["link2.length"]
    assert stretches.disagreement(40, apart) == (
        "The first 40 frames alone do fit, but their halves call for different values (link2.length "
        f"{before:.3g} and {1.3 * before:.3g} m): a shorter record would hide the fault; check that the "
        "mechanism is the one in the record, and of a clip that its outline lies where it should "
        "(diagnosis.png)."
    )
    # within the intervals, or by less than two per cent, they agree
    near = [replace(row, value=1.01 * row.value) for row in one.parameters]
    assert stretches.disagreeing(one, replace(one, parameters=tuple(near))) == []
    wide = [replace(row, value=2.0 * row.value, std=row.value) for row in one.parameters]
    assert stretches.disagreeing(one, replace(one, parameters=tuple(wide))) == []


def test_a_rate_that_fits_gravity_and_length():
    assert stretches.other_rate(0.25, 120.0, ["link1.length", "link2.length"]) == (
        "Gravity and link1.length and link2.length, as given, contradict the time stamps; the motion fits at "
        "120 samples a second (time_scale 0.25). Give the true rate (--rate for a clip, --free time_scale "
        "for a table), or correct the length."
    )
