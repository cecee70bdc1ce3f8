"""What Kinovea exports: trajectories as text for Gnuplot, or all of them as one table of CSV.

The text begins with ``#Kinovea Trajectory data export``; each trajectory follows after its name, or after a
blank line in older versions. The CSV has ``Time`` and, for each point, ``NAME/KEY/X`` and ``NAME/KEY/Y``. The
second axis of Kinovea's coordinate system goes up.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable, check_width, number, rows_of, separator_of

HEAD = "#kinovea"
"""How the text begins."""
CENTISECOND = 0.01
"""Unit of the last part of a time code [s]."""
MILLISECOND = 1e-3
"""Unit to which numeric times are rounded [s]."""


def is_csv(header: list[str]) -> bool:
    """Return whether a header is that of Kinovea's CSV.

    Args:
        header: The first row.
    """
    return (
        header[0].casefold().startswith("time")
        and len(header) > 2
        and all(re.search(r"[/\s][xy]$", cell, re.IGNORECASE) for cell in header[1:] if cell)
    )


def from_csv(path: Path, text: str) -> PointTable:
    """Read a table in CSV.

    Args:
        path: The file, for messages.
        text: Its text.

    Returns:
        The table.

    Raises:
        VideoError: there is no row of coordinates.
    """
    rows = rows_of(text, ";" if separator_of(text.splitlines()[0]) == ";" else ",")
    header = rows[0]
    if len(rows) < 2:
        raise VideoError(f"{path.name}: expected rows of coordinates after the header, got none.")
    pairs = [re.sub(r"[/\s][xyXY]$", "", cell) for cell in header[1:]]
    keys = list(dict.fromkeys(pairs))
    px = np.full((len(rows) - 1, len(keys), 2), np.nan)
    stamps = []
    for i, row in enumerate(rows[1:]):
        check_width(path, row, i + 2, len(header))
        stamps.append(row[0])
        for j, cell in enumerate(row[1 : len(header)]):
            axis = "xy".index(header[j + 1][-1].casefold())
            px[i, keys.index(pairs[j]), axis] = number(path, cell, f"row {i + 2}, column {j + 2}")
    # a trajectory has one point, a drawing several: only these need the key
    series = [key.rsplit("/", 1)[0] for key in keys]
    names = tuple(key if series.count(name) > 1 else name for key, name in zip(keys, series, strict=True))
    return _table(path, names, px, stamps)


def from_text(path: Path, text: str) -> PointTable:
    """Read trajectories in text for Gnuplot.

    Args:
        path: The file, for messages.
        text: Its text.

    Returns:
        The table.

    Raises:
        VideoError: there is no trajectory.
    """
    blocks: list[tuple[str, list[list[str]]]] = []
    open_block = False
    for line in text.splitlines()[1:]:
        cells = line.split()
        if not cells:
            open_block = False
        elif line.startswith("#"):
            name = line.lstrip("#").strip()
            if name.upper() != "T X Y":
                blocks.append((name, []))
                open_block = True
        else:
            if not open_block:
                blocks.append((f"track{len(blocks) + 1}", []))
                open_block = True
            blocks[-1][1].append(cells)
    blocks = [block for block in blocks if block[1]]
    if not blocks:
        raise VideoError(f"{path.name}: expected trajectories after the heading of Kinovea, got none.")
    stamps = sorted({row[0] for _, rows in blocks for row in rows}, key=lambda word: _seconds(path, word))
    where = {stamp: i for i, stamp in enumerate(stamps)}
    px = np.full((len(stamps), len(blocks), 2), np.nan)
    for k, (name, rows) in enumerate(blocks):
        for row in rows:
            for axis in range(2):
                cell = row[1 + axis] if len(row) > 1 + axis else ""
                px[where[row[0]], k, axis] = number(path, cell, f"trajectory '{name}' at {row[0]}")
    return _table(path, tuple(name for name, _ in blocks), px, stamps)


def _table(path: Path, names: tuple[str, ...], px: np.ndarray, stamps: list[str]) -> PointTable:
    """Return the table with its times in seconds."""
    times = np.array([_seconds(path, word) for word in stamps])
    order = np.argsort(times, kind="stable")
    times, px = times[order], px[order]
    coded = any(":" in word for word in stamps)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    frame, tick = None, CENTISECOND if coded else MILLISECOND
    likelihood = np.ones(px.shape[:2])
    # Kinovea writes times in the unit of its own clock: frames count by one, milliseconds by more
    if not coded and step >= 0.999:
        if np.allclose(np.diff(times), np.round(np.diff(times))) and step < 1.5:
            frame, times = times - times[0], None
        else:
            times, tick = times * MILLISECOND, MILLISECOND
    return PointTable(
        "Kinovea", names, px, likelihood, frame=frame, time=times, in_picture=False, upward=True, tick=tick
    )


def _seconds(path: Path, word: str) -> float:
    """Return a time code h:mm:ss:cc, or a number."""
    if ":" not in word:
        return number(path, word, "a time")
    parts = [number(path, part, f"time '{word}'") for part in word.split(":")]
    if len(parts) == 4:
        return 3600.0 * parts[0] + 60.0 * parts[1] + parts[2] + CENTISECOND * parts[3]
    return float(sum(part * 60.0**i for i, part in enumerate(reversed(parts))))
