"""Which parameters are unknowns, and the picture's information about them."""

import numpy as np
import pytest

from monodyn.estimation.shooting.unknowns import assumed_sizes, choose_unknowns
from monodyn.estimation.torque.friction import led
from monodyn.mechanism import Measured
from monodyn.stages import identify
from swings import SIZES


def test_a_size_the_picture_hardly_knows_is_near_its_proportion(poses, double):
    """Known to a quarter or better counts as measured; motion alone would trade a tail for a thickness."""
    sizes = ("link1.length", "link2.length", "link1.tail", "link2.tail")
    information = np.zeros((4, 4))
    information[:2, :2] = [[100.0, -100.0], [-100.0, 100.0]]
    information[2, 2], information[3, 3] = 15.0, 400.0
    found = identify(poses, double.with_measured(Measured(sizes, information)))
    hardly, well = found.parameter("link1.tail"), found.parameter("link2.tail")
    assert hardly.free
    assert 0.25 > hardly.std / hardly.value > 2.0 * well.std / well.value
    assert any(line.startswith("Neither a picture nor this motion determines link1") for line in found.advice)


def test_the_intervals_of_lengths_contain_other_proportions(poses, double, fit, truth):
    """With ends that reach half as far again, about one standard deviation, a length comes out elsewhere."""
    longer = double.with_values({name: 1.5 * double.values[name] for name in ("link1.tip", "link2.tail")})
    other = identify(poses, longer)
    exact = {n: v for n, v in truth.values.items() if n.split(".")[-1] in SIZES[1:]}
    known = identify(poses, double.with_choices(fix=exact))
    for name in ("link1.length", "link2.length"):
        one, two = fit.parameter(name), other.parameter(name)
        assert abs(np.log(one.value / two.value)) < 1.5 * one.std / one.value
    # the coupling of the two bodies shows the first length, only the inertia shows the other
    assert fit.parameter("link2.length").std > 2.0 * known.parameter("link2.length").std
    assert set(known.names) < set(fit.names)


def test_a_search_holds_proportions(double):
    unknowns = choose_unknowns(double)
    assert "link1.width" in unknowns.tied
    assert set(unknowns.names) | set(unknowns.tied) >= {p.name for p in assumed_sizes(double)}
    assert [p.name for p in assumed_sizes(double)] == [
        "link1.tail", "link1.tip", "link1.width", "link2.tail", "link2.width"
    ]  # fmt: skip
    assert assumed_sizes(double.with_bodies("free")) == []


LEADS = ("joint1.lead", "joint2.lead")


@pytest.mark.parametrize(
    ("starts", "name", "expected"),
    [((0.0, 0.0), "joint1.lead", (0.003, 0.003)), ((0.0, 0.002), "joint2.lead", (0.0, 0.003))],
)
def test_leads_that_begin_at_zero_keep_their_proportion(double, starts, name, expected):
    ended = led(double, LEADS).with_values(dict(zip(LEADS, starts, strict=True)))
    unknowns = choose_unknowns(ended)
    at = unknowns.x0.copy()
    at[unknowns.names.index(name)] = 0.003
    values = unknowns.named(at)
    assert (values[LEADS[0]], values[LEADS[1]]) == pytest.approx(expected)


def seen(mechanism, information):
    sizes = ("link1.length", "link2.length")
    given = {p.name: p.value for p in assumed_sizes(mechanism)}
    return mechanism.with_measured(Measured(sizes, np.array(information))).with_choices(fix=given)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e5, 1e12])
def test_negative_information_of_sizes_is_left_out_and_said(poses, double, fit, size):
    """Eigenvalues 3 and -1: what is below zero would reward sizes for running away."""
    found = identify(poses, seen(double, size * np.array([[1.0, -2.0], [-2.0, 1.0]])))
    assert all(np.isfinite(p.value) for p in found.parameters)
    assert (
        "The picture's information about the sizes contradicts itself (its matrix is negative in some "
        "direction); that part was left out, so that the motion alone determines the sizes there."
    ) in found.advice
    only = identify(poses, seen(double, size * np.array([[1.5, -1.5], [-1.5, 1.5]])))
    assert found.ok == only.ok
    np.testing.assert_allclose(
        [p.value for p in found.parameters], [p.value for p in only.parameters], rtol=1e-6
    )  # the search stops within 1e-9 of the cost


@pytest.mark.slow
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_information_that_is_no_number_is_a_status(poses, double, value):
    found = identify(poses, seen(double, [[1e4, -1e4], [-1e4, value]]))
    assert not found.ok
    assert found.status == (
        "The picture's information about link2.length is not finite; locate the mechanism in a clearer "
        "part of the clip, or give measured values with --fix."
    )
    assert all(np.isfinite(p.value) for p in found.parameters)
    length = double.values["link2.length"]
    known = seen(double, [[1e4, -1e4], [-1e4, value]]).with_choices(fix={"link2.length": length})
    assert np.isfinite(identify(poses, known).parameter("link1.length").value)
