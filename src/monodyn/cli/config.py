"""A settings file into the words of a command line: TOML with the names and values of options.

What the option ``--track.reach 5`` says is ``reach = 5`` in the table ``[track]``, or ``track.reach = 5``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from monodyn.cli.options import COMMANDS
from monodyn.cli.table import Option, listed
from monodyn.errors import SettingsError
from monodyn.forms import notation
from monodyn.names import known


def read_config(file: str | Path, command: str, options: Sequence[Option]) -> dict[str, list[str]]:
    """Return the words of each option that a settings file gives.

    Relative paths start at the folder of the file.

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
    found: dict[str, list[str]] = {}
    for key, value in _entries(_document(path), by_name):
        name = key.replace("_", "-")
        if name not in by_name:
            raise SettingsError(
                f"config '{path}': monodyn {command} has no option '{key}'; {_meant(name, by_name)}"
            )
        if name in found:
            raise SettingsError(f"config '{path}': expected one '{name}', got two; leave one out.")
        option = by_name[name]
        words = _words(f"config '{path}': {name}", option, value)
        try:
            option.form.read(name, words if option.several else words[-1])
        except SettingsError as error:
            raise SettingsError(f"config '{path}': {error}") from None
        found[name] = [_placed(option, word, path) for word in words]
    return found


def _document(path: Path) -> dict[str, Any]:
    """Return what is in a TOML file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SettingsError(
            f"config '{path}': expected a settings file, got '{error.strerror}'; check the path."
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        why = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "no UTF-8 text"
        raise SettingsError(f"config '{path}': expected TOML, got an error: {why}; correct it.") from None


def _meant(name: str, options: Mapping[str, Option]) -> str:
    """Return to which command an option belongs, or which name may have been meant."""
    others = [one for one in COMMANDS if name in {option.name for option in listed(one)}]
    if others:
        return f"it belongs to monodyn {' and '.join(others[:2])}; leave it out."
    return known("options", list(options), name)


def _entries(
    table: Mapping[str, Any], options: Mapping[str, Option], group: str = ""
) -> Iterator[tuple[str, Any]]:
    """Yield what a file gives by the names of options; a table is a stage, or NAME = VALUE of one option."""
    for key, value in table.items():
        name = f"{group}{key}"
        option = options.get(name.replace("_", "-"))
        if isinstance(value, dict) and not (option and option.form.named):
            yield from _entries(value, options, f"{name}.")
        else:
            yield name, value


def _words(where: str, option: Option, value: Any) -> list[str]:
    """Return the words of a command line that a value of a file stands for."""
    if option.form.named:
        if not isinstance(value, dict):
            raise SettingsError(
                f"{where}: expected a table of NAME = VALUE, got {value!r}; e.g. [{option.name}]."
            )
        return [f"{name}={_word(where, one)}" for name, one in value.items()]
    if isinstance(value, list) and option.several:
        return [_word(where, one) for one in value]
    return [_word(where, value)]


def _word(where: str, value: Any) -> str:
    """Return a text, a number or a truth of a file as a word."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, (str, int, float)):
        raise SettingsError(
            f"{where}: expected a text or a number, got {value!r}; write it as on the command line."
        )
    return str(value)


def _placed(option: Option, word: str, path: Path) -> str:
    """Return the name of a file as it is found from here; any other word as it is."""
    if not option.file:
        return word
    if not word:
        raise SettingsError(f"config '{path}': {option.name}: expected a name, got an empty one; give one.")
    # a text may stand for something else than a file
    if option.form is notation(str):
        from monodyn.results.again import is_no_file

        if is_no_file(word):
            return word
    return str(path.parent / Path(word).expanduser())
