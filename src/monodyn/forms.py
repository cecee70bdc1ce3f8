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
from typing import Any, Literal, get_args, get_origin

from monodyn.choices import Tolerance, check_choice
from monodyn.errors import SettingsError

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""A number without a sign, as a regular expression."""


@dataclass(frozen=True)
class Notation:
    """How values of one type are written.

    Attributes:
        metavar: What the help shows for the words; empty for a flag, which has none.
        said: What is expected, for a message; ``{}`` stands for the metavar.
        reader: From a word to the value, of ``many`` from the list of them, of ``named`` from the word of one
            name; raises a ``ValueError`` for what is none.
        write: From the value to a text, a number, a list or a table of these, as a settings file has it.
        example: A word as it may be, for a message; empty where ``said`` is plain enough.
        many: Whether there may be several words.
        named: Whether each of them is ``NAME=...``.
        commas: Whether several may stand together on the command line, with commas between them.
    """

    metavar: str
    said: str
    reader: Callable[[Any], Any]
    write: Callable[[Any], Any]
    example: str = ""
    many: bool = False
    named: bool = False
    commas: bool = False

    def items(self, option: str, given: Sequence[str]) -> Any:
        """Return what the words of a command line give: a word, a list of them, or a table of them by name.

        Args:
            option: Name of the option, for the message.
            given: The words.

        Raises:
            SettingsError: a word has no name, or a name comes twice.
        """
        if not self.many:
            return given[-1]
        parts = apart(given) if self.commas else list(given)
        if not self.named:
            return parts
        found: dict[str, str] = {}
        for part in parts:
            name, _, text = part.partition("=")
            if not (name and text):
                raise self._refusal(option, part)
            if name in found:
                raise SettingsError(
                    f"{option}: expected each name once, got '{name}' twice; keep one of them."
                )
            found[name] = text
        return found

    def read(self, option: str, items: Any) -> Any:
        """Return the value that words stand for.

        Args:
            option: Name of the option, for the message.
            items: A word, a list of words or a table of words by name, as ``items`` returns them.

        Raises:
            SettingsError: they stand for no value of the type.
        """
        if self.named:
            return {name: self._value(option, word, f"{name}={word}") for name, word in items.items()}
        return self._value(option, items, ",".join(items) if self.many else items)

    def _value(self, option: str, items: Any, shown: str) -> Any:
        try:
            return self.reader(items)
        except (ValueError, KeyError):
            raise self._refusal(option, shown) from None

    def _refusal(self, option: str, shown: str) -> SettingsError:
        said = self.said.format(self.metavar.removesuffix(" ..."))
        return SettingsError(
            f"{option}: expected {said}, got '{shown}'{f'; e.g. {self.example}' if self.example else ''}."
        )


@dataclass(frozen=True)
class _Choice(Notation):
    """How one of several words is written."""

    def read(self, option: str, items: Any) -> Any:
        check_choice(option, items, self.metavar.split("|"))
        return items


def apart(given: Sequence[str]) -> list[str]:
    """Return words that may stand together with commas between them one by one.

    Args:
        given: What the user wrote; a word without any is left for the complaint.
    """
    return [part for word in given for part in [one for one in word.split(",") if one] or [word]]


def _matched(pattern: str, text: str) -> re.Match[str]:
    """Return the match of the whole text."""
    if not (match := re.fullmatch(pattern, text)):
        raise ValueError(text)
    return match


def _frames(text: str) -> tuple[int, int | None]:
    """Return the range ``A:B``, where either end may be left out."""
    match = _matched(r"(\d*):(\d*)", text.strip())
    return int(match[1] or 0), int(match[2]) if match[2] else None


def _seconds(text: str) -> tuple[float, float | None]:
    """Return the range of seconds ``A:B``, where either end may be left out."""
    begin, end = _ends(text)
    return float(begin or 0.0), float(end) if end else None


def _interval(text: str) -> tuple[float, float]:
    """Return the interval ``LOW:HIGH``."""
    low, high = _ends(text)
    return float(low), float(high)


def _ends(text: str) -> list[str]:
    """Return what is left and right of the colon."""
    ends = text.strip().split(":")
    if len(ends) != 2:
        raise ValueError(text)
    return ends


def _pixels(count: int) -> Callable[[str], tuple[int, ...]]:
    """Return what reads so many whole numbers of pixels with commas between them."""

    def read(text: str) -> tuple[int, ...]:
        match = _matched(",".join([r"(\d+)"] * count), text.replace(" ", ""))
        return tuple(int(word) for word in match.groups())

    return read


def _numbers(text: str) -> tuple[float, ...]:
    """Return numbers with commas between them."""
    return tuple(float(word) for word in text.split(","))


def _three(given: Sequence[str]) -> tuple[float, ...]:
    """Return three numbers with blanks or commas between them."""
    found = _numbers(",".join(given))
    if len(found) != 3:
        raise ValueError(given)
    return found


UNITS = {"deg": math.pi / 180.0, "rad": 1.0}, {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""What is an angle and what is a length, by unit."""


def _tolerance(text: str) -> Tolerance:
    """Return the tolerances that ``5deg``, ``2cm`` or both with a comma between them give."""
    found: dict[str, float] = {}
    for word in text.split(","):
        match = _matched(rf"({NUMBER})(deg|rad|mm|cm|m)", word.strip())
        name, units = ("angle", UNITS[0]) if match[2] in UNITS[0] else ("length", UNITS[1])
        if name in found or not float(match[1]) > 0.0:
            raise ValueError(text)
        found[name] = float(match[1]) * units[match[2]]
    return Tolerance(**found)


def _range(kind: type[int] | type[float]) -> Callable[[Sequence[Any]], str]:
    """Return what writes a range, whose end may be open."""
    # numbers of numpy count as numbers: each is written as Python's own
    return lambda ends: f"{kind(ends[0])!r}:{'' if ends[1] is None else repr(kind(ends[1]))}"


def _listed(kind: type[int] | type[float]) -> Callable[[Sequence[Any]], str]:
    """Return what writes numbers with commas between them."""
    return lambda several: ",".join(repr(kind(number)) for number in several)


def _named(write: Callable[[Any], Any]) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what writes values by name."""
    return lambda given: {str(name): write(value) for name, value in given.items()}


def _place(path: str | Path) -> str:
    """Write a file so that it is found from every folder."""
    return os.path.abspath(path)


# the key is the annotation of the field, without its None; a new setting of the same type needs nothing here
NOTATIONS: dict[Any, Notation] = {
    bool: Notation("", "true or false", {"true": True, "false": False}.__getitem__, bool),
    int: Notation("N", "a whole number", int, int),
    float: Notation("NUMBER", "a number", float, float),
    str: Notation("TEXT", "a text", str, str),
    Path: Notation("FILE", "a file", Path, _place),
    tuple[int, int | None]: Notation("A:B", "{} with whole frame numbers", _frames, _range(int), "0:120"),
    tuple[float, float | None]: Notation("A:B", "{} in seconds", _seconds, _range(float), "1.3:6"),
    tuple[int, int, int, int]: Notation(
        "X,Y,W,H", "{} with whole numbers of pixels", _pixels(4), _listed(int), "120,0,480,360"
    ),
    tuple[int, int]: Notation("W,H", "{} with whole numbers of pixels", _pixels(2), _listed(int), "1280,720"),
    tuple[float, ...]: Notation(
        "K1,K2,P1,P2[,K3]", "numbers with commas between them", _numbers, _listed(float), "-0.28,0.09,0,0"
    ),
    tuple[float, float, float]: Notation(
        "A,B,C", "three numbers", _three, _listed(float), "0.4,0.1,0.05", many=True
    ),
    Tolerance: Notation(
        "ANGLE,LENGTH", "an angle, a length or both, above 0", _tolerance,
        lambda most: f"{float(most.angle)!r}rad,{float(most.length)!r}m", "5deg,2cm",
    ),
    Mapping[str, str]: Notation(
        "NAME=TARGET ...", "{}", str, _named(str), "knee=joint2", many=True, named=True, commas=True
    ),
    Mapping[str, float]: Notation(
        "NAME=VALUE ...", "{} with a number", float, _named(float), "gravity=9.81", many=True, named=True,
        commas=True,
    ),
    Mapping[str, tuple[float, float]]: Notation(
        "NAME=LOW:HIGH ...", "{} with two numbers", _interval, _named(_range(float)), "link1.length=0.1:0.3",
        many=True, named=True, commas=True,
    ),
    Sequence[str]: Notation(
        "NAME ...", "names", tuple, lambda names: [str(name) for name in names], many=True, commas=True
    ),
    # a comma is part of the name of a file
    tuple[Path, ...]: Notation(
        "FILE", "files", lambda names: tuple(map(Path, names)), lambda files: list(map(_place, files)),
        many=True,
    ),
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
        return _Choice("|".join(get_args(kind)), "one of {}", str, str)
    return NOTATIONS[kind]
