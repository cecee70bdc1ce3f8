"""Tables of DeepLabCut: CSV with a header of several rows, or the same as a table of pandas in HDF5.

Header rows are ``scorer``, (``individuals``,) ``bodyparts`` and ``coords``; columns come as x, y and
likelihood.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable, numbers, rows_of

LEVELS = ("scorer", "individuals", "bodyparts", "coords")
"""Names of the header rows."""
COORDINATES = (["x", "y"], ["likelihood", "x", "y"])
"""Columns of a body part, by name."""


def from_csv(path: Path, text: str) -> PointTable:
    """Read a table in CSV.

    Args:
        path: The file, for messages.
        text: Its text.

    Returns:
        The table.

    Raises:
        VideoError: the header lacks a row or a cell, no row follows, a body part lacks a coordinate, or it
            is a table of labels for training.
    """
    rows = rows_of(text, ",")
    header = {row[0].casefold(): _filled(row)[1:] for row in rows[:4] if row[0].casefold() in LEVELS}
    if "bodyparts" not in header or "coords" not in header:
        raise VideoError(
            f"{path.name}: expected header rows 'scorer', 'bodyparts' and 'coords' of DeepLabCut, got "
            f"{', '.join(repr(row[0]) for row in rows[:4])}."
        )
    width = len(header["coords"])
    odd = next((name for name, cells in header.items() if len(cells) != width), None)
    if odd is not None:
        raise VideoError(
            f"{path.name}: header row '{odd}': expected {width} cells after its name, as the row 'coords' "
            f"has, got {len(header[odd])}; name each column."
        )
    first = len(header)
    if len(rows) == first:
        raise VideoError(f"{path.name}: expected rows of coordinates after the header, got none.")
    if rows[first][0].startswith("labeled-data"):
        raise VideoError(
            f"{path.name}: expected frame numbers in the first column, got '{rows[first][0]}': these are "
            "labels for training; give the table that DeepLabCut writes when it analyses a clip."
        )
    body = numbers(path, rows[first:], first + 1, 1 + width)
    who = header.get("individuals", [""] * width)
    columns = list(zip(who, header["bodyparts"], header["coords"], strict=True))
    return _table(path, columns, body[:, 1:], body[:, 0])


def from_hdf5(path: Path, file: Any) -> PointTable:
    """Read a table in HDF5, as pandas writes it.

    Args:
        path: The file, for messages.
        file: The opened file.

    Returns:
        The table.

    Raises:
        VideoError: there is no table of points, or a body part lacks a coordinate.
    """
    for group in file.values():
        kind = _word(group.attrs.get("pandas_type", b""))
        if kind == "frame_table":
            rows = group["table"][:]
            axes = _unpickled(path, group.attrs["non_index_axes"])
            columns = [tuple(map(str, column)) for column in axes[0][1]]
            return _whole(
                path, columns, np.array(rows["index"], dtype=float), np.array(rows["values_block_0"])
            )
        if kind == "frame":
            levels = int(group.attrs["axis0_nlevels"])
            names = [[_word(word) for word in group[f"axis0_level{i}"][:]] for i in range(levels)]
            codes = [group[f"axis0_label{i}"][:] for i in range(levels)]
            columns = [tuple(names[i][int(codes[i][k])] for i in range(levels)) for k in range(len(codes[0]))]
            index = group["axis1"][:] if "axis1" in group else np.arange(len(group["block0_values"]))
            return _whole(path, columns, np.array(index, dtype=float), np.array(group["block0_values"][:]))
    raise VideoError(
        f"{path.name}: expected tracked points of DeepLabCut or an analysis file of SLEAP, got HDF5 with "
        f"{', '.join(repr(name) for name in file) or 'nothing'}."
    )


def _whole(path: Path, columns: Sequence[tuple[str, ...]], index: np.ndarray, body: np.ndarray) -> PointTable:
    """Return the table of columns with all levels of the header."""
    if body.shape != (len(index), len(columns)):
        raise VideoError(
            f"{path.name}: expected {len(columns)} columns of one kind of number, got {body.shape[-1]} in "
            "the first block; give the CSV file that DeepLabCut writes next to it."
        )
    words = [list(column) for column in columns]
    short = [(c[1] if len(c) > 3 else "", c[-2], c[-1]) for c in words]
    return _table(path, short, body, index)


def _table(
    path: Path, columns: Sequence[tuple[str, str, str]], body: np.ndarray, index: np.ndarray
) -> PointTable:
    """Return the table of columns by individual, body part and coordinate."""
    parts = list(dict.fromkeys((who, part) for who, part, _ in columns))
    # one animal needs no name: a part of several is named after both
    alone = len({part for _, part in parts}) == len(parts)
    names = [part if alone else f"{who}.{part}" for who, part in parts]
    for pair, name in zip(parts, names, strict=True):
        own = [what.casefold() for *whose, what in columns if tuple(whose) == pair]
        if sorted(own) not in COORDINATES:
            raise VideoError(
                f"{path.name}: expected columns x, y and likelihood of body part '{name}', each once, got "
                f"{', '.join(own)}; give the table that DeepLabCut writes when it analyses a clip."
            )
    px = np.full((len(body), len(parts), 2), np.nan)
    likelihood = np.ones((len(body), len(parts)))
    for k, (who, part, what) in enumerate(columns):
        row = parts.index((who, part))
        what = what.casefold()
        if what in ("x", "y"):
            px[:, row, "xy".index(what)] = body[:, k]
        else:
            likelihood[:, row] = np.nan_to_num(body[:, k])
    if not np.isfinite(index).all():
        raise VideoError(f"{path.name}: expected frame numbers in the first column, got an empty cell.")
    return PointTable("DeepLabCut", tuple(names), px, likelihood, frame=index)


def _filled(row: list[str]) -> list[str]:
    """Return a row without empty cells at its end, which spreadsheets add."""
    return row[: max((i + 1 for i, cell in enumerate(row) if cell), default=0)]


def _word(value: Any) -> str:
    return value.decode("utf-8") if isinstance(value, bytes) else str(value)


class _PlainUnpickler(pickle.Unpickler):
    """Reads lists, tuples, words and numbers, and nothing that could run code."""

    def find_class(self, module: str, name: str) -> Any:
        raise pickle.UnpicklingError(f"{module}.{name}")


def _unpickled(path: Path, value: Any) -> Any:
    """Return the names of the columns, which PyTables keeps as a pickle."""
    try:
        return _PlainUnpickler(io.BytesIO(bytes(value))).load()
    except Exception as error:  # damaged bytes make the interpreter of a pickle fail in any way
        raise VideoError(
            f"{path.name}: expected the names of the columns as plain words, got something else ({error}); "
            "give the CSV file that DeepLabCut writes next to it."
        ) from None
