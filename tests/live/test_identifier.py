"""From where on the motion of a stream goes on without a break, and why: poses are made up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fits import identified
from lives import double
from monodyn.estimation.settings import IdentifySettings
from monodyn.live.identifier import Cut, Identifier
from monodyn.live.settings import LiveSettings
from monodyn.types import Poses

RATE = 30.0


def rows(first: int, stop: int, seen: bool = True) -> Poses:
    """Return poses of a hinge by the numbers of their frames."""
    count = stop - first
    position = np.sin(np.arange(first, stop) / 10.0)[:, None] if seen else np.full((count, 1), np.nan)
    return Poses(
        ("joint1",), np.arange(first, stop), np.arange(first, stop) / RATE, position,
        np.full((count, 1, 1), 1e-6), np.full(count, seen),
    )  # fmt: skip


@pytest.fixture
def begun():
    """Return an identifier that has begun with frames 0 to 44, and with later ones."""
    made = []

    def beginning(later: Poses | None = None) -> Identifier:
        identifier = Identifier(LiveSettings(), IdentifySettings(), in_order=False)
        made.append(identifier)
        found: Any = SimpleNamespace(
            scene=SimpleNamespace(mechanism=None), poses=rows(0, 45), fit=identified()
        )
        begun: Any = SimpleNamespace(found=found, horizon=None, later=later, estimate=None)
        identifier.begin(begun)
        return identifier

    yield beginning
    for identifier in made:
        identifier.close()


def test_a_search_that_takes_long_breaks_nothing_off_where_its_frames_were_followed(begun):
    identifier = begun(rows(45, 222))
    identifier.take(rows(222, 223))
    assert identifier.cut == Cut(0.0)


def test_why_a_motion_begins_anew_is_known(begun):
    cases: tuple[Any, ...] = (
        (None, [rows(100, 101)], 100, "searching"),
        (rows(45, 60), [rows(200, 201)], 200, "searching"),
        (rows(45, 60), [rows(60, 61), rows(100, 101)], 100, "too fast"),
        (None, [*(rows(k, k + 1, seen=False) for k in range(45, 90)), rows(90, 91)], 90, "unseen"),
        (None, [*(rows(k, k + 1, seen=False) for k in range(45, 60)), rows(60, 61)], 0, ""),
    )
    for later, taken, first, why in cases:
        identifier = begun(later)
        for row in taken:
            identifier.take(row)
        assert identifier.cut == Cut(first / RATE, why)
    identifier = begun()
    identifier.take(rows(45, 46), broken=True)
    assert identifier.cut == Cut(45 / RATE, "stamps")


def test_verdict_and_status_are_those_of_the_fit_that_the_estimate_rests_on(begun):
    """A stretch that was identified anew counts from the first frame that is identified with it."""
    identifier = begun()
    assert identifier.base is identifier.fit
    before = identified()
    estimate: Any = SimpleNamespace(base=before)
    identifier.estimate = estimate
    identifier.fit = double()
    assert identifier.base is before
