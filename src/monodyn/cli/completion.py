"""``monodyn completion``: what a shell offers at the press of a key, as a script that needs no Python then.

A word that is none of the choices may be a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from monodyn.choices import AUTO, BUNDLED_FILES
from monodyn.cli.options import COMMANDS, Shell
from monodyn.cli.table import CONFIG, listed

Choices = tuple[str, ...] | None
"""Words that an option takes, () where it takes any; None for a flag."""

MODELS = (AUTO, *BUNDLED_FILES, "chain:3")
"""Bundled mechanisms, which ``--model`` takes besides files."""

LINES = {"bash": "{}) words='{}' ;;", "zsh": "({}) found=({}) ;;"}
"""A choice of words in the script of each shell, which stands beside this file."""


def completion(shell: Shell) -> str:
    """Return the script by which a shell completes command lines.

    Args:
        shell: Which shell.
    """
    options = {name: options_of(name) for name in COMMANDS}
    if shell == "fish":
        return _fish(options)
    # the same choices of several commands are written once
    values: dict[Choices, list[str]] = {}
    for command, found in options.items():
        for option, choices in found.items():
            if choices:
                values.setdefault(choices, []).append(f"'{command} {option}'")
    text, line = (Path(__file__).parent / f"completion.{shell}").read_text(encoding="utf-8"), LINES[shell]
    case = ["    " + line.format("|".join(at), " ".join(choices or ())) for choices, at in values.items()]
    names = ["      " + line.format(f"'{name} -'*", " ".join(found)) for name, found in options.items()]
    text = text.replace("@COMMANDS@", " ".join((*options, "--help", "--version")))
    return text.replace("@VALUES@", "\n".join(case)).replace("@OPTIONS@", "\n".join(names))


def _fish(options: Mapping[str, Mapping[str, Choices]]) -> str:
    """Return the script for fish, a line for each command and for each option of all that take it alike."""
    lines = ["# monodyn for fish: monodyn completion fish > ~/.config/fish/completions/monodyn.fish"]
    for name in options:
        about = (COMMANDS[name].options.__doc__ or "").splitlines()[0].replace("'", "")
        lines.append(f"complete -c monodyn -n __fish_use_subcommand -f -a {name} -d '{about}'")
    alike: dict[tuple[str, Choices], list[str]] = {}
    for command, found in options.items():
        for option, choices in found.items():
            alike.setdefault((option, choices), []).append(command)
    for (option, choices), takers in alike.items():
        # a word that is asked for is one of the choices, or the name of a file
        takes = "" if choices is None else f" -x -a '{' '.join(choices)}'" if choices else " -r -F"
        takes = takes.replace("-x", "-r") if choices == MODELS else takes
        seen = f"-n '__fish_seen_subcommand_from {' '.join(takers)}'"
        lines.append(f"complete -c monodyn {seen} -l {option.removeprefix('--')}{takes}")
    return "\n".join(lines) + "\n"


def options_of(command: str) -> dict[str, Choices]:
    """Return the options of a command by what stands for them, with the words that each takes.

    Args:
        command: One of ``COMMANDS``.
    """
    found: dict[str, Choices] = {"--help": None, "--help-all": None}
    for option in (*listed(command), *([CONFIG] if COMMANDS[command].file else [])):
        choices = MODELS if option.name == "model" else _choices(option.kind) if option.metavar else None
        if not option.word:
            found[option.flag] = choices
        if option.also:
            found[f"--{option.also}"] = choices
    return found


def _choices(hint: Any) -> tuple[str, ...]:
    """Return the words that a type takes, those of all that it may be; () where it takes any."""
    if get_origin(hint) is Literal:
        return tuple(str(word) for word in get_args(hint))
    parts = [part for part in get_args(hint) if part is not type(None)]
    if len(parts) == len(get_args(hint)) or len(parts) != 1:
        return ()
    return _choices(parts[0])
