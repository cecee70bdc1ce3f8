"""Where searches end: grouped by residual and motion."""

from __future__ import annotations

from dataclasses import replace

from experiments import moved
from monodyn.reproduce.endings import endings


def test_searches_that_end_alike_are_in_one_place() -> None:
    near, again, off = (moved("I", error, start=i) for i, error in enumerate((0.1, 0.101, 0.4), 1))
    places = endings([off, near, again], [0, 1])
    assert [len(place.cases) for place in places] == [2, 1]
    assert places[0].cases[0] is near
    assert places[0].residual < places[1].residual


def test_the_same_residual_with_another_motion_is_another_place() -> None:
    one, other = moved("I", 0.2), moved("I", -0.2)
    other = replace(other, residual=one.residual)
    assert len(endings([one, other], [0, 1])) == 2


def test_a_fit_without_a_motion_ended_nowhere() -> None:
    assert endings([replace(moved("I", 0.1), motion=None)], [0, 1]) == []
