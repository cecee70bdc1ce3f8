"""The figures of the page: what they plot, and what their captions say."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import DESIGN, evidence, lost, mechanism, moved, repetition, seen
from monodyn.reproduce.figures import (
    Column,
    case_figure,
    frames_figure,
    numbers,
    periods_figure,
    poses_figure,
)
from monodyn.reproduce.units import units_of

UNITS = units_of(mechanism().joints)


def test_numbers_are_short_and_unknown_ones_null() -> None:
    assert numbers(np.array([1.0 / 3.0, np.nan, np.inf, -2.0])) == [0.333333, None, None, -2.0]


def test_the_error_of_a_case_is_drawn_against_the_truth() -> None:
    figure = case_figure("Title", "Caption.", [Column("default", moved("I", 1e-2))], UNITS, DESIGN)
    assert (figure.title, figure.caption, figure.columns, len(figure.panels)) == ("Title", "Caption.", 1, 3)
    last = figure.panels[-1]
    assert last["title"] == "default: simulated less truth"
    for line in last["series"]:
        np.testing.assert_allclose(line["y"], np.degrees(1e-2), rtol=1e-5)
    texts = [text for _, _, text in figure.legend]
    assert texts == [
        "estimated pose", "simulated, default method", "truth", "error of θ1", "error of θ2", "fitted frames",
    ]  # fmt: skip
    assert case_figure("Title", "Caption.", [], UNITS, DESIGN).panels == []


def test_filtered_states_that_were_fitted_take_the_place_of_the_poses() -> None:
    states = np.full((40, 2), 0.1)
    figure = case_figure("", "", [Column("published", moved("I", 0.0), states)], UNITS, DESIGN)
    dots = next(line for line in figure.panels[0]["series"] if line["kind"] == "dots")
    assert (dots["colour"], len(dots["x"]), dots["name"]) == ("fitted", 40, "filtered, fitted")
    np.testing.assert_allclose(dots["y"], np.degrees(0.1), rtol=1e-5)
    assert ("dot", "fitted", "filtered state") in figure.legend


def test_errors_are_drawn_over_the_number_of_frames() -> None:
    cases = [moved("I", 1e-2, frames=n) for n in DESIGN.lengths]
    figure = frames_figure({"fast": evidence(*cases), "paper": lost()})
    assert figure.caption == (
        "Case I. Left: simulated against true motion (the poses where the truth is not known) on frames 40 "
        "to 79, which no fit has used. Right: simulated against estimated motion on the frames that were "
        "fitted."
    )
    (line,) = figure.panels[0]["series"]
    assert line["x"] == [20, 30, 40]
    assert line["y"] == pytest.approx([np.degrees(1e-2)] * 3, rel=1e-5)
    assert frames_figure({"fast": lost("fast"), "paper": lost()}).panels == []


def test_the_prediction_of_case_two_is_drawn_over_the_periods() -> None:
    case = moved("II", 1e-2, frames=40, method="paper")
    driven = mechanism().with_torque("fourier", terms=1, period=0.5)
    fit: Any = SimpleNamespace(**{**vars(case.fit), "mechanism": driven})
    published = evidence(replace(case, fit=fit), method="paper")
    figure = periods_figure([repetition(published=published)])
    assert figure.caption == (
        "Published form, each pendulum: error of the prediction over the frames after the fitted ones, by "
        "how many periods of the poses these hold."
    )
    (line,) = figure.panels[0]["series"]
    assert line["x"] == pytest.approx([39 / 30 / 0.5], rel=1e-5)
    assert line["y"] == pytest.approx([np.degrees(1e-2)], rel=1e-5)
    assert periods_figure([repetition()]).panels == []


def test_errors_of_the_poses_are_drawn_where_the_truth_is_known() -> None:
    figure = poses_figure({"fast": evidence(), "paper": lost()})
    assert figure.caption == "Estimated less true joint positions in every frame."
    (panel,) = figure.panels
    errors = seen().errors
    assert errors is not None
    for dof, line in enumerate(panel["series"]):
        np.testing.assert_allclose(line["y"], np.degrees(errors[:, dof]), rtol=1e-5)
