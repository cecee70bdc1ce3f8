"""What was found, in a sentence: sizes and friction as they are known."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fits import made_fit
from monodyn.estimation.fit import Doubt, Estimate
from monodyn.estimation.parts import Combination
from monodyn.mechanism import load
from monodyn.numbers import plus_minus
from monodyn.results.summary import meanings, summary


def length(name: str, value: float, half: float) -> Estimate:
    return Estimate(name, value, half / 1.96, value - half, value + half, "m", True, half < value, False)


@pytest.mark.parametrize(
    ("value", "half", "said"),
    [
        (24.001, 0.08, "24.00 ± 0.08"),
        (0.46497, 0.00191, "0.4650 ± 0.0019"),
        (1271.4, 35.4, "1271 ± 35"),
        (1271.4, 36.0, "1271 ± 36"),
        (-0.5, 0.3, "−0.50 ± 0.30"),
        (9.81, 0.0, "9.81"),
    ],
)
def test_a_number_has_the_digits_that_half_its_interval_leaves(value: float, half: float, said: str) -> None:
    assert plus_minus(value, half) == said


def test_links_are_counted_and_friction_stands_over_the_inertia_that_it_brakes() -> None:
    rows = (length("link1.length", 0.24001, 8e-4), length("link2.length", 0.20417, 7.7e-4))
    ratios = (
        Combination("joint1.damping / link1.J", 0.13603, 4e-4, 0.13523, 0.13683, "1/s"),
        Combination("joint1.damping / link2.J", 0.93, 4e-3, 0.92, 0.94, "1/s"),
        Combination("joint2.damping / link2.J", 0.46497, 9e-4, 0.46306, 0.46688, "1/s"),
        Combination("joint2.friction / link2.J", 0.1, 0.01, 0.08, 0.12, "1/s^2"),
    )
    fit = made_fit(mechanism=load("double"), parameters=rows, combinations=ratios)
    assert summary(fit) == (
        "Two links, 24.00 ± 0.08 cm and 20.42 ± 0.08 cm; damping over inertia 0.1360 ± 0.0008 1/s at joint1 "
        "and 0.4650 ± 0.0019 1/s at joint2; dry friction over inertia 0.100 ± 0.020 1/s^2 at joint2 (95 %)."
    )
    # of a refused fit there is nothing to say
    assert summary(fit.doubted([Doubt("refused", "No.")])) == ""


def test_slides_unknown_lengths_and_masses_that_are_known() -> None:
    damping = Estimate("slide.damping", 0.04, 1e-3, 0.038, 0.042, "N s/m", True, True, False)
    fit = made_fit(mechanism=load("cartpole"), parameters=(damping,), combinations=())
    assert summary(fit) == (
        "One slide and one link of unknown length; damping 0.0400 ± 0.0020 N s/m at slide (95 %)."
    )
    wide = length("link2.length", 0.2, math.inf)
    period = Estimate("torque.period", 1.25, 1e-3, 1.248, 1.252, "s", True, True, False)
    rows = (length("link1.length", 1.2, 0.01), wide, length("link3.length", 0.005, 1e-4), period)
    ratio = Combination("slide.damping / cart.M", 0.1431, 1e-3, 0.14, 0.146, "1/s")
    assert summary(made_fit(mechanism=load("triple"), parameters=rows, combinations=(ratio,))) == (
        "Three links, 1.200 ± 0.010 m, one of unknown length and 5.00 ± 0.10 mm; a torque repeats every "
        "1.2500 ± 0.0020 s (95 %)."
    )
    given = replace(length("link1.length", 0.3, 0.1), std=0.0, lower=0.3, upper=0.3, free=False)
    cart = made_fit(mechanism=load("cartpole"), parameters=(given,), combinations=(ratio,))
    assert summary(cart) == (
        "One slide and one link, 30 cm; damping over mass 0.1431 ± 0.0030 1/s at slide (95 %)."
    )


def test_every_kind_of_parameter_has_a_meaning() -> None:
    kinds = {p.kind for name in ("triple", "bob", "ball", "cartpole") for p in load(name).parameters}
    assert kinds <= set(meanings()["parameters"])
