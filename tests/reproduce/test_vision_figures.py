"""Figures of what the published method sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments import DESIGN, evidence, lost, repetition, seen
from monodyn.paper.subproblems import History
from monodyn.reproduce.pose_starts import PoseStarts
from monodyn.reproduce.vision import FrameworkFound
from monodyn.reproduce.vision_figures import (
    filtered_states,
    history_figure,
    starts_figure,
    states_figure,
)


def test_filtered_states_are_drawn_in_both_readings() -> None:
    figure = states_figure(evidence(), None)
    assert figure.title == "Figure 3: filtered states"
    # 2 alpha beta / (2 - alpha) at 0.4 and 0.1
    assert figure.caption == (
        "Poses of the default method through the α-β-γ filter, α = 0.4, β = 0.1, γ = 0.05, over 40 frames, "
        "in both readings of (6) and (7). As printed the acceleration takes γ/T² of what was not predicted, "
        "and errors die out for γ below 2αβ/(2 − α) = 0.05 alone; at that limit it rings without end. With "
        "γ/(2T²), to which the bound of (7) belongs, they die out for twice as much."
    )
    assert [panel["title"] for panel in figure.panels] == ["θ1", "θ2", "rate of θ1", "rate of θ2"]
    names = [line["name"] for line in figure.panels[0]["series"]]
    assert names == ["truth", "printed", "consistent", "estimated"]
    poses = seen().poses
    assert poses is not None
    measured = figure.panels[1]["series"][-1]
    np.testing.assert_allclose(measured["y"], np.degrees(poses.position[:40, 1]), rtol=1e-5)
    printed, consistent = (filtered_states(seen(), DESIGN, name) for name in ("filtered", "consistent"))
    assert printed.position.shape == (40, 2)
    assert np.abs(printed.position - consistent.position).max() > 0.01


def test_objectives_run_on_over_all_sub_problems_of_each_form() -> None:
    history = (
        History("pose", np.array([1, 5]), np.array([300.0, 20.0])),
        History("depth", np.array([2, 4]), np.array([3.0, 1e-12])),
        History("pose", np.array([3]), np.array([10.0])),
    )
    forms = [FrameworkFound("strict", "done", history=history), FrameworkFound("interleaved", "failed: x")]
    figure = history_figure(forms)
    assert figure is not None
    assert figure.caption == (
        "Least value so far of each sub-problem, each time it is solved, over the silhouettes drawn. "
        "Strict: (1) and (2) alternate with (3) until they have converged, then (4), the whole again until "
        "nothing gains, as published. Interleaved, ours: each trial of (3) and (4) has its own camera. The "
        "alternation may lead away from the least mismatch: the best turn counts, whose value is the level "
        "line. Most silhouettes are not shown: those of the choice of the start, for which poses and "
        "proportions are spread over their ranges and the framework runs in a reduced picture. Values below "
        "a billionth are left out."
    )
    areas, places = figure.panels
    assert areas["title"] == "strict: (3) and (4), area of |I_a − I_m|"
    assert [line["x"] for line in areas["series"]] == [[1, 5], [12]]
    assert [(line["x"], line["y"]) for line in places["series"]] == [([7], [3.0])]
    kept = history_figure([replace(forms[0], mismatch=9.0)])
    assert kept is not None
    level = kept.panels[0]["series"][-1]
    assert (level["x"], level["y"], level["name"]) == ([0, 12], [9.0, 9.0], "kept")
    assert kept.legend[-1] == ("line", "fitted", "kept mismatch")
    assert history_figure(forms[1:]) is None


def test_the_share_of_starts_is_drawn_over_their_distance() -> None:
    starts = PoseStarts((np.radians(10.0), np.pi), (24, 6), 24)
    figure = starts_figure([repetition(published=evidence(method="paper", starts=starts))])
    assert figure is not None
    assert figure.caption == (
        "Share of 24 searches (3) that end in the pose, to 2° in every joint, by how far from it they start: "
        "the largest turn of any hinge, in random directions. Camera and sizes are those that were found."
    )
    (line,) = figure.panels[0]["series"]
    assert line["x"] == [10.0, 180.0]
    assert line["y"] == [100.0, 25.0]
    assert starts_figure([repetition(published=lost())]) is None
