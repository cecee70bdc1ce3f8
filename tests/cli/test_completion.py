"""The scripts of ``monodyn completion``: all options of all commands, and what the shells make of them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from monodyn.choices import AUTO, BUNDLED
from monodyn.cli import main
from monodyn.cli.completion import MODELS, completion, options_of
from monodyn.cli.options import COMMANDS
from monodyn.cli.parse import parsed
from monodyn.errors import SettingsError
from monodyn.mechanism import load
from support import refuses

ASK = {
    "bash": """source ./script
        ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _monodyn; echo "${COMPREPLY[@]}"; }
        ask monodyn ""; ask monodyn run --method ""; ask monodyn run --method = p
        ask monodyn run clip.mp4 --locate.s; ask monodyn run --model c; ask monodyn run ""
        complete -p monodyn""",
    "fish": """source ./script
        for line in "monodyn " "monodyn run --method " "monodyn run --method=p" \\
            "monodyn run clip.mp4 --locate.s" "monodyn run --model c" "monodyn run c"
            echo (complete -C $line | string replace -r '\\t.*' '')
        end""",
    "zsh": """compdef() { }
        compset() { PREFIX=${PREFIX#*=} }
        compadd() { local some=(${(M)found:#$PREFIX*}); (( $#some )) && print -- $some }
        _files() { print FILES }
        source ./script
        ask() { words=("$@"); CURRENT=$#; PREFIX=$words[CURRENT]; _monodyn }
        ask monodyn ""; ask monodyn run --method ""; ask monodyn run --method=p
        ask monodyn run clip.mp4 --locate.s; ask monodyn run --model c; ask monodyn run ""
        """,
}
"""What each shell is asked: commands, choices, choices after =, options, models, files."""


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_of_the_help_is_completed(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert parsed(command, ["--help-all"]) == 0
    listed = {
        each.rstrip(".")
        for each in re.findall(r"^\W*(?:-h, )?(--[a-z][\w.-]*)", capsys.readouterr().out, re.MULTILINE)
    }
    assert listed <= set(options_of(command))
    assert "--help" in listed


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_every_completed_option_is_known(command: str) -> None:
    for option in options_of(command):
        # whatever else is wrong with such a line, the option is not: one that is not known is named
        assert f"expected known options, got {option}" not in complaint(command, option)
    assert "expected known options, got --bogus" in complaint(command, "--bogus")


def complaint(command: str, option: str) -> str:
    try:
        parsed(command, [*COMMANDS[command].example.split()[2:], option, "1"])
    except SettingsError as error:
        return str(error)
    return ""


def test_models_are_the_bundled_ones() -> None:
    assert (AUTO, *(name.replace("chain:N", "chain:3") for name in BUNDLED)) == MODELS
    assert load(MODELS[-1]).joints


def test_flags_choices_and_groups() -> None:
    found = options_of("live")
    assert found["--force"] is None
    assert found["--pace"] == found["--live.pace"] == ("fast", "real")
    assert found["--track.no-adaptive"] is None
    assert found["--locate.method"] == ("fast", "paper")
    assert found["--live.window"] == ()
    assert "--source" not in found


def test_the_command_prints_the_script(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    assert capsys.readouterr().out == completion("bash")
    assert main(["completion", "tcsh"]) == 2
    said = "shell: expected one of 'bash', 'zsh', 'fish', got 'tcsh'."
    with refuses(SettingsError, said):
        parsed("completion", ["tcsh"])


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete(shell: str, tmp_path: Path) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed")
    (tmp_path / "script").write_text(completion(shell))  # pyright: ignore[reportArgumentType]
    (tmp_path / "clip.mp4").touch()
    said = subprocess.run(
        [program, "-c", ASK[shell]], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert said.stderr == ""
    lines = said.stdout.splitlines()
    assert set(COMMANDS) <= set(lines[0].split())
    assert lines[1].split() == ["fast", "paper"]
    assert lines[2].removeprefix("--method=") == "paper"
    assert lines[3].split() == ["--locate.search-frames", "--locate.start"]
    assert {"cartpole", "chain:3"} <= set(lines[4].split())
    # bash itself, and zsh by _files, offer files where there is nothing else
    assert (
        lines[5:]
        == {
            "bash": ["", "complete -o default -F _monodyn monodyn"],
            "zsh": ["FILES"],
            "fish": ["clip.mp4"],
        }[shell]
    )
