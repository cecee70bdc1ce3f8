"""The words of a command line into the options of a command; every complaint in one sentence."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

from tyro import conf

from monodyn.cli.options import COMMANDS, options_class
from monodyn.errors import SettingsError
from monodyn.names import near

LEAST_COLUMNS = 40
"""Columns for which help is laid out at least."""


def parsed(command: str, words: Sequence[str]) -> Any:
    """Read the words after a command.

    Args:
        command: One of ``COMMANDS``.
        words: The words.

    Returns:
        The options, or an exit code when help was requested.

    Raises:
        SettingsError: an option is unknown, missing or has a value that it cannot take.
    """
    import tyro

    options = options_class(COMMANDS[command])
    _refuse_empty(command, options, words)
    about = f"{(options.__doc__ or '').splitlines()[0]}\n\nExample: {COMMANDS[command].example}"
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint), _wide_enough():
            # a flag has one form, --force or --track.no-adaptive, not a pair
            return tyro.cli(
                options,
                prog=f"monodyn {command}",
                description=about,
                args=list(words),
                config=(conf.FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if not stop.code:
            return 0
        raise SettingsError(_one_line(complaint.getvalue(), command, list(words))) from None


@contextlib.contextmanager
def _wide_enough() -> Iterator[None]:
    """Have help be laid out for a few words a line at least: in a column or two tyro takes minutes."""
    given, width = os.environ.get("COLUMNS"), shutil.get_terminal_size().columns
    if width < LEAST_COLUMNS:
        os.environ["COLUMNS"] = str(LEAST_COLUMNS)
    try:
        yield
    finally:
        if width < LEAST_COLUMNS:
            os.environ.pop("COLUMNS")
            os.environ.update({} if given is None else {"COLUMNS": given})


def _refuse_empty(command: str, options: type[Any], words: Sequence[str]) -> None:
    """Refuse an empty name of a file, which would be read as the current folder."""
    hints = get_type_hints(options)
    named = {
        f"--{option.name}"
        for option in fields(options)
        if option.name == "model" or Path in (hints[option.name], *get_args(hints[option.name]))
    }
    # both forms count: --out "" and --out=
    for before, word in zip(["", *words], words, strict=False):
        name = before if word == "" else word.removesuffix("=")
        if name in named and (word == "" or word.endswith("=")):
            raise SettingsError(f"{command}: {name}: expected a name, got an empty one; give one.")


def _one_line(complaint: str, command: str, words: list[str]) -> str:
    """Bring a boxed complaint about the command line into one sentence."""
    # tyro draws a box around its complaint and adds hints below it; both go, the words between them stay
    text = re.sub(r"[\u2500-\u257f]|-{4,}", " ", complaint)
    text = " ".join(text.split())
    text = re.split(
        r"For full helptext|Argument helptext|Arguments similar|Got errors|Perhaps you meant", text
    )[0].strip()
    see = f"see monodyn {command} --help."
    # the names are listed in the order of this table, whatever the order of the help
    if text.startswith("Required options"):
        wanted = [
            name
            for name in ("CLIP", "SOURCE", "POSES.csv", "RUN", "--model", "--out")
            if re.search(rf"(^|\s){name}\b", text)
        ]
        return f"{command}: expected {', '.join(wanted)}, got {' '.join(words) or 'nothing'}; {see}"
    if text.startswith("Unrecognized"):
        odd = re.sub(r"^.*?Unrecognized options:\s*", "", text).split(". ")[0].strip()
        # tyro lists what is near, each name at the beginning of a line of its box
        listed = re.findall(r"^\W{4,}--([\w.-]+)", complaint, re.MULTILINE)
        nearest = near(listed, odd.split(",")[0].removeprefix("--"))
        meant = f" Did you mean --{nearest[0]}?" if nearest else ""
        return f"{command}: expected known options, got {odd}; {see}{meant}"
    # a word for one of several choices, then a word for a number
    choice = re.search(r"invalid choice '(.*?)' for argument '(.*?)'. Expected one of \((.*?)\)", text)
    if choice:
        return f"{command}: {choice[2]}: expected {choice[3]}, got '{choice[1]}'; {see}"
    value = re.search(r"Error parsing (\S+): .*?(?:from \[|base 10: )'?(.*?)'?(?:\]|$)", text)
    if value:
        return f"{command}: {value[1]}: expected another kind of value, got '{value[2]}'; {see}"
    return f"{command}: {text.rstrip('.')}; {see}"
