"""How well gravity is known, and what follows from it: intervals against fits with another gravity."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monodyn.mechanism
from driven import CART, DOUBLE, THICKNESS, simulated, started
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.verdict.gravity import GRAVITY_STD, taken_densities
from monodyn.mechanism import load
from monodyn.stages import identify
from monodyn.types import TorqueLog
from support import slow
from swings import TIMES, motion, record

GIVEN = 9.81
SAID = "Gravity in the plane of motion is taken to be 9.81 +- 0.015 m/s^2"
CASES = (
    "ratios", "given thickness", "given mass", "free bodies", "slide in a picture", "known torque",
    "known torque, given thickness",
)  # fmt: skip
QUICK = "given thickness", "slide in a picture"
VISCOUS = IdentifySettings(torque="friction")


def push(time):
    return 0.06 * np.sin(2 * np.pi * time / 2.3) + 0.05 * np.sin(9 * time + 1)


@pytest.fixture(scope="module")
def cart():
    """A record of a cart-pole, with the slide in metres."""
    return replace(simulated(CART, [0.0, 0.7], 90)[0], metric=True)


@pytest.fixture(scope="module")
def pushed():
    """A double pendulum under a torque that is known."""
    time = np.arange(-0.2, 2.5, 1 / 100)
    record, _ = simulated(DOUBLE, (0.6, -0.4), 60, lambda at: np.array([push(at), 0.0]))
    return replace(record, torques=TorqueLog(("joint1",), time, push(time)[:, None]))


@pytest.fixture(scope="module")
def cases(passive, cart, pushed, tmp_path_factory):
    """Record and start of each case."""
    folder = tmp_path_factory.mktemp("gravity")
    double, poled = started(DOUBLE, folder, 0.8), started(CART, folder, 1.0)
    picture = replace(cart, metric=False)
    found = (
        (passive[0], double),
        (passive[0], double.with_choices(fix=THICKNESS)),
        (passive[0], double.with_bodies("free").with_choices(fix={"link1.mass": 0.5})),
        (passive[0], double.with_bodies("free")),
        (picture, poled),
        (pushed, double),
        (pushed, double.with_choices(fix=THICKNESS)),
    )
    return dict(zip(CASES, found, strict=True))


def deviations(fit):
    """Return value and deviation of what is known, by name."""
    rows = (*fit.parameters, *fit.combinations)
    return {one.name: (one.value, one.std) for one in rows if 0.0 < one.std < np.inf}


def fits(case, *gravities):
    record, start = case
    return [
        identify(record, start if g is None else start.with_choices(fix={"gravity": g}), VISCOUS)
        for g in gravities
    ]


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in CASES])
def test_what_another_gravity_changes_is_in_the_interval(cases, name):
    """Whatever is known follows from gravity as fits with more of it show; the motion cannot tell it."""
    more = 1.0 + GRAVITY_STD
    taken, given, other = fits(cases[name], None, GIVEN, GIVEN * more)
    found, exact, moved = (deviations(fit) for fit in (taken, given, other))
    assert set(found) == set(exact)
    followed = 0
    for row, (value, std) in exact.items():
        assert found[row][0] == pytest.approx(value, rel=1e-6, abs=1e-3 * std), row
        change = moved[row][0] - value
        # of several deviations that are as small as rounding none tells anything
        assert found[row][1] == pytest.approx(np.hypot(std, change), rel=0.05), row
        followed += abs(change) > 0.3 * std
    assert followed >= 2
    assert any(line.startswith(SAID) for line in taken.advice)
    assert not any(line.startswith("Gravity in the plane of motion is taken") for line in given.advice)
    for one, sure in zip(taken.parameters, given.parameters, strict=True):
        if np.isfinite(sure.std):
            assert one.lower <= sure.lower + 1e-9 * abs(sure.lower)
            assert one.upper >= sure.upper - 1e-9 * abs(sure.upper)
    np.testing.assert_allclose(taken.covariance, given.covariance, rtol=1e-3, atol=1e-12)


@pytest.mark.slow
def test_a_length_that_something_else_tells_hardly_follows(cases, cart):
    record, start = cases["ratios"]
    known = start.with_choices(fix={"link1.length": 0.23})
    taken, given = fits((record, known), None, GIVEN)
    open_length = deviations(fits(cases["ratios"], None)[0])["link2.length"]
    length = deviations(taken)["link2.length"]
    assert deviations(given)["link2.length"][1] <= length[1] < open_length[1]
    metric = deviations(fits((cart, cases["slide in a picture"][1]), None)[0])["pole.com_x"]
    picture = deviations(fits(cases["slide in a picture"], None)[0])["pole.com_x"]
    assert metric[1] < picture[1]


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1e-6, 1e-7, 1e-8])
def test_an_exact_record_knows_gravity_no_better(double, noise):
    """With next to no noise gravity is all that lengths do not know."""
    exact = record(double, TIMES, motion(double, TIMES, [0.3, 0.5], [0.0, 1.0]), noise=noise)
    fit = identify(exact, double, VISCOUS)
    length = fit.parameter("link1.length")
    assert length.std == pytest.approx(GRAVITY_STD * length.value, rel=1e-3)
    assert any(line.startswith(SAID) for line in fit.advice)


def test_the_intervals_of_a_bundled_mechanism_contain_other_densities():
    """A ball of plastic on a rod of metal: its length and friction rest on that."""
    bundled = load("bob")
    filmed = bundled.with_values({"link1.sphere.density": 1800.0, "link1.density": 4000.0})
    moved = record(filmed, TIMES, motion(filmed, TIMES, [0.9], [0.0]), noise=1e-3)
    # sizes other than the length as a picture has them
    sizes = {n: v for n, v in filmed.values.items() if n.endswith("width")}
    found = identify(moved, bundled.with_choices(fix=sizes), VISCOUS)
    true = filmed.values
    for name in ("link1.length", "joint1.damping"):
        p = found.parameter(name)
        assert p.lower < true[name] < p.upper
    given = {name: bundled.values[name] for name in taken_densities(bundled)}
    assert set(given) == {"link1.density", "link1.sphere.density"}
    exact = identify(moved, bundled.with_choices(fix=sizes | given), VISCOUS)
    p = exact.parameter("link1.length")
    assert not p.lower < true["link1.length"] < p.upper
    said = (
        "Nobody has stated link1.density and link1.sphere.density: 2700 kg/m^3 is the bundled mechanism's, "
        "taken to be right within a factor of 1.6 (one standard deviation), which the intervals of lengths, "
        "masses and friction contain; --fix link1.density=VALUE link1.sphere.density=VALUE [kg/m^3] gives "
        "what they are."
    )
    assert said in found.advice
    assert not any(said.startswith("Nobody has stated") for said in exact.advice)


def test_densities_of_a_file_are_its_own(tmp_path):
    copy = tmp_path / "mine.xml"
    copy.write_text((Path(monodyn.mechanism.__file__).parent / "models" / "bob.xml").read_text())
    assert taken_densities(load(copy)) == []
    assert taken_densities(load("double")) == []


@pytest.mark.parametrize("uncertainty", ["linear", slow("profile")])
@pytest.mark.parametrize("hangs", ["0.42 0 0", "0 0 -0.42"])
def test_a_thread_that_the_file_does_not_have_is_in_the_interval(tmp_path, hangs, uncertainty):
    """A string of 0.6 g a metre makes the swing of a light ball faster; at a steel one nobody notices it."""

    def hung(mass, more=""):
        (tmp_path / "ball.xml").write_text(
            '<mujoco><worldbody><body name="b"><joint name="j" axis="0 -1 0"/>'
            f'<geom type="sphere" size="0.0082" pos="{hangs}" mass="{mass}"/>{more}'
            "</body></worldbody></mujoco>"
        )
        return load(tmp_path / "ball.xml")

    string = f'<geom name="string" type="capsule" size="0.0004" fromto="0 0 0 {hangs}" mass="{6e-4 * 0.42}"/>'
    settings = IdentifySettings(torque="friction", uncertainty=uncertainty)
    found = {}
    for mass in (0.0024, 0.3):
        truth, times = hung(mass, string), np.arange(200) / 30.0
        rest = 0.0 if hangs.startswith("0 ") else -0.5 * np.pi
        swing = record(truth, times, motion(truth, times, [rest + 0.5], [0.0]), noise=1e-3)
        fit = identify(swing, hung(mass), settings)
        found[mass] = next(p for p in fit.parameters if p.name == "b.length")
    light, heavy = found[0.0024], found[0.3]
    assert 0.01 < 1.0 - light.value / 0.42 < 4.0 * light.std / light.value
    assert heavy.value == pytest.approx(0.42, rel=2e-3)
    assert GRAVITY_STD < heavy.std / heavy.value < 1.3 * GRAVITY_STD
