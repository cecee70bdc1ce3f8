"""Which fits are planned, with which settings and from which start values."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments import mechanism
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.reproduce.plans import Design, FitPlan, identify_settings, own_form, plans, started


def test_every_fit_is_planned_once() -> None:
    design = Design()
    published, default = plans(design, 140, "paper"), plans(design, 140, "fast")
    # five cases and ways, three compared otherwise, four other lengths, one of Case II and ten starts
    assert len(published) == len(set(published)) == 5 + 3 + 4 + 1 + 10
    assert len(default) == len(set(default)) == 5 + 4 + 1 + 10
    assert FitPlan("fast", "I", 60) in default
    assert FitPlan("fast", "I", 60) not in plans(design, 99, "fast")
    one_way = plans(replace(design, both_ways=False), 140, "paper")
    assert {plan.series for plan in one_way} == {"", "alone"}


def test_own_form_leaves_friction_out_where_the_paper_does() -> None:
    assert own_form("paper", "II", 40).series == "alone"
    assert own_form("fast", "III", 40).series == "with-friction"
    assert own_form("fast", "I", 40).series == ""


def test_settings_follow_the_plan() -> None:
    design = Design(seed=3)
    found = identify_settings(FitPlan("paper", "I", 40, "consistent", start=2), design)
    assert isinstance(found, PaperIdentifySettings)
    assert (found.states, found.filter, found.rates, found.begin) == (
        "filtered",
        "consistent",
        False,
        "given",
    )
    found = identify_settings(FitPlan("paper", "II", 40, "rates", "with-friction"), design)
    assert isinstance(found, PaperIdentifySettings)
    assert (found.torque, found.series, found.states, found.rates, found.begin, found.seed) == (
        "fourier", "with-friction", "measured", True, "matched", 3,
    )  # fmt: skip
    assert identify_settings(FitPlan("fast", "III", 40, series="alone"), design).series == "alone"


def test_a_short_clip_is_fitted_by_half() -> None:
    design = Design()
    assert design.within(120) == design
    assert (design.within(90).lengths, design.within(90).periods) == ((20, 30, 40), (40,))
    # the last frames are those after the longest fit that the clip has
    assert (design.longest, design.within(90).longest) == (80, 40)
    short = design.within(50)
    assert (short.frames, short.ahead, short.periods) == (25, 25, (25,))
    assert short.lengths == (20,)


def test_other_starts_have_other_values_within_the_factors() -> None:
    first = mechanism().values
    for number in (1, 2):
        other = started(mechanism(), number, 0).values
        scale = other["link1.length"] / first["link1.length"]
        assert other["link2.width"] == pytest.approx(scale * first["link2.width"])
        names = ("link1.thickness", "joint1.damping", "link2.length")
        factors = [other[name] / first[name] for name in names]
        assert all(0.4 <= factor <= 2.5 for factor in factors)
        assert len({round(factor, 6) for factor in factors}) == 3
    assert started(mechanism(), 0, 0).values == first
