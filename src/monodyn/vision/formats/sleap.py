"""Analysis files of SLEAP: HDF5 with ``tracks`` (track, xy, node, frame), ``node_names`` and
``point_scores``.

Newer files name the axes of each array, which may be in another order, in an attribute ``dims``. Scores are
peaks of confidence maps, which may exceed 1 by a little: up to ``HIGHEST_SCORE`` they count as 1.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from monodyn.errors import VideoError
from monodyn.vision.formats.table import PointTable

AXES = ("track", "xy", "node", "frame")
"""Axes of the places; scores lack the second."""

HIGHEST_SCORE = 1.1
"""Most that the peak of a confidence map, which is fitted to peaks of 1, comes to."""


def from_hdf5(path: Path, file: Any) -> PointTable:
    """Read an analysis file.

    Args:
        path: The file, for messages.
        file: The opened file.

    Returns:
        The table; tracks that never show in the same frame are one. A score above 1, up to
        ``HIGHEST_SCORE``, is 1; one above that stays as it is.

    Raises:
        VideoError: the arrays have other shapes than those of SLEAP.
    """
    nodes = [_word(name) for name in file["node_names"][:]]
    tracks = _array(path, file["tracks"], AXES)
    shape = tracks.shape
    scored = "point_scores" in file
    scores = _array(path, file["point_scores"], (AXES[0], *AXES[2:])) if scored else None
    if tracks.ndim == 4 and shape[1:3] != (2, len(nodes)):
        # as it is in Python, before SLEAP turns it round for Matlab: (frame, node, 2, track)
        tracks = np.transpose(tracks)
        scores = None if scores is None else np.transpose(scores)
    if tracks.ndim != 4 or tracks.shape[1:3] != (2, len(nodes)):
        raise VideoError(
            f"{path.name}: expected 'tracks' as (track, 2, {len(nodes)}, frame), got {shape}; export the "
            "analysis HDF5 of SLEAP."
        )
    each = (len(tracks), len(nodes), tracks.shape[3])
    if scores is not None and scores.shape != each:
        raise VideoError(
            f"{path.name}: expected 'point_scores' as (track, node, frame), {each}, got {scores.shape}; "
            "export the analysis HDF5 of SLEAP."
        )
    scores = np.ones(each) if scores is None else scores
    # labels made by hand have no score
    scores = np.where(np.isfinite(scores), scores, 1.0)
    scores = np.where(scores <= HIGHEST_SCORE, np.minimum(scores, 1.0), scores)
    shown = np.isfinite(tracks).any(axis=(1, 2))
    if np.all(shown.sum(axis=0) <= 1):
        # a tracker that loses the animal begins another track: they are one
        which = np.argmax(shown, axis=0)
        frames = np.arange(tracks.shape[3])
        px = tracks[which, :, :, frames].transpose(0, 2, 1)
        return PointTable("SLEAP", tuple(nodes), px, scores[which, :, frames], frame=frames)
    names = [_word(name) for name in file["track_names"][:]] if "track_names" in file else []
    names = names if len(names) == len(tracks) else [f"track{i}" for i in range(len(tracks))]
    px = tracks.transpose(3, 0, 2, 1).reshape(tracks.shape[3], -1, 2)
    return PointTable(
        "SLEAP", tuple(f"{name}.{node}" for name in names for node in nodes), px,
        scores.transpose(2, 0, 1).reshape(tracks.shape[3], -1), frame=np.arange(tracks.shape[3]),
    )  # fmt: skip


def _array(path: Path, data: Any, axes: tuple[str, ...]) -> np.ndarray:
    """Return an array with its axes in the order of Matlab, where it names them."""
    if data.dtype.kind not in "iuf":
        raise VideoError(f"{path.name}: expected numbers in '{data.name}', got {data.dtype}.")
    array = np.array(data[:], dtype=float)
    named = json.loads(data.attrs["dims"]) if "dims" in data.attrs else []
    return array.transpose([named.index(axis) for axis in axes]) if named else array


def _word(value: Any) -> str:
    return value.decode("utf-8") if isinstance(value, bytes) else str(value)
