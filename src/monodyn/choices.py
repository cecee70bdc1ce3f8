"""Words that a setting can be: checked in one way, wherever the setting lives."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal, get_args

from monodyn.errors import SettingsError

Method = Literal["fast", "paper"]
"""What the method of a stage can be called; ``stages`` has the functions."""
METHOD_NAMES: tuple[str, ...] = get_args(Method)


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
        known = ", ".join(f"'{choice}'" for choice in choices if choice is not None)
        raise SettingsError(f"{name}: expected one of {known}, got '{value}'.")
