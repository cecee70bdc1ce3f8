"""How a setting is written on the command line when a single word cannot hold its type."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tyro import conf

from monodyn.choices import Tolerance
from monodyn.errors import SettingsError

Words = conf.UseAppendAction[tuple[tuple[str, ...], ...]]
"""The words after each use of an option that may be repeated."""


@dataclass(frozen=True)
class Notation:
    """How settings of one type are written.

    Attributes:
        words: Type of what the user writes.
        usual: What stands for an option that is left out.
        metavar: What the help shows for the words.
        read: From the option's name and its words to the setting.
    """

    words: Any
    usual: Any
    metavar: str
    read: Callable[[str, Any], Any]


def frame_range(option: str, text: str | None) -> tuple[int, int | None] | None:
    """Return the range ``A:B``, where either end may be left out.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not two whole numbers with a colon between them.
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d*):(\d*)", text.strip())
    if not match:
        raise SettingsError(f"{option}: expected A:B with whole frame numbers, got '{text}'; e.g. 0:120.")
    return int(match[1] or 0), int(match[2]) if match[2] else None


def time_range(option: str, text: str | None) -> tuple[float, float | None] | None:
    """Return the range of seconds ``A:B``, where either end may be left out.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not two numbers with a colon between them.
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d+\.?\d*|\.\d+)?:(\d+\.?\d*|\.\d+)?", text.strip())
    if not match:
        raise SettingsError(f"{option}: expected A:B in seconds, got '{text}'; e.g. 1.3:6.")
    return float(match[1] or 0.0), float(match[2]) if match[2] else None


def rectangle(option: str, text: str | None) -> tuple[int, int, int, int] | None:
    """Return the rectangle ``X,Y,W,H``.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not four whole numbers with commas between them.
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d+),(\d+),(\d+),(\d+)", text.replace(" ", ""))
    if not match:
        raise SettingsError(
            f"{option}: expected X,Y,W,H with whole numbers of pixels, got '{text}'; e.g. 120,0,480,360."
        )
    left, top, width, height = (int(word) for word in match.groups())
    return left, top, width, height


def sides(option: str, text: str | None) -> tuple[int, int] | None:
    """Return the sides ``W,H``.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not two whole numbers with a comma between them.
    """
    if text is None:
        return None
    match = re.fullmatch(r"(\d+),(\d+)", text.replace(" ", ""))
    if not match:
        raise SettingsError(
            f"{option}: expected W,H with whole numbers of pixels, got '{text}'; e.g. 1280,720."
        )
    return int(match[1]), int(match[2])


def numbers(option: str, text: str | None) -> tuple[float, ...] | None:
    """Return numbers with commas between them.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: a word is no number.
    """
    if text is None:
        return None
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise SettingsError(
            f"{option}: expected numbers with commas between them, got '{text}'; e.g. -0.28,0.09,0,0."
        ) from None


UNITS = {"deg": math.pi / 180.0, "rad": 1.0}, {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""What is an angle and what is a length, by unit."""


def tolerance(option: str, text: str | None) -> Tolerance:
    """Return the tolerances that ``5deg``, ``2cm`` or both with a comma between them give.

    Args:
        option: Name of the option, for the message.
        text: What the user wrote, or None.

    Raises:
        SettingsError: it is not an angle, a length or both.
    """
    found: dict[str, float] = {}
    for word in (text or "").split(",") if text is not None else ():
        match = re.fullmatch(r"(\d+\.?\d*|\.\d+)(deg|rad|mm|cm|m)", word.strip())
        name, units = ("angle", UNITS[0]) if match and match[2] in UNITS[0] else ("length", UNITS[1])
        if not match or name in found or not float(match[1]) > 0.0:
            raise SettingsError(
                f"{option}: expected an angle, a length or both, above 0, got '{text}'; e.g. 5deg,2cm."
            )
        found[name] = float(match[1]) * units[match[2]]
    return Tolerance(**found)


def apart(given: Sequence[Sequence[str]]) -> list[list[str]]:
    """Return words that may stand together with commas between them one by one.

    Args:
        given: What the user wrote, by use of the option; a word without any is left for the complaint.
    """
    return [
        [part for word in group for part in [one for one in word.split(",") if one] or [word]]
        for group in given
    ]


def words(option: str, given: Sequence[Sequence[str]]) -> dict[str, str]:
    """Return the words by name that ``NAME=WORD`` words give.

    Args:
        option: Name of the option, for the message.
        given: What the user wrote, by use of the option.

    Raises:
        SettingsError: a word is not a name and a word, or a name comes twice.
    """
    found: dict[str, str] = {}
    for word, name, text in _assigned(option, given):
        if not name or not text:
            raise SettingsError(f"{option}: expected NAME=TARGET, got '{word}'; e.g. knee=joint2.")
        found[name] = text
    return found


def values(option: str, words: Sequence[Sequence[str]]) -> dict[str, float]:
    """Return the values by name that ``NAME=VALUE`` words give.

    Args:
        option: Name of the option, for the message.
        words: What the user wrote, by use of the option.

    Raises:
        SettingsError: a word is not a name and a number, or a name comes twice.
    """
    found: dict[str, float] = {}
    for word, name, text in _assigned(option, words):
        try:
            found[name] = float(text)
        except ValueError:
            raise SettingsError(
                f"{option}: expected NAME=VALUE with a number, got '{word}'; e.g. gravity=9.81."
            ) from None
    return found


def intervals(option: str, words: Sequence[Sequence[str]]) -> dict[str, tuple[float, float]]:
    """Return the intervals by name that ``NAME=LOW:HIGH`` words give.

    Args:
        option: Name of the option, for the message.
        words: What the user wrote, by use of the option.

    Raises:
        SettingsError: a word is not a name and two numbers, or a name comes twice.
    """
    found: dict[str, tuple[float, float]] = {}
    for word, name, text in _assigned(option, words):
        low, _, high = text.partition(":")
        try:
            found[name] = float(low), float(high)
        except ValueError:
            raise SettingsError(
                f"{option}: expected NAME=LOW:HIGH with two numbers, got '{word}'; e.g. link1.length=0.1:0.3."
            ) from None
    return found


def names(option: str, words: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the names of repeated options in order, with blanks or commas between them.

    Args:
        option: Name of the option.
        words: What the user wrote, by use of the option.
    """
    return tuple(word for group in apart(words) for word in group)


def paths(option: str, words: Sequence[Sequence[str]]) -> tuple[Path, ...]:
    """Return the files of repeated options in order; a comma is part of a name.

    Args:
        option: Name of the option.
        words: What the user wrote, by use of the option.
    """
    return tuple(Path(name) for group in words for name in group)


def _assigned(option: str, words: Sequence[Sequence[str]]) -> list[tuple[str, str, str]]:
    """Return each word with what is left and right of its ``=``; a name may come once."""
    parts = []
    for word in names(option, words):
        name, _, text = word.partition("=")
        if any(name == other for _, other, _ in parts):
            raise SettingsError(f"{option}: expected each name once, got '{name}' twice; keep one of them.")
        parts.append((word, name, text))
    return parts


# the key is the annotation of the field, so a new setting of the same type needs nothing here
FORMS: dict[Any, Notation] = {
    tuple[int, int | None] | None: Notation(str | None, None, "A:B", frame_range),
    tuple[float, float | None] | None: Notation(str | None, None, "A:B", time_range),
    tuple[int, int, int, int] | None: Notation(str | None, None, "X,Y,W,H", rectangle),
    tuple[float, ...] | None: Notation(str | None, None, "K1,K2,P1,P2[,K3]", numbers),
    tuple[int, int] | None: Notation(str | None, None, "W,H", sides),
    Tolerance: Notation(str | None, None, "ANGLE,LENGTH", tolerance),
    Mapping[str, str]: Notation(Words, (), "NAME=TARGET ...", words),
    Mapping[str, float]: Notation(Words, (), "NAME=VALUE ...", values),
    Sequence[str]: Notation(Words, (), "NAME ...", names),
    tuple[Path, ...]: Notation(Words, (), "FILE ...", paths),
    Mapping[str, tuple[float, float]]: Notation(Words, (), "NAME=LOW:HIGH ...", intervals),
}
"""The form of each type of setting that a single word cannot hold; all others are one word."""
