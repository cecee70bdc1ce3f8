"""Motion as tables, documents as JSON: ``states.csv``, ``prediction.csv``, ``torques.csv``, ``camera.csv``.

Numbers are written with enough digits to read back the same number. JSON has no infinity: an interval that is
unbounded, and a value that is unknown, is null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.results.trace import Trace

if TYPE_CHECKING:
    from monodyn.vision.clip.steady import CameraPath


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


def camera_table(times: np.ndarray, path: CameraPath | None) -> str:
    """Return ``camera.csv``: ``frame,time,registered,x_px,y_px,turn,zoom,std_px``, and what perspective adds,
    ``stretch,shear,lean_x,lean_y``.

    Where the still scene appears in a frame: what a camera at its mean place shows at ``c + d`` [px] is at
    ``c + (zoom R d + S d + (x_px, y_px)) / (1 + lean_x d_x + lean_y d_y)``, with the middle of the picture
    ``c``, x to the right and y down, ``R = [[cos turn, sin turn], [-sin turn, cos turn]]`` (the turn is
    counter-clockwise as seen [rad]) and ``S = [[stretch, shear], [shear, -stretch]]``; the last four columns
    are zero but for rounding where no perspective shows, ``lean`` is in 1/px.

    Args:
        times: Time stamps of the clip [s], (frame,).
        path: The way of a camera that moves; None writes the header alone.
    """
    text = "frame,time,registered,x_px,y_px,turn,zoom,std_px,stretch,shear,lean_x,lean_y\n"
    if path is None:
        return text
    table = np.column_stack([path.shift, path.turn, path.zoom, path.std, path.stretch, path.lean])
    table[~path.registered] = np.nan
    for frame, (time, known) in enumerate(zip(times.tolist(), path.registered.tolist(), strict=True)):
        numbers = ",".join(map(repr, table[frame].tolist()))
        text += f"{frame},{time!r},{int(known)},{numbers}\n"
    return text


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
    # repr of a float is the shortest text that reads back as the same number
    rows = np.column_stack(columns).tolist()
    return "".join(f"{n},{','.join(map(repr, row))}{end}\n" for n, row in zip(frames, rows, strict=True))


def json_text(document: Any) -> str:
    """Return a document as JSON; numbers that JSON cannot hold become null.

    Args:
        document: Dicts, lists, numbers, texts, paths and arrays.
    """
    return json.dumps(jsonable(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def jsonable(value: Any) -> Any:
    """Return a value as JSON types.

    Args:
        value: Dicts, lists, tuples, numbers, texts, paths and arrays.
    """
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, np.ndarray):
        return jsonable(value.tolist())
    if isinstance(value, np.generic):
        return jsonable(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return str(value) if isinstance(value, Path) else repr(value)
