"""Logs of known torques in: what a controller sent or measured, in N m, at each joint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from monodyn.arrays import WILD, clock
from monodyn.errors import VideoError
from monodyn.estimation.record.tables import row_numbers, table_rows
from monodyn.mechanism import Mechanism
from monodyn.names import known, quoted, short
from monodyn.types import TorqueLog

SUFFIX = "_torque"
"""Ends the names of torques where a table has the positions of the joints as well."""
NO_TORQUES = ("time", "frame")
"""Columns of a log that are no torques."""


def read_torques(path: str | Path, joints: Mechanism | Sequence[str]) -> TorqueLog:
    """Read a log of known torques.

    The header names the columns: ``time`` [s] on the clock of the record, and ``<joint>_torque`` [N m or N]
    for each joint at which one acts; without any such column they are called ``<joint>``, as in the
    ``torques.csv`` of a run folder, whose deviations are left alone.

    Args:
        path: File of comma-separated values.
        joints: The mechanism, or its joint names in order.

    Returns:
        The torques.

    Raises:
        VideoError: The file cannot be read, names no joint or one that the mechanism has not, holds something
            that is not a finite number, its times do not increase, or no torque acts.
    """
    path = Path(path)
    names = tuple(joints if isinstance(joints, Sequence) else (joint.name for joint in joints.joints))
    header, rows = table_rows(path, "torques")
    columns = _columns(path, header, names)
    table = np.array([row_numbers(path, header, row, line) for line, row in rows])
    for name, column in (("time", header.index("time")), *((header[c], c) for c in columns.values())):
        bad = np.flatnonzero(~(np.abs(table[:, column]) <= WILD))
        if len(bad):
            line, row = rows[bad[0]]
            cell = short(row[column].strip()) or "an empty cell"
            raise VideoError(
                f"{path.name}: line {line}, column '{name}': expected a number within {WILD:g} of 0, got "
                f"{cell}; a torque has to be known throughout."
            )
    time = clock(f"{path.name}: column 'time'", table[:, header.index("time")], error=VideoError)
    torque = table[:, list(columns.values())]
    if len(time) < 2:
        raise VideoError(f"{path.name}: expected two rows of torques or more, got {len(time)}.")
    if not torque.any():
        raise VideoError(
            f"{path.name}: expected torques that act, got zeros alone, which say nothing of masses; leave "
            "the log out."
        )
    return TorqueLog(tuple(columns), time, torque)


def _columns(path: Path, header: list[str], names: tuple[str, ...]) -> dict[str, int]:
    """Index of the column of each joint's torque."""
    suffixed = any(name.endswith(SUFFIX) for name in header)
    others = {*NO_TORQUES, *(f"{name}_std" for name in names)}
    found = {
        name.removesuffix(SUFFIX): column
        for column, name in enumerate(header)
        if (name.endswith(SUFFIX) if suffixed else name not in others)
    }
    if "time" not in header or not found:
        raise VideoError(
            f"{path.name}: expected columns 'time' and '<joint>{SUFFIX}' or '<joint>' of joints with a "
            f"torque, got {quoted(header)}; joints: {quoted(names)}."
        )
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        raise VideoError(
            f"{path.name}: column {twice[0]!r} is there {header.count(twice[0])} times; keep one."
        )
    for name, column in found.items():
        if name not in names:
            raise VideoError(
                f"{path.name}: column {short(header[column])!r} is of no joint of the mechanism; name it as "
                f"its joint, or leave it out; {known('joints', names, name)}"
            )
    return found
