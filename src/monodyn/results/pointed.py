"""The panels of tracked points in the diagnosis: all of them, and a typical and the worst frame of them."""

from __future__ import annotations

import numpy as np

from monodyn.errors import VideoError
from monodyn.results import sheet
from monodyn.results.panels import TALLEST, picture_of
from monodyn.results.sight import Sight, outlines_of
from monodyn.vision.points.scene import PointScene
from monodyn.vision.points.tracks import PointTracks

COLOURS: tuple[sheet.Colour, ...] = (sheet.BLUE, sheet.ORANGE, sheet.GREEN, sheet.PURPLE, sheet.SKY)
"""Colours of the points."""
MOST_DRAWN = 1500
"""Places of one point that are drawn at most."""
MOST_KEYS = 10
"""Points that the legend names at most."""


def points_panels(sight: Sight) -> list[sheet.Picture]:
    """Return pictures of all tracked points, of a typical frame and of the worst.

    Args:
        sight: What the run saw; it has tracked points.
    """
    tracks, scene = sight.tracks, sight.points
    assert tracks is not None
    width = sheet.column_width(3)
    panels = [_paths_panel(sight, tracks, width)]
    if scene is None:
        picture = sheet.absent(f"{sight.stage}: no mark to compare the points with", width, 200)
        return [
            *panels,
            *(sheet.panel(title, picture, [], width) for title in ("Typical frame", "Worst frame")),
        ]
    off = _off(scene)
    order = np.argsort(off, kind="stable")
    order = order[np.isfinite(off[order])]
    if not len(order):
        order = np.zeros(1, dtype=np.int64)
    chosen = [("Typical frame", order[len(order) // 2]), ("Worst frame", order[-1])]
    return [*panels, *(_frame_panel(sight, scene, int(row), name) for name, row in chosen)]


def _off(scene: PointScene) -> np.ndarray:
    """Return the largest distance of a point from its mark in each frame [px], (frame,)."""
    away = np.linalg.norm(scene.found_px - scene.marked_px, axis=2)
    known = np.isfinite(away)
    return np.where(known.any(axis=1), np.where(known, away, 0.0).max(axis=1), np.nan)


def _paths_panel(sight: Sight, tracks: PointTracks, width: int) -> sheet.Picture:
    """Draw every place of every point."""
    crop = _whole(tracks, width)
    picture = _ground(sight, tracks, int(tracks.frame[0]), crop)
    keys = []
    for k, name in enumerate(tracks.names):
        colour = COLOURS[k % len(COLOURS)]
        rows = np.flatnonzero(tracks.found[:, k])
        places = np.round(crop.points(tracks.px[rows[:: max(1, len(rows) // MOST_DRAWN)], k])).astype(int)
        for x, y in places[((places >= 0) & (places < crop.size)).all(axis=1)]:
            picture[max(y - 1, 0) : y + 1, max(x - 1, 0) : x + 1] = colour
        keys.append(sheet.Key(f"{name} ({len(rows)} of {len(tracks)})", colour, "dot"))
    return sheet.panel("Tracked points", picture, keys[:MOST_KEYS], width)


def _frame_panel(sight: Sight, scene: PointScene, row: int, name: str) -> sheet.Picture:
    """Draw the points of a frame, their marks, and the outline through these."""
    tracks, width = scene.tracks, sheet.column_width(3)
    crop = _whole(tracks, width)
    number = int(tracks.frame[row])
    picture = sheet.washed(_ground(sight, tracks, number, crop), 0.35)
    position = scene.fitted.position[row, : len(scene.mechanism.joints)]
    for corners in outlines_of(scene.mechanism, scene.camera, position):
        shown = corners if scene.drift is None else scene.drift.at(row).added(corners[np.newaxis])[0]
        sheet.polygon(picture, crop.points(shown), sheet.INK)
    for k, (at, found) in enumerate(
        zip(crop.points(scene.marked_px[row]), crop.points(scene.found_px[row]), strict=True)
    ):
        lies = bool(scene.lying[row, k])
        if np.all(np.isfinite(at)):
            sheet.mark(picture, at, sheet.GREEN if lies else sheet.SOFT, "ring", 6)
        if np.all(np.isfinite(found)):
            sheet.mark(picture, found, sheet.GREEN if lies else sheet.RED, "dot" if lies else "cross", 4)
    keys = [
        sheet.Key("point on its mark", sheet.GREEN, "dot"),
        sheet.Key("point elsewhere", sheet.RED, "cross"),
        sheet.Key("where a mark is", sheet.SOFT, "ring"),
    ]
    return sheet.panel(f"{name}: frame {number}", picture, keys, width)


def _whole(tracks: PointTracks, width: int) -> sheet.Crop:
    return sheet.fitted_crop((0, 0, tracks.width, tracks.height), width, TALLEST)


def _ground(sight: Sight, tracks: PointTracks, number: int, crop: sheet.Crop) -> sheet.Picture:
    """Return the picture of a frame, or a blank one where there is none."""
    if sight.filmed:
        try:
            frame = next(iter(sight.video.frames(number, number + 1)), None)
        except VideoError:
            frame = None
        if frame is not None:
            return sheet.washed(crop.shown(picture_of(frame)))
    blank = np.full((tracks.height, tracks.width, 3), 255, np.uint8)
    return crop.shown(blank)
