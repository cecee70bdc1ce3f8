"""What is known before the motion: the picture's sizes and places, and the file's thicknesses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monodyn.estimation.shooting.prior import (
    PROPORTION_STD,
    THICKNESS_STD,
    size_prior,
    size_ratios,
    thickness_ratios,
)
from monodyn.estimation.shooting.unknowns import choose_unknowns
from monodyn.mechanism import Measured, Mechanism, load

SIZES = ("a.length", "a.width", "a.disc.width", "a.disc.along")


@pytest.fixture
def counter(tmp_path: Path) -> Mechanism:
    """A rod with a disc behind its hinge."""
    (tmp_path / "body.xml").write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 -1 0"/>'
        '<geom type="box" size=".1 .003 .01" pos=".1 0 0"/>'
        '<geom name="disc" type="cylinder" size=".03 .004" pos="-.06 0 0" euler="90 0 0"/>'
        "</body></worldbody></mujoco>"
    )
    mechanism = load(tmp_path / "body.xml")
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    return mechanism.with_measured(Measured(SIZES, 1e4 * (root @ root.T + 4.0 * np.eye(4))))


def test_a_place_is_searched_as_a_ratio(counter: Mechanism) -> None:
    unknowns = choose_unknowns(counter)
    at = unknowns.names.index("a.disc.along")
    assert unknowns.x0[at] == pytest.approx(-0.06 / 0.2, rel=1e-12)
    x = unknowns.x0.copy()
    x[unknowns.names.index("a.length")] += np.log(2.0)
    # it grows with its body
    assert unknowns.named(x)["a.disc.along"] == pytest.approx(-0.12, rel=1e-12)
    assert unknowns.coordinates(unknowns.values(x)) == pytest.approx(x, abs=1e-12)
    assert unknowns.carried(x, unknowns) == pytest.approx(x, abs=1e-12)


def test_the_chain_is_that_of_finite_differences(counter: Mechanism) -> None:
    unknowns = choose_unknowns(counter)
    x = unknowns.x0 + 0.1
    chain = unknowns.chain(x)
    for k in range(len(x)):
        high, low = (np.array([*unknowns.named(x + s * np.eye(len(x))[k]).values()]) for s in (1e-6, -1e-6))
        # central differences of exponentials: relative 1e-12 truncation, 1e-10 rounding
        assert chain[:, k] == pytest.approx((high - low) / 2e-6, rel=1e-7, abs=1e-9)


def test_a_fixed_length_leaves_the_place_a_ratio_to_it(counter: Mechanism) -> None:
    fixed = counter.with_choices(fix={"a.length": 0.2})
    unknowns = choose_unknowns(fixed)
    at = unknowns.names.index("a.disc.along")
    assert unknowns.x0[at] == pytest.approx(-0.3, rel=1e-12)
    assert unknowns.slope(unknowns.x0)[at, at] == pytest.approx(0.2, rel=1e-12)


def test_places_have_no_part_in_the_common_scale(counter: Mechanism) -> None:
    unknowns = choose_unknowns(counter)
    prior = size_prior(counter, unknowns)
    place = unknowns.names.index("a.disc.along")
    assert prior.weights[place] == 0.0
    assert prior.weights.sum() == pytest.approx(1.0, rel=1e-12)
    measured = [unknowns.names.index(name) for name in SIZES]
    assert counter.measured is not None
    given = counter.measured.information
    assert prior.information[np.ix_(measured, measured)] == pytest.approx(given, rel=1e-9)


def test_the_proportion_of_thicknesses_is_assumed(counter: Mechanism) -> None:
    unknowns = choose_unknowns(counter)
    freed = counter.with_choices(free=["a.disc.thickness"])
    (ratio,) = thickness_ratios(counter, unknowns)
    assert ratio.size.name == "a.disc.thickness"
    change = ratio.change
    information = size_prior(counter, unknowns).information - size_prior(freed, unknowns).information
    # one direction alone: the disc's thickness over the rod's, to a factor of two
    assert information == pytest.approx(np.outer(change, change) / THICKNESS_STD**2, abs=1e-12)
    assert {unknowns.names[i]: change[i] for i in np.flatnonzero(change)} == {
        "a.disc.thickness": 1.0, "a.thickness": -1.0
    }  # fmt: skip
    assert thickness_ratios(freed, choose_unknowns(freed)) == []


def test_the_proportion_of_what_nothing_measures_is_assumed(counter: Mechanism) -> None:
    table = replace(counter, measured=None).with_choices(fix={"a.width": 0.02})
    unknowns = choose_unknowns(table, near=True)
    ratios = {ratio.size.name: ratio for ratio in size_ratios(table, unknowns)}
    assert set(ratios) == {"a.disc.width", "a.disc.along"}
    length = unknowns.names.index("a.length")
    # a place's coordinate is its ratio to the length already
    assert (ratios["a.disc.width"].change[length], ratios["a.disc.along"].change[length]) == (-1.0, 0.0)
    information = size_prior(table, unknowns).information
    for name, ratio in ratios.items():
        at = unknowns.names.index(name)
        assert information[at, at] == pytest.approx(1.0 / PROPORTION_STD**2, rel=1e-12)
        # a quarter of the variance is the limit
        direction = np.outer(ratio.change, ratio.change) / (ratio.change @ ratio.change) ** 2
        assert ratio.hardly_known(0.26 * PROPORTION_STD**2 * direction)
        assert not ratio.hardly_known(0.24 * PROPORTION_STD**2 * direction)
    given = size_ratios(counter, choose_unknowns(counter))
    assert [ratio.size.name for ratio in given] == []


def test_what_is_searched_as_a_ratio_is_as_far_from_the_file_as_its_logarithm_was_drawn(double):
    unknowns = choose_unknowns(double, near=True)
    (tail,) = [ratio for ratio in size_ratios(double, unknowns) if ratio.size.name == "link1.tail"]
    drawn = np.exp(PROPORTION_STD * np.random.default_rng(0).normal(size=400_000))
    assert tail.std == pytest.approx(np.sqrt(np.mean((drawn - 1.0) ** 2)), rel=1e-2)
