"""The panels of the diagnosis: background, what moves, the outline over the edges, the foreground.

Each takes what a run saw of its clip and returns a picture with title and legend; what was not found is said
in its place.
"""

from __future__ import annotations

import numpy as np

from monodyn.results import sheet
from monodyn.results.overlay import Drawing, draw
from monodyn.results.sight import REACH_PX, Judged, Sight, outlines_of
from monodyn.types import FULL, Frame
from monodyn.vision.drawing import contour
from monodyn.vision.drawing.probe import TRUSTED
from monodyn.vision.foreground.background import Background
from monodyn.vision.foreground.given import GivenMasks
from monodyn.vision.foreground.masks import planes_for

TALLEST = 470
"""Most height of a picture on the page [px]."""
MOVES = 16.0
"""Range of a pixel's grey level over the samples from which it is drawn as moving [grey levels]."""
LOOKED_AT = 24
"""Samples from which the range is taken."""
SHOWN_FRAMES = 4
"""Frames whose foreground is shown."""
SPACING_PX = 9.0
"""Distance of the outline samples that are drawn, on the page [px]."""
PLANES: tuple[sheet.Colour, ...] = (sheet.BLUE, sheet.ORANGE, sheet.GREEN, sheet.PURPLE)
"""Colours of a mask's planes."""
FATES: dict[int, tuple[str, sheet.Colour, str]] = {
    contour.ON_EDGE: ("on an edge of the foreground", sheet.GREEN, "dot"),
    contour.ELSEWHERE: ("edge is elsewhere", sheet.ORANGE, "triangle"),
    contour.NO_EDGE: ("no edge there", sheet.RED, "cross"),
    contour.NO_CONTRAST: ("background unknown or alike", sheet.PURPLE, "square"),
    contour.COVERED: ("behind another part", sheet.SOFT, "ring"),
    contour.OFF_PICTURE: ("leaves the picture", sheet.SOFT, "diamond"),
}
"""What became of an outline sample: in words, and how it is drawn."""


def picture_of(frame: Frame) -> sheet.Picture:
    """Return a frame in colour, uint8 (height, width, 3).

    Args:
        frame: The frame.
    """
    import cv2

    height, width = frame.luma.shape
    return cv2.cvtColor(draw(frame, Drawing([])), cv2.COLOR_YUV2BGR_I420)[:height, :width]


def background_panel(sight: Sight) -> sheet.Picture:
    """Return a picture of what each pixel shows without the mechanism, and where that is not known.

    Args:
        sight: What the run saw.
    """
    width = sheet.column_width(2)
    back = sight.background
    crop = _whole(sight, width)
    picture = crop.shown(picture_of(_as_frame(back)))
    unknown = ~back.known
    sheet.hatch(picture, crop.marked(unknown), sheet.RED)
    source = "a picture that was given" if back.given else f"median of {len(sight.samples.frames)} frames"
    masks = isinstance(sight.masks, GivenMasks)
    keys = [sheet.Key("masks have none" if masks else f"{source}; noise {back.noise:.1f} grey levels")]
    if unknown.any():
        keys.append(sheet.Key(f"never seen uncovered ({_percent(unknown.mean())})", sheet.RED, "hatch"))
    return sheet.panel("Background", picture, keys, width)


def motion_panel(sight: Sight) -> sheet.Picture:
    """Return a picture of where anything moves, what is left out, and where the mechanism would not show.

    Args:
        sight: What the run saw.
    """
    import cv2

    width = sheet.column_width(2)
    crop, back = _whole(sight, width), sight.background
    frames = sight.samples.frames
    lightest = darkest = frames[0].luma
    for frame in frames[:: max(1, len(frames) // LOOKED_AT)]:
        lightest, darkest = cv2.max(lightest, frame.luma), cv2.min(darkest, frame.luma)
    moves = cv2.subtract(lightest, darkest) > max(MOVES, 8.0 * back.noise)
    picture = sheet.washed(crop.shown(picture_of(_as_frame(back))), 0.6)
    sheet.blended(picture, 0.55 * crop.marked(moves), sheet.SKY)
    keys = [sheet.Key(f"changes during the clip ({_percent(moves.mean())})", sheet.SKY)]
    outside = ~back.counts
    if outside.any():
        sheet.hatch(picture, crop.marked(outside), sheet.PALE, rising=False)
        keys.append(sheet.Key("left out", sheet.SOFT, "hatch"))
        corners = np.array([[back.window.left, back.window.top], [back.window.right, back.window.bottom]])
        (x0, y0), (x1, y1) = np.round(crop.points(corners - 0.5)).astype(int)
        cv2.rectangle(picture, (x0, y0), (x1, y1), sheet.INK, 1)
    if sight.shown_masks is not None:
        view = sight.shown_masks.view(_geoms(sight))
        alike = (view.trust.max(axis=0) < TRUSTED) & back.known & ~outside
        if alike.any():
            sheet.hatch(picture, crop.marked(alike), sheet.PURPLE)
            keys.append(
                sheet.Key(f"looks like the mechanism ({_percent(alike.mean())})", sheet.PURPLE, "hatch")
            )
    if sight.hidden is not None:
        sheet.hatch(picture, crop.marked(sight.hidden), sheet.RED, rising=False)
        keys.append(sheet.Key("something stands before the mechanism", sheet.RED, "hatch"))
    return sheet.panel("What moves, and where it would show", picture, keys, width)


def outline_panels(sight: Sight) -> list[sheet.Picture]:
    """Return pictures of the outline over a typical frame and the worst, and what became of each sample.

    Args:
        sight: What the run saw.
    """
    width = sheet.column_width(2)
    if not sight.judged:
        picture = sheet.absent(f"{sight.stage}: there is no outline to compare with the edges", width, 200)
        return [sheet.panel(title, picture, [], width) for title in ("Typical outline", "Worst outline")]
    order = sorted(sight.judged, key=lambda judged: judged.score)
    chosen = [("Typical outline", order[len(order) // 2]), ("Worst outline", order[0])]
    return [_outline_panel(sight, name, judged, width) for name, judged in chosen]


def _outline_panel(sight: Sight, name: str, judged: Judged, width: int) -> sheet.Picture:
    scene = sight.scene
    assert scene is not None
    outlines = outlines_of(scene.mechanism, scene.camera, judged.position)
    crop = sheet.fitted_crop(_around(sight, outlines), width, TALLEST)
    picture = sheet.washed(crop.shown(picture_of(sight.followed(judged.frame)), sheet.PALE), 0.35)
    for corners in outlines:
        sheet.polygon(picture, crop.points(corners), sheet.INK)
    rig = scene.moving(judged.frame.index)
    mask, view = scene.masks.of(judged.frame), scene.masks.view(len(rig.radius))
    found = contour.contour(
        planes_for(mask, view), view, rig, judged.position, REACH_PX, max(1.0, SPACING_PX / crop.scale)
    )
    places, edges = crop.points(found.place), crop.points(found.edge)
    keys = []
    for fate, (text, colour, shape) in FATES.items():
        these = np.flatnonzero(found.fate == fate)
        for i in these:
            sheet.mark(
                picture,
                edges[i] if fate == contour.ELSEWHERE else places[i],
                colour,
                shape,
                3 if fate == contour.OFF_PICTURE else 4,
            )
        if len(these):
            keys.append(sheet.Key(f"{text} ({_percent(len(these) / len(found.fate))})", colour, shape))
    how = "tracked" if judged.tracked else "located, not tracked"
    title = f"{name}: frame {judged.frame.index}, {how}"
    return sheet.panel(title, picture, keys or [sheet.Key("the outline is not in the picture")], width)


def foreground_panels(sight: Sight) -> list[sheet.Picture]:
    """Return pictures of the foreground of frames spread over the motion, each plane in its colour.

    Args:
        sight: What the run saw.
    """
    width = sheet.column_width(SHOWN_FRAMES)
    frames = sight.samples.frames
    picks = [round((k + 0.5) / SHOWN_FRAMES * (len(frames) - 1)) for k in range(SHOWN_FRAMES)]
    return [_foreground_panel(sight, frames[i], width) for i in picks]


def _foreground_panel(sight: Sight, frame: Frame, width: int) -> sheet.Picture:
    crop = _whole(sight, width)
    title = f"Foreground of frame {frame.index}"
    masks = sight.shown_masks
    if masks is None:
        picture = crop.shown(picture_of(frame))
        return sheet.panel(
            f"Frame {frame.index}", picture, [sheet.Key("nothing stands out from the background")], width
        )
    picture = sheet.washed(crop.shown(picture_of(sight.followed(frame))))
    mask = masks.of(frame)
    # reduced first: a page has fewer pixels than most clips
    planes = np.stack([crop.shown(np.minimum(plane, FULL), (0, 0, 0)) for plane in mask.planes])
    strongest = planes.argmax(axis=0)
    # the last plane may stand for no colour: of a varied mechanism, or of borders
    any_difference = masks.varied or masks.view(_geoms(sight)).border >= 0
    keys = []
    for k, plane in enumerate(planes):
        own = np.where(strongest == k, plane, 0)
        sheet.blended(picture, 0.85 / FULL * own, PLANES[k % len(PLANES)])
        if own.any():
            other = any_difference and k == len(mask.planes) - 1
            share = float(own.sum()) / FULL / own.size
            what = "any other difference" if other else f"colour {k + 1}"
            keys.append(sheet.Key(f"{what}: {_percent(share)}", PLANES[k % len(PLANES)]))
    return sheet.panel(title, picture, keys or [sheet.Key("nothing stands out in this frame")], width)


def _geoms(sight: Sight) -> int:
    return 1 if sight.scene is None else len(sight.scene.mechanism.shapes.radius)


def _whole(sight: Sight, width: int) -> sheet.Crop:
    return sheet.fitted_crop((0, 0, sight.video.width, sight.video.height), width, TALLEST)


def _around(sight: Sight, outlines: list[np.ndarray]) -> tuple[float, float, float, float]:
    """Return the box of the part that moves and of the outlines, which may reach beyond the picture."""
    window, video = sight.background.window, sight.video
    box = np.array([window.left, window.top, window.right, window.bottom], dtype=np.float64)
    # half a picture beyond its border shows where a pivot outside is meant to be
    far_x, far_y = 0.5 * video.width, 0.5 * video.height
    for corners in outlines:
        low = np.clip(corners.min(axis=0) - 8.0, [-far_x, -far_y], [video.width, video.height])
        high = np.clip(corners.max(axis=0) + 9.0, [0.0, 0.0], [video.width + far_x, video.height + far_y])
        box[:2], box[2:] = np.minimum(box[:2], low), np.maximum(box[2:], high)
    return (float(box[0]), float(box[1]), float(box[2]), float(box[3]))


def _as_frame(background: Background) -> Frame:
    """Return the background as a frame."""

    def whole(plane: np.ndarray) -> np.ndarray:
        return np.clip(np.round(plane), 0, 255).astype(np.uint8)

    chroma = None if background.chroma is None else (whole(background.chroma[0]), whole(background.chroma[1]))
    return Frame(0, 0.0, whole(background.luma), chroma)


def _percent(share: float) -> str:
    if share < 0.001:
        return "under 0.1 %"
    return f"{100.0 * share:.0f} %" if share >= 0.095 else f"{100.0 * share:.2g} %"
