"""Settings as they are written on the command line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import pytest

from monodyn.choices import Tolerance
from monodyn.errors import SettingsError
from monodyn.forms import notation
from support import refuses

FRAMES, SECONDS = tuple[int, int | None], tuple[float, float | None]
BOX, SIZE, BENDS, GAINS = (
    tuple[int, int, int, int],
    tuple[int, int],
    tuple[float, ...],
    tuple[float, float, float],
)
TARGETS, VALUES, INTERVALS = Mapping[str, str], Mapping[str, float], Mapping[str, tuple[float, float]]
NAMES, FILES = Sequence[str], tuple[Path, ...]


def read(kind: Any, *words: str) -> Any:
    """Read words as a command line does."""
    form = notation(kind)
    return form.read("option", form.items("option", words))


@pytest.mark.parametrize(
    ("kind", "words", "value"),
    [
        (FRAMES, "3:9", (3, 9)),
        (FRAMES, ":9", (0, 9)),
        (FRAMES, "3:", (3, None)),
        (SECONDS, "1.3:6", (1.3, 6.0)),
        (SECONDS, ":.5", (0.0, 0.5)),
        (SECONDS, "2.:", (2.0, None)),
        # clips may begin before 0
        (SECONDS, "-1:2", (-1.0, 2.0)),
        (SECONDS, "0:inf", (0.0, math.inf)),
        (BOX, "120,0,480,360", (120, 0, 480, 360)),
        (SIZE, "1280,720", (1280, 720)),
        (BENDS, "-0.3,1e-2,0,0", (-0.3, 0.01, 0.0, 0.0)),
        (GAINS, "0.4,0.1 0.05", (0.4, 0.1, 0.05)),
        (Tolerance, "3mm", Tolerance(length=3e-3)),
        (Tolerance, ".1rad", Tolerance(angle=0.1)),
        (Tolerance, "5deg,1cm", Tolerance(math.radians(5.0), 0.01)),
        # several are read in order, with blanks or commas between them
        (VALUES, "a=1 b=-2.5e3 c=0", {"a": 1.0, "b": -2500.0, "c": 0.0}),
        (VALUES, "a=1,b=2 c=0, d=1", {"a": 1.0, "b": 2.0, "c": 0.0, "d": 1.0}),
        (INTERVALS, "a=1:2,b=-inf:0", {"a": (1.0, 2.0), "b": (-math.inf, 0.0)}),
        (TARGETS, "a=joint1,b=none", {"a": "joint1", "b": "none"}),
        (NAMES, "a,b c", ("a", "b", "c")),
        (FILES, "a,b.csv", (Path("a,b.csv"),)),
    ],
)
def test_words_become_values(kind: Any, words: str, value: Any) -> None:
    assert read(kind, *words.split()) == value


def test_blanks_within_a_word_make_no_difference() -> None:
    assert read(BOX, "120,0, 480,360") == (120, 0, 480, 360)
    assert read(SIZE, "1280, 720") == (1280, 720)
    assert read(BENDS, "-0.3, 0,0,0") == (-0.3, 0.0, 0.0, 0.0)
    assert read(Tolerance, "5deg, 2cm") == Tolerance()


@pytest.mark.parametrize(
    ("kind", "words", "said"),
    [
        (FRAMES, ("ten", "-3:5"), "A:B with whole frame numbers, got '{}'; e.g. 0:120."),
        (SECONDS, ("6", "a:b", "1:2:3"), "A:B in seconds, got '{}'; e.g. 1.3:6."),
        (BOX, ("120,0,480", "1.5,0,4,3", "-1,0,40,30"),
         "X,Y,W,H with whole numbers of pixels, got '{}'; e.g. 120,0,480,360."),
        (SIZE, ("12",), "W,H with whole numbers of pixels, got '{}'; e.g. 1280,720."),
        (BENDS, ("-0.3,x", "", "0.1,,0"),
         "numbers with commas between them, got '{}'; e.g. -0.28,0.09,0,0."),
        (GAINS, ("1,2",), "three numbers, got '{}'; e.g. 0.4,0.1,0.05."),
        (Tolerance, ("5", "5deg,3deg", "0deg", "-1deg", "5 %", ""),
         "an angle, a length or both, above 0, got '{}'; e.g. 5deg,2cm."),
        (VALUES, ("gravity", "a=1=2", "a=", "=1", "", ","),
         "NAME=VALUE with a number, got '{}'; e.g. gravity=9.81."),
        (INTERVALS, ("link1.length=3", "a=1:", "a"),
         "NAME=LOW:HIGH with two numbers, got '{}'; e.g. link1.length=0.1:0.3."),
        (TARGETS, ("a", "a=", "=joint1"), "NAME=TARGET, got '{}'; e.g. knee=joint2."),
        (bool, ("yes",), "true or false, got '{}'."),
        (int, ("1.5",), "a whole number, got '{}'."),
        (float | None, ("x",), "a number, got '{}'."),
        (Literal["fast", "paper"], ("slow",), "one of 'fast', 'paper', got '{}'."),
    ],
)  # fmt: skip
def test_what_is_no_value_of_its_type_is_refused(kind: Any, words: tuple[str, ...], said: str) -> None:
    for word in words:
        with refuses(SettingsError, f"option: expected {said.format(word)}"):
            read(kind, word)


def test_a_name_comes_once() -> None:
    with refuses(SettingsError, "option: expected each name once, got 'a' twice; keep one of them."):
        read(INTERVALS, "a=1:2", "a=1:2")


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
        items: Any = {name: str(one) for name, one in written.items()}
    else:
        items = [str(one) for one in written] if isinstance(written, list) else str(written)
        items = items.lower() if kind is bool else [items] if form.many and isinstance(items, str) else items
    assert form.read("option", items) == value
