"""Status and advice of the published fit, each sentence compared whole."""

from dataclasses import replace

import numpy as np
import pytest

from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import prepare
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.verdict.summary import refused
from monodyn.mechanism import load
from monodyn.paper.descent import Descent
from monodyn.paper.fit_verdict import published_advice, published_verdict
from monodyn.paper.fixed_start import FixedStart
from monodyn.paper.pose_series import PoseSeries
from monodyn.paper.torque_model import TorqueModel
from swings import TIMES, motion, record
from waves import PAPER

SWING = 0.5
"""Amplitude of the measured motion [rad]."""


def ended(torque="friction", *, frames=40, compared=None, converged=True, tried=1, error=0.0, spent=True):
    """Return where a search of a single pendulum ended that follows a swing of standard deviation one."""
    single = load("single").with_torque(torque, terms=1, period=1.0, knots=TIMES[:frames])
    position = motion(load("single"), TIMES[:frames], [SWING], [0.0])
    poses = record(load("single"), TIMES[:frames], position, noise=1e-4)
    problem = posed(single, prepare((poses,), single))
    x = problem.unknowns.x0
    target = np.where(np.arange(frames)[:, None] < (compared or frames), poses.position, np.nan)
    fixed = FixedStart(
        problem=problem, start=np.array([[SWING, 0.0]]), target=target, white=None, scale=np.ones(len(x)),
        substeps=4,
    )  # fmt: skip
    return Descent(fixed, x, np.stack((x - 1.0, x + 1.0)), 100, converged, tried, error, spent), poses


SERIES = PoseSeries(1.234567, 1.23, np.zeros((3, 1)), (1,), 0.0)
"""Poses of a little more than a period."""


def of_series(found, series=None, *, known=False) -> TorqueModel:
    """Return the torque model of what was found, with the series of its poses."""
    return TorqueModel(found.fixed.problem, series=series, known=known)


def fit_with(found, poses, rms) -> Fit:
    """Return a fit with some residual, and no parameter of which anything can be said."""
    blank = refused(found.fixed.problem, "", (poses,), 0.0)
    return replace(blank, rms={"joint1": rms}, parameters=())


@pytest.mark.parametrize(
    ("share", "case", "series", "status"),
    [
        (
            0.5, {}, None,
            "The simulated motion does not follow the record: rms residual of joint1 {amount}, 50 % of its "
            "motion; fit fewer frames, or try --identify.method fast.",
        ),
        (
            0.5, {"states": "filtered"}, SERIES,
            "The simulated motion does not follow the record: rms residual of joint1 {amount}, 50 % of its "
            "motion; compare with --identify.states measured, which do not lag, give the period, 1.235 s in "
            "the poses, with --fix torque.period=SECONDS, or try --identify.method fast.",
        ),
        (
            0.5, {"frames": 8}, None,
            "The simulated motion does not follow the record: rms residual of joint1 {amount}, 50 % of its "
            "motion; try --identify.method fast.",
        ),
        (
            0.1, {"converged": False}, None,
            "The search ended before its minimum: rms residual of joint1 {amount}, 10 % of its motion; allow "
            "more with --identify.evaluations, or try --identify.method fast.",
        ),
        (
            0.1, {"converged": False, "spent": False}, None,
            "The search ended before its minimum: rms residual of joint1 {amount}, 10 % of its motion; fix "
            "parameters, give more frames, or try --identify.method fast.",
        ),
    ],
)  # fmt: skip
def test_a_fit_that_does_not_follow(share, case, series, status):
    settings = replace(PAPER, states=case.pop("states", "measured"))
    found, _ = ended(**case)
    rms = share * float(found.fixed.problem.data.motion_size[0])
    amount = f"{np.degrees(rms):.3g} deg"
    assert published_verdict(found, {"joint1": rms}, settings, of_series(found, series)) == (
        status.format(amount=amount),
        False,
    )


def test_a_fit_that_follows():
    found, _ = ended()
    rms = {"joint1": np.radians(0.1)}
    assert published_verdict(found, rms, PAPER, of_series(found)) == (
        "Identified 3 unknowns by the published method from 40 frames, torque model friction; rms residual "
        "0.1 deg (joint1).",
        True,
    )
    few, _ = ended(compared=3)
    assert published_verdict(few, rms, PAPER, of_series(few))[0] == (
        "Identified 3 unknowns (more than there are measured values: one of many solutions) by the published "
        "method from 40 frames, torque model friction; rms residual 0.1 deg (joint1)."
    )


def test_a_record_of_less_than_a_period():
    found, _ = ended()
    rms = {"joint1": np.radians(0.1)}
    short = of_series(found, replace(SERIES, periods=0.6))
    status, ok = published_verdict(found, rms, PAPER, short)
    assert ok
    assert status == (
        "Identified 3 unknowns by the published method from 40 frames, torque model friction; rms residual "
        "0.1 deg (joint1). The frames hold 0.6 of the period of 1.235 s; its estimate requires multiple "
        "periods."
    )
    given = replace(short, known=True)
    assert "require" not in published_verdict(found, rms, PAPER, given)[0]


def test_advice_of_a_search_that_misses_and_stops_early():
    found, poses = ended(converged=False, tried=2, error=1e-3, frames=11)
    model = of_series(found, SERIES)
    rms = 0.2 * float(found.fixed.problem.data.motion_size[0])
    settings = replace(PAPER, states="filtered")
    poses = replace(poses, position=poses.position + np.radians(2.0))
    data = prepare((poses,), found.fixed.problem.mechanism)
    problem = found.fixed.problem.with_data(data)
    found = replace(found, fixed=replace(found.fixed, problem=problem))
    advice = published_advice(found, model, fit_with(found, poses, rms), (poses,), settings, ())
    assert advice[0].startswith("With 4 integration steps between time stamps")
    assert advice[1].startswith("The residual of joint1, ")
    assert advice[2:] == (
        "Bodies were taken to be uniform; if they are not, try --identify.bodies free.",
        "Dry friction was taken to be zero; --free joint1.friction estimates it.",
        "The published method holds the start state at the filtered one, whose error adds to the residual; "
        "--identify.method fast estimates it.",
        "The period of 1.235 s is that of the poses, held in the fit.",
        "The frames hold 1.2 periods, and its estimate requires multiple ones; give more frames, or the "
        "period with --fix torque.period=SECONDS.",
        "With these gains, the paper's own, the filtered states ring and errors do not die out; take a gamma "
        "below 0.05 with --identify.gains, or the other reading of eq. (6) with --identify.filter "
        "consistent.",
        "11 measured positions are few for 3 unknowns; more frames give smaller intervals.",
        "The search ended before the minimum was certain; allow more with --identify.evaluations.",
        "2 starts were tried; the best of them is reported.",
    )


def test_gains_without_effect():
    found, poses = ended()
    fit = fit_with(found, poses, 1e-4)
    settings = replace(PAPER, gains=(0.5, 0.1, 0.01))
    model = of_series(found)
    assert published_advice(found, model, fit, (poses,), settings, ()) == (
        "The gains have no effect on this fit: measured angles are compared, and the start state is the "
        "parabola through the first three samples.",
    )


def test_a_reading_of_the_filter_without_effect():
    found, poses = ended()
    fit, settings = fit_with(found, poses, 1e-4), replace(PAPER, filter="consistent")
    why = "measured angles are compared, and the start state is the parabola through the first three samples."
    for changed, what in (
        (settings, "--identify.filter consistent has"),
        (
            replace(settings, gains=(0.5, 0.1, 0.01)),
            "The gains and --identify.filter consistent have",
        ),
    ):
        advice = published_advice(found, of_series(found), fit, (poses,), changed, ())
        assert advice == (f"{what} no effect on this fit: {why}",)
    # where rates are compared the filter counts
    used = replace(settings, rates=True)
    advice = published_advice(found, of_series(found), fit, (poses,), used, ())
    assert not any("no effect" in line for line in advice)


def test_a_size_at_the_lower_bound_of_the_search():
    found, poses = ended()
    names = np.array(found.fixed.problem.unknowns.names)
    low = np.where(names == "link1.length", found.x, found.bounds[0])
    edge = replace(found, bounds=np.stack((low, found.bounds[1])))
    size = found.fixed.problem.mechanism.values["link1.length"]
    assert published_advice(edge, of_series(edge), fit_with(edge, poses, 1e-4), (poses,), PAPER, ()) == (
        f"The search ended at its own bounds: link1.length at {size:.3g} m, 1/10 of its start value; the "
        "truth may lie beyond: give nearer values in the mechanism file.",
    )


def test_advice_of_free_torques():
    found, poses = ended("free", frames=12)
    model = TorqueModel(found.fixed.problem)
    settings = replace(PAPER, torque="free")
    assert published_advice(found, model, fit_with(found, poses, 1e-4), (poses,), settings, ()) == (
        "15 unknowns and 12 measured values: free torques are underdetermined and follow the noise of the "
        "poses; there are no intervals.",
        "With free torques any sizes and masses are possible: link1.length, link1.thickness and "
        "joint1.damping are arbitrary; give measured values with --fix.",
    )


def test_advice_of_given_starts_and_of_bounds_of_the_search():
    found, poses = ended(converged=False)
    fit, settings = fit_with(found, poses, 1e-4), replace(PAPER, begin="given")
    length = np.array([name == "link1.length" for name in found.fixed.problem.unknowns.names])
    edge = replace(found, bounds=np.stack((found.bounds[0], np.where(length, found.x, found.bounds[1]))))
    size = found.fixed.problem.mechanism.values["link1.length"]
    assert published_advice(edge, of_series(edge), fit, (poses,), settings, ()) == (
        f"The search ended at its own bounds: link1.length at {size:.3g} m, 10 times its start value; the "
        "truth may lie beyond: give nearer values in the mechanism file.",
        "From the given start values the search ended short of a minimum; --identify.begin matched starts "
        "nearer.",
        "The search ended before the minimum was certain; allow more with --identify.evaluations.",
    )


@pytest.mark.parametrize(
    ("torque", "instead"),
    [
        ("friction", "fix parameters or give more frames"),
        ("fourier", "take fewer harmonics with --identify.terms or give more frames"),
        ("free", "fit fewer frames"),
    ],
)
def test_more_evaluations_are_advised_where_they_ended_the_search_alone(torque, instead):
    flat = (
        "The search ended before the minimum was certain, and more evaluations would not take it further; "
        f"{instead}."
    )
    short = "The search ended before the minimum was certain; allow more with --identify.evaluations."
    for spent, last in ((False, flat), (True, short)):
        found, poses = ended(torque, converged=False, spent=spent)
        fit, settings = fit_with(found, poses, 1e-4), replace(PAPER, torque=torque)
        advice = published_advice(found, of_series(found), fit, (poses,), settings, ())
        assert advice[-1] == last
        assert (flat in advice, short in advice) == (not spent, spent)


def test_gains_of_the_user_that_ring():
    found, poses = ended()
    fit, settings = fit_with(found, poses, 1e-4), replace(PAPER, states="filtered", gains=(0.5, 0.1, 0.1))
    assert published_advice(found, of_series(found), fit, (poses,), settings, ()) == (
        "With these gains the filtered states ring and errors do not die out; take a gamma below 0.0667 with "
        "--identify.gains, or the other reading of eq. (6) with --identify.filter consistent.",
    )


def test_a_period_at_its_bound():
    found, poses = ended()
    model = replace(of_series(found, replace(SERIES, periods=3.0)), bounded=True)
    assert published_advice(found, model, fit_with(found, poses, 1e-4), (poses,), PAPER, ()) == (
        "The period of 1.235 s, held in the fit, is a bound of torque.period: that of the poses may lie "
        "beyond; widen it with --bounds.",
    )
