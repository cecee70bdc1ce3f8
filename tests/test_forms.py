"""Settings as they are written on the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from monodyn.choices import Tolerance
from monodyn.cli.forms import (
    frame_range,
    intervals,
    names,
    numbers,
    paths,
    rectangle,
    sides,
    time_range,
    tolerance,
    values,
    words,
)
from monodyn.errors import SettingsError
from support import refuses


def test_frame_range() -> None:
    assert frame_range("fit-frames", "3:9") == (3, 9)
    assert frame_range("fit-frames", ":9") == (0, 9)
    assert frame_range("fit-frames", "3:") == (3, None)
    assert frame_range("fit-frames", None) is None
    with refuses(SettingsError, "fit-frames: expected A:B with whole frame numbers, got 'ten'; e.g. 0:120."):
        frame_range("fit-frames", "ten")


def test_repeated_options_are_read_in_order() -> None:
    assert values("fix", (("a=1", "b=-2.5e3"), ("c=0",))) == {"a": 1.0, "b": -2500.0, "c": 0.0}
    assert intervals("bounds", (("a=1:2",), ("b=-inf:0",))) == {"a": (1.0, 2.0), "b": (-float("inf"), 0.0)}
    assert names("free", (("a", "b"), ("c",))) == ("a", "b", "c")


def test_blanks_or_commas_stand_between_words() -> None:
    assert values("fix", (("a=1,b=2",), ("c=0,", "d=1"))) == {"a": 1.0, "b": 2.0, "c": 0.0, "d": 1.0}
    assert intervals("bounds", (("a=1:2,b=0:1",),)) == {"a": (1.0, 2.0), "b": (0.0, 1.0)}
    assert names("free", (("a,b", "c"),)) == ("a", "b", "c")
    assert words("points.map", [["a=joint1,b=none"]]) == {"a": "joint1", "b": "none"}
    assert paths("torques", (("a,b.csv",),)) == (Path("a,b.csv"),)


@pytest.mark.parametrize("word", ["gravity", "a=1=2", "a=", "", ","])
def test_a_value_is_a_name_and_a_number(word: str) -> None:
    with refuses(SettingsError, f"fix: expected NAME=VALUE with a number, got '{word}'; e.g. gravity=9.81."):
        values("fix", ((word,),))


@pytest.mark.parametrize("word", ["link1.length=3", "a=1:", "a"])
def test_bounds_are_a_name_and_two_numbers(word: str) -> None:
    said = f"bounds: expected NAME=LOW:HIGH with two numbers, got '{word}'; e.g. link1.length=0.1:0.3."
    with refuses(SettingsError, said):
        intervals("bounds", ((word,),))


def test_a_name_comes_once() -> None:
    said = "bounds: expected each name once, got 'a' twice; keep one of them."
    with refuses(SettingsError, said):
        intervals("bounds", (("a=1:2",), ("a=1:2",)))


def test_tolerances_are_an_angle_a_length_or_both() -> None:
    both = tolerance("tolerance", "5deg, 2cm")
    assert (both.angle, both.length) == (pytest.approx(0.0872664626), 0.02)
    assert tolerance("tolerance", "3mm").length == pytest.approx(3e-3)
    assert tolerance("tolerance", ".1rad") == Tolerance(angle=0.1)
    assert tolerance("tolerance", None) == Tolerance()
    for text in ("5", "5deg,3deg", "0deg", "-1deg", "5 %", ""):
        said = f"tolerance: expected an angle, a length or both, above 0, got '{text}'; e.g. 5deg,2cm."
        with refuses(SettingsError, said):
            tolerance("tolerance", text)


def test_time_range() -> None:
    assert time_range("time-range", "1.3:6") == (1.3, 6.0)
    assert time_range("time-range", ":.5") == (0.0, 0.5)
    assert time_range("time-range", "2.:") == (2.0, None)
    assert time_range("time-range", None) is None
    for text in ("6", "a:b", "-1:3", "1:2:3"):
        with refuses(SettingsError, f"time-range: expected A:B in seconds, got '{text}'; e.g. 1.3:6."):
            time_range("time-range", text)


def test_rectangle() -> None:
    assert rectangle("roi", "120,0, 480,360") == (120, 0, 480, 360)
    assert rectangle("roi", None) is None
    for text in ("120,0,480", "1.5,0,4,3", "-1,0,40,30"):
        with refuses(
            SettingsError,
            f"roi: expected X,Y,W,H with whole numbers of pixels, got '{text}'; e.g. 120,0,480,360.",
        ):
            rectangle("roi", text)


def test_sides_are_two_whole_numbers() -> None:
    assert sides("points.size", "1280, 720") == (1280, 720)
    assert sides("points.size", None) is None
    with refuses(
        SettingsError, "points.size: expected W,H with whole numbers of pixels, got '12'; e.g. 1280,720."
    ):
        sides("points.size", "12")


def test_numbers() -> None:
    assert numbers("camera.distortion", "-0.3, 1e-2,0,0") == (-0.3, 0.01, 0.0, 0.0)
    assert numbers("camera.distortion", None) is None
    for text in ("-0.3,x", "", "0.1,,0"):
        with refuses(
            SettingsError,
            f"camera.distortion: expected numbers with commas between them, got '{text}'; e.g. "
            "-0.28,0.09,0,0.",
        ):
            numbers("camera.distortion", text)


def test_words_by_name() -> None:
    assert words("points.map", [["a=joint1"], ["b=none"]]) == {"a": "joint1", "b": "none"}
    with refuses(SettingsError, "points.map: expected NAME=TARGET, got 'a='; e.g. knee=joint2."):
        words("points.map", [["a="]])
