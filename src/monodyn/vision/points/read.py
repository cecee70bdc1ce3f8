"""A file of tracked points in, points by frame and time out, whatever tool wrote it."""

from __future__ import annotations

import csv
import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from monodyn.arrays import check_unbroken, usual_step
from monodyn.choices import check_choice, check_endless
from monodyn.errors import VideoError
from monodyn.names import meant, near_files
from monodyn.vision.clip.video import Video, check_rate
from monodyn.vision.formats import deeplabcut, kinovea, plain, sleap, tracker
from monodyn.vision.formats.table import PointTable, rows_of, text_of
from monodyn.vision.points.tracks import PointTracks
from monodyn.vision.settings import MOST_SIDE, Axis

SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""How an HDF5 file begins."""
LONGER_SIDE = 640
"""Longer side of the picture that lengths of a scene are brought into [px]."""
MARGIN = 0.1
"""Room around them there, as a share of their extent; and around a picture, of its sides."""
MOST_BEYOND = 0.1
"""Share of the places that may lie outside of the picture, by more than the margin."""
EXTREME = 0.5
"""Percentile of the coordinates, from either end, within which the picture of a table is taken to lie."""
MOST_BYTES = 2e9
"""Largest array of a file."""
MOST_FRAMES = 1_000_000
"""Most frames of a table: what is told frame by frame has room for as many."""
TOOLS = (
    "DeepLabCut (CSV, HDF5), SLEAP analysis HDF5, Tracker or Kinovea text, or frame,NAME_x,NAME_y[,NAME_p]"
)
"""What can be read, in words."""


def read_points(
    path: str | Path,
    *,
    rate: float | None = None,
    clip: Video | None = None,
    size: tuple[int, int] | None = None,
    axis: Axis = "auto",
) -> PointTracks:
    """Read points that another tool tracked.

    DeepLabCut (CSV or HDF5, also of several individuals), SLEAP's analysis HDF5, text exports of Tracker and
    Kinovea, and a plain table ``frame,NAME_x,NAME_y[,NAME_p]`` are told apart by their content.

    Args:
        path: The file.
        rate: Frames a second [Hz]; None takes the times of the table, or those of the clip.
        clip: The clip that was tracked: its time stamps and its size.
        size: Width and height of the picture [px]; None takes the clip's, or what the points span.
        axis: Where the second coordinate goes; ``auto`` as the tool has it: down in pixels, up in the
            coordinate systems of Tracker and Kinovea.

    Returns:
        The points by frame.

    Raises:
        VideoError: The file cannot be read, is no such table, has no places, no times or times in a unit
            that nothing shows, a frame twice, frames that the clip does not have, or likelihoods that are
            none.

    Example:
        >>> monodyn.read_points("pendulumDLC.csv", rate=30)  # doctest: +SKIP
    """
    path = Path(path)
    check_choice("points.axis", axis, get_args(Axis))
    check_rate(rate)
    table = _table(path)
    if not np.isfinite(table.px).all(axis=2).any():
        raise VideoError(f"{path.name}: expected places of points, got none in {len(table.px)} rows.")
    _check_names(path, table)
    table = _sorted(path, table)
    frame, time, tick = _clock(path, table, rate, clip)
    if clip is None:
        check_unbroken(path.name, time)
    upward = table.upward if axis == "auto" else axis == "up"
    px, (width, height), notes = _in_picture(path, table, size, clip, upward=upward)
    return PointTracks(
        path, table.names, frame, time, px, table.likelihood, width, height,
        in_picture=table.in_picture, tick=tick, notes=(*table.notes, *notes),
    )  # fmt: skip


def _table(path: Path) -> PointTable:
    """Return the table of a file, whatever tool wrote it."""
    check_endless(path, VideoError)
    try:
        with path.open("rb") as file:
            hdf5 = file.read(len(SIGNATURE)) == SIGNATURE
        text = "" if hdf5 else text_of(path)
    except OSError as error:
        asked = [] if path.exists() else near_files(path)
        end = meant(asked) or "name a table of points."
        raise VideoError(f"{path}: cannot be read ({error.strerror}); {end}") from None
    try:
        return _from_hdf5(path) if hdf5 else _from_text(path, text)
    except (csv.Error, OSError, AttributeError, LookupError, TypeError, ValueError, RuntimeError) as error:
        # a damaged file, or one that keeps something else under the names that are looked for
        reason = " ".join(str(error).split())
        raise VideoError(
            f"{path.name}: cannot be read as a table of points ({reason}); export it again, or as CSV."
        ) from None


def _from_hdf5(path: Path) -> PointTable:
    try:
        h5py: Any = importlib.import_module("h5py")
    except ImportError:
        raise VideoError(
            f"{path.name}: reading HDF5 needs the package h5py, which is not installed; "
            "pip install 'monodyn[hdf5]', or give the points as CSV."
        ) from None
    with h5py.File(path, "r") as file:
        _check_arrays(path, file, h5py)
        if "tracks" in file and "node_names" in file:
            return sleap.from_hdf5(path, file)
        return deeplabcut.from_hdf5(path, file)


def _check_arrays(path: Path, file: Any, h5py: Any) -> None:
    """Refuse HDF5 that takes its numbers from other files, or announces more of them than any table has."""

    def check(name: str, found: Any) -> None:
        if isinstance(found, h5py.Group):
            elsewhere = any(isinstance(found.get(n, getlink=True), h5py.ExternalLink) for n in found)
        else:
            elsewhere = bool(found.external) or found.is_virtual
            if found.nbytes > MOST_BYTES:
                raise VideoError(
                    f"{path.name}: expected arrays of up to {MOST_BYTES / 1e9:g} GB, got '{name}' of "
                    f"{found.nbytes / 1e9:.3g} GB; export the points of one clip alone."
                )
        if elsewhere:
            raise VideoError(
                f"{path.name}: expected all numbers in the file itself, got '{name}', which takes them from "
                "another one; export the points anew."
            )

    check("/", file)
    file.visititems(check)


def _from_text(path: Path, text: str) -> PointTable:
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise VideoError(f"{path.name}: expected a table of points, got an empty file.")
    if lines[0].casefold().startswith(kinovea.HEAD):
        return kinovea.from_text(path, text)
    if lines[0].split(",")[0].strip().casefold() in deeplabcut.LEVELS:
        return deeplabcut.from_csv(path, text)
    rows = rows_of("\n".join(lines[:6]))
    commas = rows_of(lines[0], ",")[0]
    if kinovea.is_csv(commas) or kinovea.is_csv(rows[0]):
        return kinovea.from_csv(path, text)
    if plain.is_plain(rows[0]):
        return plain.from_csv(path, text)
    if lines[0].strip().casefold().startswith("#multi") or tracker.heading(rows) is not None:
        return tracker.from_text(path, text)
    raise VideoError(
        f"{path.name}: expected points of {TOOLS}, got a file that begins with '{lines[0][:60]}'."
    )


def _check_names(path: Path, table: PointTable) -> None:
    """Refuse two points of one name, and likelihoods that are none."""
    twice = sorted({name for name in table.names if table.names.count(name) > 1})
    if twice:
        raise VideoError(
            f"{path.name}: expected each point once, got '{twice[0]}' {table.names.count(twice[0])} times; "
            "rename one of them."
        )
    low, high = float(table.likelihood.min(initial=0.0)), float(table.likelihood.max(initial=0.0))
    if low < 0.0 or high > 1.0:
        raise VideoError(
            f"{path.name}: expected likelihoods from 0 to 1, got {low if low < 0.0 else high:g}; scale them, "
            "and leave the places of points that were not found empty."
        )


def _sorted(path: Path, table: PointTable) -> PointTable:
    """Return the table in the order of its frames."""
    clock, unit = (table.time, "time") if table.frame is None else (table.frame, "frame")
    if clock is None:
        return table
    odd = np.flatnonzero(~np.isfinite(clock))
    if len(odd):
        raise VideoError(
            f"{path.name}: expected a {unit} in every row, got {clock[odd[0]]:g} in row {odd[0] + 1} of the "
            "data; complete or remove that row."
        )
    order = np.argsort(clock, kind="stable")
    clock = clock[order]
    if np.any(np.diff(clock) <= 0):
        twice = clock[int(np.argmax(np.diff(clock) <= 0))]
        raise VideoError(
            f"{path.name}: expected each {unit} once, got {unit} {twice:g} twice; keep one of them."
        )
    return replace(
        table, px=table.px[order], likelihood=table.likelihood[order],
        frame=None if table.frame is None else table.frame[order],
        time=None if table.time is None else table.time[order],
    )  # fmt: skip


def _clock(
    path: Path, table: PointTable, rate: float | None, clip: Video | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return frame numbers, times [s] and the unit to which these are rounded [s]."""
    count, time = len(table.px), table.time
    frame = table.frame if table.frame is not None else _numbered(table, clip)
    if np.any(frame != np.round(frame)) or np.any(frame < 0):
        odd = frame[int(np.argmax((frame != np.round(frame)) | (frame < 0)))]
        raise VideoError(
            f"{path.name}: expected whole frame numbers from 0 on, got {odd:g}; count the frames of the clip."
        )
    if frame[-1] >= MOST_FRAMES:
        raise VideoError(
            f"{path.name}: expected frame numbers below {MOST_FRAMES}, got {frame[-1]:g}; correct the last "
            "row."
        )
    frame = frame.astype(np.int64)
    if clip is not None and frame[-1] >= clip.count:
        raise VideoError(
            f"{path.name}: expected frames of the clip, 0 to {clip.count - 1}, got {count} rows up to frame "
            f"{int(frame[-1])}; give the table of this clip."
        )
    if rate is not None:
        return frame, frame / rate, 0.0
    if clip is not None:
        return frame, clip.times[frame], clip.tick
    if table.doubt:
        raise VideoError(
            f"{path.name}: expected times in frames, milliseconds or seconds, got {table.doubt}; give --rate "
            "HZ, or the clip with --clip."
        )
    if time is not None:
        return frame, *_even(frame, time, table.tick)
    raise VideoError(
        f"{path.name}: expected time stamps, but a table of {table.tool} has none; give --rate HZ, or the "
        "clip with --clip."
    )


def _numbered(table: PointTable, clip: Video | None) -> np.ndarray:
    """Return frame numbers of rows that have none: those of the clip's stamps, or by the usual step."""
    count, time = len(table.px), table.time
    if time is None or count < 2:
        return np.arange(count)
    if clip is not None and clip.count > 1 and not table.doubt:
        near = np.searchsorted(0.5 * (clip.times[1:] + clip.times[:-1]), time)
        most = 0.5 * usual_step(clip.times)
        if np.all(np.diff(near) > 0) and np.abs(clip.times[near] - time).max() < most:
            return near
    steps = np.diff(time)
    # each step is counted by itself: rounded stamps do not add up to a frame too many
    missing = np.maximum(np.round(steps / float(np.median(steps))), 1.0)
    number = np.concatenate([[0.0], np.cumsum(missing)])
    if clip is None or not table.doubt:
        return number
    # a step is a frame in any unit: so many of them are before the first row, too
    return number + np.round(time[0] * number[-1] / (time[-1] - time[0]))


def _even(frame: np.ndarray, time: np.ndarray, tick: float) -> tuple[np.ndarray, float]:
    """Return the times of a constant rate where it explains rounded ones, and what they are rounded to
    [s]."""
    if tick <= 0.0 or len(time) < 3:
        return time, tick
    line = np.polyfit(frame, time, 1)
    even = np.polyval(line, frame)
    # rounded at most by a whole unit: some tools cut off instead
    explained = bool(np.abs(even - time).max() <= tick)
    return (even + (time[0] - even[0]), 0.0) if explained else (time, tick)


def _in_picture(
    path: Path, table: PointTable, size: tuple[int, int] | None, clip: Video | None, *, upward: bool
) -> tuple[np.ndarray, tuple[int, int], list[str]]:
    """Return the points in pixels with the second coordinate down, the picture's size, and notes."""
    places = table.px[np.isfinite(table.px).all(axis=2) & (table.likelihood > 0.0)]
    places = places if len(places) else np.zeros((1, 2))
    low, high = (np.percentile(places, q, axis=0) for q in (EXTREME, 100.0 - EXTREME))
    if not table.in_picture:
        return _of_scene(table, low, high, upward=upward)
    notes = []
    if clip is not None:
        size = (clip.width, clip.height)
    if size is None:
        reach = np.minimum(np.maximum(high, 1.0), MOST_SIDE)
        size = (int(np.ceil(reach[0])) + 1, int(np.ceil(reach[1])) + 1)
        notes.append(
            f"The table does not say how large the picture is: {size[0]}x{size[1]} px assumed, as far as "
            "the points reach; give --points.size W,H, on which the assumed focal length depends."
        )
    room = MARGIN * np.array(size)
    beyond = float(np.mean(np.any((places < -room) | (places > size + room), axis=1)))
    if beyond > MOST_BEYOND:
        raise VideoError(
            f"{path.name}: expected pixels of a picture of {size[0]}x{size[1]}, got {beyond:.0%} of the "
            f"places outside of it, from {low[0]:.4g}, {low[1]:.4g} to {high[0]:.4g}, {high[1]:.4g}; give "
            "the clip that was tracked, or the size of its pictures with --points.size W,H."
        )
    px = table.px.copy()
    if upward:
        px[..., 1] = size[1] - 1 - px[..., 1]
    return px, size, notes


def _of_scene(
    table: PointTable, low: np.ndarray, high: np.ndarray, *, upward: bool
) -> tuple[np.ndarray, tuple[int, int], list[str]]:
    """Return lengths of a scene, which reach from ``low`` to ``high``, in a picture of their own, in which
    they have the size that pixels usually have."""
    extent = np.maximum(high - low, 1e-9)
    scale = LONGER_SIDE / ((1.0 + 2.0 * MARGIN) * float(extent.max()))
    px = (table.px - (low - MARGIN * extent.max())) * scale
    width, height = (int(np.ceil(n)) for n in (extent + 2.0 * MARGIN * extent.max()) * scale)
    if upward:
        px[..., 1] = height - 1 - px[..., 1]
    note = (
        f"The table of {table.tool} has lengths of a scene and no pixels: no overlay can be drawn, and its "
        "second axis is taken to go " + ("up" if upward else "down") + " (--points.axis chooses)."
    )
    return px, (width, height), [note]
