"""Motion as tables, documents as JSON: ``states.csv``, ``prediction.csv``, ``torques.csv``, ``camera.csv``.

Numbers are written with enough digits to read back the same number. Neither has infinities: an interval that
is unbounded, and a value that is unknown, is an empty cell or null.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.estimation.record.tables import cell_text
from monodyn.results.torques import Torques
from monodyn.results.trace import Trace

if TYPE_CHECKING:
    from monodyn.results.fill import States
    from monodyn.vision.clip.steady import CameraPath

CAMERA = "frame,time,registered,x_px,y_px,turn,zoom,std_px,stretch,shear,lean_x,lean_y"
"""Columns of ``camera.csv``."""


def states_table(joints: Sequence[str], traces: Sequence[Trace]) -> str:
    """Return ``states.csv``: ``frame,time,<joint>,...,<joint>_vel,...,<joint>_std,...,<joint>_vel_std,...``.

    Several records follow each other, with a last column ``record`` that counts them from 0.

    Args:
        joints: Joint names.
        traces: The records and their motion.
    """
    return motion_table(joints, [(trace.poses.frame, trace.states) for trace in traces])


def motion_table(joints: Sequence[str], motions: Sequence[tuple[Iterable[int], States]]) -> str:
    """Return motions as ``states.csv`` has them.

    Args:
        joints: Joint names.
        motions: Frame numbers and motion of each.
    """
    parts = [(frames, [s.time, s.position, s.velocity, s.std, s.velocity_std]) for frames, s in motions]
    return _by_record(joints, ("", "_vel", "_std", "_vel_std"), parts, len(motions))


def prediction_table(joints: Sequence[str], traces: Sequence[Trace]) -> str:
    """Return ``prediction.csv``: ``frame,time,<joint>,...,<joint>_std,...``.

    Several records follow each other, with a last column ``record`` that counts them from 0.

    Args:
        joints: Joint names.
        traces: The records and their predictions; where there is none the header stands alone.
    """
    parts = []
    for trace in traces:
        future = trace.future
        if future is None or trace.future_frame is None:
            parts.append(((), [np.zeros((0, 1 + 2 * len(joints)))]))
        else:
            parts.append((trace.future_frame, [future.time, future.position, future.std]))
    return _by_record(joints, ("", "_std"), parts, len(traces))


def torque_table(joints: Sequence[str], traces: Sequence[Trace], courses: Sequence[Torques]) -> str:
    """Return ``torques.csv``: ``frame,time,<joint>,...,<joint>_std,...`` [N m or N].

    Several records follow each other, with a last column ``record`` that counts them from 0.

    Args:
        joints: Joint names.
        traces: The records.
        courses: Torques of each; a row between two frames has no frame number.
    """
    parts = []
    for trace, course in zip(traces, courses, strict=True):
        number = dict(zip(trace.poses.time.tolist(), trace.poses.frame.tolist(), strict=True))
        if trace.future is not None and trace.future_frame is not None:
            number |= dict(zip(trace.future.time.tolist(), trace.future_frame.tolist(), strict=True))
        frames = [number.get(time) for time in course.time.tolist()]
        parts.append((frames, [course.time, course.torque, course.std]))
    return _by_record(joints, ("", "_std"), parts, len(traces))


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
    header = CAMERA.split(",")
    if path is None:
        return table_text(header, [])
    table = np.column_stack([path.shift, path.turn, path.zoom, path.std, path.stretch, path.lean])
    table[~path.registered] = np.nan
    rows = zip(times.tolist(), path.registered.tolist(), table.tolist(), strict=True)
    return table_text(header, ([i, time, int(known), *row] for i, (time, known, row) in enumerate(rows)))


def _by_record(
    joints: Sequence[str],
    endings: Sequence[str],
    parts: Sequence[tuple[Iterable[int | None], list[np.ndarray]]],
    records: int,
) -> str:
    """Return a table of joints with a part for each record: frame numbers, and columns from the time on."""
    header = ["frame", "time", *(f"{joint}{ending}" for ending in endings for joint in joints)]
    rows = []
    for number, (frames, columns) in enumerate(parts):
        last = [number] if records > 1 else []
        numbers = np.column_stack(columns).tolist()
        rows += [[frame, *row, *last] for frame, row in zip(frames, numbers, strict=True)]
    return table_text([*header, "record"] if records > 1 else header, rows)


def table_text(header: Sequence[str], rows: Iterable[Sequence[float | int | None]]) -> str:
    """Return a table of comma-separated values; what is missing or unbounded is an empty cell.

    Args:
        header: Names of the columns, quoted where they need it.
        rows: The numbers; None, NaN and infinity are missing.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    # repr of a float is the shortest text that reads back as the same number
    writer.writerows([cell_text(number) for number in row] for row in rows)
    return text.getvalue()


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
