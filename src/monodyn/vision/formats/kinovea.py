"""What Kinovea exports: trajectories as text for Gnuplot, or all of them as one table of CSV.

The text begins with ``#Kinovea Trajectory data export``; each trajectory follows after its name, or after a
blank line in older versions. The CSV has ``Time`` and, for each point, ``NAME/KEY/X`` and ``NAME/KEY/Y``. The
second axis of Kinovea's coordinate system goes up.

Times are in the unit that the user chose for the display, and nothing says which. Codes ``h:mm:ss:cc`` end in
hundredths of a second, or above 100 frames a second in thousandths, ``h:mm:ss:fff``; hours, minutes and
seconds may be left out from the left. Numbers are frames, s or ms where their step can be nothing else at 10
to 1000 Hz; others are left without a unit.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from monodyn.arrays import usual_step
from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable, check_width, number, rows_of, separator_of

HEAD = "#kinovea"
"""How the text begins."""
FRACTIONS = {2: 0.01, 3: 0.001}
"""Unit of the last part of a time code by its digits [s]."""
MILLISECOND = 1e-3
"""Unit to which numeric times are rounded [s]."""
OF_SECONDS = (0.999e-3, 0.1001)
"""Steps of 10 to 1000 Hz in s; longer ones may be ms, and shorter ones are lost in rounding."""
OF_MILLISECONDS = (0.999, 100.1)
"""Steps of 10 to 1000 Hz in ms; shorter ones may be s, and longer ones microseconds."""
OF_FRAMES = (0.999, 1.5)
"""Usual step of whole numbers that are frames."""
CODE = r"-?(\d+:)*\d+([.,]\d+)?"
"""A time code; newer ones have a point before the fraction of a second."""
WITH_SECONDS = r"-?(\d+|0\d:\d+|\d+:\d\d:.*)"
"""Codes that only hours, minutes and seconds give: these are padded, and left out where they are 0."""
WITHOUT_SECONDS = r"-?(\d|[6-9]\d|\d{3,}):\d\d"
"""Codes that they do not give: hundredths of a minute, or ten-thousandths of an hour, and hundredths of
these."""
MOST_DIGITS = 1000.0
"""Times below which seven digits, as Kinovea writes, show thousandths."""
ROUNDED = 0.01
"""How far times that are rounded to ms are from whole ones at most [ms]."""


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
    return _table(path, names, px, stamps, 0)


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
    named = False
    for line in text.splitlines()[1:]:
        # what is before the origin of time has a sign and a blank
        cells = re.sub(r"^\s*-\s+", "-", line).split()
        if not cells:
            open_block = False
        elif line.startswith("#"):
            name = line.lstrip("#").strip()
            if name.upper() != "T X Y":
                blocks.append((name, []))
                open_block = named = True
        else:
            if not open_block:
                blocks.append((f"track{len(blocks) + 1}", []))
                open_block = True
            blocks[-1][1].append(cells)
    blocks = [block for block in blocks if block[1]]
    if not blocks:
        raise VideoError(f"{path.name}: expected trajectories after the heading of Kinovea, got none.")
    stamps = list(dict.fromkeys(row[0] for _, rows in blocks for row in rows))
    where = {stamp: i for i, stamp in enumerate(stamps)}
    px = np.full((len(stamps), len(blocks), 2), np.nan)
    for k, (name, rows) in enumerate(blocks):
        for row in rows:
            for axis in range(2):
                cell = row[1 + axis] if len(row) > 1 + axis else ""
                px[where[row[0]], k, axis] = number(path, cell, f"trajectory '{name}' at {row[0]}")
    return _table(path, tuple(name for name, _ in blocks), px, stamps, 0 if named else 1)


def _table(path: Path, names: tuple[str, ...], px: np.ndarray, stamps: list[str], base: int) -> PointTable:
    """Return the table by its times, or by its frames where the version of Kinovea counts them from
    ``base``."""
    words = [word.replace("- ", "-") for word in stamps]
    coded = any(":" in word or re.fullmatch(r"-?0\d+", word) for word in words)
    if coded:
        times, tick = _decoded(path, words)
    else:
        times, tick = np.array([number(path, word, "a time") for word in words]), MILLISECOND
    order = np.argsort(times, kind="stable")
    times, px = times[order], px[order]
    kind, doubt = ("s", _doubtful(words)) if coded else _kind(words, times)
    frame, notes = None, ()
    if kind == "frames":
        base = base if times[0] >= 1.0 else 0
        notes = (_counted(base, times[0]),) if times[0] > 0.0 else ()
        frame, times = times - base, None
    elif kind == "ms":
        times = times * MILLISECOND
    return PointTable(
        "Kinovea", names, px, np.ones(px.shape[:2]), frame=frame, time=times, in_picture=False, upward=True,
        tick=tick, doubt=doubt, notes=notes,
    )  # fmt: skip


def _decoded(path: Path, words: list[str]) -> tuple[np.ndarray, float]:
    """Return the times of codes [s], and the unit of their last digit [s]."""
    last = [word.split(":")[-1].lstrip("-") for word in words if word]
    decimals = [len(re.split("[.,]", cell)[1]) for cell in last if re.search("[.,]", cell)]
    fractions = [cell for cell in last if not re.search("[.,]", cell)]
    digits = min(map(len, fractions), default=2)
    odd = [word for word in words if word and not re.fullmatch(CODE, word)]
    # 0.995 s and more come as 100 hundredths
    odd += [cell for cell in fractions if len(cell) != digits and (digits, cell) != (2, "100")]
    odd += fractions if digits not in FRACTIONS else []
    if odd:
        raise VideoError(
            f"{path.name}: expected times as h:mm:ss:cc or h:mm:ss:fff, hundredths or thousandths of a "
            f"second, got '{odd[0]}'; export them again, or as CSV."
        )
    unit = FRACTIONS[digits]
    times = np.array([_seconds(word, unit) if word else np.nan for word in words])
    return times, unit if fractions else 10.0 ** -max(decimals, default=2)


def _seconds(word: str, unit: float) -> float:
    """Return the time of a code [s], whose last part counts ``unit`` [s] unless it has a decimal sign."""
    parts = [float(part.replace(",", ".")) for part in word.lstrip("-").split(":")]
    fraction = 0.0 if re.search("[.,]", word) else unit * parts.pop()
    time = fraction + sum(part * 60.0**power for power, part in enumerate(reversed(parts)))
    return -time if word.startswith("-") else time


def _doubtful(words: list[str]) -> str:
    """Return what codes look like that may count other things than seconds; empty where they do not."""
    pairs = [word for word in words if re.fullmatch(r"-?\d+:\d\d", word)]
    clear = any(re.fullmatch(WITH_SECONDS, word) for word in words)
    other = any(re.fullmatch(WITHOUT_SECONDS, word) for word in pairs)
    if pairs and (other or not clear):
        return f"codes such as '{pairs[0]}', which may count hundredths of a minute"
    return ""


def _kind(words: list[str], times: np.ndarray) -> tuple[str, str]:
    """Return what numbers in order are (frames, s or ms), or nothing, and what they look like."""
    if len(times) < 2:
        return "", "a single number"
    step = usual_step(times)
    if OF_FRAMES[0] <= step < OF_FRAMES[1] and np.array_equal(times, np.round(times)):
        return "frames", ""
    if OF_MILLISECONDS[0] <= step <= OF_MILLISECONDS[1]:
        if all(re.fullmatch(r"-?\d\d", word) for word in words):
            return "", "numbers of two digits, which may be hundredths of a second"
        return "ms", ""
    if OF_SECONDS[0] <= step <= OF_SECONDS[1]:
        # seconds are rounded to ms, minutes and hours are not; later numbers have no digits to show it
        small = times[np.abs(times) < MOST_DIGITS] / MILLISECOND
        if len(small) and np.abs(small - np.round(small)).max() < ROUNDED:
            return "s", ""
        return "", f"steps of {step:.4g} that are no whole milliseconds"
    return "", f"steps of {step:.6g}"


def _counted(base: int, first: float) -> str:
    """Return the note on what frame numbers are counted from."""
    which = "older versions, which give trajectories no name, do" if base else "present versions do"
    return (
        f"The frame numbers of Kinovea, which begin with {first:g}, are taken to be counted from {base}, as "
        f"its {which}; correct them in the table where the points are a frame off."
    )
