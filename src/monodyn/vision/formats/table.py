"""What every reader returns, and the text of a table as cells and numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monodyn.errors import VideoError

SEPARATORS = (";", "\t", ",")
"""What may stand between cells; a comma may be the decimal sign where another one does."""

SHOWN = 40
"""Most characters of a cell that a message repeats."""


@dataclass(frozen=True, eq=False)
class PointTable:
    """A table of tracked points as its tool wrote it.

    Attributes:
        tool: Name of the tool.
        names: Names of the points.
        px: Coordinates, (frame, point, 2); NaN where not found.
        likelihood: 0 to 1, (frame, point).
        frame: Frame numbers, int (frame,), or None.
        time: Time stamps [s], (frame,), or None; in an unknown unit where there is a doubt.
        in_picture: False where the coordinates are no pixels of the picture.
        upward: True where the second coordinate goes up.
        tick: Unit to which the stamps are rounded [s]; 0 where they are exact.
        doubt: What the stamps look like where nothing says their unit; empty where they are in seconds.
        notes: What was assumed, whole sentences.
    """

    tool: str
    names: tuple[str, ...]
    px: np.ndarray
    likelihood: np.ndarray
    frame: np.ndarray | None = None
    time: np.ndarray | None = None
    in_picture: bool = True
    upward: bool = False
    tick: float = 0.0
    doubt: str = ""
    notes: tuple[str, ...] = ()


def text_of(path: Path) -> str:
    """Return the text of a file, its lines ended by line feeds.

    Args:
        path: The file.

    Raises:
        VideoError: it is no text.
    """
    data = path.read_bytes()
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    if b"\x00" in data and not wide:
        raise VideoError(
            f"{path.name}: expected a table of tracked points (CSV, text or HDF5), got other binary data."
        )
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        # older programs write the names of tracks in the code page of Western Europe
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def rows_of(text: str, separator: str | None = None) -> list[list[str]]:
    """Split a text into rows of cells.

    Args:
        text: The text.
        separator: What stands between cells; None finds it.

    Returns:
        The rows that are not empty, each cell without blanks around it.
    """
    separator = separator or separator_of(text)
    if separator == " ":
        rows = [line.split() for line in text.splitlines()]
    else:
        rows = list(csv.reader(io.StringIO(text), delimiter=separator))
    return [[cell.strip() for cell in row] for row in rows if any(cell.strip() for cell in row)]


def separator_of(text: str) -> str:
    """Find what stands between the cells of a text: what the most of its lines have.

    Args:
        text: The text.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    for separator in SEPARATORS:
        if sum(separator in line for line in lines) > len(lines) // 2:
            return separator
    return " "


def number(path: Path, cell: str, where: str) -> float:
    """Return a cell as a number; an empty one is NaN.

    Args:
        path: The file, for the message.
        cell: The cell; a comma may be its decimal sign.
        where: Row and column, for the message.

    Raises:
        VideoError: it is no number.
    """
    if not cell:
        return float("nan")
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        shown = " ".join(cell.split())[:SHOWN]
        raise VideoError(f"{path.name}: {where}: expected a number, got '{shown}'.") from None


def numbers(path: Path, rows: Sequence[Sequence[str]], first: int, width: int) -> np.ndarray:
    """Return rows of cells as numbers; what a row lacks at its end is NaN.

    Args:
        path: The file, for messages.
        rows: The rows.
        first: Number of the first of them in the file, for messages.
        width: Number of columns.

    Returns:
        The numbers, (row, column).

    Raises:
        VideoError: a row has more cells than there are columns.
    """
    table = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        check_width(path, row, first + i, width)
        for j, cell in enumerate(row[:width]):
            table[i, j] = number(path, cell, f"row {first + i}, column {j + 1}")
    return table


def check_width(path: Path, row: Sequence[str], place: int, width: int) -> None:
    """Refuse a row that has more cells than there are columns; empty ones at its end do not count.

    Args:
        path: The file, for the message.
        row: The cells.
        place: Number of the row in the file, for the message.
        width: Number of columns.

    Raises:
        VideoError: there are more.
    """
    if any(row[width:]):
        raise VideoError(
            f"{path.name}: row {place}: expected {width} cells, as the header has columns, got {len(row)}; "
            "name each column, and write numbers without a comma between their digits."
        )
