"""``diagnosis.png``: what a run saw of its clip on one page, so that a refusal can be understood.

Background, what moves, the outline over the edges, the foreground of some frames, and the clip along its
time. What was not found is said where it would be.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from monodyn.results.folder import RunFolder
from monodyn.results.panels import background_panel, foreground_panels, motion_panel, outline_panels
from monodyn.results.pointed import points_panels
from monodyn.results.sheet import (
    BODY,
    GREEN,
    INK,
    MARGIN,
    ORANGE,
    RED,
    SKY,
    SOFT,
    WIDTH,
    Picture,
    blank,
    row,
    wrapped,
    write,
)
from monodyn.results.sight import Sight
from monodyn.results.strip import strip

HEADING = 0.9
"""Size of the heading's text."""
COLOURS = {"trusted": GREEN, "approximate": ORANGE, "refused": RED}
"""Of the bar beside the status, by grade."""
PACKED = 1
"""Compression of the picture, 0 to 9: more takes longer than it saves."""


def diagnosis(sight: Sight) -> Picture:
    """Draw what a run saw of its clip.

    Args:
        sight: What the run saw; its clip is readable.

    Returns:
        The page.
    """
    if sight.tracks is not None:
        rows = [_heading(sight), row(points_panels(sight)), strip(sight)]
        if sight.masks is not None:
            rows.insert(1, row([background_panel(sight), motion_panel(sight)]))
    else:
        rows = [
            _heading(sight),
            row([background_panel(sight), motion_panel(sight)]),
            row(outline_panels(sight)),
            row(foreground_panels(sight)),
            strip(sight),
        ]
    gap = blank(18)
    return np.concatenate([part for shown in rows for part in (shown, gap)])


def write_diagnosis(folder: RunFolder, sight: Sight) -> Picture | None:
    """Write ``diagnosis.png``.

    Args:
        folder: Where to.
        sight: What the run saw.

    Returns:
        The page; None where the clip has no picture that could be shown.
    """
    if not sight.readable:
        return None
    page = diagnosis(sight)

    def file(path: Path) -> None:
        path.write_bytes(png(page))

    folder.write("diagnosis.png", file)
    return page


def png(page: Picture) -> bytes:
    """Return a page as a PNG file.

    Args:
        page: From ``diagnosis``.
    """
    import cv2

    # of the filters, which are chosen anew for each row otherwise, one does for a page
    how = [cv2.IMWRITE_PNG_COMPRESSION, PACKED, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB]
    return cv2.imencode(".png", page, how)[1].tobytes()


def jpeg(page: Picture, quality: int = 85) -> bytes:
    """Return a page as a JPEG file, a quarter of the size, for a report.

    Args:
        page: From ``diagnosis``.
        quality: 0 to 100.
    """
    import cv2

    return cv2.imencode(".jpg", page, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def _heading(sight: Sight) -> Picture:
    """Write clip and verdict."""
    video = sight.video
    lines = wrapped(sight.status, WIDTH - 2 * MARGIN - 30, BODY)
    page = blank(76 + 22 * len(lines))
    x = write(page, sight.name, (MARGIN, 42), HEADING, INK)
    about = (
        f"{video.count} frames of {video.width} x {video.height} px, "
        f"{float(video.times[-1] - video.times[0]):.2f} s"
    )
    write(page, about, (x + 20, 42), BODY, SOFT)
    colour = SKY if sight.grade is None else COLOURS[sight.grade]
    if sight.status:
        page[58 : 64 + 22 * len(lines), MARGIN : MARGIN + 6] = colour
    for i, line in enumerate(lines):
        write(page, line, (MARGIN + 20, 74 + 22 * i), BODY, INK)
    return page
