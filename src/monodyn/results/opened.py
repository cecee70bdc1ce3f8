"""A run folder in, the fit that it holds out: what a later command knows of an identified mechanism."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import Combination, Doubt, Estimate, Fit, Start, TriedTorque, Unmodelled
from monodyn.mechanism import Mechanism, load
from monodyn.results.findings import SCHEMA
from monodyn.types import Camera

LARGEST = 500e6
"""Size from which on ``fit.json`` is none [byte]."""


def open_run(folder: str | Path) -> Fit:
    """Read the fit of a run folder back, from its ``fit.json`` and ``model.xml``.

    Motion, prediction and their bands are those of the fit that was written. Its parameters are those of the
    written model, whose bodies have masses and inertias in place of densities and thicknesses; residuals are
    not kept, nor are logs of known torques: without these the mechanism moves freely.

    Args:
        folder: The run folder.

    Returns:
        The fit.

    Raises:
        SettingsError: There is no such run, nothing was identified in it, or its files were changed.
        MechanismError: ``model.xml`` is not as it was written.

    Example:
        >>> fit = monodyn.open_run("run")  # doctest: +SKIP
        >>> monodyn.predict(fit, until=10.0)  # doctest: +SKIP
    """
    folder = Path(folder)
    document = _document(folder)
    try:
        return _fit(document, folder / "model.xml")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SettingsError(
            f"'{folder / 'fit.json'}': expected the file as it was written, got one without what it should "
            f"hold ({type(error).__name__}: {error}); run it again."
        ) from None


def filmed_by(folder: str | Path) -> tuple[Camera, dict[str, float]]:
    """Return the camera of a run, and the thicknesses with which bodies were located before it.

    Args:
        folder: The run folder.

    Returns:
        The camera in the frame of the mechanism; thicknesses by parameter name [m], which in the mechanism
        stand for masses and may be others.

    Raises:
        SettingsError: There is no such run, or it has no camera.
    """
    camera = _document(Path(folder))["camera"]
    if camera is None:
        raise SettingsError(
            f"'{folder}': expected the run of a clip, got one of tables, which has no camera; "
            "leave --film out."
        )
    return Camera(**{f.name: camera[f.name] for f in fields(Camera)}), dict(camera["thickness"])


def _document(folder: Path) -> dict[str, Any]:
    """Return the content of ``fit.json``."""
    file = folder / "fit.json"
    if not file.is_file():
        what = "no such folder" if not folder.is_dir() else "a folder without fit.json"
        raise SettingsError(
            f"'{folder}': expected the folder of a run, got {what}; name the one given as --out."
        )
    if file.stat().st_size > LARGEST:
        raise SettingsError(
            f"'{file}': expected a file of a run, got one of {file.stat().st_size} bytes; run it again."
        )
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise SettingsError(f"'{file}': expected JSON, got other text ({error}); run it again.") from None
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema != SCHEMA:
        raise SettingsError(
            f"'{file}': expected a file of schema {SCHEMA}, got {'none' if schema is None else schema}; "
            "run it again with this version."
        )
    if not document["initial_state"]:
        raise SettingsError(
            f"'{folder}': expected an identified mechanism, got a run without one: {document['status']}"
        )
    return document


def _fit(document: Mapping[str, Any], model: Path) -> Fit:
    rows = {row["name"]: row for row in document["parameters"]}
    names, matrix = document["covariance"]["names"], document["covariance"]["matrix"]
    mechanism, varying = _mechanism(document, load(model), rows, names)
    joints = [joint.name for joint in mechanism.joints]
    states = [f"record{k}.{j}{end}" for k in range(len(document["initial_state"]))
              for end in ("", "_vel") for j in joints]  # fmt: skip
    at = [names.index(name) for name in (*varying, *states)]
    covariance = np.array([[math.nan if c is None else float(c) for c in row] for row in matrix])
    covariance = covariance.reshape(len(names), len(names))[np.ix_(at, at)]
    lacks = document["unmodelled"]
    width = 2 * len(joints)
    starts = []
    for k, row in enumerate(document["initial_state"]):
        own = len(varying) + k * width + np.arange(width)
        position, velocity = (np.array([row[what][j] for j in joints]) for what in ("position", "velocity"))
        starts.append(Start(float(row["time"]), position, velocity, covariance[np.ix_(own, own)]))
    estimates = [_estimate(p.name, p.value, p.unit, rows.get(p.name), free=p.name in varying)
                 for p in mechanism.parameters]  # fmt: skip
    return Fit(
        status=document["status"],
        doubts=tuple(Doubt(**doubt) for doubt in document["doubts"]),
        advice=tuple(document["advice"]),
        mechanism=mechanism,
        parameters=tuple(estimates),
        combinations=tuple(
            Combination(**{**one, "std": _number(one["std"], math.inf)}) for one in document["combinations"]
        ),
        starts=tuple(starts),
        tied=(),
        covariance=covariance,
        residual=(),
        rms={joint: float(document["rms"][joint]) for joint in joints},
        scale=float(document["scale"]),
        torque=document["torque"],
        # first, last and number are all that counts: stamps in between are about even
        time=tuple(np.linspace(row["first"], row["last"], row["rows"]) for row in document["fitted"]),
        evaluations=int(document["evaluations"]),
        seconds=0.0,
        stamp_error=float(document["stamp_error"]),
        unmodelled=None
        if lacks is None
        else Unmodelled(np.array(lacks["density"], float), np.array(lacks["off"], float)),
        tried_torques=tuple(TriedTorque(**tried) for tried in document["tried_torques"]),
        alternatives=tuple(document["alternatives"]),
    )


def _mechanism(
    document: Mapping[str, Any], written: Mechanism, rows: Mapping[str, Any], names: Sequence[str]
) -> tuple[Mechanism, list[str]]:
    """Return the identified mechanism, and the parameters of it that have an error, in its order."""
    drive, known = document["drive"], {name: float(row["value"]) for name, row in rows.items()}
    mechanism = written
    if drive["model"] != "friction":
        mechanism = written.with_torque(
            drive["model"],
            terms=int(drive["harmonics"]),
            knots=np.array(drive["knots"], dtype=float),
            period=known.get("torque.period"),
        )
    varying = [p.name for p in mechanism.parameters if p.name in set(names)]
    mechanism = mechanism.with_choices(free=varying)
    follows = {p.name for p in mechanism.parameters if p.follows}
    here = {name: value for name, value in known.items() if name in mechanism.values and name not in follows}
    return mechanism.with_values(here), varying


def _estimate(name: str, value: float, unit: str, row: Mapping[str, Any] | None, *, free: bool) -> Estimate:
    """Return a parameter of the written model with the interval that was written."""
    if row is None:
        return Estimate(name, value, 0.0, value, value, unit, free, True, False)
    std = _number(row["std"], math.inf)
    lower, upper = _number(row["lower"], -math.inf), _number(row["upper"], math.inf)
    return Estimate(name, value, std, lower, upper, unit, free, row["identifiable"], row["at_bound"])


def _number(value: float | None, unknown: float) -> float:
    """Return a number of a JSON file, which has null for what is none."""
    return unknown if value is None else float(value)
