"""The help page of a command, in two levels: the options that most people need, and all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING
from typing import Any

from monodyn.choices import Tolerance
from monodyn.cli.options import COMMANDS
from monodyn.cli.pages import command_line, paragraph, two_columns
from monodyn.cli.table import CONFIG, Option, described
from monodyn.settings import RunSettings


def page(command: str, options: Sequence[Option], *, whole: bool) -> str:
    """Return the help page of a command.

    Args:
        command: Its name.
        options: All that it takes.
        whole: All of them; else those that most people need.
    """
    entry = COMMANDS[command]
    listed = [*options, *([CONFIG] if entry.file else [])]
    named = {option.name: option for option in listed}
    # where a command has few options the first level has them all
    first = entry.people.split() or list(named)
    shown = [named[name] for name in first]
    others = [option for option in listed if option not in shown]
    sections = [("", [option for option in shown if option.word])]
    sections.append(("Options", [option for option in shown if not option.word]))
    if whole:
        sections += _groups(others)
    lines = [*_usage(command, options), *_about(command)]
    for title, rows in sections:
        if rows:
            lines += [
                "",
                *paragraph(f"{title}:" if title else ""),
                *two_columns((_left(row), _right(row)) for row in rows),
            ]
    lines += ["", *two_columns(_helps(others, whole=whole))]
    return "\n".join(lines) + "\n"


def _usage(command: str, options: Sequence[Option]) -> list[str]:
    """Return how a command is used, in a line or two."""
    parts = []
    for option in options:
        needed = option.usual is MISSING
        if option.word:
            parts.append(option.metavar if needed or option.form.many else f"[{option.metavar}]")
    parts += [f"{o.flag} {o.metavar}" for o in options if o.usual is MISSING and not o.word]
    return command_line(" ".join(["Usage: monodyn", command, *parts, "[OPTIONS]"]))


def _about(command: str) -> list[str]:
    """Return what a command does, and an example."""
    entry = COMMANDS[command]
    said = (entry.options.__doc__ or "").splitlines()[0].replace("``", "'")
    return ["", *paragraph(said), "", "Example:", *command_line(entry.example, "  ")]


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
    this = "Show this page."
    if not others:
        return [("-h, --help", this)]
    if whole:
        return [("-h, --help", "Show the options that most people need."), ("--help-all", this)]
    return [("-h, --help", this), ("--help-all", f"Show all options, {len(others)} more.")]


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
    if option.usual is True:
        return f"Do not {_small(option.help)}."
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
