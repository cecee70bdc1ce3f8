"""A run folder in, the fit that it holds out: what a later command knows of an identified mechanism."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.choices import is_bundled
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Doubt, Estimate, Fit, Grade
from monodyn.estimation.parts import Combination, Start, TriedTorque, Unmodelled
from monodyn.estimation.shooting.unknowns import SEEN_ONLY, assumed_sizes
from monodyn.estimation.wording import listed
from monodyn.mechanism import Measured, Mechanism, load
from monodyn.mechanism.ends import with_ends
from monodyn.mechanism.parts import PLACE_KINDS
from monodyn.mechanism.torques import LAG
from monodyn.mechanism.upright import ROLL
from monodyn.names import meant, near_files
from monodyn.numbers import known_or
from monodyn.results.findings import SCHEMA
from monodyn.results.folder import recover
from monodyn.results.intact import check_model, check_seal, differing, digest
from monodyn.results.known_torques import known_torques
from monodyn.results.log import fingerprint
from monodyn.types import Camera, TorqueLog

NOTHING = 0.04
"""Information about the logarithm of a size below which a picture knows nothing of it: a factor of e^5."""
LARGEST = 500e6
"""Size from which on ``fit.json`` is none [byte]."""


def open_run(folder: str | Path) -> Fit:
    """Read the fit of a run folder back, from its ``fit.json`` and ``model.xml``.

    Motion, prediction and their bands are those of the fit that was written. Its parameters are those of the
    written model, whose bodies have masses and inertias in place of densities and thicknesses; residuals are
    not kept, so that ``report`` and ``smooth`` refuse it. Known torques are those of ``torques.csv``: after
    record and prediction they are unknown. A refused fit opens, too: ``status`` has the reason, and
    ``check()`` raises it.

    Args:
        folder: The run folder.

    Returns:
        The fit.

    Raises:
        SettingsError: There is no such run, or its files were changed after they were written.
        MechanismError: ``model.xml`` is no mechanism.

    Example:
        >>> fit = monodyn.open_run("run")  # doctest: +SKIP
        >>> monodyn.predict(fit, until=10.0)  # doctest: +SKIP
    """
    folder = Path(folder)
    document = _document(folder)
    try:
        return _fit(document, folder / "model.xml")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise _changed(folder / "fit.json", error) from None


def _changed(file: Path, error: Exception) -> SettingsError:
    """Return the complaint about a file that was changed."""
    return SettingsError(
        f"'{file}': expected the file as it was written, got one without what it should hold "
        f"({type(error).__name__}: {error}); run it again."
    )


def is_run(model: str | Path) -> bool:
    """Return whether a folder was given as the mechanism, that of a run; a bundled name is never one.

    Args:
        model: What was given as the mechanism.
    """
    return not is_bundled(model) and Path(model).is_dir()


def origins(model: str | Path) -> list[Path]:
    """Name the files to which a mechanism leads back: without them it cannot be opened again.

    Args:
        model: What was given as the mechanism, and could be opened.

    Returns:
        Its file; where it is a run folder, what is read of that run and of those before it, and the file with
        which they began.

    Raises:
        SettingsError: From deeper down: it could not be opened.
    """
    if not is_run(model):
        return [Path(model)]
    folder = Path(model)
    before = _same(_json(folder / "run.json")["inputs"]["model"], folder)
    return [folder / "fit.json", folder / "run.json", *origins(before)]


def remembered(folder: str | Path, *, through: frozenset[Path] = frozenset()) -> Mechanism:
    """Return the mechanism of a run as the start of another one: what its picture knows of it goes along.

    It is the mechanism file of that run with the identified values, the user's choices, and what the pictures
    know of sizes. What its motion has shown is the start alone: a record that is identified again is not
    counted twice. Sizes of which no picture knows anything keep the file's proportion, about which they are
    assumed to be.

    Args:
        folder: The run folder.
        through: The run folders that led here.

    Returns:
        The mechanism.

    Raises:
        SettingsError: There is no such run, nothing was identified in it, or its mechanism file is gone.
        MechanismError: From ``load``: the mechanism file is not what it was.
    """
    folder = Path(folder)
    document = _document(folder)
    if not document["initial_state"]:
        raise SettingsError(
            f"'{folder}': expected an identified mechanism, got a run without one: {document['status']}"
        )
    log, through = _json(folder / "run.json"), through | {folder.resolve()}
    try:
        model, settings = log["inputs"]["model"], log["settings"]
        source = _same(model, folder)
        # a run that went on with the mechanism of another one leads back to that one's file
        if is_run(source) and Path(source).resolve() in through:
            raise SettingsError(
                f"model '{folder}': expected a run that leads back to a mechanism file, got one that leads "
                f"to '{source}' again; give the file itself with --model."
            )
        mechanism = remembered(source, through=through) if is_run(source) else load(source)
        mechanism = with_ends(mechanism, document.get("ends", {}))
        known = {row["name"]: float(row["value"]) for row in document["parameters"]}
        given = {n: float(v) for n, v in settings["fix"].items() if n in mechanism.values}
        mechanism = mechanism.with_choices(
            fix=given,
            free=[name for name in settings["free"] if name in mechanism.values],
            bounds={name: (float(a), float(b)) for name, (a, b) in settings["bounds"].items()},
        )
        follows = {p.name for p in mechanism.parameters if p.follows}
        here = {n: v for n, v in known.items() if n in mechanism.values and n not in follows and n != ROLL}
        file, mechanism = mechanism, mechanism.with_values(here)
        seen = document["measured"]
        if seen is not None:
            mechanism = mechanism.with_measured(Measured(tuple(seen["names"]), np.array(seen["information"])))
        mechanism = mechanism.with_values(_unseen(file, mechanism))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise _changed(folder / "run.json", error) from None
    return mechanism


def _unseen(file: Mechanism, mechanism: Mechanism) -> dict[str, float]:
    """Return the sizes of which no picture knows anything, in their proportion in the file."""
    then, now, seen = file.values, mechanism.values, mechanism.measured
    shown = {} if seen is None else dict(zip(seen.names, np.diag(seen.information), strict=True))
    found: dict[str, float] = {}
    for p in assumed_sizes(mechanism):
        against = p.against if p.kind in PLACE_KINDS else f"{p.owner}.length"
        if shown.get(p.name, 0.0) < NOTHING and p.name not in mechanism.chosen:
            found[p.name] = then[p.name] * (now[against] / then[against] if against else 1.0)
    return found


def known_before(model: str | Path, fit: Fit) -> list[str]:
    """Name what the run that was given as the model knows, and its own motion no more does.

    Args:
        model: What was given as the model of a fit; nothing is said where it is no run folder.
        fit: The fit.

    Returns:
        Sentences.

    Raises:
        SettingsError: From deeper down: the folder is no longer that of a run.
    """
    if not is_run(model):
        return []
    rows = {row["name"]: row for row in _document(Path(model))["parameters"]}
    names = [p.name for p in fit.parameters if p.free and not p.identifiable and p.name in rows]
    known = [f"{n} ({rows[n]['value']:.4g} ± {rows[n]['std']:.2g} {rows[n]['unit']})"
             for n in names if rows[n]["free"] and rows[n]["identifiable"]]  # fmt: skip
    if not known:
        return []
    return [
        f"The motion of '{model}' determined {listed(known, 12)}, which counts for that record alone: "
        "identify both records together (monodyn identify with both tables) to have it here."
    ]


def judged_before(verdict: Grade | None, fit: Fit, frames: tuple[int, int]) -> list[str]:
    """Say where a stream was judged otherwise while it went on.

    Args:
        verdict: The last one of the stream; None where there was none.
        fit: The fit of its frames together.
        frames: The first of these, and the one after the last.

    Returns:
        Sentences.
    """
    if verdict in (None, fit.grade):
        return []
    return [
        f"At the last frame of the stream the verdict was {verdict}, by the seconds before it; that of "
        f"frames {frames[0]} to {frames[1] - 1} together is {fit.grade}."
    ]


def _same(model: Mapping[str, Any], folder: Path) -> str | Path:
    """Return the name of a run's mechanism file, which still has to be the one that was read."""
    name = str(model["name"])
    expected = model.get("sha256")
    if expected is None:
        return name
    for file in (Path(name), folder / Path(name).name):
        if file.is_file() and digest(file) == expected:
            return file
    raise SettingsError(
        f"model '{folder}': expected the mechanism file of that run, '{name}', as it was then, got none; put "
        "it there, or into the folder."
    )


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


def clip_of(folder: str | Path) -> Path | None:
    """Return where a run found its clip; None where it has no log, or had no clip.

    Args:
        folder: The run folder.

    Raises:
        SettingsError: The log is not what was written.
    """
    log = Path(folder) / "run.json"
    # where the mechanism of ``monodyn.report`` is of no file
    if not log.is_file():
        return None
    try:
        clip = _json(log)["inputs"].get("clip")
        return None if clip is None else Path(clip["name"])
    except (KeyError, TypeError, AttributeError) as error:
        raise _changed(log, error) from None


def is_other_clip(folder: str | Path, clip: str | Path) -> bool:
    """Return whether a clip is another file than the one that a run was made of, as far as its log says.

    Args:
        folder: The run folder.
        clip: The clip.

    Raises:
        SettingsError: The log is not what was written.
    """
    log = Path(folder) / "run.json"
    known = _json(log)["inputs"].get("clip", {}) if log.is_file() else {}
    found = fingerprint("clip", clip)
    return any(found.get(name) != value for name, value in known.items() if name != "name")


def _document(folder: Path) -> dict[str, Any]:
    """Return the content of ``fit.json`` of a run."""
    recover(folder)
    document = _json(folder / "fit.json")
    if document.get("schema") != SCHEMA:
        raise SettingsError(
            f"'{folder / 'fit.json'}': expected a file of schema {SCHEMA}, got "
            f"{document.get('schema') or 'none'}; run it again with this version."
        )
    check_seal(folder / "fit.json", document)
    return document


def _json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file of a run."""
    if not file.is_file():
        what = f"a folder without {file.name}" if file.parent.is_dir() else "no such folder"
        asked = [] if file.parent.is_dir() else near_files(file.parent)
        end = meant(asked) or "name the one given as --out, of a run that came to a fit."
        raise SettingsError(f"'{file.parent}': expected the folder of a run, got {what}; {end}")
    if file.stat().st_size > LARGEST:
        raise SettingsError(
            f"'{file}': expected a file of a run, got one of {file.stat().st_size} bytes; run it again."
        )
    try:
        text = file.read_text(encoding="utf-8")
        document = json.loads(text, parse_float=_finite, parse_constant=_finite)
    except ValueError as error:
        raise SettingsError(f"'{file}': expected JSON, got other text ({error}); run it again.") from None
    return document if isinstance(document, dict) else {}


def _finite(text: str) -> float:
    """Return a number of a JSON file, which has null for what is none."""
    if not math.isfinite(number := float(text)):
        raise ValueError(f"{text} is no number")
    return number


def _fit(document: Mapping[str, Any], model: Path) -> Fit:
    """Return the fit that a run wrote."""
    rows = {row["name"]: row for row in document["parameters"]}
    names, matrix = document["covariance"]["names"], document["covariance"]["matrix"]
    if not model.is_file():
        raise SettingsError(
            f"'{model.parent}': expected the folder of a run with its model.xml, got one without; put it "
            "back, or run it again."
        )
    written = load(model)
    check_model(model, written, document)
    mechanism, varying = _mechanism(document, written, rows, names)
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
    logs: tuple[TorqueLog, ...] = ()
    if document["drive"]["model"] == "known":
        lag = mechanism.values[LAG]
        logs = known_torques(model.parent / "torques.csv", joints, records=len(starts), lag=lag)
    return Fit(
        status=document["status"],
        doubts=tuple(
            Doubt(**{**doubt, "holds": known_or(doubt.get("holds"), math.inf)})
            for doubt in document["doubts"]
        ),
        advice=tuple(document["advice"]),
        mechanism=mechanism,
        parameters=tuple(estimates),
        combinations=tuple(_combination(one) for one in document["combinations"]),
        starts=tuple(starts),
        tied=(),
        covariance=covariance,
        residual=(),
        rms={joint: known_or(document["rms"][joint], math.nan) for joint in joints},
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
        torques=logs,
        unknowns=int(document["unknowns"]),
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
    # what the scale of the masses rests on is a choice of the user's, which the model does not name
    heavy = [p for p in mechanism.parameters if p.kind == "mass" and p.name not in varying]
    given = {p.name: p.value for p in heavy if document["mass_scale"] == "given"}
    mechanism = mechanism.with_choices(fix=given, free=varying)
    follows = {p.name for p in mechanism.parameters if p.follows}
    here = {name: value for name, value in known.items() if name in mechanism.values and name not in follows}
    # where the written file shares a body out otherwise, into length and overhangs, it is the one that moves
    # as the fit does
    shapes = {p.name for p in mechanism.parameters if p.kind in (*SEEN_ONLY, "length", "thickness")}
    for name in shapes.intersection(differing(written, known)):
        here.pop(name, None)
    return mechanism.with_values(here), varying


def _combination(row: Mapping[str, Any]) -> Combination:
    """Return a combination with the interval that was written."""
    value, std = known_or(row["value"], math.nan), known_or(row["std"], math.inf)
    lower, upper = known_or(row["lower"], -math.inf), known_or(row["upper"], math.inf)
    return Combination(row["name"], value, std, lower, upper, row["unit"])


def _estimate(name: str, value: float, unit: str, row: Mapping[str, Any] | None, *, free: bool) -> Estimate:
    """Return a parameter of the written model with the value and the interval that were written."""
    if row is None:
        return Estimate(name, value, 0.0, value, value, unit, free, True, False)
    value, std = known_or(row["value"], math.nan), known_or(row["std"], math.inf)
    lower, upper = known_or(row["lower"], -math.inf), known_or(row["upper"], math.inf)
    return Estimate(name, value, std, lower, upper, unit, free, row["identifiable"], row["at_bound"])
