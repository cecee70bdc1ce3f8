"""The tables of the page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments import DESIGN, evidence, moved, repetition
from monodyn.reproduce.cases import Case
from monodyn.reproduce.page_tables import (
    PageTable,
    assumptions_table,
    fits_table,
    frameworks_table,
    lengths_table,
    poses_table,
    remarks,
    starts_table,
)
from monodyn.reproduce.plans import FitPlan, start_scale
from monodyn.reproduce.vision import FrameworkFound

BOTH_WAYS = (
    "Cases II and III are fitted both ways: with the torque over time alone, the published form, and with "
    "friction in addition to it, the default method's. Ratios compare fits that follow the poses, with the "
    "same friction and poses of the same frames."
)
OWN_WAY = (
    "By the published method Cases II and III are fitted in its own form alone, without friction in addition "
    "to the torque over time, to save time; by the default method both ways. Ratios compare fits that follow "
    "the poses, with the same friction and poses of the same frames."
)
REFUSES = (
    "The default method refuses {} where no period shows that explains the motion better than friction "
    "alone: a freely swinging pendulum has no periodic torque."
)


def test_columns_without_a_number_are_left_out() -> None:
    table = PageTable.of(["method", "truth", "l1"], [("", ["a", "–", "1"]), ("last", ["b", "–", "–"])])
    assert table.head == ["method", "l1"]
    assert table.rows == [("", ["a", "1"]), ("last", ["b", "–"])]
    untold = fits_table(repetition(replace(moved("I", 1e-3), error=None)))
    assert "truth [°]" not in untold.head
    assert "l1 [%]" not in untold.head


def test_a_larger_residual_of_the_default_method_in_case_three_is_explained() -> None:
    remark = (
        "In Case III the default method has the larger residual where it does not follow the noise of the "
        "poses from frame to frame. The errors against the truth and of the prediction are the ones to "
        "compare."
    )
    default = moved("III", 5e-3, series="alone")
    published = evidence(moved("III", 0.0, noise=1.0, method="paper"), method="paper")
    assert remarks(repetition(default, published=published)) == [remark, OWN_WAY]
    both = evidence(moved("III", 0.0, series="with-friction", method="paper"), method="paper")
    assert remarks(repetition(default, published=both)) == [BOTH_WAYS]


def test_a_refused_case_two_is_explained_and_has_no_ratio() -> None:
    refused = Case(FitPlan("fast", "II", 40, series="alone"), "no period")
    published = evidence(moved("II", 0.0, method="paper"), method="paper")
    found = repetition(moved("I", 1e-3), refused, published=published)
    assert remarks(found) == [
        REFUSES.format("Case II") + " So there is no ratio for it.",
        OWN_WAY,
    ]
    alone = moved("II", 1e-3, series="alone")
    other = Case(FitPlan("fast", "II", 40, series="with-friction"), "no period")
    assert remarks(repetition(alone, other, published=published)) == [
        REFUSES.format("Case II, with friction"),
        OWN_WAY,
    ]
    table = fits_table(found)
    assert [cells[:2] for _, cells in table.rows] == [
        ["Case I", "default"], ["Case II, torque alone", "published"], ["Case II, torque alone", "default"],
    ]  # fmt: skip


def test_the_table_says_by_how_much_the_default_method_is_better() -> None:
    default = replace(moved("I", 1e-3), seconds=0.5)
    published = evidence(replace(moved("I", 4e-3, method="paper"), seconds=0.25), method="paper")
    table = fits_table(repetition(default, published=published))
    kind, cells = table.rows[-1]
    assert kind == "gain last"
    assert cells[:5] == ["", "ratio", "", "1×", '<span class="flag">0.5×</span>']
    assert list(cells).count("4× · 4×") == 2
    poses = poses_table(repetition(default, published=published))
    assert poses.rows[1][1][-3] == "not counted"
    assert poses.rows[2][1][0] == "ratio"


def test_frameworks_are_compared_by_mismatch_and_error() -> None:
    forms = (
        FrameworkFound("strict", "done", 137.0, 4500.0, 1000, 2.0, np.radians([0.1, -0.2])),
        FrameworkFound("interleaved", "failed: lost"),
    )
    published = evidence(method="paper")
    published = replace(published, seen=replace(published.seen, frameworks=forms))
    table = frameworks_table([repetition(published=published)])
    assert table.rows[0][1] == ["0", "strict", "137", "3.04", "1000", "2", "0.1 · 0.2", "done"]
    assert table.rows[1] == ("last", ["0", "interleaved", "–", "–", "–", "–", "–", "failed: lost"])


def test_lengths_and_starts_have_a_row_each() -> None:
    cases = [moved("I", 1e-3, frames=n) for n in (20, 30, 40)]
    table = lengths_table(repetition(*cases))
    assert [cells[:3] for _, cells in table.rows] == [["Case I", n, "default"] for n in ("20", "30", "40")]
    fits = [moved("I", 1e-3), moved("I", 0.3, start=1), moved("I", 1e-3, start=2)]
    table = starts_table(repetition(*fits))
    assert [cells[:2] for _, cells in table.rows] == [
        ["default", "as seen, matched"], ["default", "2, place 1"], ["default", "1, place 2"],
    ]  # fmt: skip
    shown = [cells[2] for _, cells in table.rows]
    assert shown == ["–", *(f"{start_scale(number, DESIGN.seed):.3g}" for number in (2, 1))]


def test_assumptions_are_marked() -> None:
    table = assumptions_table(repetition())
    assert table.rows[0][1] == [
        "The silhouette shows the pose in every frame.",
        '<span class="not">does not hold</span>',
        "There are no poses: failed: x",
    ]
