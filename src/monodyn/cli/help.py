"""The help pages: of the program, and of each command in two levels, as wide as the terminal."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import MISSING
from typing import Any

from monodyn.choices import Tolerance
from monodyn.cli.options import COMMANDS
from monodyn.cli.parse import CONFIG, config_option
from monodyn.cli.table import Option, described
from monodyn.settings import RunSettings

WIDEST, LEAST = 100, 24
"""Columns of a page: lines that are longer are hard to read; and no page is narrower."""
NARROW = 64
"""Columns below which what is said of an option stands under its name, not beside it."""


def page(command: str, options: Sequence[Option], *, whole: bool) -> str:
    """Return the help page of a command.

    Args:
        command: Its name.
        options: All that it takes.
        whole: All of them; else those that most people need.
    """
    entry = COMMANDS[command]
    listed = [*options, *([config_option()] if entry.file else [])]
    named = {option.name: option for option in listed}
    # where a command has few options the first level has them all
    first = entry.people.split() or list(named)
    shown = [named[name] for name in first]
    others = [option for option in listed if option not in shown]
    sections = [("", [option for option in shown if option.word])]
    sections.append(("Options", [option for option in shown if not option.word]))
    if whole:
        sections += _groups(others)
    lines = [_usage(command, options), *_about(command)]
    for title, rows in sections:
        if rows:
            lines += ["", *([f"{title}:"] if title else []), *table((_left(row), _right(row)) for row in rows)]
    lines += ["", *table(_helps(others, whole=whole))]
    return "\n".join(lines) + "\n"


def _usage(command: str, options: Sequence[Option]) -> str:
    """Return how a command is used, in a line or two."""
    parts = []
    for option in options:
        needed = option.usual is MISSING
        if option.word:
            parts.append(option.metavar if needed or option.several else f"[{option.metavar}]")
    parts += [f"{o.flag} {o.metavar}" for o in options if o.usual is MISSING and not o.word]
    return command_line(" ".join(["Usage: monodyn", command, *parts, "[OPTIONS]"]))


def _about(command: str) -> list[str]:
    """Return what a command does, and an example."""
    entry = COMMANDS[command]
    said = (entry.options.__doc__ or "").splitlines()[0].replace("``", "'")
    return ["", *textwrap.wrap(said, width(), break_on_hyphens=False), "", "Example:", f"  {example(command)}"]


def example(command: str) -> str:
    """Return the example of a command, in several lines where it is wider than the page.

    Args:
        command: Its name.
    """
    return command_line(COMMANDS[command].example, "  ")


def command_line(text: str, indent: str = "") -> str:
    """Return a command line that is broken between words where it is wider than the page.

    Args:
        text: The command line.
        indent: What stands before it.
    """
    lines = textwrap.wrap(
        text, width() - len(indent) - 2, break_on_hyphens=False, break_long_words=False, subsequent_indent="    "
    )
    return f" \\\n{indent}".join(lines)


def _groups(options: Sequence[Option]) -> list[tuple[str, list[Option]]]:
    """Return options by the stage that takes them, each with what it is about."""
    said, found = described(RunSettings), {}
    for option in options:
        found.setdefault(option.place if option.place not in ("", "settings") else "", []).append(option)
    said["live"] = "How the stream is read and followed."
    return [
        ("More options" if not place else f"{place.capitalize()}: {_small(said[place])}", rows)
        for place, rows in found.items()
    ]


def _small(sentence: str) -> str:
    return sentence[0].lower() + sentence[1:].rstrip(".")


def _helps(others: Sequence[Option], *, whole: bool) -> list[tuple[str, str]]:
    """Return the rows that name the pages themselves."""
    more = f"Show all options, {len(others)} more: every number and choice of every stage."
    short, full = ("-h, --help", "Show this page."), ("--help-all", more)
    if not others:
        return [short]
    return [("-h, --help", "Show the options that most people need."), ("--help-all", "Show this page.")] if whole else [
        short, full
    ]


def _left(option: Option) -> str:
    """Return what stands for an option on the command line."""
    if option.word:
        return option.metavar
    names = [option.flag, *([f"--{option.also}"] if option.also else [])]
    return f"{', '.join(reversed(names))} {option.metavar}".rstrip()


def _right(option: Option) -> str:
    """Return what is said of an option, and its usual value."""
    if option.usual is MISSING and not option.word:
        return f"{option.help} Required."
    usual = _usual(option.usual)
    return f"{option.help} Default: {usual}." if usual else option.help


def _usual(value: Any) -> str:
    """Write the value of an option that is left out; nothing where there is none, or for a flag."""
    if isinstance(value, Tolerance):
        return "5deg,2cm"
    if value is MISSING or value is None or isinstance(value, bool) or value in ((), {}):
        return ""
    if isinstance(value, tuple):
        return ",".join(f"{one:g}" for one in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def table(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Return rows of two columns as lines; in a narrow page the second stands under the first.

    Args:
        rows: A name, and what is said of it.
    """
    lines: list[str] = []
    wide = width() >= NARROW
    at = 26 if wide else 6
    for left, right in rows:
        said = textwrap.wrap(right, width() - at, break_on_hyphens=False, break_long_words=False) or [""]
        if wide and len(left) <= at - 4:
            lines.append(f"  {left:{at - 2}}{said.pop(0)}".rstrip())
        else:
            lines += textwrap.wrap(
                left, width() - 2, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False,
                break_long_words=False,
            )  # fmt: skip
        lines += [" " * at + line for line in said]
    return lines


def width() -> int:
    """Return how many columns a page has."""
    return max(LEAST, min(WIDEST, shutil.get_terminal_size().columns))
