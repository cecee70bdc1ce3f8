"""The settings of a run as ``run.toml``: those of every stage, but for the method that is the whole run's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, get_type_hints

from monodyn.forms import notation, option_name
from monodyn.results.run_toml import document_toml, given, written
from monodyn.settings import SHARED, STAGES, UNUSED, RunSettings


def run_toml(command: str, inputs: Mapping[str, object], settings: RunSettings, live: object = None) -> str:
    """Return the content of ``run.toml``.

    Args:
        command: Name of the command.
        inputs: Clip, source or tables, and the model, by the names of their options.
        settings: The settings of the run.
        live: How a stream was read and followed, as ``LiveSettings`` has it.
    """
    plain: dict[str, Any] = given(inputs)
    hints, stages = get_type_hints(RunSettings), {}
    for setting in fields(RunSettings):
        if setting.name in UNUSED[command]:
            continue
        value = getattr(settings, setting.name)
        if setting.name in STAGES:
            stages[setting.name] = written(value, SHARED)
            # so that another method of the whole run, on the command line, is that of its stages
            if value.method == settings.method or setting.name == "segment":
                del stages[setting.name]["method"]
        elif value is not None:
            plain[option_name(setting)] = notation(hints[setting.name]).write(value)
    if live is not None:
        stages["live"] = written(live, SHARED)
    return document_toml(command, plain, stages)
