"""``run.toml``: a command with its options as a settings file that does it again, to the last digit.

Every option that has a value stands there under its name, as the command line writes it; what is left open
is left out. Files are named by their whole paths, so that it works in every folder.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import Any, get_type_hints

from monodyn.choices import is_bundled
from monodyn.forms import notation, option_name
from monodyn.numbers import is_whole
from monodyn.typed import is_a

RUN_TOML = "run.toml"
"""Its name."""
BARE = re.compile(r"[A-Za-z0-9_-]+")
"""A key that needs no quotes."""


def command_toml(command: str, inputs: Mapping[str, object], wanted: object = None) -> str:
    """Return the file of a command that goes on from a run, or needs none.

    Args:
        command: Name of the command.
        inputs: Files, numbers and flags by the names of their options; what is None is left out.
        wanted: Further settings, a dataclass whose fields have the names of options.
    """
    return document_toml(command, given(inputs) | ({} if wanted is None else written(wanted)), {})


def given(inputs: Mapping[str, object]) -> dict[str, Any]:
    """Return inputs so that they are found from every folder.

    Args:
        inputs: By the names of their options; what is None is left out.
    """
    return {name: _input(name, value) for name, value in inputs.items() if value is not None}


def document_toml(command: str, plain: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the content of the file: single values first, then the tables.

    Args:
        command: Name of the command.
        plain: Values by the names of their options.
        stages: Values of each stage by the names of its options.
    """
    # nothing is said of several of which there are none
    plain = {name: value for name, value in plain.items() if not isinstance(value, (dict, list)) or value}
    tables = {name: value for name, value in plain.items() if isinstance(value, dict)}
    lines = [
        "# The settings of this run. To do it again, into another folder:",
        f"#   monodyn {command} --config run.toml --out again",
    ]
    lines += [_line(name, value) for name, value in plain.items() if name not in tables]
    for name, table in {**tables, **stages}.items():
        lines += ["", f"[{_key(name)}]", *(_line(key, value) for key, value in table.items())]
    return "\n".join(lines) + "\n"


def written(settings: object, shared: Sequence[str] = ()) -> dict[str, Any]:
    """Return settings that have a value, by the names of their options.

    Args:
        settings: A dataclass of settings.
        shared: Names of those that are given once for all stages, and left out.
    """
    hints, found = get_type_hints(type(settings)), {}
    for setting in fields(settings):  # pyright: ignore[reportArgumentType]
        value = getattr(settings, setting.name)
        if value is None or setting.name in shared:
            continue
        # a tuple with names is written as a table of them
        named = getattr(value, "_asdict", None)
        found[option_name(setting)] = named() if named else notation(hints[setting.name]).write(value)
    return found


def is_no_file(name: str, value: object) -> bool:
    """Return whether what was given is not the name of a file, though it might be one.

    Args:
        name: Name of the option: a model may be a bundled mechanism, a source the number of a camera, the
            address of a stream or ``-``, and ``-`` stands for the standard output, too.
        value: What was given.
    """
    if name == "model":
        return is_bundled(value)
    if name == "source" and isinstance(value, str):
        return value == "-" or is_whole(value) or "://" in value
    return is_a(value, int) if name == "source" else name == "ndjson" and value == "-"


def _input(name: str, value: object) -> object:
    """Return an input so that it is found from every folder: a file by its whole path, the rest as it is."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_input(name, one) for one in value]
    if is_no_file(name, value):
        return str(value)
    return value if is_a(value, bool) or isinstance(value, Real) else os.path.abspath(Path(str(value)))


def _line(name: str, value: object) -> str:
    line = f"{_key(name)} = {_value(value)}"
    try:
        line.encode()
    except UnicodeEncodeError:
        # the name of a file may be any bytes, TOML is a text
        return f"# {name if BARE.fullmatch(name) else json.dumps(name)}: no text"
    return line


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else _value(name)


def _value(value: object) -> str:
    """Return a text, a number, a truth or a list as TOML."""
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        # the escapes of JSON are those of TOML, but for one character
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if is_a(value, bool):
        return repr(bool(value)).lower()
    # numbers of numpy count as numbers: each is written as Python's own
    return repr(int(value) if isinstance(value, Integral) else float(value))  # type: ignore[arg-type]
