"""What a user sees: progress on the error stream, results on the standard output."""

from __future__ import annotations

import io
import json
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fits import made_fit, record
from monodyn.cli import show as shown
from monodyn.cli.show import progress_on, show, show_models
from monodyn.estimation.fit import Doubt
from monodyn.mechanism import BUNDLED, load
from monodyn.pipeline import Outcome
from monodyn.results.findings import Findings, fit_document
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of


def outcome(folder: Path | None = Path("run"), **changes: Any) -> Outcome:
    """Return the outcome of a run whose record is 1 mrad above the motion."""
    fit = made_fit(**changes)
    poses = record(fit)
    trace = trace_of(fit, poses, predict(fit, times=poses.time[20:]))
    fit = replace(fit, rms={"joint1": 1e-3})
    document = fit_document(Findings(fit, [trace], notes=["Light it better."]))
    return Outcome(folder, document, poses, fit, [trace], ["Light it better."], {"track": 1.26})


def words(text: str) -> list[list[str]]:
    """Return the words of each line, drawn lines left out."""
    lines = [[word for word in line.split() if set(word) != {"─"}] for line in text.splitlines()]
    return [line for line in lines if line]


LEFT = "Predictions stay within 5 deg over all of the 60 s that were looked at."
"""What is said of the prediction of a fit whose parameters are exact."""


def test_a_fit_is_shown_as_tables_status_and_advice(capsys: pytest.CaptureFixture[str]) -> None:
    assert show(outcome(), as_json=False, quiet=False) == 0
    assert words(capsys.readouterr().out) == [
        ["parameter", "value", "95", "%", "interval", "unit"],
        ["link1.length", "0.2", "0.198", "to", "0.202", "m"],
        ["joint1.damping", "0.001", "not", "determined", "N", "m", "s/rad"],
        ["combination", "value", "standard", "deviation", "unit"],
        ["joint1.damping", "/", "link1.J", "0.1235", "0.0012"],
        ["joint", "fit", "rms", "prediction", "rms", "unit"],
        ["joint1", "0.0573", "0.0573", "deg"],
        ["Trusted.", "Identified", "from", "20", "frames."],
        LEFT.split(),
        ["-", "Measure", "<b>one</b>", "mass", "&", "be", "done."],
        ["-", "Light", "it", "better."],
        ["report:", "run/report.html"],
    ]


def test_a_parameter_is_held_or_at_its_bound(capsys: pytest.CaptureFixture[str]) -> None:
    length, damping, gravity = made_fit().parameters
    found = outcome(
        parameters=(replace(length, at_bound=True), replace(damping, free=False, unit="m"), gravity)
    )
    assert found.fit is not None
    show(replace(found, fit=replace(found.fit, torque="free")), as_json=False, quiet=False)
    lines = words(capsys.readouterr().out)
    assert ["link1.length", "0.2", "at", "its", "bound", "m"] in lines
    assert ["joint1.damping", "0.001", "held", "m"] in lines


def test_a_tracked_clip_is_shown_in_a_few_lines(capsys: pytest.CaptureFixture[str]) -> None:
    assert show(replace(outcome(), fit=None, traces=()), as_json=False, quiet=False) == 0
    assert capsys.readouterr().out == (
        "29 of 30 frames were tracked (1.3 s).\n- Light it better.\nposes: run/poses.csv\n"
    )


def test_json_is_the_document_and_the_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert show(outcome(None), as_json=True, quiet=True) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["out"] is None
    assert document["status"] == "Identified from 20 frames."
    assert document["parameters"][1]["std"] is None


def test_a_fit_that_is_not_to_be_trusted_is_code_1_and_said_even_when_quiet(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lost = outcome(doubts=(Doubt("refused", "It does not fit."),), status="It does not fit.")
    assert show(lost, as_json=False, quiet=True) == 1
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "monodyn: It does not fit.\n")


def test_models_are_listed_with_their_lengths(capsys: pytest.CaptureFixture[str]) -> None:
    """The list is a file, so that it takes no time; it says what the mechanisms' own files do."""
    assert show_models(as_json=True) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in listed] == list(BUNDLED)
    for row in listed:
        mechanism = load(row["name"].replace("chain:N", "chain:3"))
        lengths = {p.name: p.value for p in mechanism.parameters if p.kind == "length"}
        assert row["joints"] == [f"{joint.name} ({joint.kind})" for joint in mechanism.joints]
        assert row["lengths"] == pytest.approx(lengths, abs=1e-12)
    show_models(as_json=False)
    assert capsys.readouterr().out.splitlines()[-1] == (
        "chain:N has N hinges, 1 to 10; shown for 3. Any MJCF or URDF file of a planar mechanism works too."
    )


@pytest.mark.parametrize("columns", ["0", "1", "20", "300", "many"])
def test_no_cell_of_a_table_is_cut(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    show_models(as_json=False)
    show(outcome(), as_json=False, quiet=False)
    out = capsys.readouterr().out
    assert "…" not in out
    assert "joint1 (hinge), joint2 (hinge), joint3 (hinge)" in out
    assert ["link1.length", "0.2", "0.198", "to", "0.202", "m"] in words(out)


def test_progress_is_a_few_lines_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(range(0, 1000, 2))
    monkeypatch.setattr(shown.time, "perf_counter", lambda: float(next(clock)))
    stream = io.StringIO()
    with progress_on(stream, quiet=False) as progress:
        assert progress is not None
        for done in range(1, 9):
            progress("track", 40 * done, 320)
        progress("search", 1, None)
    # a line after ten seconds, and one at the end of each step; no rate below one a second
    assert stream.getvalue().splitlines() == [
        "track: 280 of 320, 23/s, 12 s", "track: 320 of 320, 20/s, 16 s", "search: 1"
    ]  # fmt: skip
    with progress_on(sys.stderr, quiet=True) as nothing:
        assert nothing is None


def test_a_step_that_is_not_heard_of_is_told_of_all_the_same() -> None:
    stream, told = io.StringIO(), threading.Event()
    lines = shown._ProgressLines(stream, every=0.02)
    lines("identify", 3, None)
    # nothing is called from here on
    assert any("identify: 3, " in stream.getvalue() or told.wait(0.02) for _ in range(1000))
    lines.close()
    lines.end()
    assert stream.getvalue().count("identify: 3") >= 2


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("columns", ["0", "1", "55"])
def test_progress_is_lines_on_a_terminal_that_is_too_narrow(
    columns: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    stream = Terminal()
    with progress_on(stream, quiet=False) as progress:
        assert progress is not None
        progress("track", 8, 8)
    assert stream.getvalue().startswith("track: 8 of 8")


@pytest.mark.parametrize("columns", ["56", "300", "many"])
def test_progress_is_a_bar_on_a_terminal(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    stream = Terminal()
    with progress_on(stream, quiet=False) as progress:
        assert progress is not None
        progress("track", 4, 8)
        progress("track", 8, 8)
    assert "track" in stream.getvalue()
    assert "8/8" in stream.getvalue()


def test_a_refused_fit_says_so_before_its_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    said = outcome()
    document = {
        **said.document,
        "grade": "refused",
        "tried_torques": [{"kind": "friction", "said": "it is."}],
    }
    show(replace(said, document=document), as_json=False, quiet=False)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "What acts at the joints, the likeliest first:",
        "- friction: it is.",
        "A refused fit tells nothing of the mechanism: neither values nor intervals are to be relied on.",
    ]
