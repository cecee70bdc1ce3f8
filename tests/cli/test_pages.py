"""Text as wide as the terminal."""

from __future__ import annotations

import pytest

from monodyn.cli.pages import command_line, fitted, paragraph, two_columns, width


@pytest.mark.parametrize(("columns", "wide"), [("1", 24), ("40", 40), ("80", 80), ("200", 100)])
def test_a_page_is_as_wide_as_the_terminal_within_reason(
    columns: str, wide: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert width() == wide


def test_a_command_is_broken_where_a_shell_reads_it_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    assert command_line("monodyn run clip.mp4 --model double.xml --out run", "  ") == [
        "  monodyn run clip.mp4 \\",
        "      --model double.xml --out run",
    ]
    assert command_line("monodyn models") == ["monodyn models"]


def test_the_second_column_stands_beside_the_first_where_there_is_room(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rows = [
        ("--out DIR", "Folder for the results."),
        ("--tolerance ANGLE,LENGTH", "How far off."),
        ("-h", ""),
    ]
    monkeypatch.setenv("COLUMNS", "80")
    assert two_columns(rows) == [
        "  --out DIR               Folder for the results.",
        "  --tolerance ANGLE,LENGTH",
        "                          How far off.",
        "  -h",
    ]
    monkeypatch.setenv("COLUMNS", "40")
    assert two_columns(rows[:1]) == ["  --out DIR", "      Folder for the results."]


def test_words_are_not_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "24")
    assert paragraph("frame,NAME_x,NAME_y[,NAME_p] --fit-frames") == [
        "frame,NAME_x,NAME_y[,NAME_p]",
        "--fit-frames",
    ]


def test_a_page_is_fitted_row_by_row(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        "Commands:\n  run   track a clip and identify the mechanism\n\nSee monodyn COMMAND --help for more.\n"
    )
    monkeypatch.setenv("COLUMNS", "200")
    assert fitted(text) == text
    monkeypatch.setenv("COLUMNS", "36")
    assert fitted(text) == (
        "Commands:\n  run\n      track a clip and identify the\n      mechanism\n\n"
        "See monodyn COMMAND --help for more.\n"
    )
