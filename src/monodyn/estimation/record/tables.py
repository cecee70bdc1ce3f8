"""Tables of joint positions in and out: ``poses.csv`` of a run folder, and encoder logs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from monodyn.arrays import WILD, clock, frozen
from monodyn.choices import check_endless
from monodyn.errors import VideoError
from monodyn.estimation.record.held import held_rows
from monodyn.mechanism import Mechanism
from monodyn.names import meant, near, near_files, quoted, short
from monodyn.types import Poses, shared_columns

MOST_ROWS = 200_000
"""Most rows of a table of joint positions: they tell enough. A fit of them takes two minutes or so, one that
is refused, with the search for a cause, several times as long."""
SEEN_WORDS = {"1": True, "true": True, "0": False, "false": False}
"""What a cell of the column ``seen`` may hold; some tools write words."""
SIGNS = {";": "semicolons", "\t": "tabs", "|": "bars", " ": "blanks"}
"""What other programs write between cells in place of commas."""


def read_poses(path: str | Path, joints: Mechanism | Sequence[str]) -> Poses:
    """Read a table of joint positions.

    The header names the columns: ``time`` [s] and one per joint [rad or m] are needed; ``frame``, ``seen`` (1
    or 0), ``<joint>_std`` [rad or m] and ``<joint>_seen`` (1 or 0) are used when they are there, others are
    left alone. An empty or ``nan`` position is a gap. In a row whose ``seen`` is 0 the joints count whose
    own ``_seen`` is 1, unless that is said of all of them. Without a ``_std`` column the noise is estimated
    from the record itself. A position that repeats the one before while its joint moves on is a gap, too: the
    log held its last reading. ``<joint>_shared1``, ``<joint>_shared2`` ... [rad or m] are errors that the
    positions share: by how much each is off where what they have in common is off by one standard deviation.

    Args:
        path: File of comma-separated values.
        joints: The mechanism, or its joint names in order.

    Returns:
        The record; slides are in metres.

    Raises:
        VideoError: The file cannot be read, lacks a column, holds something that is not a number or that
            its column cannot have, or its times do not increase.
    """
    path = Path(path)
    names = tuple(joints if isinstance(joints, Sequence) else (joint.name for joint in joints.joints))
    header, rows = table_rows(path)
    if len(rows) > MOST_ROWS:
        raise VideoError(
            f"{path.name}: expected at most {MOST_ROWS} rows, got {len(rows)}; keep one of every "
            f"{-(-len(rows) // MOST_ROWS)}, a motion needs some ten rows a swing."
        )
    columns = _columns(path, header, names)
    # numbers first, then what they may be: a message names the first thing that is wrong in a line
    table = np.array([row_numbers(path, header, row, line) for line, row in rows])
    _check_values(path, columns, names, rows, table)
    time = clock(f"{path.name}: column 'time'", table[:, columns["time"]], error=VideoError)
    position = table[:, [columns[name] for name in names]]
    seen, joint_seen = _seen(position, table, columns, names)
    held = held_rows(position, np.isfinite(position))
    if held.any():
        joint_seen = (seen[:, None] if joint_seen is None else joint_seen) & np.isfinite(position) & ~held
        seen = np.asarray(joint_seen.all(axis=1))
    frame = table[:, columns["frame"]].astype(int) if "frame" in columns else np.arange(len(time))
    if not (seen if joint_seen is None else joint_seen).any():
        raise VideoError(f"{path.name}: expected measured joint positions, got none in {len(time)} rows.")
    std = np.full(position.shape, np.nan)
    for dof, name in enumerate(names):
        if f"{name}_std" in columns:
            std[:, dof] = table[:, columns[f"{name}_std"]]
    covariance = np.zeros((len(time), len(names), len(names)))
    covariance[:, range(len(names)), range(len(names))] = std**2
    shifts = _shared(table, columns, names)
    poses = Poses(names, frame, time, position, covariance, seen, joint_seen=joint_seen, shifts=shifts)
    return poses if np.isfinite(std[poses.measured]).all() else _with_noise(poses, std)


def column_names(path: str | Path) -> list[str]:
    """Return the names of the columns of a table.

    Args:
        path: File of comma-separated values.

    Raises:
        VideoError: The file cannot be read, or holds no table.
    """
    return table_rows(Path(path))[0]


def write_poses(
    poses: Poses,
    path: str | Path,
    excluded: np.ndarray | None = None,
    shared: np.ndarray | None = None,
) -> None:
    """Write a record as a table that `read_poses` reads back.

    Numbers are written with as many digits as it takes to read the same number back, what is missing as an
    empty cell; covariances between joints are left out.

    Args:
        poses: The record.
        path: File to write.
        excluded: True for positions that an identified motion excludes, which `read_poses` does not use,
            bool (frame, dof); None writes no columns of them.
        shared: Errors that the positions share [rad or m], one standard deviation of each of several
            directions, (direction, frame, dof); None writes no columns of them.

    Raises:
        VideoError: From the checks of arrays: one has another shape.
    """
    columns, shape = poses.columns(), poses.position.shape
    if shared is not None:
        shared = frozen("write_poses: shared", shared, (None, *shape), error=VideoError)
    if excluded is not None:
        excluded = frozen("write_poses: excluded", excluded, shape, dtype=np.bool_, error=VideoError)
        columns |= {f"{name}_excluded": excluded[:, dof] for dof, name in enumerate(poses.joints)}
    columns |= shared_columns(poses.joints, shared)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    # marks are written as 1 and 0
    cells = [(values.astype(int) if values.dtype == bool else values).tolist() for values in columns.values()]
    writer.writerows([cell_text(cell) for cell in row] for row in zip(*cells, strict=True))
    Path(path).write_text(text.getvalue(), encoding="utf-8")


def cell_text(number: float | int | None) -> str:
    """Return a cell of a table: the shortest text that reads back as the number, nothing where it is missing.

    Args:
        number: The number; None, NaN and infinity are missing.
    """
    return "" if number is None or not math.isfinite(number) else str(number)


def table_rows(path: Path, what: str = "joint positions") -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Read a file of comma-separated values, empty lines left out.

    Args:
        path: The file.
        what: What it is a table of, for a message.

    Returns:
        The header, and the rows with their line numbers.

    Raises:
        VideoError: The file cannot be read, or is no such table, or has no end.
    """
    check_endless(path, VideoError)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        asked = [] if path.exists() else near_files(path)
        end = meant(asked) or f"name a table of {what}."
        raise VideoError(f"{path}: cannot be read ({error.strerror}); {end}") from None
    except UnicodeDecodeError:
        raise VideoError(
            f"{path.name}: expected a table of comma-separated values, got binary data."
        ) from None
    try:
        lines = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise VideoError(f"{path.name}: expected a table of comma-separated values, but {error}.") from None
    rows = [(i + 1, row) for i, row in enumerate(lines) if any(cell.strip() for cell in row)]
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    if odd := _other_sign(header):
        raise VideoError(
            f"{path.name}: expected commas between the cells, got {odd}; save it with commas, and "
            "with points in its numbers."
        )
    if len(rows) < 2:
        raise VideoError(f"{path.name}: expected a header line and rows of numbers, got {len(rows)} lines.")
    if all(_is_number(cell) for cell in header):
        raise VideoError(
            f"{path.name}: expected a header line, got numbers in line {rows[0][0]}; name the columns there, "
            "'time' and others."
        )
    return header, rows[1:]


def _other_sign(header: list[str]) -> str:
    """Return what divides the cells of a header in place of commas, in words; nothing where commas do."""
    found = [word for sign, word in SIGNS.items() if len(header) == 1 and sign in header[0]]
    return found[0] if found else ""


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _columns(path: Path, header: list[str], names: tuple[str, ...]) -> dict[str, int]:
    """Index of each column by its name."""
    missing = [name for name in ("time", *names) if name not in header]
    if missing:
        there = [name for name in ("time", *names) if name in header]
        plain = [name for name in header if not name.startswith(tuple(f"{one}_" for one in there))]
        # a header in capitals lacks them all; the column of another joint was not meant
        others = [name for name in plain if name not in there]
        asked = [repr(found) for name in missing for found in near(others, name)[:1]]
        end = f"did you mean {' and '.join(asked)}?" if asked else f"columns: {quoted(plain)}."
        raise VideoError(f"{path.name}: column {quoted(missing)} is missing; {end}")
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        raise VideoError(
            f"{path.name}: column {twice[0]!r} is there {header.count(twice[0])} times; keep one."
        )
    return {name: i for i, name in enumerate(header)}


def row_numbers(path: Path, header: list[str], row: list[str], line: int) -> list[float]:
    """Return one row as numbers; an empty cell is NaN.

    Args:
        path: The file, for a message.
        header: Names of the columns.
        row: The cells.
        line: Line number of the row.

    Raises:
        VideoError: The row has another number of cells than the header, or one that is no number.
    """
    if len(row) != len(header):
        raise VideoError(
            f"{path.name}: line {line} has {len(row)} cells, expected {len(header)} as in the header."
        )
    numbers = []
    for name, cell in zip(header, row, strict=True):
        cell = cell.strip()
        try:
            numbers.append(float(SEEN_WORDS.get(cell.lower(), cell)) if cell else float("nan"))
        except ValueError:
            raise VideoError(
                f"{path.name}: line {line}, column {name!r}: expected a number, got {short(cell)!r}."
            ) from None
    return numbers


def _seen(
    position: np.ndarray, table: np.ndarray, columns: dict[str, int], names: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray | None]:
    """Rows that count (frame,), and joints that do (frame, dof) where each has a column on it."""
    # encoder logs have no column ``seen``: a row counts when any joint was measured
    seen = np.asarray(np.isfinite(position).any(axis=1))
    if "seen" in columns:
        seen &= table[:, columns["seen"]] > 0
    own = [f"{name}_seen" for name in names]
    if not all(name in columns for name in own):
        return seen, None
    joint_seen = np.isfinite(position) & (table[:, [columns[name] for name in own]] > 0)
    # a row that is 0 although none of its joints is was taken out by hand
    joint_seen &= (seen | ~joint_seen.all(axis=1))[:, None]
    return np.asarray(joint_seen.all(axis=1)), joint_seen


def _shared(table: np.ndarray, columns: dict[str, int], names: tuple[str, ...]) -> np.ndarray | None:
    """Errors that all positions share, (direction, frame, dof), or None; an empty cell is no error."""
    found = []
    while any(f"{name}_shared{len(found) + 1}" in columns for name in names):
        one = np.zeros((len(table), len(names)))
        for dof, name in enumerate(names):
            column = columns.get(f"{name}_shared{len(found) + 1}")
            if column is not None:
                one[:, dof] = np.nan_to_num(table[:, column])
        found.append(one)
    return np.array(found) if found else None


def _check_values(
    path: Path,
    columns: dict[str, int],
    names: tuple[str, ...],
    rows: list[tuple[int, list[str]]],
    table: np.ndarray,
) -> None:
    """Refuse numbers that their column cannot have: what is used must be finite, a gap or a deviation."""
    deviations = [f"{name}_std" for name in names]
    errors = [column for column in columns if column.rstrip("0123456789") in {f"{n}_shared" for n in names}]
    rules = [
        (["frame"], lambda x: np.isfinite(x) & (x == np.rint(x)), "a whole number"),
        (names, lambda x: ~(np.abs(x) > WILD), f"a number within {WILD:g} of 0, or nothing for a gap"),
        (errors, lambda x: ~(np.abs(x) > WILD), f"an error within {WILD:g} of 0, or nothing"),
        (deviations, lambda x: ~(x > WILD) & ~(x < 0), f"a deviation from 0 to {WILD:g}, or nothing"),
    ]
    for chosen, holds, expected in rules:
        for name in chosen:
            if name not in columns:
                continue
            bad = np.flatnonzero(~holds(table[:, columns[name]]))
            if len(bad):
                line, row = rows[bad[0]]
                cell = short(row[columns[name]].strip()) or "an empty cell"
                raise VideoError(
                    f"{path.name}: line {line}, column {name!r}: expected {expected}, got {cell}."
                )


def _with_noise(poses: Poses, std: np.ndarray) -> Poses:
    """Fill in missing standard deviations with the scatter about a smooth curve."""
    from monodyn.estimation.record.smooth import motion_size, smooth

    smoothed = smooth(poses)
    scatter = np.nan_to_num(smoothed.noise, nan=0.0)
    columns = zip(poses.position.T, poses.measured.T, strict=True)
    # a record without any scatter would have infinite weight; a ten-thousandth of its motion is exact enough
    floor = np.array([1e-4 * motion_size(values[use]) for values, use in columns])
    filled = np.where(np.isfinite(std), std, np.maximum(np.maximum(scatter, floor), 1e-9))
    covariance = np.zeros_like(poses.covariance)
    covariance[:, range(len(poses.joints)), range(len(poses.joints))] = filled**2
    return replace(poses, covariance=covariance)
