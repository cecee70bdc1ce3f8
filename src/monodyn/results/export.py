"""A fit and its motion as tables and documents: ``states.csv``, ``prediction.csv``, ``fit.json``.

Numbers are written with enough digits to read back the same number. JSON has no infinity: an interval that is
unbounded, and a value that is unknown, is null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.types import Camera, Poses

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.results.fill import States
    from monodyn.results.predict import Prediction
    from monodyn.results.torques import Torques


@dataclass(frozen=True, eq=False)
class Trace:
    """One record beside its motion under the identified dynamics.

    Attributes:
        name: What the record is called, e.g. its file name.
        poses: Measured joint positions, slides in metres of the identified scale.
        states: Motion under the identified dynamics at ``poses.time``.
        rows: First fitted row of ``poses`` and the one after the last.
        future: Prediction from the end of the fitted rows, or None.
        future_frame: Frame numbers of the prediction, int (frame,).
        torques: Torques at ``poses.time`` besides friction, or None where there are none.
    """

    name: str
    poses: Poses
    states: States
    rows: tuple[int, int]
    future: Prediction | None = None
    future_frame: np.ndarray | None = None
    torques: Torques | None = None

    def errors(self) -> np.ndarray:
        """Measured minus simulated positions [rad or m], (frame, dof); NaN where not seen."""
        error = self.poses.position - self.states.position
        return np.where(self.poses.seen[:, None], error, np.nan)

    def heldout(self) -> dict[str, float | None]:
        """Rms of the prediction against the measured rows after the fitted ones, by joint [rad or m].

        A joint without measured rows there has None.
        """
        if self.future is None or not len(self.future.time):
            return dict.fromkeys(self.poses.joints)
        after = self.poses.part(self.rows[1], len(self.poses))
        row = np.minimum(np.searchsorted(self.future.time, after.time - 1e-9), len(self.future.time) - 1)
        predicted = after.seen & (np.abs(self.future.time[row] - after.time) < 1e-9)
        error = after.position - self.future.position[row]
        return rms_of(self.poses.joints, np.where(predicted[:, None], error, np.nan))


def rms_of(joints: Sequence[str], error: np.ndarray) -> dict[str, float | None]:
    """Return the rms of each joint's error over the rows that have one.

    Args:
        joints: Joint names.
        error: Errors [rad or m], (frame, dof), NaN where unknown.
    """
    found: dict[str, float | None] = {}
    for dof, joint in enumerate(joints):
        column = error[:, dof][np.isfinite(error[:, dof])]
        found[joint] = float(np.sqrt(np.mean(column**2))) if len(column) else None
    return found


def states_table(joints: Sequence[str], traces: Sequence[Trace]) -> str:
    """Return ``states.csv``: ``frame,time,<joint>,...,<joint>_vel,...,<joint>_std,...``.

    Several records follow each other, with a last column ``record`` that counts them from 0.

    Args:
        joints: Joint names.
        traces: The records and their motion.
    """
    several = len(traces) > 1
    header = ["frame", "time", *joints, *(f"{j}_vel" for j in joints), *(f"{j}_std" for j in joints)]
    text = ",".join([*header, "record"] if several else header) + "\n"
    for number, trace in enumerate(traces):
        states = trace.states
        columns = [states.time, states.position, states.velocity, states.std]
        text += rows_text(trace.poses.frame, columns, f",{number}" if several else "")
    return text


def prediction_table(joints: Sequence[str], trace: Trace | None) -> str:
    """Return ``prediction.csv``: ``frame,time,<joint>,...,<joint>_std,...``.

    Args:
        joints: Joint names.
        trace: The record and its prediction; None writes the header alone.
    """
    header = ["frame", "time", *joints, *(f"{j}_std" for j in joints)]
    text = ",".join(header) + "\n"
    if trace is None or trace.future is None or trace.future_frame is None:
        return text
    future = trace.future
    return text + rows_text(trace.future_frame, [future.time, future.position, future.std])


def torque_table(joints: Sequence[str], trace: Trace) -> str:
    """Return ``torques.csv``: ``frame,time,<joint>,...,<joint>_std,...`` [N m or N].

    Args:
        joints: Joint names.
        trace: A record with torques.
    """
    text = ",".join(["frame", "time", *joints, *(f"{j}_std" for j in joints)]) + "\n"
    found = trace.torques
    if found is None:
        return text
    return text + rows_text(trace.poses.frame, [found.time, found.torque, found.std])


def rows_text(frames: Iterable[int], columns: Sequence[np.ndarray], end: str = "") -> str:
    """Return comma-separated lines, one per frame, with numbers that read back as they were.

    Args:
        frames: Frame numbers.
        columns: Arrays (frame,) or (frame, dof), side by side.
        end: Put at the end of every line.
    """
    rows = np.column_stack(columns).tolist()
    return "".join(f"{n},{','.join(map(repr, row))}{end}\n" for n, row in zip(frames, rows, strict=True))


def fit_document(
    fit: Fit,
    *,
    traces: Sequence[Trace] = (),
    camera: Camera | None = None,
    camera_std: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the content of ``fit.json``.

    Args:
        fit: The fit.
        traces: The records that were fitted; the first one's frames and held-out error are given.
        camera: Camera in metres of the identified scale.
        camera_std: Standard deviations of the estimated camera parameters by name, e.g. ``camera.depth``.
    """
    joints = [joint.name for joint in fit.mechanism.joints]
    trace = traces[0] if traces else None
    document = {
        "status": str(fit.status),
        "ok": bool(fit.ok),
        "advice": list(fit.advice),
        "torque": fit.torque,
        "unknowns": sum(estimate.free for estimate in fit.parameters),
        "evaluations": fit.evaluations,
        "parameters": [parameter_row(estimate) for estimate in fit.parameters],
        "combinations": [{"name": c.name, "value": c.value, "std": c.std} for c in fit.combinations],
        "initial_state": [start_row(joints, start) for start in fit.starts],
        "rms": dict(fit.rms),
        "heldout_rms": trace.heldout() if trace is not None else dict.fromkeys(joints),
        "scale": fit.scale,
        "camera": None if camera is None else {**asdict(camera), "std": dict(camera_std or {})},
        "fit_frames": None if trace is None else frames_of(trace),
    }
    if len(fit.starts) == 1:
        document["initial_state"] = document["initial_state"][0]
    return document


def parameter_row(estimate: Any) -> dict[str, Any]:
    """Return one parameter as ``fit.json`` lists it.

    Args:
        estimate: An ``Estimate`` of a fit.
    """
    names = ("name", "value", "std", "lower", "upper", "unit", "free", "identifiable", "at_bound")
    return {name: getattr(estimate, name) for name in names}


def start_row(joints: Sequence[str], start: Any) -> dict[str, Any]:
    """Return one start state as ``fit.json`` lists it.

    Args:
        joints: Joint names.
        start: A start of a fit: time, position and rate with their covariance.
    """
    std = np.sqrt(np.maximum(np.diagonal(start.covariance), 0.0))
    dofs = len(joints)
    return {
        "time": float(start.time),
        "position": dict(zip(joints, np.asarray(start.position).tolist(), strict=True)),
        "velocity": dict(zip(joints, np.asarray(start.velocity).tolist(), strict=True)),
        "position_std": dict(zip(joints, std[:dofs].tolist(), strict=True)),
        "velocity_std": dict(zip(joints, std[dofs:].tolist(), strict=True)),
    }


def frames_of(trace: Trace) -> list[int]:
    """Return the first fitted frame number and the one after the last.

    Args:
        trace: The record.
    """
    first, stop = trace.rows
    return [int(trace.poses.frame[first]), int(trace.poses.frame[stop - 1]) + 1]


def json_text(document: Any) -> str:
    """Return a document as JSON; numbers that JSON cannot hold become null.

    Args:
        document: Dicts, lists, numbers, texts, paths and arrays.
    """
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def plain(value: Any) -> Any:
    """Return a value as JSON types.

    Args:
        value: Dicts, lists, tuples, numbers, texts, paths and arrays.
    """
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value) if isinstance(value, Path) else repr(value)
