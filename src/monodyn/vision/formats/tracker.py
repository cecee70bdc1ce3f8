"""Text that Tracker exports: the names of its point masses, then ``t``, ``x``, ``y`` and what else was
chosen.

One point mass, or several after ``#multi:``. Columns ``pixelx`` and ``pixely`` are places in the picture;
``x`` and ``y`` are lengths in Tracker's coordinate system, whose second axis goes up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable, numbers, rows_of, separator_of

CLOCKS = ("t", "frame", "step")
"""What the first column of numbers may be."""

PAIRS = (("pixelx", "pixely"), ("x", "y"))
"""Columns of a place: pixels, which come first, or lengths."""


def heading(rows: list[list[str]]) -> int | None:
    """Return the row of the variables' names, None where it is no table of Tracker.

    Args:
        rows: The first rows.
    """
    for i, row in enumerate(rows[:4]):
        named = [cell.casefold() for cell in row]
        if named[0] in CLOCKS and i > 0 and ("x" in named or "pixelx" in named):
            return i
    return None


def from_text(path: Path, text: str) -> PointTable:
    """Read an exported text.

    Args:
        path: The file, for messages.
        text: Its text.

    Returns:
        The table.

    Raises:
        VideoError: a point has no coordinates, or one has pixels and another lengths alone.
    """
    body = text.splitlines()
    multi = bool(body) and body[0].strip().casefold().startswith("#multi")
    rows = rows_of("\n".join(body[1:] if multi else body), separator_of(text))
    at = heading(rows) or 0
    variables = [cell.casefold() for cell in rows[at]]
    starts = _starts(rows[at - 1], variables)
    table = numbers(path, rows[at + 1 :], at + 2 + multi, len(variables))
    names, places = [], []
    for k, (first, name) in enumerate(starts):
        stop = starts[k + 1][0] if k + 1 < len(starts) else len(variables)
        own = {what: first + i for i, what in enumerate(variables[first:stop]) if what}
        if not any(_has(own, pair) for pair in PAIRS):
            raise VideoError(
                f"{path.name}: expected columns x and y, or pixelx and pixely, of point '{name}', got "
                f"{', '.join(own) or 'none'}; choose them in Tracker's table."
            )
        names.append(name)
        places.append(own)
    pair = _shared(path, names, places)
    in_picture = pair == PAIRS[0]
    px = np.stack([table[:, [own[what] for what in pair]] for own in places], axis=1)
    frame = _column(table, variables, "frame")
    time = _column(table, variables, "t")
    return PointTable(
        "Tracker", tuple(names), px, np.ones(px.shape[:2]), frame=frame, time=time, in_picture=in_picture,
        upward=not in_picture,
    )  # fmt: skip


def _starts(names: list[str], variables: list[str]) -> list[tuple[int, str]]:
    """Return the first column of each point with its name."""
    found = [(i, name) for i, name in enumerate(names) if name]
    if len(found) <= 1:
        # a single name stands in the first column, or over that of its first variable
        return [(1, found[0][1] if found else "mass_A")]
    return [(max(i, 1), name) for i, name in found if i < len(variables)]


def _has(own: dict[str, int], pair: tuple[str, str]) -> bool:
    return all(what in own for what in pair)


def _shared(path: Path, names: list[str], places: list[dict[str, int]]) -> tuple[str, str]:
    """Return the kind of columns that all points have: pixels and lengths are not in one system."""
    for pair in PAIRS:
        if all(_has(own, pair) for own in places):
            return pair
    odd = next(name for name, own in zip(names, places, strict=True) if not _has(own, PAIRS[0]))
    other = next(name for name, own in zip(names, places, strict=True) if not _has(own, PAIRS[1]))
    raise VideoError(
        f"{path.name}: expected columns of one kind for all points, got x, y of '{odd}' and pixelx, pixely "
        f"of '{other}'; choose the same for each in Tracker's table."
    )


def _column(table: np.ndarray, variables: list[str], name: str) -> np.ndarray | None:
    """Return the first column of a name, filled from others of that name, (frame,)."""
    places = [i for i, what in enumerate(variables) if what == name]
    if not places:
        return None
    column = table[:, places[0]].copy()
    for other in places[1:]:
        column = np.where(np.isnan(column), table[:, other], column)
    return column
