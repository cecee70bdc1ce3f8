"""Words that a setting can be, and small values that rooms share: checked in one way, wherever they live."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Literal, get_args

from monodyn.errors import MonodynError, SettingsError
from monodyn.names import meant, near, quoted

Method = Literal["fast", "paper"]
"""What the method of a stage can be called; ``stages`` has the functions."""
METHOD_NAMES: tuple[str, ...] = get_args(Method)

BUNDLED_FILES = ("single", "double", "triple", "bob", "ball", "cartpole")
BUNDLED = (*BUNDLED_FILES, "chain:N")
"""Names that ``load`` takes; N is the number of links of a chain, 1 to 10."""

AUTO = "auto"
"""What stands for the one of them that the evidence prefers."""

MOST_DRAWN = 100
"""Models that may be drawn from what the data allow."""


@dataclass(frozen=True)
class Tolerance:
    """How far off a prediction may be.

    Attributes:
        angle: Of a hinge [rad].
        length: Of a slide [m].
    """

    angle: float = math.radians(5.0)
    length: float = 0.02

    def __post_init__(self) -> None:
        for name, value, unit in (("angle", self.angle, "rad"), ("length", self.length, "m")):
            if not isinstance(value, Real) or not 0.0 < value < math.inf:
                raise SettingsError(
                    f"tolerance: expected a finite {name} above 0 [{unit}], got {value}; change it."
                )

    def of(self, joint: str) -> float:
        """Return the tolerance of a joint [rad or m].

        Args:
            joint: Its kind, ``hinge`` or ``slide``.
        """
        return self.angle if joint == "hinge" else self.length


def is_bundled(source: object) -> bool:
    """Return whether a mechanism is named that comes with the package, or any, whatever file has the name.

    Args:
        source: What was given as a mechanism; a path is none of these names.
    """
    return isinstance(source, str) and (source in (*BUNDLED_FILES, AUTO) or source.startswith("chain:"))


def check_whole(name: str, value: object, most: int | None = None) -> None:
    """Refuse what is no count, nor a seed.

    Args:
        name: Name of the setting, for the message.
        value: What was given.
        most: Largest that it may be; None for any.

    Raises:
        SettingsError: ``value`` is no whole number, less than 0, or too large.
    """
    if not isinstance(value, Integral) or value < 0 or (most is not None and int(value) > most):
        expected = "0 or more" if most is None else f"0 to {most}"
        raise SettingsError(f"{name}: expected {expected}, got {value}; give a whole number.")


def check_endless(path: Path, error: type[MonodynError]) -> None:
    """Refuse a device, whose end nobody knows, in place of a file.

    Args:
        path: What was named; it need not exist.
        error: Class of the exception.

    Raises:
        MonodynError: (as ``error``) it is a device.
    """
    if path.is_char_device() or path.is_block_device():
        raise error(f"'{path}': expected a file, got a device; save its content to a file.")


def check_choice(name: str, value: str | None, choices: Collection[str | None]) -> None:
    """Refuse a word that is no choice of a setting.

    Args:
        name: Name of the setting, for the message.
        value: What was chosen.
        choices: What can be; None among them stands for a setting that may be left open.

    Raises:
        SettingsError: ``value`` is none of them.
    """
    if value not in choices:
        names = [choice for choice in choices if choice is not None]
        asked = f"; {meant(near(names, value))}" if value and near(names, value) else "."
        raise SettingsError(f"{name}: expected one of {quoted(names)}, got '{value}'{asked}")
