"""``diagnosis.png``: what a run saw of its clip on one page, so that a refusal can be understood.

Background, what moves, the outline over the edges, the foreground of some frames, and the clip along its
time. What was not found is said where it would be.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from monodyn.results import sheet
from monodyn.results.folder import RunFolder
from monodyn.results.panels import background_panel, foreground_panels, motion_panel, outline_panels
from monodyn.results.pointed import points_panels
from monodyn.results.sight import Sight
from monodyn.results.strip import strip

HEADING = 0.9
"""Size of the heading's text."""
COLOURS = {"trusted": sheet.GREEN, "approximate": sheet.ORANGE, "refused": sheet.RED}
"""Of the bar beside the status, by grade."""
PACKED = 1
"""Compression of the picture, 0 to 9: more takes longer than it saves."""


def diagnosis(sight: Sight) -> sheet.Picture:
    """Draw what a run saw of its clip.

    Args:
        sight: What the run saw; its clip is readable.

    Returns:
        The page.
    """
    if sight.tracks is not None:
        rows = [_heading(sight), sheet.row(points_panels(sight)), strip(sight)]
        if sight.masks is not None:
            rows.insert(1, sheet.row([background_panel(sight), motion_panel(sight)]))
    else:
        rows = [
            _heading(sight),
            sheet.row([background_panel(sight), motion_panel(sight)]),
            sheet.row(outline_panels(sight)),
            sheet.row(foreground_panels(sight)),
            strip(sight),
        ]
    gap = sheet.blank(18)
    return np.concatenate([part for shown in rows for part in (shown, gap)])


def write_diagnosis(folder: RunFolder, sight: Sight) -> sheet.Picture | None:
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


def png(page: sheet.Picture) -> bytes:
    """Return a page as a PNG file.

    Args:
        page: From ``diagnosis``.
    """
    import cv2

    # of the filters, which are chosen anew for each row otherwise, one does for a page
    how = [cv2.IMWRITE_PNG_COMPRESSION, PACKED, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB]
    return cv2.imencode(".png", page, how)[1].tobytes()


def jpeg(page: sheet.Picture, quality: int = 85) -> bytes:
    """Return a page as a JPEG file, a quarter of the size, for a report.

    Args:
        page: From ``diagnosis``.
        quality: 0 to 100.
    """
    import cv2

    return cv2.imencode(".jpg", page, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def _heading(sight: Sight) -> sheet.Picture:
    """Write clip and verdict."""
    video = sight.video
    lines = sheet.wrapped(sight.status, sheet.WIDTH - 2 * sheet.MARGIN - 30, sheet.BODY)
    page = sheet.blank(76 + 22 * len(lines))
    x = sheet.write(page, sight.name, (sheet.MARGIN, 42), HEADING, sheet.INK)
    about = (
        f"{video.count} frames of {video.width} x {video.height} px, "
        f"{float(video.times[-1] - video.times[0]):.2f} s"
    )
    sheet.write(page, about, (x + 20, 42), sheet.BODY, sheet.SOFT)
    colour = sheet.SKY if sight.grade is None else COLOURS[sight.grade]
    if sight.status:
        page[58 : 64 + 22 * len(lines), sheet.MARGIN : sheet.MARGIN + 6] = colour
    for i, line in enumerate(lines):
        sheet.write(page, line, (sheet.MARGIN + 20, 74 + 22 * i), sheet.BODY, sheet.INK)
    return page
