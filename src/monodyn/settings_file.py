"""``run.toml``: a run as a settings file that does it again, to the last digit.

It has every setting that has a value, under the name of its option and as the command line writes it; what
is left open is left out, and the method of a stage that is the whole run's. Files are named by their whole
paths, so that it works in every folder.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, get_type_hints

from monodyn.forms import notation
from monodyn.mechanism.bundled import is_bundled
from monodyn.settings import SHARED, STAGES, UNUSED, RunSettings, option_name

BARE = re.compile(r"[A-Za-z0-9_-]+")
"""A key that needs no quotes."""


def settings_text(
    command: str, inputs: Mapping[str, object], settings: RunSettings, live: object = None
) -> str:
    """Return the content of ``run.toml``.

    Args:
        command: Name of the command.
        inputs: Clip, source or tables, and the model, by the names of their options.
        settings: The settings of the run.
        live: How a stream was read and followed, as ``LiveSettings`` has it.
    """
    given = {name: value for name, value in inputs.items() if value is not None}
    plain: dict[str, Any] = {name: _input(name, value) for name, value in given.items()}
    hints, stages = get_type_hints(RunSettings), {}
    for setting in fields(RunSettings):
        if setting.name in UNUSED[command]:
            continue
        value = getattr(settings, setting.name)
        if setting.name in STAGES:
            stages[setting.name] = _written(value)
            # so that another method of the whole run, on the command line, is that of its stages
            if value.method == settings.method or setting.name == "segment":
                del stages[setting.name]["method"]
        elif value is not None:
            plain[option_name(setting)] = notation(hints[setting.name]).write(value)
    if live is not None:
        stages["live"] = _written(live)
    return _document(command, plain, stages)


def _document(command: str, plain: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]]) -> str:
    """Return TOML: single values first, then the tables."""
    tables = {name: value for name, value in plain.items() if isinstance(value, dict) and value}
    lines = [
        "# The settings of this run. To do it again, into another folder:",
        f"#   monodyn {command} --config run.toml --out again",
    ]
    lines += [
        _line(name, value) for name, value in plain.items() if value not in ({}, []) and name not in tables
    ]
    for name, table in {**tables, **stages}.items():
        lines += ["", f"[{_key(name)}]", *(_line(key, value) for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _written(settings: object) -> dict[str, Any]:
    """Return the settings of a stage by the names of their options."""
    hints, found = get_type_hints(type(settings)), {}
    for setting in fields(settings):  # pyright: ignore[reportArgumentType]
        value = getattr(settings, setting.name)
        if setting.name not in SHARED and value is not None:
            found[option_name(setting)] = notation(hints[setting.name]).write(value)
    return found


def is_no_file(text: object) -> bool:
    """Return whether what was given as a model or a source is not the name of a file.

    Args:
        text: A bundled mechanism, the number of a camera, the address of a stream or ``-``; or a file.
    """
    if not isinstance(text, str):
        return isinstance(text, int)
    return is_bundled(text) or text == "-" or text.isdigit() or "://" in text


def _input(name: str, value: object) -> object:
    """Return an input so that it is found from every folder: a file by its whole path, a name as it is."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_input(name, one) for one in value]
    if name in ("model", "source") and is_no_file(value):
        return str(value)
    return os.path.abspath(Path(str(value)))


def _line(name: str, value: object) -> str:
    line = f"{_key(name)} = {_value(value)}"
    try:
        line.encode()
    except UnicodeEncodeError:
        # the name of a file may be any bytes, TOML is a text
        return f"# {name}: no text"
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
    return repr(value).lower() if isinstance(value, bool) else repr(value)
