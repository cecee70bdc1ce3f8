"""The words of a command line: every complaint is one sentence."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from monodyn.cli.parse import parsed
from monodyn.errors import SettingsError
from support import refuses

WORDS = ["a.mp4", "--model", "double", "--out", "o"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "run: expected --out, got nothing; see monodyn run --help."),
        (["a.mp4", "--model", "m"], "run: expected --out, got a.mp4 --model m; see monodyn run --help."),
        ([*WORDS, "--bogus"], "run: expected known options, got --bogus; see monodyn run --help."),
        ([*WORDS, "--identify.seed", "3"],
         "run: expected known options, got --identify.seed, 3; see monodyn run --help."),
        ([*WORDS, "--until", "abc"],
         "run: --until: expected another kind of value, got 'abc'; see monodyn run --help."),
        ([*WORDS, "--track.patience", "1.5"],
         "run: --track.patience: expected another kind of value, got '1.5'; see monodyn run --help."),
        ([*WORDS, "--identify.bodies", "odd"],
         "run: --identify.bodies: expected 'auto', 'uniform', 'free', got 'odd'; see monodyn run --help."),
    ],
)  # fmt: skip
def test_complaints_are_one_sentence(words: list[str], message: str) -> None:
    with refuses(SettingsError, message):
        parsed("run", words)


@pytest.mark.parametrize("name", ["--out", "--model", "--background"])
def test_an_empty_name_is_not_the_current_folder(name: str) -> None:
    for words in ([name, ""], [f"{name}="]):
        with refuses(SettingsError, f"run: {name}: expected a name, got an empty one; give one."):
            parsed("run", ["a.mp4", *words])


def test_help_is_an_exit_code() -> None:
    assert parsed("models", ["--help"]) == 0


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["models", "--help"]])
def test_help_loads_nothing_heavy(words: list[str]) -> None:
    heavy = ("numpy", "scipy", "numba", "mujoco", "cv2", "av", "plotly")
    code = (
        f"import sys; from monodyn.cli import main; main({words}); "
        f"print('loaded', [m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded []"


@pytest.mark.parametrize("columns", ["1", "2", "12"])
def test_help_of_a_narrow_terminal_is_there_at_once(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    assert parsed("models", ["--help"]) == 0
    assert "The list as JSON." in " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert os.environ["COLUMNS"] == columns
