"""The optimum as a fit, or the reason why there is none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from models import GEOM, HINGE, body_with, mjcf, read
from monodyn.estimation.record.samples import Pieces, prepare
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.shooting.trial import Trial
from monodyn.estimation.torque.task import TorqueSolution
from monodyn.estimation.verdict.summary import _hardly_scaled, _scale_alone, _undetermined, summarize
from monodyn.mechanism import Measured, load
from swings import motion, record, white


def test_a_start_that_cannot_be_simulated_is_a_status(poses, double):
    problem = posed(double, prepare([poses], double))
    trial = Trial(problem.unknowns.x0, np.zeros((1, 4)), Pieces(np.array([0, 60]), np.array([0])))
    lost = Optimum(trial, np.zeros((60, 2)), np.inf, np.inf, 1, False, np.zeros(len(trial.x), dtype=bool))
    solution = TorqueSolution(problem, lost, advice=("Said before.",))
    fit = summarize(solution, (poses,), IdentifySettings(), 0.0)
    assert not fit.ok
    assert fit.status == (
        "The motion of the start cannot be simulated through the record; check the mechanism file and that "
        "its joints turn as in the record."
    )
    assert fit.advice == ("Said before.",)
    assert fit.mechanism is double
    assert fit.starts == fit.names == ()
    assert all(np.isnan(value) for value in fit.rms.values())


def test_a_reason_becomes_the_status(poses, double):
    problem = posed(double, prepare([poses], double))
    fit = summarize(TorqueSolution(problem, None, reason="Not today."), (poses,), IdentifySettings(), 0.0)
    assert (fit.ok, fit.status, fit.evaluations) == (False, "Not today.", 0)
    free = {p.name for p in fit.parameters if p.free}
    assert free == set(problem.unknowns.names)
    assert all(np.isinf(p.std) for p in fit.parameters if p.free)


def test_residuals_stay_in_the_rows_of_their_tables(poses, double):
    from monodyn.stages import identify

    seen = poses.seen.copy()
    seen[[0, 1, 30]] = False
    fit = identify([replace(poses, seen=seen), poses[10:50]], double, IdentifySettings(starts=1))
    assert [len(table) for table in fit.residual] == [60, 40]
    np.testing.assert_array_equal(np.isfinite(fit.residual[0][:, 0]), seen)
    assert np.isfinite(fit.residual[1]).all()


def test_a_motion_that_only_one_number_of_steps_follows_is_not_trusted():
    from monodyn.stages import identify

    single, times = load("single"), np.arange(90) / 30.0
    values = single.values
    # damping / inertia is the rate at which a motion decays; the method of order 4 is stable below
    # 2.79 / step: with 64 steps a frame, not with 32
    rate, per_mass = 4000.0, values["link1.inertia"] / values["link1.mass"] + values["link1.com_x"] ** 2
    pull = values["gravity"] * values["link1.com_x"] / per_mass / rate
    # the overdamped pendulum falls by q' = -pull cos q, which has a closed form
    creep = 2.0 * np.arctan(np.tanh(0.5 * (np.arcsinh(np.tan(0.3)) - pull * times)))
    known = {name: values[name] for name in ("link1.length", "link1.width", "link1.thickness")}
    stiff = single.with_choices(fix={"joint1.damping": rate * per_mass * values["link1.mass"], **known})
    found = identify(record(stiff, times, creep[:, None], noise=1e-4), stiff, IdentifySettings(starts=1))
    assert max(found.rms.values()) < 1e-3
    assert not found.ok
    assert found.status == (
        "The identified mechanism cannot be simulated: with as many integration steps as there may be its "
        "motion still grows beyond all bounds, as with a joint that is damped so much that it hardly turns; "
        "check that the mechanism is the one in the record, without joints that it has not."
    )


def test_a_length_at_the_limit_of_what_is_tried_is_not_trusted():
    from monodyn.stages import identify

    single = load("single")
    times = 0.1 * np.arange(120)
    # a rod of 1200 times the length in the file would swing as slowly: sqrt(1.5 g / L)
    rate = np.sqrt(1.5 * 9.81 / (1200.0 * single.values["link1.length"]))
    slow = record(single, times, (-0.5 * np.pi + 0.1 * np.sin(rate * times))[:, None], noise=5e-3)
    found = identify(slow, single, IdentifySettings(starts=1))
    assert not found.ok
    assert found.status == (
        "link1.length ended at the limit of what is tried: the motion is not that of the mechanism, or does "
        "not determine its size; check the mechanism file, or set the limits with --bounds."
    )
    wider = single.with_choices(bounds={"link1.length": (0.01, 1e4)})
    assert identify(slow, wider, IdentifySettings(starts=1)).ok


def test_a_length_as_uncertain_as_its_value_is_not_trusted():
    from monodyn.stages import identify

    single, times = load("single"), np.arange(60) / 30.0
    # a pendulum that creeps shows its damping over its length, and neither alone
    creep = record(single, times, (-0.5 * np.pi + 0.5 * np.exp(-times))[:, None], noise=5e-3)
    found = identify(creep, single, IdentifySettings(starts=1))
    assert not found.ok
    assert found.status == (
        "The motion does not determine link1.length: the error is as large as the value. A longer record or "
        "a livelier motion would help, or a measured length, given with --fix."
    )
    known = single.with_choices(fix={"link1.length": single.values["link1.length"]})
    assert identify(creep, known, IdentifySettings(starts=1)).ok


def test_a_length_of_a_body_that_slides_on_one_that_turns_may_not(tmp_path):
    slide = '<joint name="s" type="slide" axis="1 0 0"/>'
    inner = f'<body name="bead" pos="0.05 0 0">{slide}{GEOM}</body>'
    mechanism = read(tmp_path, mjcf(body_with(HINGE, inner)))
    lengths = ("a.length", "bead.length")
    hardly = [SimpleNamespace(name=name, free=True, std=1.0, identifiable=False) for name in lengths]
    assert _undetermined(SimpleNamespace(parameters=hardly), mechanism) == list(lengths)  # pyright: ignore[reportArgumentType]


def test_a_scale_that_is_hardly_seen_is_said_and_no_reason_to_refuse(fit):
    """Lengths that are wrong by one factor are in the ratio that they have."""
    names = ["link1.length", "link2.length"]
    at = [fit.shared.index(name) for name in names]
    values = np.array([fit.parameter(name).value for name in names])
    parameters = tuple(replace(p, identifiable=p.name not in names) for p in fit.parameters)
    covariance = np.zeros_like(fit.covariance)
    covariance[np.ix_(at, at)] = 1.2**2 * np.outer(values, values)
    open_scale = replace(fit, parameters=parameters, covariance=covariance)
    assert _scale_alone(open_scale, names)
    assert not _scale_alone(open_scale, names[:1])
    assert _hardly_scaled(open_scale, fit.mechanism) == [
        "The motion hardly shows how large link1.length and link2.length are, each uncertain by as much as "
        "its value, and well what ratio they are in; a measured length, given with --fix, fixes the scale."
    ]
    assert not _hardly_scaled(fit, fit.mechanism)
    covariance[at[1], at[1]] += (0.2 * values[1]) ** 2
    assert not _scale_alone(open_scale, names)


@pytest.mark.slow
def test_a_length_of_a_body_that_never_turns_may_be_unknown():
    from monodyn.stages import identify

    cart, times = load("cartpole"), np.arange(60) / 30.0
    sizes = ("cart.length", "link1.length")
    # the pictures know the cart's length within a factor of 4, and the rod's within a thousandth
    cart = cart.with_measured(Measured(sizes, np.diag([1.4**-2, 1e6])))
    swung = motion(cart, times, [0.1, 0.8], [0.2, 0.0])
    found = identify(white(("slide", "joint1"), times, swung, 1e-4), cart, IdentifySettings(starts=1))
    length = found.parameter("cart.length")
    assert np.isfinite(length.std)
    assert not length.identifiable
    assert found.ok
