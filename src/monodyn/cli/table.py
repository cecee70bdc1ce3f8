"""The options of each command as one table, made from the typed settings.

A command states its own options as the fields of a dataclass; those of ``UNUSED`` take the settings of a run,
too, but for those that they have no use for. A new field of `RunSettings`, or of a stage's settings, is an
option of every command that takes them, with its help text and its usual value, without a line here.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

from monodyn.cli.options import COMMANDS, FileOptions
from monodyn.forms import Notation, notation, option_name
from monodyn.live.settings import LiveSettings
from monodyn.settings import SHARED, UNUSED, RunSettings, settings_classes

SHORT = ("pace", "ahead")
"""Settings of a stream that have a short name, too: ``--pace`` for ``--live.pace``."""


@dataclass(frozen=True, eq=False)
class Option:
    """One option of a command.

    Attributes:
        name: What it is called, without dashes, as ``track.reach``.
        place: Which object takes it: empty for the command's own, ``settings``, or a stage.
        field: Name of the field there.
        kind: Annotation of the field.
        usual: Its value where it is left out; ``MISSING`` where it must be given.
        help: What it does, in sentences.
        form: How its values are written, with a metavar and an example of its own.
        word: Whether it is given without its name: a word of the command line.
        also: Another name of it.
        file: Whether it names a file.
    """

    name: str
    place: str
    field: str
    kind: Any
    usual: Any
    help: str
    form: Notation
    word: bool = False
    also: str = ""
    file: bool = False

    @property
    def flag(self) -> str:
        """What stands on the command line for it: ``--out``, or the word of the usage for a word."""
        if self.word:
            return self.metavar.split()[0]
        # a flag that is on by itself is there to be turned off
        return self.negated if self.usual is True else f"--{self.name}"

    @property
    def negated(self) -> str:
        """What turns a flag off, as ``--track.no-adaptive``."""
        head, dot, tail = self.name.rpartition(".")
        return f"--{head}{dot}no-{tail}"

    @property
    def metavar(self) -> str:
        """What the help shows for its words; empty for a flag."""
        return self.form.metavar


def listed(command: str) -> tuple[Option, ...]:
    """Return the options of a command: its own, then those of the settings that it takes.

    Args:
        command: One of ``COMMANDS``.
    """
    return tuple(_listed(command))


def owners(name: str) -> str:
    """Say to which commands an option belongs; nothing where there is none.

    Args:
        name: What it is called, without dashes.

    Returns:
        The end of a sentence with its stop.
    """
    others = [command for command in COMMANDS if name in {option.name for option in listed(command)}]
    return f"belongs to monodyn {' and '.join(others[:2])}; leave it out." if others else ""


def _listed(command: str) -> Iterator[Option]:
    kind = COMMANDS[command].options
    yield from _of(kind, "")
    if command not in UNUSED:
        return
    if command == "live":
        yield from _of(LiveSettings, "live")
    taken = [setting for setting in fields(RunSettings) if setting.name not in UNUSED[command]]
    # the classes are looked up at each call, because they depend on which methods are installed
    stages = settings_classes()
    yield from _of(RunSettings, "settings", [s for s in taken if s.name not in stages])
    for setting in taken:
        if setting.name in stages:
            yield from _of(stages[setting.name], setting.name)


def _of(kind: type[Any], place: str, chosen: Sequence[Field[Any]] | None = None) -> Iterator[Option]:
    """Yield the options that fields of a class are."""
    hints, said = get_type_hints(kind), described(kind)
    group = "" if place in ("", "settings") else f"{place}."
    # what a command states itself comes before what it shares with others
    stated = inspect.get_annotations(kind) if not place else hints
    ordered = sorted(fields(kind), key=lambda setting: setting.name not in stated)
    for setting in ordered if chosen is None else chosen:
        if setting.metadata.get("hidden") or (group and setting.name in SHARED):
            continue
        notes = setting.metadata
        own = {name: notes[name] for name in ("metavar", "example") if name in notes}
        made = setting.default_factory is not MISSING
        yield Option(
            name=group + option_name(setting),
            place=place,
            field=setting.name,
            kind=hints[setting.name],
            usual=setting.default_factory() if made else setting.default,  # pyright: ignore[reportCallIssue]
            help=said[setting.name],
            form=replace(notation(hints[setting.name]), **own),
            word=notes.get("word", False),
            also=setting.name if place == "live" and setting.name in SHORT else "",
            file=notes.get("file", False) or Path in (hints[setting.name], *get_args(hints[setting.name])),
        )


def described(kind: type[Any]) -> dict[str, str]:
    """Return the entries under ``Attributes`` of a class and of those it is made from, by field.

    Args:
        kind: The class.
    """
    found: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        text = inspect.cleandoc(one.__dict__.get("__doc__") or "").partition("Attributes:\n")[2]
        for entry in re.split(r"\n {4}(?=\w)", f"\n{text}")[1:]:
            name, _, said = entry.partition(":")
            found[name] = " ".join(said.replace("``", "'").split())
    return found


(CONFIG,) = _of(FileOptions, "")
"""The option that names a settings file."""
