"""Numbers as they are written for people."""

from __future__ import annotations

import math

from monodyn.numbers import interval, is_whole, number, short


def test_numbers_keep_the_digits_that_their_deviation_leaves() -> None:
    assert number(0.2345678, 0.0012) == "0.2346"
    assert number(-123.456, 10.0) == "−123"
    assert number(0.2345678) == "0.23457"
    assert number(math.inf) == "∞"
    assert number(None) == "unknown"
    assert short(0.0012345) == "0.0012"
    assert short(math.inf) == "∞"
    assert number(-math.inf) == "−∞"
    assert number(math.nan) == "unknown"


def test_an_interval_or_why_there_is_none():
    usual = {"free": True, "known": True, "at_bound": False}
    assert interval(0.198, 0.202, 1e-3, **usual) == "0.198 to 0.202"
    assert interval(None, None, None, **usual | {"known": False}) == "not determined"
    assert interval(None, None, None, **usual | {"known": False, "free": False}) == "held"
    assert interval(0.0, 1.0, 0.1, **usual | {"at_bound": True}) == "at its bound"


def test_a_whole_number_has_no_digits_of_other_scripts():
    assert all(map(is_whole, ("0", "12", "007")))
    assert not any(map(is_whole, ("", "-1", "1.0", "²", "٣", "1 ")))
