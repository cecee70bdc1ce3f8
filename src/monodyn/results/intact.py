"""What a run folder holds, checked before it is believed: that fit.json is as it was written, and its model.

fit.json carries the SHA-256 of its own content, and that of model.xml: a number that was changed by hand, in
either, says what no fit says. It is refused, whether or not it contradicts another one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from monodyn.errors import SettingsError
from monodyn.mechanism import Mechanism
from monodyn.mechanism.plan import START_DAMPING
from monodyn.mechanism.upright import ROLL
from monodyn.results.export import jsonable

SEAL = "sha256"
"""Key of ``fit.json`` under which the SHA-256 of all the rest of it stands."""
ROUNDED = 1e-9
"""How far apart two numbers may be that are the same but for rounding, as a share."""
WRITTEN = 1e-12
"""The same for numbers of ``model.xml``, which has 14 digits after the point [SI]."""


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document as JSON types, with the SHA-256 of its content.

    Args:
        document: What is to be written; a seal that it has is replaced.
    """
    content = {name: value for name, value in jsonable(document).items() if name != SEAL}
    return {**content, SEAL: _content_digest(content)}


def check_seal(file: Path, document: Mapping[str, Any]) -> None:
    """Refuse a ``fit.json`` that was changed after it was written.

    Args:
        file: Where it is.
        document: Its content.

    Raises:
        SettingsError: It was, or does not state what its content was.
    """
    content = {name: value for name, value in document.items() if name != SEAL}
    if document.get(SEAL) != _content_digest(content):
        got = "one that was changed since" if SEAL in document else f"one without its {SEAL}"
        raise SettingsError(
            f"'{file}': expected the file as it was written, got {got}; run it again, or give other values "
            "with --fix."
        )


def _content_digest(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of values of JSON, however they are laid out in a file."""
    # a float is written with the fewest digits that read back as the same one
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def check_model(file: Path, model: Mechanism, document: Mapping[str, Any]) -> None:
    """Refuse a ``model.xml`` that was changed into another mechanism than that of ``fit.json``.

    Of some bodies the file does not say where their length ends and an overhang begins, and meshes are
    rounded: a file that is as it was written is believed whatever it has.

    Args:
        file: Where it is.
        model: What it holds.
        document: The content of ``fit.json``.

    Raises:
        SettingsError: It has other joints or bodies, or a parameter of another value than the written digits
            leave.
    """
    if digest(file) == document["model_sha256"]:
        return
    do = "keep changed models elsewhere, give other values with --fix, or run it again"
    joints, known = [joint.name for joint in model.joints], list(document["units"])
    if sorted(joints) != sorted(known):
        raise SettingsError(
            f"'{file}': expected the joints of fit.json, {', '.join(known)}, got {', '.join(joints)}; {do}."
        )
    values = {row["name"]: float(row["value"]) for row in document["parameters"]}
    strange = [body for body in model.bodies if f"{body}.mass" not in values]
    if strange:
        raise SettingsError(
            f"'{file}': expected the bodies of fit.json, got also {', '.join(strange)}; {do}."
        )
    other = differing(model, values)
    if other:
        name, more = other[0], len(other) - 1
        expected, got, also = values[name], model.values[name], f" (and {more} more)" if more else ""
        raise SettingsError(
            f"'{file}': expected {name} {expected:.10g} as in fit.json, got {got:.10g}{also}; {do}."
        )


def digest(file: Path) -> str:
    """Return what tells a file from any other one: its SHA-256.

    Args:
        file: The file.
    """
    return hashlib.sha256(file.read_bytes()).hexdigest()


def differing(model: Mechanism, values: Mapping[str, float]) -> list[str]:
    """Name the parameters that a written mechanism has with other values than the digits leave.

    Args:
        model: The mechanism as it was read back.
        values: What its parameters were, by name.

    Returns:
        Their names. The roll of the camera is not in the file.
    """
    return [
        p.name
        for p in model.parameters
        if p.name in values
        and p.name != ROLL
        and abs(p.value - values[p.name]) > WRITTEN + ROUNDED * abs(values[p.name])
        # a joint that has no damping is written, and read, without: then it starts at some
        and not (p.kind == "damping" and values[p.name] == 0.0 and p.value == START_DAMPING)
    ]
