"""The help pages: two levels, every option and choice in words, as wide as the terminal."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest

from monodyn.cli.options import COMMANDS
from monodyn.cli.pages import usage
from monodyn.cli.table import CONFIG, listed
from support import command

PAGES = [(), *((name,) for name in COMMANDS)]


def page(*words: str) -> str:
    done = command(*words)
    assert (done.code, done.err) == (0, "")
    return done.out


def shown(text: str) -> set[str]:
    """Return the options that a page has rows for."""
    rows = re.findall(r"^  (-.*?)(?:  |$)", text, re.MULTILINE)
    return {flag for row in rows for flag in re.findall(r"--[\w.-]+", row)} - {"--help", "--help-all"}


@pytest.mark.parametrize("width", [40, 80, 200])
@pytest.mark.parametrize("words", PAGES, ids=" ".join)
def test_pages_fit_the_terminal_and_no_markup_shows(
    words: tuple[str, ...], width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for level in ("--help", *(["--help-all"] if words else [])):
        text = page(*words, level)
        for line in text.splitlines():
            # longer lines are hard to read
            assert len(line) <= min(width, 100)
            assert line == line.rstrip()
        assert not re.search(r"``|\bNone\b|\bFLOAT\b|\bINT\b|MISSING|factory|[\u2500-\u257f]", text)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_first_page_has_what_most_people_need_and_the_second_everything(name: str) -> None:
    entry = COMMANDS[name]
    options = [option for option in (*listed(name), *([CONFIG] if entry.file else [])) if not option.word]
    people = [option for option in options if not entry.people or option.name in entry.people.split()]
    for rows, level in ((people, "--help"), (options, "--help-all")):
        also = {f"--{option.also}" for option in rows if option.also}
        assert shown(page(name, level)) == {option.flag for option in rows} | also
    assert ("--help-all" in page(name, "--help")) == (len(people) < len(options))


@pytest.mark.parametrize("name", COMMANDS)
def test_the_first_page_has_ten_options_at_most(name: str) -> None:
    rows = re.findall(r"^  (?:-h, )?--([\w.-]+)", page(name, "--help"), re.MULTILINE)
    assert len(set(rows) - {"help", "help-all"}) <= 10


@pytest.mark.parametrize("name", COMMANDS)
def test_every_choice_is_explained(name: str) -> None:
    for option in listed(name):
        assert option.help.endswith("."), option.name
        kinds = (option.kind, *get_args(option.kind))
        for choice in [word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]:
            assert f"'{choice}'" in option.help, (option.name, choice)


def test_what_is_usual_and_what_is_required_is_said() -> None:
    text = " ".join(page("run", "--help-all").split())
    for said in (
        "--out DIR Folder for the results. Required.",
        "The integration error of a rollout stays below this [rad or m]. Default: 1e-05.",
        "--track.no-adaptive Do not have the move limits",
        "Gains alpha, beta, gamma of the filter of the method 'paper', eq. (7). Default: 0.4,0.1,0.05.",
        "Identify: how the dynamics are identified: --identify.method fast|paper",
    ):
        assert said in text
    assert "--pace, --live.pace fast|real" in page("live", "--help")


def test_the_list_of_commands_is_whole() -> None:
    listed_there = re.findall(r"^  ([a-z]+)  +[a-z]", usage(), re.MULTILINE)
    assert listed_there == list(COMMANDS)


def test_help_is_shown_whatever_else_is_there() -> None:
    for words in (["--bogus", "--help"], ["--help", "--out"], ["clip.mp4", "-h"]):
        assert page("run", *words).startswith("Usage: monodyn run")


def test_help_without_docstrings_is_refused() -> None:
    done = subprocess.run(
        [sys.executable, "-OO", "-m", "monodyn", "run", "--help"], capture_output=True, text=True
    )
    said = "python -OO: expected docstrings, which the help is made of, got none; leave -OO out."
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"monodyn: {said}\n")


@pytest.mark.slow
def test_a_way_of_drawing_that_is_not_there_is_no_obstacle(tmp_path: Path) -> None:
    """MuJoCo draws nothing for us, and must not be kept from being loaded by how it would."""
    log = tmp_path / "swing.csv"
    log.write_text("time,joint1\n" + "".join(f"{k / 30},{math.sin(k / 5)}\n" for k in range(60)))
    done = subprocess.run(
        [sys.executable, "-m", "monodyn", "identify", log, "--model", "single", "--json"],
        capture_output=True, text=True, env={**os.environ, "MUJOCO_GL": "nonsense"},
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    assert "rms" in json.loads(done.stdout)


def test_a_program_that_calls_the_command_keeps_its_way_of_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert command("models").code == 0
    assert os.environ["MUJOCO_GL"] == "egl"
