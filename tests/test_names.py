"""Which name was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from monodyn.names import known, near_files, quoted, short

PARAMETERS = ["link1.length", "link1.width", "link2.length", "camera.x", "camera.y", "gravity"]


@pytest.mark.parametrize(
    ("given", "end"),
    [
        ("link1.lenght", "did you mean 'link1.length' or 'link2.length'?"),
        ("gravty", "did you mean 'gravity'?"),
        # of the same group, and nothing else
        ("camera.zoom", "parameters: 'link1.length', 'link1.width', 'link2.length', 'camera.x', 'camera.y', "
         "'gravity'."),
    ],
)  # fmt: skip
def test_what_is_near_is_asked_about(given: str, end: str) -> None:
    assert known("parameters", PARAMETERS, given) == end


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
