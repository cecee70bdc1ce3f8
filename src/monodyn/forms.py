"""How values of settings are written, on the command line and in a settings file, and read again.

Every type of setting has one notation: a word, or several where an option may be repeated. What is written is
read as the same value, to the last digit.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

from monodyn.choices import Tolerance, check_choice
from monodyn.errors import SettingsError

Value = TypeVar("Value")
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""A number without a sign, as a regular expression."""


@dataclass(frozen=True)
class Notation:
    """How values of one type are written.

    Attributes:
        metavar: What the help shows for the words; empty for a flag, which has none.
        read: From the option's name and its word, or words, to the value; raises a ``SettingsError``.
        write: From the value to a text, a number, a list or a table of these, as a settings file has it.
        many: Whether there may be several words.
        named: Whether each of them is ``NAME=...``.
    """

    metavar: str
    read: Callable[[str, Any], Any]
    write: Callable[[Any], Any]
    many: bool = False
    named: bool = False


def frame_range(option: str, text: str) -> tuple[int, int | None]:
    """Return the range ``A:B``, where either end may be left out.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: it is not two whole numbers with a colon between them.
    """
    match = re.fullmatch(r"(\d*):(\d*)", text.strip())
    if not match:
        raise SettingsError(f"{option}: expected A:B with whole frame numbers, got '{text}'; e.g. 0:120.")
    return int(match[1] or 0), int(match[2]) if match[2] else None


def time_range(option: str, text: str) -> tuple[float, float | None]:
    """Return the range of seconds ``A:B``, where either end may be left out.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: it is not two numbers with a colon between them.
    """
    match = re.fullmatch(rf"({NUMBER})?:({NUMBER})?", text.strip())
    if not match:
        raise SettingsError(f"{option}: expected A:B in seconds, got '{text}'; e.g. 1.3:6.")
    return float(match[1] or 0.0), float(match[2]) if match[2] else None


def rectangle(option: str, text: str) -> tuple[int, int, int, int]:
    """Return the rectangle ``X,Y,W,H``.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: it is not four whole numbers with commas between them.
    """
    match = re.fullmatch(r"(\d+),(\d+),(\d+),(\d+)", text.replace(" ", ""))
    if not match:
        raise SettingsError(
            f"{option}: expected X,Y,W,H with whole numbers of pixels, got '{text}'; e.g. 120,0,480,360."
        )
    left, top, width, height = (int(word) for word in match.groups())
    return left, top, width, height


def sides(option: str, text: str) -> tuple[int, int]:
    """Return the sides ``W,H``.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: it is not two whole numbers with a comma between them.
    """
    match = re.fullmatch(r"(\d+),(\d+)", text.replace(" ", ""))
    if not match:
        raise SettingsError(
            f"{option}: expected W,H with whole numbers of pixels, got '{text}'; e.g. 1280,720."
        )
    return int(match[1]), int(match[2])


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Return numbers with commas between them.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: a word is no number.
    """
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise SettingsError(
            f"{option}: expected numbers with commas between them, got '{text}'; e.g. -0.28,0.09,0,0."
        ) from None


def three(option: str, given: Sequence[str]) -> tuple[float, float, float]:
    """Return three numbers with blanks or commas between them.

    Args:
        option: Name of the option, for the message.
        given: What the user wrote.

    Raises:
        SettingsError: a word is no number, or there are more or fewer.
    """
    found = numbers(option, ",".join(given))
    if len(found) != 3:
        raise SettingsError(f"{option}: expected three numbers, got {len(found)}; e.g. 0.4,0.1,0.05.")
    return found[0], found[1], found[2]


UNITS = {"deg": math.pi / 180.0, "rad": 1.0}, {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""What is an angle and what is a length, by unit."""


def tolerance(option: str, text: str) -> Tolerance:
    """Return the tolerances that ``5deg``, ``2cm`` or both with a comma between them give.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote.

    Raises:
        SettingsError: it is not an angle, a length or both.
    """
    found: dict[str, float] = {}
    for word in text.split(","):
        match = re.fullmatch(rf"({NUMBER})(deg|rad|mm|cm|m)", word.strip())
        name, units = ("angle", UNITS[0]) if match and match[2] in UNITS[0] else ("length", UNITS[1])
        if not match or name in found or not float(match[1]) > 0.0:
            raise SettingsError(
                f"{option}: expected an angle, a length or both, above 0, got '{text}'; e.g. 5deg,2cm."
            )
        found[name] = float(match[1]) * units[match[2]]
    return Tolerance(**found)


def apart(given: Sequence[str]) -> list[str]:
    """Return words that may stand together with commas between them one by one.

    Args:
        given: What the user wrote; a word without any is left for the complaint.
    """
    return [part for word in given for part in [one for one in word.split(",") if one] or [word]]


def words(option: str, given: Sequence[str]) -> dict[str, str]:
    """Return the words by name that ``NAME=WORD`` words give.

    Args:
        option: Name of the option, for the message.
        given: What the user wrote.

    Raises:
        SettingsError: a word is not a name and a word, or a name comes twice.
    """
    found: dict[str, str] = {}
    for word, name, text in _assigned(option, given):
        if not name or not text:
            raise SettingsError(f"{option}: expected NAME=TARGET, got '{word}'; e.g. knee=joint2.")
        found[name] = text
    return found


def values(option: str, given: Sequence[str]) -> dict[str, float]:
    """Return the values by name that ``NAME=VALUE`` words give.

    Args:
        option: Name of the option, for the message.
        given: What the user wrote.

    Raises:
        SettingsError: a word is not a name and a number, or a name comes twice.
    """
    said = "NAME=VALUE with a number", "gravity=9.81"
    return _read_each(option, given, float, said)


def intervals(option: str, given: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the intervals by name that ``NAME=LOW:HIGH`` words give.

    Args:
        option: Name of the option, for the message.
        given: What the user wrote.

    Raises:
        SettingsError: a word is not a name and two numbers, or a name comes twice.
    """
    said = "NAME=LOW:HIGH with two numbers", "link1.length=0.1:0.3"
    return _read_each(option, given, _interval, said)


def names(option: str, given: Sequence[str]) -> tuple[str, ...]:
    """Return names in order, with blanks or commas between them.

    Args:
        option: Name of the option.
        given: What the user wrote.
    """
    return tuple(apart(given))


def paths(option: str, given: Sequence[str]) -> tuple[Path, ...]:
    """Return files in order; a comma is part of a name.

    Args:
        option: Name of the option.
        given: What the user wrote.
    """
    return tuple(Path(name) for name in given)


def _interval(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    return float(low), float(high)


def _read_each(
    option: str, given: Sequence[str], read: Callable[[str], Value], said: tuple[str, str]
) -> dict[str, Value]:
    """Return what is read to the right of each ``=``, by the name to its left; ``said`` is what is expected,
    and an example."""
    found: dict[str, Value] = {}
    for word, name, text in _assigned(option, given):
        try:
            found[name] = read(text)
        except ValueError:
            raise SettingsError(f"{option}: expected {said[0]}, got '{word}'; e.g. {said[1]}.") from None
    return found


def _assigned(option: str, given: Sequence[str]) -> list[tuple[str, str, str]]:
    """Return each word with what is left and right of its ``=``; a name may come once."""
    parts = []
    for word in apart(given):
        name, _, text = word.partition("=")
        if any(name == other for _, other, _ in parts):
            raise SettingsError(f"{option}: expected each name once, got '{name}' twice; keep one of them.")
        parts.append((word, name, text))
    return parts


def _one(kind: Callable[[str], Any], said: str) -> Callable[[str, str], Any]:
    """Return what reads a word as a value of a simple type."""

    def read(option: str, text: str) -> Any:
        try:
            return kind(text)
        except (ValueError, KeyError):
            raise SettingsError(f"{option}: expected {said}, got '{text}'.") from None

    return read


def _chosen(choices: tuple[str, ...]) -> Callable[[str, str], str]:
    """Return what reads a word that is one of several."""

    def read(option: str, text: str) -> str:
        check_choice(option, text, choices)
        return text

    return read


def _range(ends: tuple[float, float | None]) -> str:
    """Write a range whose end may be open."""
    return f"{ends[0]!r}:{'' if ends[1] is None else repr(ends[1])}"


def _listed(several: Sequence[float]) -> str:
    """Write numbers with commas between them."""
    return ",".join(repr(float(number)) for number in several)


def _place(path: str | Path) -> str:
    """Write a file so that it is found from every folder."""
    return os.path.abspath(path)


# the key is the annotation of the field, without its None; a new setting of the same type needs nothing here
NOTATIONS: dict[Any, Notation] = {
    bool: Notation("", _one({"true": True, "false": False}.__getitem__, "true or false"), bool),
    int: Notation("N", _one(int, "a whole number"), int),
    float: Notation("NUMBER", _one(float, "a number"), float),
    str: Notation("TEXT", _one(str, "a text"), str),
    Path: Notation("FILE", _one(Path, "a file"), _place),
    tuple[int, int | None]: Notation("A:B", frame_range, _range),
    tuple[float, float | None]: Notation("A:B", time_range, _range),
    tuple[int, int, int, int]: Notation("X,Y,W,H", rectangle, lambda box: ",".join(map(str, box))),
    tuple[int, int]: Notation("W,H", sides, lambda size: ",".join(map(str, size))),
    tuple[float, ...]: Notation("K1,K2,P1,P2[,K3]", numbers, _listed),
    tuple[float, float, float]: Notation("A,B,C", three, _listed, many=True),
    Tolerance: Notation("ANGLE,LENGTH", tolerance, lambda most: f"{most.angle!r}rad,{most.length!r}m"),
    Mapping[str, str]: Notation("NAME=TARGET ...", words, dict, many=True, named=True),
    Mapping[str, float]: Notation(
        "NAME=VALUE ...", values, lambda given: {k: float(v) for k, v in given.items()}, many=True, named=True
    ),
    Mapping[str, tuple[float, float]]: Notation(
        "NAME=LOW:HIGH ...", intervals, lambda given: {k: _range(v) for k, v in given.items()}, many=True,
        named=True,
    ),
    Sequence[str]: Notation("NAME ...", names, list, many=True),
    tuple[Path, ...]: Notation("FILE", paths, lambda files: [_place(file) for file in files], many=True),
}  # fmt: skip
"""The notation of each type of setting."""


def option_name(setting: Field[Any]) -> str:
    """Return what a setting is called on the command line and in a settings file, without its stage.

    Args:
        setting: The field.
    """
    return setting.metadata.get("name", setting.name.replace("_", "-"))


def notation(kind: Any) -> Notation:
    """Return how values of a type are written.

    Args:
        kind: The annotation of a setting; what may be left open is written as if it could not.
    """
    if kind not in NOTATIONS and NoneType in get_args(kind):
        (kind,) = (one for one in get_args(kind) if one is not NoneType)
    if get_origin(kind) is Literal:
        return Notation("|".join(get_args(kind)), _chosen(get_args(kind)), str)
    return NOTATIONS[kind]
