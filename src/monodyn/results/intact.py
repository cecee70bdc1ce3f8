"""What a run folder holds, checked before it is believed: the numbers of fit.json, and those of the model.

A file that was changed by hand may say what no fit says: a matrix that is no covariance, a value beside its
interval, a model whose numbers are others. What contradicts itself, or the file next to it, is refused.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import GRADES
from monodyn.mechanism import Mechanism
from monodyn.mechanism.plan import START_DAMPING
from monodyn.mechanism.upright import ROLL

KINDS: dict[str, tuple[type, ...]] = {
    "object": (dict,), "array": (list,), "string": (str,), "boolean": (bool,), "number": (int, float),
    "integer": (int,), "null": (type(None),),
}  # fmt: skip
"""What a kind of JSON is in Python."""
LONGEST = 60
"""Characters of a wrong value that are shown."""
ROUNDED = 1e-9
"""How far apart two numbers may be that are the same but for rounding, as a share; of a matrix, of what its
diagonal allows an entry."""
WRITTEN = 1e-12
"""The same for numbers of ``model.xml``, which has 14 digits after the point [SI]."""
NEGATIVE = 1e-6
"""How far below zero a variance may be, as a share, where unknowns are hardly told apart: rounding."""


def check_numbers(file: Path, document: Mapping[str, Any]) -> None:
    """Refuse a ``fit.json`` whose numbers contradict one another.

    Args:
        file: Where it is.
        document: Its content.

    Raises:
        SettingsError: They do.
    """
    schema = files("monodyn.results").joinpath("fit.schema.json").read_text(encoding="utf-8")
    for expected, got in chain(_other_kinds(document, json.loads(schema), ""), _contradictions(document)):
        raise SettingsError(f"'{file}': expected {expected}, got {got}: it was changed; run it again.")


def check_model(file: Path, model: Mechanism, document: Mapping[str, Any]) -> None:
    """Refuse a ``model.xml`` that was changed into another mechanism than that of ``fit.json``.

    Of some bodies the file does not say where their length ends and an overhang begins, and meshes are
    rounded: a file that is as it was written is believed whatever it has.

    Args:
        file: Where it is.
        model: What it holds.
        document: The content of ``fit.json``.

    Raises:
        SettingsError: It has other joints, or a parameter of another value than the written digits leave.
    """
    if digest(file) == document.get("model_sha256"):
        return
    do = "keep changed models elsewhere, give other values with --fix, or run it again"
    joints, known = [joint.name for joint in model.joints], list(document["units"])
    if sorted(joints) != sorted(known):
        raise SettingsError(
            f"'{file}': expected the joints of fit.json, {', '.join(known)}, got {', '.join(joints)}; {do}."
        )
    values = {row["name"]: float(row["value"]) for row in document["parameters"]}
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


def _other_kinds(value: Any, schema: Mapping[str, Any], name: str) -> Iterator[tuple[str, str]]:
    """Yield what is of another kind than the schema of ``fit.json`` has it, from ``name`` on down."""
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    # a truth value of Python is a number, too
    fitting = [kind for kind in kinds if isinstance(value, KINDS[kind])]
    if kinds and (not fitting or (isinstance(value, bool) and "boolean" not in fitting)):
        yield f"{' or '.join(kinds)} as {name or 'its content'}", json.dumps(value)[:LONGEST]
        return
    if isinstance(value, dict):
        known, others = schema.get("properties", {}), schema.get("additionalProperties")
        for key, one in value.items():
            inner = known.get(key, others)
            if isinstance(inner, dict):
                yield from _other_kinds(one, inner, f"{name}.{key}" if name else key)
    elif isinstance(value, list) and "items" in schema:
        for place, one in enumerate(value):
            yield from _other_kinds(one, schema["items"], f"{name}[{place}]")


def _contradictions(document: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what is expected, and what was got in its place."""
    grade = document["doubts"][0]["grade"] if document["doubts"] else GRADES[0]
    if document["grade"] != grade:
        yield f"the grade of its doubts, {grade}", f"{document['grade']}"
    if document["ok"] is not (grade != GRADES[-1]):
        yield f"ok {json.dumps(grade != GRADES[-1])} of the grade {grade}", json.dumps(document["ok"])
    for row in document["parameters"]:
        name, value = row["name"], float(row["value"])
        slack = WRITTEN + ROUNDED * abs(value)
        low, high = row["lower"], row["upper"]
        if (low is not None and low > value + slack) or (high is not None and high < value - slack):
            yield f"{name} within its interval, {low} to {high}", f"{value:g}"
        if row["std"] is not None and row["std"] < 0.0:
            yield f"a standard deviation of {name} that is not negative", f"{row['std']:g}"
    yield from _other_drive(document)
    names, matrix = document["covariance"]["names"], document["covariance"]["matrix"]
    yield from _no_covariance("covariance", matrix, len(names))
    starts, fitted, joints = document["initial_state"], document["fitted"], list(document["units"])
    if len(fitted) != len(starts):
        yield f"as many fitted stretches as start states, {len(starts)}", f"{len(fitted)}"
    for row in fitted:
        if not row["first"] < row["last"]:
            yield "a fitted stretch that ends after it begins", f"{row['first']:g} to {row['last']:g} s"
    lacks = document["unmodelled"]
    if lacks is not None:
        if len(lacks["density"]) != len(joints) or min(lacks["density"]) < 0.0:
            yield f"a density of unmodelled by joint ({len(joints)}), none negative", f"{lacks['density']}"
        yield from _no_covariance("unmodelled.off", lacks["off"], 2 * len(joints))
    seen = document["measured"]
    if seen is not None:
        # where two pictures disagree it may be negative in part: what is, an identification leaves out
        yield from _unsymmetric("measured.information", seen["information"], len(seen["names"]))


def _other_drive(document: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield where the torques over time are not those of the parameters."""
    known = {row["name"]: float(row["value"]) for row in document["parameters"]}
    drive = document["drive"]
    stated = {"torque.period": drive.get("period"), "torque.lag": drive.get("lag")}
    for joint, row in drive.get("joints", {}).items():
        stated[f"{joint}.torque.mean"] = row["mean"]
        stated |= {
            f"{joint}.torque.{wave}{k}": x for wave in ("cos", "sin") for k, x in enumerate(row[wave], 1)
        }
        stated |= {f"{joint}.torque.{k}": x for k, x in enumerate(row["values"])}
    for name, x in stated.items():
        if x is not None and name in known and abs(x - known[name]) > WRITTEN + ROUNDED * abs(x):
            yield f"{name} {known[name]:g} in drive, as among the parameters", f"{x:g}"


def _no_covariance(name: str, rows: list[list[float | None]], count: int) -> Iterator[tuple[str, str]]:
    """Yield why a matrix is none of variances, and of covariances that they allow."""
    yield from _unsymmetric(name, rows, count)
    matrix = _array(rows)
    variance = np.diag(matrix)
    if np.any(variance < 0.0):
        yield f"variances that are not negative in {name}", f"{np.nanmin(variance):g}"
    # what nothing determines has no number
    known = np.isfinite(variance)
    scale = np.sqrt(np.where(variance[known] > 0.0, variance[known], 1.0))
    matrix = matrix[np.ix_(known, known)] / np.outer(scale, scale)
    if not np.all(np.isfinite(matrix)):
        yield f"covariances of all that has a variance in {name}", "null"
    elif matrix.size and (least := float(np.linalg.eigvalsh(matrix)[0])) < -NEGATIVE * len(matrix):
        yield f"no negative eigenvalue of {name}, in units of its variances", f"{least:.3g}"


def _unsymmetric(name: str, rows: list[list[float | None]], count: int) -> Iterator[tuple[str, str]]:
    """Yield why a matrix is not of one row and one column for every name, and symmetric."""
    lengths = {len(row) for row in rows}
    if len(rows) != count or (count and lengths != {count}):
        got = f"{len(rows)}x{max(lengths, default=0)}"
        yield f"a {name} of {count}x{count} numbers, as many as it has names", got
    matrix = _array(rows)
    scale = np.sqrt(np.abs(np.diag(matrix)))
    off = np.abs(matrix - matrix.T) > ROUNDED * (np.outer(scale, scale) + np.abs(matrix))
    off |= np.isnan(matrix) != np.isnan(matrix).T
    if off.any():
        i, k = (int(place[0]) for place in np.nonzero(off))
        yield f"a symmetric {name}", f"{rows[i][k]} in row {i}, column {k}, and {rows[k][i]} across"


def _array(rows: list[list[float | None]]) -> np.ndarray:
    """Return a matrix of JSON, which has null for what is no number, (name, name)."""
    return np.array([[np.nan if x is None else float(x) for x in row] for row in rows]).reshape(
        len(rows), len(rows)
    )
