"""Truth of a clip: files that state it, and errors up to what a picture cannot show."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments import SETTINGS, mechanism, truth
from monodyn.errors import VideoError
from monodyn.mechanism import load
from monodyn.reproduce.clip import Pendulum, truth_document
from monodyn.reproduce.truth import errors_of, identifiable, read_truth, stated_values
from support import refuses

TIMES = np.arange(5) / 30.0


def written(folder: Path, document: Any) -> Path:
    """Write a JSON document."""
    path = folder / "truth.json"
    path.write_text(json.dumps(document))
    return path


def test_the_document_of_a_made_clip_is_read_back(tmp_path: Path) -> None:
    path = written(tmp_path, truth_document(truth(), SETTINGS))
    found = read_truth(path, mechanism(), truth().time[:20])
    assert found.position == pytest.approx(truth().position[:20], abs=1e-8)
    assert found.velocity == pytest.approx(truth().velocity[:20], abs=2e-7)
    assert found.values == pytest.approx(truth().values)


def test_positions_are_interpolated_at_the_stamps_and_unknown_beyond(tmp_path: Path) -> None:
    document = {"times": [0.0, 0.1, 0.2], "q": [[0.0, 1.0], [1.0, 1.0], [2.0, 1.0]]}
    found = read_truth(written(tmp_path, document), mechanism(), np.array([0.05, 0.15, 0.25]))
    np.testing.assert_allclose(found.position, [[0.5, 1.0], [1.5, 1.0], [np.nan, np.nan]])
    assert np.isnan(found.velocity).all()
    # without stamps the rows are the clip's frames
    found = read_truth(written(tmp_path, {"q": [[0.0, 1.0], [1.0, 1.0]]}), mechanism(), TIMES)
    assert np.isfinite(found.position[:, 0]).tolist() == [True, True, False, False, False]


def test_a_table_is_read_as_identify_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    path.write_text("time,joint2,joint1\n0,1,2\n0.1,1,4\n0.2,1,6\n")
    found = read_truth(path, mechanism(), np.array([0.05]))
    np.testing.assert_allclose(found.position, [[3.0, 1.0]])
    assert found.values == {}


def test_sizes_are_those_that_the_document_states() -> None:
    stated = {
        "truth": {"links": [[0.2, 0.03, 0.01], [0.1, 0.03, 0.01]], "density": 1000, "damping": [6e-5, 0]}
    }
    assert stated_values(stated) == pytest.approx(
        {"l1": 0.2, "l2": 0.1, "m2/m1": 0.5, "b1/m1": 1e-3, "b2/m1": 0.0}
    )
    assert stated_values({"truth": {"links": [[0.62]], "shape": "other"}}) == {"l1": 0.62}
    assert stated_values({"q": []}) == {}
    rods = Pendulum()
    assert stated_values({"pendulum": vars(rods)}) == pytest.approx(truth().values)


def test_bad_files_are_refused_in_one_line(tmp_path: Path) -> None:
    def refused(document: Any, message: str) -> None:
        with refuses(VideoError, message):
            read_truth(written(tmp_path, document), mechanism(), TIMES)

    missing = tmp_path / "none.json"
    with refuses(
        VideoError, f"{missing}: cannot be read (No such file or directory); name the truth of the clip."
    ):
        read_truth(missing, mechanism(), TIMES)
    bad = tmp_path / "truth.json"
    bad.write_text("{")
    with refuses(VideoError, "truth.json: expected a JSON document, got something else; correct it."):
        read_truth(bad, mechanism(), TIMES)
    refused([], "truth.json: expected a JSON document with joint positions 'q' by frame, got none; add them.")
    refused(
        {"q": [[0.0]]},
        "truth.json: expected rows of 2 numbers, one a joint, as 'q', got something else; correct it.",
    )
    refused(
        {"q": [[0.0, 1.0]], "times": "now"},
        "truth.json: expected a list of numbers as 'times', got something else; correct it.",
    )
    refused(
        {"q": [[0.0, 1.0]], "times": [0.0, 1.0]},
        "truth.json: expected as many times and rates as positions, got 2 and 1 for 1; correct it.",
    )
    refused(
        {"q": [[0.0, 1.0]] * 2, "times": [1.0, 0.0]},
        "truth.json: expected times that increase, got others; correct 'times'.",
    )
    refused(
        {"q": [[None, None]] * 2},
        "truth.json: expected true positions that are numbers, got none; give the truth of this clip.",
    )
    refused(
        {"q": [[10**400, 1.0]]},
        "truth.json: expected rows of 2 numbers, one a joint, as 'q', got something else; correct it.",
    )
    bad.write_text("[" * 100_000)
    with refuses(VideoError, "truth.json: expected a JSON document, got something else; correct it."):
        read_truth(bad, mechanism(), TIMES)
    refused(
        {"q": [[0.0, 1.0]] * 2, "times": [7.0, 8.0]},
        "truth.json: expected true positions within the clip's 0.00 to 0.13 s, got 7.00 to 8.00 s; give the "
        "truth of this clip.",
    )


def test_sizes_of_another_form_are_refused_in_one_line(tmp_path: Path) -> None:
    def refused(message: str, **stated: Any) -> None:
        with refuses(VideoError, message):
            read_truth(written(tmp_path, {"q": [[0.0, 1.0]] * 2, **stated}), mechanism(), TIMES)

    refused(
        "truth.json: expected entries with names in 'pendulum', got something else; correct it.",
        pendulum="x",
    )
    lists = (
        "truth.json: expected lists of as many numbers as 'pendulum.length', 'pendulum.width' and "
        "'pendulum.thickness', got something else; correct it."
    )
    refused(lists, pendulum={"length": [0.2, 0.1]})
    refused(lists, pendulum={"length": [0.2, 0.1], "width": [0.1], "thickness": [0.1, 0.1]})
    refused(lists, pendulum={"length": [], "width": [0.1], "thickness": [0.1]})
    refused(lists, pendulum={"length": 0.2, "width": 0.1, "thickness": 0.1})
    sizes = (
        "truth.json: expected sizes above 0 in 'truth', a list for each body, got something else; correct it."
    )
    for links in (3.0, [0.2], [[0.2], []], [["a"]], [[0.0]], {"a": 1}):
        refused(sizes, truth={"links": links})
    bars = [[0.2, 0.03, 0.01], [0.1, 0.03, 0.01]]
    refused("truth.json: expected entries with names in 'truth', got something else; correct it.", truth=[3])
    rods = {"length": [0.2], "width": [0.03], "thickness": [0.01]}
    refused(
        "truth.json: expected a number above 0 as 'pendulum.density', got something else; correct it.",
        pendulum={**rods, "density": -1.0},
    )
    refused(
        "truth.json: expected a list of numbers as 'pendulum.damping', got something else; correct it.",
        pendulum={**rods, "damping": ["a"]},
    )
    refused(
        "truth.json: expected a number above 0 as 'truth.density', got something else; correct it.",
        truth={"links": bars, "density": [1000.0]},
    )
    refused(
        "truth.json: expected a list of numbers as 'truth.damping', got something else; correct it.",
        truth={"links": bars, "density": 1000.0, "damping": 1e-3},
    )
    refused(
        "truth.json: expected rows of 2 numbers, one a joint, as 'q', got something else; correct it.", q=5.0
    )


def test_hinges_are_compared_up_to_whole_turns_and_slides_up_to_origin_and_scale() -> None:
    joints = mechanism().joints
    position = truth().position[:20]
    turned = position + np.array([2.0, -4.0]) * np.pi
    assert errors_of(turned + 0.01, position, joints) == pytest.approx(0.01)
    slide = [replace(joints[0], kind="slide"), joints[1]]
    moved = position * [3.0, 1.0] + [0.5, 0.0]
    assert errors_of(moved, position, slide, metric=False) == pytest.approx(0.0, abs=1e-9)
    shifted = position + np.array([0.5, 0.0])
    assert errors_of(shifted, position, slide) == pytest.approx(0.0, abs=1e-9)


def test_what_the_motion_determines_counts_hinges() -> None:
    assert list(identifiable(mechanism())) == ["l1", "l2", "m2/m1", "b1/m1", "b2/m1"]
    assert list(identifiable(load("cartpole"))) == ["l1", "b1/m1"]
