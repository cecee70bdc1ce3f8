"""Which name was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from monodyn.cli.options import COMMANDS
from monodyn.cli.table import listed
from monodyn.names import known, near, near_files, quoted, short

PARAMETERS = ["link1.length", "link1.width", "link2.length", "camera.x", "camera.y", "gravity"]


@pytest.mark.parametrize(
    ("given", "end"),
    [
        ("link1.lenght", "did you mean 'link1.length' or 'link2.length'?"),
        ("gravty", "did you mean 'gravity'?"),
        ("garvtiy", "did you mean 'gravity'?"),
        # of the same group, and nothing else
        ("camera.zoom", "parameters: 'link1.length', 'link1.width', 'link2.length', 'camera.x', 'camera.y', "
         "'gravity'."),
    ],
)  # fmt: skip
def test_what_is_near_is_asked_about(given: str, end: str) -> None:
    assert known("parameters", PARAMETERS, given) == end


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ("form", ["from"]), ("fsat", ["fast"]), ("rio", ["roi"]), ("fixx", ["fix"]), ("jont1", ["joint1"]),
        ("versoin", ["version"]), ("modle", ["model"]), ("actauted", ["actuated"]), ("ot", ["out"]),
    ],
)  # fmt: skip
def test_slips_of_short_words_are_seen(given: str, names: list[str]) -> None:
    known = ["from", "fast", "roi", "fix", "joint1", "version", "model", "actuated", "out", "at", "paper"]
    assert near(known, given) == names


def test_words_that_have_nothing_to_do_with_a_name_bring_none_to_mind() -> None:
    options = {option.name for command in COMMANDS for option in listed(command)}
    words = (
        "time house water light green table plane river stone music chair bread cloud horse night sound "
        "heart voice world money story month study book word side kind head hand part place case week "
        "company number home area lot mother father a b c x1 y2"
    )
    assert [word for word in words.split() if near(sorted(options), word)] == []
    # nor does one letter, or two, one after the other
    assert near(["a", "b", "j1", "j2"], "j3") == near(["a", "b"], "c") == near(["x"], "") == []


def test_capitals_make_no_difference() -> None:
    assert known("joints", ["joint1", "elbow"], "ELBOW") == "did you mean 'elbow'?"


def test_files_next_to_one_that_is_not_there_are_asked_about(tmp_path: Path) -> None:
    for name in ("double.xml", "double.mp4", "notes.txt"):
        (tmp_path / name).touch()
    assert near_files(tmp_path / "dobule.mp4") == [str(tmp_path / "double.mp4")]
    assert near_files(tmp_path / "double.xmm", (".xml",)) == [str(tmp_path / "double.xml")]
    assert near_files(tmp_path / "single.mp4") == []
    assert near_files(tmp_path / "none" / "double.mp4") == []
    assert near_files(tmp_path / ("double.mp4" * 100)) == []


def test_the_middle_of_a_long_name_is_left_out() -> None:
    assert short("a" * 60) == "a" * 60
    assert short("a" * 30 + "b" * 31) == "a" * 30 + "b" * 10 + "..." + "b" * 17
    assert quoted(["x", "y" * 1000]) == f"'x', '{'y' * 40}...{'y' * 17}'"


def test_a_long_list_is_cut() -> None:
    names = [f"joint{k}.damping" for k in range(1, 15)]
    said = known("parameters", names, "gravity")
    assert said == f"parameters: {', '.join(map(repr, names[:9]))} and 5 more."
    letters = [str(k) for k in range(20)]
    assert quoted(letters) == f"{', '.join(map(repr, letters[:12]))} and 8 more"
