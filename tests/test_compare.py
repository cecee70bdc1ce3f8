"""Figures of two runs of a benchmark, compared by benchmarks/compare.py."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from compare import main
from figures import Figure, save

FIGURES = [
    Figure("single", "link1.length", 0.1, "%", 0.7, bound=0.05),
    Figure("single", "joint1 predicted", float("nan"), "deg"),
    Figure("single", "locate", 80.0, "ms"),
    Figure("single, paper / fast", "time to locate", 1.5, "", 1.0, least=True),
]


def compared(after: list[Figure], folder: Path, *words: str) -> int:
    """Compare FIGURES with others and return the exit code."""
    paths = folder / "before.json", folder / "after.json"
    save(FIGURES, paths[0])
    save(after, paths[1])
    return main([*map(str, paths), *words])


def test_times_and_versions_do_not_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    after = [*FIGURES[:2], replace(FIGURES[2], value=90.0), replace(FIGURES[3], value=1.6)]
    assert compared(after, tmp_path) == 0
    document = json.loads((tmp_path / "after.json").read_text())
    (tmp_path / "after.json").write_text(json.dumps({**document, "versions": {}}))
    assert main([str(tmp_path / "before.json"), str(tmp_path / "after.json")]) == 0
    line = "2 figures compared, 0 differ by more than 1e-09 of their value.\n"
    assert capsys.readouterr().out == 2 * line


def test_rows_that_differ_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    after = [replace(FIGURES[0], value=0.1 * (1 + 1e-6), bound=None), Figure("double", "rms", 1.0, "deg")]
    assert compared(after, tmp_path) == 1
    assert capsys.readouterr().out.splitlines() == [
        "single, joint1 predicted: only before",
        "double, rms: only after",
        f"single, link1.length: value 0.1 before, {0.1 * (1 + 1e-6)} after, 1.0e-06 of it",
        "single, link1.length: bound 0.05 before, None after",
        "1 figures compared, 4 differ by more than 1e-09 of their value.",
    ]


def test_the_allowed_change_is_relative(tmp_path: Path) -> None:
    after = [replace(FIGURES[0], value=0.1 * (1 + 1e-6)), *FIGURES[1:]]
    assert compared(after, tmp_path, "--relative", "2e-6") == 0
    assert compared(after, tmp_path, "--relative", "5e-7") == 1


def test_a_file_of_something_else_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.json").write_text("[]")
    assert main([str(tmp_path / "a.json"), str(tmp_path / "a.json")]) == 2
    assert capsys.readouterr().err.startswith(
        "compare.py: expected two files written with --json, got TypeError("
    )
