"""A settings file into what a command line would give: TOML with the names and values of options.

What the option ``--track.reach 5`` says is ``reach = 5`` in the table ``[track]``, or ``track.reach = 5``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from monodyn.cli.table import Option, owners
from monodyn.errors import SettingsError
from monodyn.names import known, meant, near, near_files
from monodyn.results.run_toml import is_no_file

LARGEST = 1_000_000
"""Bytes of a settings file, at most."""
DEEPEST, MOST_BITS = 20, 64
"""Tables and lists in one another, and bits of a whole number, at most; the latter is the limit of TOML."""


def read_config(file: str | Path, command: str, options: Sequence[Option]) -> dict[str, Any]:
    """Return what a settings file gives, by the names of options, as ``Notation.items`` does of words.

    Relative paths start at the folder of the file. Items of lists and tables are taken as they are: a comma,
    or an equals sign, is part of a name there.

    Args:
        file: The settings file.
        command: Name of the command.
        options: What it takes.

    Raises:
        SettingsError: the file cannot be read, names an option that the command does not take, or has a value
            that no option can have.
    """
    path = Path(file)
    by_name = {option.name: option for option in options}
    found: dict[str, Any] = {}
    for key, value in _entries(_document(path), by_name):
        name = key.replace("_", "-")
        if name not in by_name:
            belongs = owners(name)
            end = f"it {belongs}" if belongs else known("options", list(by_name), name)
            raise SettingsError(f"config '{path}': monodyn {command} has no option '{key}'; {end}")
        if name in found:
            raise SettingsError(f"config '{path}': expected one '{name}', got two; leave one out.")
        option = by_name[name]
        try:
            items = _items(option, value)
            option.form.read(name, items)
        except SettingsError as error:
            raise SettingsError(f"config '{path}': {error}") from None
        found[name] = _placed(option, items, path)
    return found


def _document(path: Path) -> dict[str, Any]:
    """Return what is in a TOML file."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise SettingsError(f"config '{path}': expected a settings file, got a device or pipe; name a file.")
    try:
        if path.stat().st_size > LARGEST:
            raise SettingsError(f"config '{path}': expected at most 1 MB of settings, got more; shorten it.")
        # some editors begin a text with a mark of its encoding, and end lines as Windows does
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        end = "" if path.exists() else meant(near_files(path))
        raise SettingsError(
            f"config '{path}': expected a settings file, got '{error.strerror}'; {end or 'check the path.'}"
        ) from None
    except (ValueError, RecursionError) as error:
        why = {
            UnicodeDecodeError: "no UTF-8 text", RecursionError: "too many brackets in one another",
            ValueError: "a number of too many digits",
        }.get(type(error), str(error))  # fmt: skip
    else:
        why = _unusable(document)
        if not why:
            return document
    raise SettingsError(f"config '{path}': expected TOML, got an error: {why}; correct it.")


def _unusable(document: dict[str, Any]) -> str:
    """Return what no option can have, of all that is in a file; empty where there is nothing."""
    values: list[tuple[int, Any]] = [(0, document)]
    while values:
        depth, value = values.pop()
        if depth > DEEPEST:
            return "too many tables in one another"
        if isinstance(value, int) and value.bit_length() > MOST_BITS:
            return f"a whole number of more than {MOST_BITS} bits"
        if isinstance(value, str) and "\0" in value:
            return "a text with a zero in it"
        within = [*value, *value.values()] if isinstance(value, dict) else value
        values += [(depth + 1, one) for one in within] if isinstance(within, list) else []
    return ""


def _entries(
    table: Mapping[str, Any], options: Mapping[str, Option], group: str = ""
) -> Iterator[tuple[str, Any]]:
    """Yield what a file gives by the names of options; a table is a stage, or NAME = VALUE of one option."""
    tables = [name for name, option in options.items() if option.form.named]
    stages = {name.partition(".")[0] for name in options if "." in name}
    for key, value in table.items():
        name = f"{group}{key}"
        written = name.replace("_", "-")
        # a table of another name is whatever its name is nearer to
        one = written in tables or (written not in stages and near(tables, written))
        if isinstance(value, dict) and not one:
            yield from _entries(value, options, f"{name}.")
        else:
            yield name, value


def _items(option: Option, value: Any) -> Any:
    """Return a value of a file as ``Notation.items`` returns words: a word, a list or a table of words."""
    if option.form.named:
        if not isinstance(value, dict):
            raise SettingsError(
                f"{option.name}: expected a table of NAME = VALUE, got {value!r}; e.g. [{option.name}]."
            )
        return {name: _word(option, one) for name, one in value.items()}
    if isinstance(value, list) and option.form.many:
        return [_word(option, one) for one in value]
    return option.form.items(option.name, [_word(option, value)])


def _word(option: Option, value: Any) -> str:
    """Return a text, a number or a truth of a file as a word."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, (str, int, float)):
        raise SettingsError(
            f"{option.name}: expected a text or a number, got {value!r}; write it as on the command line."
        )
    return str(value)


def _placed(option: Option, items: Any, path: Path) -> Any:
    """Return the names of files as they are found from here; anything else as it is."""
    if not option.file:
        return items
    if isinstance(items, list):
        return [_placed(option, one, path) for one in items]
    if not items:
        raise SettingsError(f"config '{path}': {option.name}: expected a name, got an empty one; give one.")
    if is_no_file(option.name, items):
        return items
    try:
        return str(path.parent / Path(items).expanduser())
    except RuntimeError:
        raise SettingsError(
            f"config '{path}': {option.name}: expected a file, got '{items}' of nobody here; "
            "write where it is."
        ) from None
