"""Settings as they are written on the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pytest

from monodyn.choices import Tolerance
from monodyn.errors import SettingsError
from monodyn.forms import (
    frame_range,
    intervals,
    names,
    notation,
    numbers,
    paths,
    rectangle,
    sides,
    three,
    time_range,
    tolerance,
    values,
    words,
)
from support import refuses


def test_frame_range() -> None:
    assert frame_range("fit-frames", "3:9") == (3, 9)
    assert frame_range("fit-frames", ":9") == (0, 9)
    assert frame_range("fit-frames", "3:") == (3, None)
    with refuses(SettingsError, "fit-frames: expected A:B with whole frame numbers, got 'ten'; e.g. 0:120."):
        frame_range("fit-frames", "ten")


def test_repeated_options_are_read_in_order() -> None:
    assert values("fix", ("a=1", "b=-2.5e3", "c=0")) == {"a": 1.0, "b": -2500.0, "c": 0.0}
    assert intervals("bounds", ("a=1:2", "b=-inf:0")) == {"a": (1.0, 2.0), "b": (-float("inf"), 0.0)}
    assert names("free", ("a", "b", "c")) == ("a", "b", "c")


def test_blanks_or_commas_stand_between_words() -> None:
    assert values("fix", ("a=1,b=2", "c=0,", "d=1")) == {"a": 1.0, "b": 2.0, "c": 0.0, "d": 1.0}
    assert intervals("bounds", ("a=1:2,b=0:1",)) == {"a": (1.0, 2.0), "b": (0.0, 1.0)}
    assert names("free", ("a,b", "c")) == ("a", "b", "c")
    assert words("points.map", ["a=joint1,b=none"]) == {"a": "joint1", "b": "none"}
    assert paths("torques", ("a,b.csv",)) == (Path("a,b.csv"),)


@pytest.mark.parametrize("word", ["gravity", "a=1=2", "a=", "", ","])
def test_a_value_is_a_name_and_a_number(word: str) -> None:
    with refuses(SettingsError, f"fix: expected NAME=VALUE with a number, got '{word}'; e.g. gravity=9.81."):
        values("fix", (word,))


@pytest.mark.parametrize("word", ["link1.length=3", "a=1:", "a"])
def test_bounds_are_a_name_and_two_numbers(word: str) -> None:
    said = f"bounds: expected NAME=LOW:HIGH with two numbers, got '{word}'; e.g. link1.length=0.1:0.3."
    with refuses(SettingsError, said):
        intervals("bounds", (word,))


def test_a_name_comes_once() -> None:
    said = "bounds: expected each name once, got 'a' twice; keep one of them."
    with refuses(SettingsError, said):
        intervals("bounds", ("a=1:2", "a=1:2"))


def test_tolerances_are_an_angle_a_length_or_both() -> None:
    both = tolerance("tolerance", "5deg, 2cm")
    assert (both.angle, both.length) == (pytest.approx(0.0872664626), 0.02)
    assert tolerance("tolerance", "3mm").length == pytest.approx(3e-3)
    assert tolerance("tolerance", ".1rad") == Tolerance(angle=0.1)
    for text in ("5", "5deg,3deg", "0deg", "-1deg", "5 %", ""):
        said = f"tolerance: expected an angle, a length or both, above 0, got '{text}'; e.g. 5deg,2cm."
        with refuses(SettingsError, said):
            tolerance("tolerance", text)


def test_time_range() -> None:
    assert time_range("time-range", "1.3:6") == (1.3, 6.0)
    assert time_range("time-range", ":.5") == (0.0, 0.5)
    assert time_range("time-range", "2.:") == (2.0, None)
    for text in ("6", "a:b", "-1:3", "1:2:3"):
        with refuses(SettingsError, f"time-range: expected A:B in seconds, got '{text}'; e.g. 1.3:6."):
            time_range("time-range", text)


def test_rectangle() -> None:
    assert rectangle("roi", "120,0, 480,360") == (120, 0, 480, 360)
    for text in ("120,0,480", "1.5,0,4,3", "-1,0,40,30"):
        with refuses(
            SettingsError,
            f"roi: expected X,Y,W,H with whole numbers of pixels, got '{text}'; e.g. 120,0,480,360.",
        ):
            rectangle("roi", text)


def test_sides_are_two_whole_numbers() -> None:
    assert sides("points.size", "1280, 720") == (1280, 720)
    with refuses(
        SettingsError, "points.size: expected W,H with whole numbers of pixels, got '12'; e.g. 1280,720."
    ):
        sides("points.size", "12")


def test_numbers() -> None:
    assert numbers("camera.distortion", "-0.3, 1e-2,0,0") == (-0.3, 0.01, 0.0, 0.0)
    for text in ("-0.3,x", "", "0.1,,0"):
        with refuses(
            SettingsError,
            f"camera.distortion: expected numbers with commas between them, got '{text}'; e.g. "
            "-0.28,0.09,0,0.",
        ):
            numbers("camera.distortion", text)


def test_words_by_name() -> None:
    assert words("points.map", ["a=joint1", "b=none"]) == {"a": "joint1", "b": "none"}
    with refuses(SettingsError, "points.map: expected NAME=TARGET, got 'a='; e.g. knee=joint2."):
        words("points.map", ["a="])


def test_three_numbers() -> None:
    assert three("identify.gains", ["0.4,0.1", "0.05"]) == (0.4, 0.1, 0.05)
    with refuses(SettingsError, "identify.gains: expected three numbers, got 2; e.g. 0.4,0.1,0.05."):
        three("identify.gains", ["1", "2"])


@pytest.mark.parametrize(
    ("kind", "value", "written"),
    [
        (bool, True, True),
        (int | None, 3, 3),
        (float, 1 / 3, 1 / 3),
        (tuple[int, int | None] | None, (3, 90), "3:90"),
        (tuple[int, int | None] | None, (0, None), "0:"),
        (tuple[float, float | None], (1e-7, 1 / 3), "1e-07:0.3333333333333333"),
        (tuple[int, int, int, int], (120, 0, 480, 360), "120,0,480,360"),
        (tuple[int, int], (1280, 720), "1280,720"),
        (tuple[float, ...], (-1 / 3, 1e-20, 0, 0), "-0.3333333333333333,1e-20,0.0,0.0"),
        (tuple[float, float, float], (0.4, 0.1, 0.2), "0.4,0.1,0.2"),
        (Tolerance, Tolerance(1 / 3, 1e-9), "0.3333333333333333rad,1e-09m"),
        (Mapping[str, str], {"a": "joint1"}, {"a": "joint1"}),
        (Mapping[str, float], {"a": 0.1 + 0.2}, {"a": 0.1 + 0.2}),
        (Mapping[str, tuple[float, float]], {"a": (-math.inf, 1e-9)}, {"a": "-inf:1e-09"}),
        (Sequence[str], ("a", "b"), ["a", "b"]),
        (Path, Path("/a/b.mp4"), "/a/b.mp4"),
        (tuple[Path, ...], (Path("/a,b.csv"),), ["/a,b.csv"]),
        (Literal["fast", "paper"] | None, "paper", "paper"),
    ],
)  # fmt: skip
def test_what_is_written_is_read_as_the_same_value(kind: Any, value: Any, written: Any) -> None:
    form = notation(kind)
    assert form.write(value) == written
    if form.named:
        words = [f"{name}={one}" for name, one in written.items()]
    else:
        words = [str(one) for one in (written if isinstance(written, list) else [written])]
    words = [word.lower() if kind is bool else word for word in words]
    assert form.read("option", words if form.many else words[0]) == value


def test_what_is_no_value_of_its_type_is_refused() -> None:
    for kind, text, message in [
        (bool, "yes", "option: expected true or false, got 'yes'."),
        (int, "1.5", "option: expected a whole number, got '1.5'."),
        (float | None, "x", "option: expected a number, got 'x'."),
        (Literal["fast", "paper"], "slow", "option: expected one of 'fast', 'paper', got 'slow'."),
    ]:
        with refuses(SettingsError, message):
            notation(kind).read("option", text)
