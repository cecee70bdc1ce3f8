"""Sentences of advice, each compared whole."""

from dataclasses import replace

import numpy as np
import pytest

from fits import estimates
from monodyn.estimation.fit import Estimate
from monodyn.estimation.verdict import advice, undetermined
from monodyn.estimation.verdict.uncertainty import NoiseFactors
from monodyn.mechanism import load
from monodyn.mechanism.bundled import chain
from monodyn.stages import identify

LIVELY = "a longer record or a livelier motion would help."


def test_masses_without_a_scale(double):
    found = estimates(double, {"link1.thickness": np.inf, "joint1.damping": np.inf, "link1.length": 0.001})
    assert undetermined.open_parameters(double, found, ()) == [
        "The motion fixes link1.thickness and joint1.damping only in ratios (see the combinations); one of "
        "them, measured and given with --fix, fixes the mass scale."
    ]


def test_inertias_of_free_bodies(double):
    free = double.with_bodies("free")
    found = estimates(free, {"link1.mass": np.inf, "link1.com_x": np.inf, "link1.inertia": np.inf})
    assert undetermined.open_parameters(free, found, ()) == [
        "Planar motion fixes how the inertias of free bodies act together (see the combinations), not "
        "link1.mass, link1.inertia and link1.com_x one by one; measured masses and centres of mass, given "
        "with --fix, would fix the rest."
    ]


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (
            ("link1.length", "gravity"),
            "The data do not fix link1.length and gravity one by one; a measured length, or known values of "
            "gravity and of the time scale, given with --fix, would fix them.",
        ),
        (
            ("gravity", "time_scale"),
            "The data do not fix gravity and time_scale one by one; the true frame rate (--rate for a clip, "
            "or --fix time_scale=VALUE) or the value of gravity would fix the rest.",
        ),
        (
            ("link1.length", "gravity", "time_scale"),
            "The data do not fix link1.length, gravity and time_scale one by one: lengths are only known up "
            "to the time scale (see the combinations). Two of these would fix them: a measured length, the "
            "value of gravity, the true frame rate (--rate for a clip, or --fix time_scale=VALUE).",
        ),
    ],
)
def test_lengths_that_are_open(double, names, sentence):
    assert undetermined.open_parameters(double, estimates(double, dict.fromkeys(names, np.inf)), ()) == [
        sentence
    ]


def test_what_has_no_effect_and_what_is_hardly_known(double):
    found = estimates(double, {"link2.density": np.inf, "link1.length": 10.0})
    assert undetermined.open_parameters(double, found, ("link2.density",)) == [
        "link2.density does not change the motion, which cannot determine it.",
        f"The data hardly fix link1.length: the error is as large as the value; {LIVELY}",
    ]
    damping = estimates(double, {"joint1.damping": 10.0})
    assert undetermined.open_parameters(double, damping, (), (), ["joint1.damping"]) == [
        "The data show joint1.damping against the inertias (see the combinations), and hardly by itself: no "
        "longer record would, but a measured mass, density or thickness, given with --fix."
    ]
    two = undetermined.open_parameters(double, [], ("link1.density", "link2.density"))
    assert two == ["link1.density and link2.density do not change the motion, which cannot determine them."]


def test_bounds_that_were_met(double):
    still = double.with_values({"joint1.damping": 0.0})
    found = estimates(still, {"joint1.damping": 0.1, "link1.length": 0.1}, bound=still.values)
    assert undetermined.nothing_seen(found) == [
        "joint1.damping came out as zero, the smallest value allowed: too small to be seen."
    ]
    assert advice.bounds_met(found) == [
        "link1.length ended on a bound; widen the bound or check the mechanism file."
    ]
    assert undetermined.nothing_seen(found[1:]) == []
    assert advice.bounds_met(found[:1]) == []
    # of one that the data leave open any value will do, that of a bound too
    loose = estimates(still, {"link1.length": np.inf}, bound=still.values)
    assert loose[0].at_bound
    assert advice.bounds_met(loose) == []


def test_residuals_above_the_noise_and_what_may_be_the_reason():
    cart = load("cartpole")
    slide, hinge = (joint.name for joint in cart.joints)
    noise = NoiseFactors(np.array([4.0, 12.34]), np.array([1.0, 2.0]))
    rms = {slide: 0.00123, hinge: np.radians(2.0)}
    assert advice.misfit(cart, rms, noise, advice.Assumed(True, ["a.friction", "b.friction"], True)) == [
        f"The residual of {slide}, 1.23 mm, is 4 times the noise of its samples: the record is less exact "
        "than these suggest; the intervals are widened accordingly.",
        f"The residual of {hinge}, 2 deg, is 12.3 times the noise of its samples and changes slowly: the "
        "model lacks something, or the record is less exact than these suggest; the intervals are widened "
        "accordingly.",
        "Bodies were taken to be uniform; if they are not, try --identify.bodies free.",
        "Dry friction was taken to be zero; --free a.friction b.friction estimates it.",
        "Gravity was taken to act straight down where the angles are measured; where it does not (a camera "
        "out of level, the zero of an encoder), --free camera.roll estimates the tilt and --fix "
        "camera.roll=VALUE [rad] gives it (positive turns the picture of the mechanism clockwise).",
    ]
    # noise that does not change slowly is no fault of the model
    white = NoiseFactors(noise.size, np.ones(2))
    assert len(advice.misfit(cart, rms, white, advice.Assumed(True, ["a.friction"], True))) == 2
    fine = NoiseFactors(np.ones(2), np.ones(2))
    assert advice.misfit(cart, rms, fine, advice.Assumed(True, ["a.friction"], True)) == []


def test_stamps_that_are_off():
    assert advice.stamps(0.0) == []
    assert advice.stamps(0.00213) == [
        "The residuals grow with the rate of the motion, as if the time stamps were off by about 2.1 ms from "
        "picture to picture. The intervals take that into account."
    ]


def test_what_free_torques_rest_on(double):
    after = "No torque is known after the fitted frames: a prediction goes on without any."
    assert advice.free_torques(double) == [
        "Any sizes and masses explain a motion together with free torques: they were held at values that "
        "explain most of it without (link1.length, link1.thickness, link2.length and link2.thickness), and "
        "the torques are in proportion to them; give measured values with --fix.",
        after,
    ]
    known = double.with_choices(fix={p.name: p.value for p in double.parameters if p.free})
    assert advice.free_torques(known) == [after]


def test_an_integration_bound_that_is_not_kept():
    assert advice.integration(64, 0.00123, 1e-5) == [
        "With 64 integration steps between time stamps, the most there are, the motion is exact to 0.0012 "
        "rad (m for slides) and not to the required 1e-05; fit a shorter record, or give a larger "
        "--identify.error-bound if that is exact enough."
    ]
    assert advice.integration(4, 1e-6, 1e-5) == []


def test_joint_limits_are_said(poses, double):
    narrow = replace(double, joints=(replace(double.joints[0], lower=-1.0, upper=1.0), double.joints[1]))
    fit = identify(poses, narrow)
    assert (
        "The motion takes joint1 past its limits, -57.3 deg to 57.3 deg; stops are not simulated, so leave "
        "out the frames in which it touches them."
    ) in fit.advice


def test_lengths_rest_on_the_clock(double):
    real = (
        "Lengths follow from gravity and take the time stamps for real time: in a clip k times slower than "
        "life they come out k^2 times too long."
    )
    length = {"link1.length": 0.1}
    assert advice.clock(double, estimates(double, length)) == [real]
    assert advice.clock(double, estimates(double, length | {"time_scale": np.inf})) == [real]
    assert advice.clock(double, estimates(double, length | {"time_scale": 0.1})) == []
    assert advice.clock(double, estimates(double, {"link1.thickness": 0.1})) == []


def test_a_file_without_weight_is_said(double, tmp_path):
    file = tmp_path / "flat.xml"
    file.write_text(chain(2).replace('axis="0 -1 0"', 'axis="0 0 1"'))
    flat = load(file)
    assert advice.without_weight(flat) == [
        "In this mechanism file no gravity acts in the plane of motion: its hinges turn about the vertical, "
        'as on a table, or gravity is off. If it hangs or stands, state level axes, as axis="0 1 0", and '
        "gravity."
    ]
    assert advice.clock(flat, estimates(flat, {"link1.length": 0.1})) == []
    assert advice.without_weight(double) == []
    assert advice.without_weight(flat.with_choices(free=["gravity"])) == []


def test_gravity_that_is_taken_from_the_file_is_said(double):
    assert advice.taken_gravity(double) == [
        "Gravity in the plane of motion is taken to be 9.81 +- 0.015 m/s^2, which the intervals of what "
        "follows from it contain; --fix gravity=VALUE [m/s^2] gives that of the place exactly."
    ]


def test_values_without_use():
    assert undetermined.without_use(["link1.thickness"]) == [
        "link1.thickness was given, but the motion of this mechanism does not depend on it: its file states "
        "masses; give those."
    ]
    assert undetermined.without_use(["link1.thickness", "link2.thickness"]) == [
        "link1.thickness and link2.thickness were given, but the motion of this mechanism does not depend on "
        "them: its file states masses; give those."
    ]


def test_samples_starts_and_the_end_of_the_search():
    two = ["2 of 50 samples were left out as gross errors (frame 7 and 9)."]
    assert advice.outliers(50, 2, [7, 9]) == two
    assert advice.outliers(1, 1, []) == ["1 of 1 sample was left out as gross errors."]
    assert advice.few(20, 6) == [
        "20 measured positions are few for 6 unknowns; more frames give smaller intervals."
    ]
    assert advice.few(24, 6) == []
    assert advice.search_end(False) == [
        "The search ended before the minimum was certain; allow more with --identify.evaluations."
    ]
    assert advice.search_end(True) == []
    assert advice.starts_tried(3) == ["3 starts were tried; the best of them is reported."]
    assert advice.starts_tried(1) == []


def test_zero_frictions_are_those_not_estimated(double):
    from monodyn.estimation.shooting.unknowns import choose_unknowns

    freed = double.with_choices(free=["joint2.friction"])
    assert advice.zero_frictions(freed, choose_unknowns(freed)) == ["joint1.friction"]


def test_friction_that_turns_ahead(double):
    from monodyn.estimation.shooting.unknowns import choose_unknowns

    led = double.with_values({"joint1.lead": 0.0095})
    assert advice.turning_ahead(led, choose_unknowns(led)) == []
    freed = led.with_choices(free=["joint1.lead"])
    assert advice.turning_ahead(freed, choose_unknowns(freed)) == [
        "Dry friction turns ahead of the rate, by 9.5 ms (joint1.lead): so does the soft constraint of a "
        "simulator (of MuJoCo, by half of solreffriction, about 10 ms unless a file says otherwise), but no "
        "bearing. In a record of a real mechanism it stands for something else that acts where the motion "
        "reverses."
    ]


def test_records_that_share_a_roll():
    assert advice.one_roll(1) == []
    assert advice.one_roll(2) == [
        "One camera.roll was taken for all 2 records: where the camera was turned otherwise in one of them, "
        "its angles against gravity are off by the difference, which no interval contains. Positions against "
        "gravity (poses.csv of a run of each clip by itself) have no roll in common."
    ]


def test_a_tilt_that_is_large_or_hardly_known():
    def told(value, std, free=True):
        return advice.tilt([Estimate("camera.roll", value, std, -9.0, 9.0, "rad", free, True, False)])

    assert told(np.radians(7.0), 1e-4) == []
    assert told(np.radians(20.0), 1e-4, free=False) == []
    assert told(np.radians(-13.5), 1e-4) == [
        "Gravity acts 13.5 deg from straight down in the picture, more than a camera is usually out of "
        "level: if it was not, the mechanism file is not that of the clip, or the clip is turned; --fix "
        "camera.roll=0 holds the camera level."
    ]
    assert "hardly determines camera.roll" in told(np.radians(20.0), np.radians(2.0))[0]
