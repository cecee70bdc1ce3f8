"""Streams that break, and places that cannot be written."""

from __future__ import annotations

import errno
import io
import os
import sys
from pathlib import Path

import pytest

from monodyn.cli import main, streams
from monodyn.cli.show import progress_on
from monodyn.errors import SettingsError
from support import refuses


class Closed(io.StringIO):
    """A stream whose other end is in trouble."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    def write(self, text: str) -> int:
        raise OSError(self.number, os.strerror(self.number))


def test_a_lost_error_stream_drops_the_progress_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Closed(errno.EPIPE))
    with streams.safe(), progress_on(sys.stderr, quiet=False) as progress:
        assert progress is not None
        progress("track", 1, 2)
        progress("identify", 1, 2)


@pytest.mark.parametrize("words", [["models"], ["--help"], ["run", "--help"]])
def test_a_reader_that_has_gone_away_is_no_error(monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    monkeypatch.setattr(sys, "stdout", Closed(errno.EPIPE))
    assert main(words) == 0
    monkeypatch.setattr(sys, "stdout", Closed(errno.ENOSPC))
    monkeypatch.setattr(sys, "stderr", err := io.StringIO())
    assert main(words) == 2
    assert err.getvalue() == (
        "monodyn: standard output: cannot print the result (No space left on device); give it another place, "
        "or --quiet.\n"
    )


def test_an_output_that_cannot_be_written_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", Closed(errno.EIO))
    said = "standard output: cannot print the result (Input/output error); give it another place, or --quiet."
    with refuses(SettingsError, said), streams.printing():
        print("a result")


def test_names_that_the_terminal_cannot_show_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    with streams.safe(), streams.printing():
        print("µ")
    assert raw.getvalue() == b"?\n"


def test_compiled_functions_go_to_a_temporary_folder_when_no_other_can_be_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setattr(streams.tempfile, "gettempdir", lambda: str(tmp_path))
    said = streams.keep_compiled()
    chosen = Path(os.environ["NUMBA_CACHE_DIR"])
    assert said == (f"no usual folder for compiled functions can be written; they are kept in '{chosen}'.")
    assert chosen.parent == tmp_path
    assert chosen.stat().st_mode & 0o077 == 0
    assert streams.keep_compiled() == ""
