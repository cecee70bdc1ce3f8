"""The figures of the page: what they plot, and what their captions say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from experiments import DESIGN, FAILED, moved, seen
from monodyn.paper.locate import PaperScene
from monodyn.paper.subproblems import History
from monodyn.reproduce.claims import Evidence
from monodyn.reproduce.figures import (
    case_figure,
    frames_figure,
    history_figure,
    numbers,
    poses_figure,
    states_figure,
)
from monodyn.reproduce.vision import Seen
from monodyn.types import Camera

BOTH = {"fast": seen(), "paper": FAILED}


def test_numbers_are_short_and_unknown_ones_null() -> None:
    assert numbers(np.array([1.0 / 3.0, np.nan, np.inf, -2.0])) == [0.333333, None, None, -2.0]


def test_filtered_states_are_drawn_in_degrees_with_the_limit_of_the_gains() -> None:
    figure = states_figure(seen(), None, None, DESIGN)
    assert figure.title == "Figure 3: filtered states"
    # 2 alpha beta / (2 - alpha) at 0.4 and 0.1
    assert figure.caption == (
        "Poses of the default method through the α-β-γ filter, α = 0.4, β = 0.1, γ = 0.05, over 40 frames. "
        "In eq. (6) an error of the states dies out for γ below 2αβ/(2 − α) = 0.05; at that limit it rings "
        "without end."
    )
    assert [panel["title"] for panel in figure.panels] == ["θ1", "θ2", "rate of θ1", "rate of θ2"]
    poses = seen().poses
    assert poses is not None
    measured = next(each for each in figure.panels[1]["series"] if each["name"] == "estimated")
    np.testing.assert_allclose(measured["y"], np.degrees(poses.position[:40, 1]), rtol=1e-5)


def test_the_error_of_a_case_is_drawn_against_the_truth() -> None:
    cases = {"fast": moved("I", 1e-2), "paper": None}
    figure = case_figure("Title", "Caption.", cases, BOTH, DESIGN)
    assert (figure.title, figure.caption, figure.columns, len(figure.panels)) == ("Title", "Caption.", 1, 3)
    last = figure.panels[-1]
    assert last["title"] == "default: simulated less truth"
    for line in last["series"]:
        np.testing.assert_allclose(line["y"], np.degrees(1e-2), rtol=1e-5)


def test_errors_are_drawn_over_the_number_of_frames() -> None:
    cases = [moved("I", 1e-2, frames=n) for n in DESIGN.lengths]
    evidence = {"fast": Evidence(seen(), cases, DESIGN), "paper": Evidence(FAILED, [], DESIGN)}
    figure = frames_figure(evidence)
    assert figure.caption == (
        "Case I. Left: simulated against true motion (the poses where the truth is not known) on frames 40 "
        "to 79, which no fit has used. Right: simulated against estimated motion on the frames that were "
        "fitted."
    )
    (line,) = figure.panels[0]["series"]
    assert line["x"] == [20, 30, 40]
    assert line["y"] == pytest.approx([np.degrees(1e-2)] * 3, rel=1e-5)


def test_objectives_run_on_over_all_sub_problems() -> None:
    history = (
        History("pose", np.array([1, 5]), np.array([300.0, 20.0])),
        History("depth", np.array([2, 4]), np.array([3.0, 1e-12])),
        History("pose", np.array([3]), np.array([10.0])),
    )
    unused: Any = None
    scene = PaperScene(
        mechanism=unused, camera=Camera(64, 48, 100.0), masks=unused, frame=0, position=np.zeros(2),
        key_frames=(), key_positions=np.zeros((0, 2)), camera_std={}, rms_px=0.0, advice=(),
        mismatch_px2=3.0, evaluations=12, history=history, level=0.0,
    )  # fmt: skip
    figure = history_figure(Seen("paper", "done", scene))
    assert figure is not None
    assert figure.caption == (
        "Least value so far of each sub-problem, each time it is solved, over the silhouettes drawn. The "
        "choice of the start, before it, drew further ones. Values below a billionth are left out."
    )
    areas, places = figure.panels
    assert [line["x"] for line in areas["series"]] == [[1, 5], [12]]
    assert [(line["x"], line["y"]) for line in places["series"]] == [([7], [3.0])]
    assert history_figure(FAILED) is None


def test_errors_of_the_poses_are_drawn_where_the_truth_is_known() -> None:
    figure = poses_figure(BOTH)
    assert figure.caption == "Estimated less true joint angles in every frame."
    (panel,) = figure.panels
    errors = seen().errors
    assert errors is not None
    for dof, line in enumerate(panel["series"]):
        np.testing.assert_allclose(line["y"], np.degrees(errors[:, dof]), rtol=1e-5)
