"""A plain table: ``frame`` or ``time``, then ``NAME_x``, ``NAME_y`` and where there is one ``NAME_p``."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable, numbers, rows_of

CLOCKS = ("frame", "time")
"""Columns that are no points."""

ROUNDINGS = (0.01, 0.001)
"""Units to which programs round times [s]."""


def is_plain(header: list[str]) -> bool:
    """Return whether a header is that of a plain table.

    Args:
        header: The first row.
    """
    return any(cell.casefold() in CLOCKS for cell in header) and any(
        re.search(r"_x$", cell, re.IGNORECASE) for cell in header
    )


def from_csv(path: Path, text: str) -> PointTable:
    """Read a plain table.

    Args:
        path: The file, for messages.
        text: Its text.

    Returns:
        The table.

    Raises:
        VideoError: a column is there twice, a point lacks one, or there is no row.
    """
    rows = rows_of(text)
    header = rows[0]
    lower = [cell.casefold() for cell in header]
    twice = [cell for cell in header if cell and lower.count(cell.casefold()) > 1]
    if twice:
        raise VideoError(
            f"{path.name}: column '{twice[0]}' is there {lower.count(twice[0].casefold())} times, capitals "
            "or not; keep one."
        )
    if len(rows) < 2:
        raise VideoError(f"{path.name}: expected rows of coordinates after the header, got none.")
    known = {cell: i for i, cell in enumerate(lower)}
    names = [cell[:-2] for cell in header if re.search(r"_x$", cell, re.IGNORECASE)]
    table = numbers(path, rows[1:], 2, len(header))
    px = np.full((len(table), len(names), 2), np.nan)
    likelihood = np.ones((len(table), len(names)))
    for k, name in enumerate(names):
        lacking = f"{name}_y".casefold() not in known
        if lacking:
            raise VideoError(
                f"{path.name}: expected a column '{name}_y' next to '{name}_x', got none; add it."
            )
        px[:, k, 0] = table[:, known[f"{name}_x".casefold()]]
        px[:, k, 1] = table[:, known[f"{name}_y".casefold()]]
        if f"{name}_p".casefold() in known:
            likelihood[:, k] = np.nan_to_num(table[:, known[f"{name}_p".casefold()]])
    frame = table[:, known["frame"]] if "frame" in known else None
    time = table[:, known["time"]] if "time" in known else None
    tick = 0.0 if time is None else _rounding(time)
    return PointTable("CSV", tuple(names), px, likelihood, frame=frame, time=time, tick=tick)


def _rounding(time: np.ndarray) -> float:
    """Return the unit to which times are rounded [s]; 0 where none of the usual ones explains them."""
    for unit in ROUNDINGS:
        if np.allclose(time / unit, np.round(time / unit), atol=1e-6):
            return unit
    return 0.0
