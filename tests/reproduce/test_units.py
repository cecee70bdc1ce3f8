"""How joints are shown."""

from __future__ import annotations

import pytest

from monodyn.mechanism import load
from monodyn.reproduce.units import shared_unit, units_of


def test_hinges_are_shown_in_degrees_and_slides_in_millimetres() -> None:
    slide, hinge = units_of(load("cartpole").joints)
    assert (slide.symbol, slide.unit, slide.sign, slide.factor) == ("s1", "mm", " mm", 1000.0)
    assert (hinge.symbol, hinge.unit, hinge.sign) == ("θ2", "deg", "°")
    assert hinge.factor == pytest.approx(57.29578)
    assert shared_unit((slide, hinge)) == ""
    assert shared_unit(units_of(load("double").joints)) == "deg"
