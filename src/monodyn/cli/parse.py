"""The words of a command line into the options of a command; every complaint in one sentence.

Options and words without a name may stand in any order. An option takes one word; where several belong to it
(``--fix NAME=VALUE NAME=VALUE``, ``--free NAME NAME``), those that follow and look alike go with it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

from monodyn.cli.options import COMMANDS
from monodyn.cli.table import CONFIG, Option, listed, owners
from monodyn.errors import SettingsError
from monodyn.forms import NUMBER, apart
from monodyn.live.settings import LiveSettings
from monodyn.names import near
from monodyn.settings import RunSettings, settings_classes

HELP, HELP_ALL = ("-h", "--help"), "--help-all"
Given = dict[str, list[str]]
"""The words of each option that was given, by its name."""


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
    options = listed(command)
    if HELP_ALL in words or any(word in HELP for word in words):
        from monodyn.cli.help import page

        print(page(command, options, whole=HELP_ALL in words), end="")
        return 0
    given, filed = split(command, options, words), {}
    if CONFIG.name in given:
        from monodyn.cli.config import read_config

        filed = read_config(given.pop(CONFIG.name)[-1], command, options)
    both = merged(options, filed, given)
    # what stands alone comes first
    needed = sorted((o for o in options if o.usual is MISSING), key=lambda o: not o.word)
    lacking = [option.flag for option in needed if option.name not in both]
    if lacking:
        got = " ".join(words) or "nothing"
        raise SettingsError(f"{command}: expected {', '.join(lacking)}, got {got}; {_see(command)}")
    return _built(command, options, both)


def split(command: str, options: Sequence[Option], words: Sequence[str]) -> Given:
    """Return the words of a command line by option.

    Args:
        command: Name of the command.
        options: What it takes.
        words: The words after it.

    Raises:
        SettingsError: an option is unknown, lacks its word, or has one too many.
    """
    named = _named(command, options)
    alone = [option.name for option in options if option.word]
    given: Given = {}
    odd, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        if word == "--" and alone:
            # what follows are no options, whatever they begin with
            given.setdefault(alone[0], []).extend(rest)
            break
        name = word.partition("=")[0].replace("_", "-")
        if name in named and _is_option(word):
            taken = _taken(command, named[name], word, rest)
            given.setdefault(named[name].name, []).extend(taken)
        elif alone and not _is_option(word):
            given.setdefault(alone[0], []).append(word)
        else:
            odd.append(word)
            # what follows an option that is not known is hardly the clip
            if _is_option(word) and rest and not _is_option(rest[0]):
                odd.append(rest.pop(0))
    if odd:
        raise SettingsError(
            f"{command}: expected known options, got {', '.join(odd)}; {_meant(command, named, odd[0])}"
        )
    _refuse_repeated(command, [*options, CONFIG], given)
    return given


def _meant(command: str, named: Mapping[str, Option], word: str) -> str:
    """Return which option may have been meant, or to which commands the one that was given belongs."""
    name = word.removeprefix("--").partition("=")[0].replace("_", "-")
    if word.startswith("--") and (belongs := owners(name)):
        return f"--{name} {belongs}"
    nearest = near([one.removeprefix("--") for one in named], name)
    return _see(command) + (f" Did you mean --{nearest[0]}?" if nearest else "")


def _taken(command: str, option: Option, word: str, rest: list[str]) -> list[str]:
    """Return the words that belong to an option; those of the words after it are taken out of these."""
    name, equals, value = word.partition("=")
    if not option.metavar:
        if equals:
            raise SettingsError(f"{command}: {name}: expected no value, got '{value}'; leave it out.")
        return ["true" if name.replace("_", "-") == f"--{option.name}" else "false"]
    if equals:
        return [value]
    if not rest or _is_option(rest[0]):
        raise SettingsError(f"{command}: {name}: expected {option.metavar}, got nothing; {_see(command)}")
    taken = [rest.pop(0)]
    while rest and _goes_on(option, rest[0]):
        taken.append(rest.pop(0))
    return taken


def _named(command: str, options: Sequence[Option]) -> dict[str, Option]:
    """Return the options by what stands for them on the command line."""
    named = {f"--{option.name}": option for option in options}
    named |= {f"--{option.also}": option for option in options if option.also}
    named |= {option.negated: option for option in options if not option.metavar}
    if COMMANDS[command].file:
        named[f"--{CONFIG.name}"] = CONFIG
    return named


def _is_option(word: str) -> bool:
    """Return whether a word is an option, not a value: neither ``-`` nor a negative number."""
    return len(word) > 1 and word.startswith("-") and not re.match(rf"-{NUMBER}", word)


def _goes_on(option: Option, word: str) -> bool:
    """Return whether one more word belongs to an option, and not to what stands on the command line alone."""
    form = option.form
    if not form.many or _is_option(word):
        return False
    if form.named:
        return "=" in word
    if option.kind == tuple[float, float, float]:
        return re.fullmatch(rf"-?{NUMBER}", word) is not None
    # what are files, or names of joints, cannot be told from a file or folder that stands alone
    return option.name == "free" and _is_parameter(word)


def _is_parameter(word: str) -> bool:
    """Return whether all names in a word are like that of a parameter."""
    from monodyn.mechanism.dimensions import DIMENSIONS
    from monodyn.types import Camera

    kinds = {*DIMENSIONS, *(part.name for part in fields(Camera))}
    return all(
        name in ("gravity", "time_scale")
        or ("." in name and (name.rpartition(".")[2] in kinds or ".torque." in name))
        for name in apart([word])
    )


def _refuse_repeated(command: str, options: Sequence[Option], given: Mapping[str, Sequence[str]]) -> None:
    """Refuse two values where there can be one, and an empty name of a file."""
    for option in options:
        words = given.get(option.name, ())
        if len({*words} if not option.metavar else words) > 1 and not option.form.many:
            listing = " and ".join(repr(word) for word in words)
            raise SettingsError(f"{command}: expected one {option.flag}, got {listing}; leave one out.")
        if "" in words and option.file:
            raise SettingsError(f"{command}: {option.flag}: expected a name, got an empty one; give one.")


def merged(options: Sequence[Option], filed: Mapping[str, Any], given: Given) -> dict[str, Any]:
    """Return what a file and the command line give: the latter wins, of ``NAME=...`` name by name.

    Args:
        options: What the command takes.
        filed: What the file gives, by the names of options, as ``Notation.items`` returns it.
        given: The words of the command line.

    Returns:
        What they give together, in the form of the file.

    Raises:
        SettingsError: a word has no name where there has to be one, or a name comes twice.
    """
    both = dict(filed)
    for option in options:
        if option.name in given:
            items = option.form.items(option.name, given[option.name])
            both[option.name] = {**filed.get(option.name, {}), **items} if option.form.named else items
    return both


def _built(command: str, options: Sequence[Option], given: Mapping[str, Any]) -> Any:
    """Return the options of a command with the values of all that is given, the rest as usual."""
    values: dict[str, dict[str, Any]] = {option.place: {} for option in options}
    for option in options:
        if option.name in given:
            values[option.place][option.field] = option.form.read(option.name, given[option.name])
    own = values.pop("", {})
    if "live" in values:
        own["live"] = LiveSettings(**values.pop("live"))
    if "settings" in values:
        whole, classes = values.pop("settings"), settings_classes()
        stages = {stage: classes[stage](**chosen) for stage, chosen in values.items()}
        own["settings"] = RunSettings(**whole, **stages)
    return COMMANDS[command].options(**own)


def _see(command: str) -> str:
    return f"see monodyn {command} --help."
