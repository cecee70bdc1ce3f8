"""Which part of the picture holds the mechanism: the one whose motion the mechanism explains.

The mechanism is located in everything that moves. Where that leaves much of the foreground unexplained, and
the motion falls into parts, it is located in each part too, and the scene that fits its part best is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from monodyn.errors import MonodynError
from monodyn.types import FULL
from monodyn.vision.drawing.outline import covered_pixels, outline
from monodyn.vision.foreground.background import Samples
from monodyn.vision.locating.locate import Sought
from monodyn.vision.locating.scene import Scene
from monodyn.vision.locating.unit import in_usual_proportions

EXPLAINED = 0.95
"""Agreement of mechanism and foreground from which no other part is tried."""
MOST_PARTS = 4
"""Parts that are tried."""
FULLER = 1.6
"""Foreground of a frame over that of the quarter with the least, from which something else may be in it."""
CALM, BLURRED = 0.4, 1.2
"""Share of the samples that motion blurs least, and foreground of the usual frame over that of these from
which it is blur that makes the difference."""
LEAST_FRAMES = 12
"""Least number of samples in which the mechanism is located."""
JUDGED_FRAMES = 8
"""Key frames in which mechanism and foreground are compared."""
NEAR_PX = 3.0
"""Distance within which an edge of one lies on the other [px]."""
LEAST_IN_PICTURE = 0.25
"""Share of the mechanism's area inside of the picture below which what agrees is a sliver of it."""
ONE_SHARE = 0.03
"""Difference of places and lengths, as a share of the longest, up to which two scenes are one."""
LEFT_SHARE, LEFT_FRAMES = 0.1, 0.1
"""Share of the mechanism outside of a part of the picture from which it leaves the part in a frame, and
share of the key frames from which it is cut off there."""

Find = Callable[[Sought], Scene]


def find_in_region(sought: Sought, find: Find) -> Scene:
    """Locate the mechanism in everything that moves, or in the part of it that it explains best.

    Args:
        sought: The masks, the mechanism, and what is known of the camera.
        find: Locates it in masks.

    Returns:
        The scene; its masks are those of the part.
    """
    best, share = None, -1.0
    refusals: list[MonodynError] = []
    for tried in _attempts(sought):
        try:
            scene = find(tried)
        except MonodynError as refusal:
            refusals.append(refusal)
            continue
        agrees = agreement(scene)
        if agrees > share and (best is None or not is_cut_off(best, scene)):
            best, share = scene, agrees
        if share >= EXPLAINED:
            break
    if best is None:
        # what is wrong with the whole clip concerns the user, not what is wrong with a part of it
        raise refusals[0]
    return best


def _attempts(sought: Sought) -> Iterator[Sought]:
    """Return in which masks the mechanism is located, and from which proportions, the likeliest first."""
    if sought.guess is not None:
        yield sought
        sought = replace(sought, guess=None)
    usual = in_usual_proportions(sought.mechanism, sought.pinned)
    for i, samples in enumerate(candidates(sought.masks.samples)):
        yield replace(sought, masks=sought.masks.over(samples)) if i else sought
        if i == 0 and usual is not sought.mechanism:
            yield replace(sought, mechanism=usual)


def candidates(samples: Samples) -> Iterator[Samples]:
    """Return what the mechanism may be located in, the likeliest first.

    Args:
        samples: Frames of the clip.

    Yields:
        All of it; the frames that are not fuller than usual, where a hand may hold the mechanism in the
        others; those of the least foreground, which motion blurs least; the parts of the picture that move
        apart from one another, without such frames too.
    """
    yield samples
    for fewer in (without_fuller, least_blurred):
        if (some := fewer(samples)) is not None:
            yield some
    parts = samples.parts
    if parts is None:
        return
    for number in range(1, min(parts.count, MOST_PARTS) + 1):
        window, others = parts.window([number]), parts.others([number])
        part = replace(samples, window=window, others=others, parts=None)
        # a hand that lets go is in the part that it held
        yield without_fuller(part, parts.labels == number) or part


def without_fuller(samples: Samples, cells: np.ndarray | None = None) -> Samples | None:
    """Return the samples without those of much more foreground than usual.

    Args:
        samples: Frames of the clip.
        cells: Which cells of the thumbnails count, bool (height, width); None stands for all.

    Returns:
        The others, or None where all are usual or too few would be left.
    """
    area = _foreground(samples, cells)
    if area is None:
        return None
    # the quarter with the least foreground has no hand in it, unless all have
    kept = area <= FULLER * np.percentile(area, 25.0)
    if kept.all() or kept.sum() < max(LEAST_FRAMES, len(kept) // 4):
        return None
    return replace(samples, frames=tuple(f for f, keep in zip(samples.frames, kept, strict=True) if keep))


def least_blurred(samples: Samples) -> Samples | None:
    """Return the samples in which motion blurs the mechanism least.

    What moves while a picture is exposed covers more of it, the faster the more.

    Args:
        samples: Frames of the clip.

    Returns:
        The share ``CALM`` of them with the least foreground, or None where all show about as much or too few
        would be left.
    """
    area = _foreground(samples)
    if area is None:
        return None
    kept = area <= np.quantile(area, CALM)
    if kept.sum() < LEAST_FRAMES or np.median(area) < BLURRED * np.median(area[kept]):
        return None
    return replace(samples, frames=tuple(f for f, keep in zip(samples.frames, kept, strict=True) if keep))


def _foreground(samples: Samples, cells: np.ndarray | None = None) -> np.ndarray | None:
    """Return how many cells of its thumbnail differ in each sample from the median, (frame,); None without
    thumbnails."""
    if samples.thumbnails is None:
        return None
    rows = np.searchsorted(samples.thumbnails.number, [frame.index for frame in samples.frames])
    planes = samples.thumbnails.planes[rows]
    usual = np.median(planes, axis=0).astype(np.uint8)
    differs = np.maximum(planes, usual) - np.minimum(planes, usual) > samples.thumbnails.still
    shown = differs.any(axis=1) if cells is None else differs.any(axis=1) & cells
    return shown.sum(axis=(1, 2))


def is_cut_off(whole: Scene, part: Scene) -> bool:
    """Return whether a part of the picture holds the same scene as a larger one, and less of its motion.

    A post that the mechanism passes behind parts the motion: on either side of it the mechanism agrees with
    all that moves there, and on the other side it would be lost.

    Args:
        whole: The scene in the larger part of the picture.
        part: The scene in the smaller one.

    Returns:
        True where both are one, and the mechanism leaves the smaller part in more than a few key frames.
    """
    if not _are_one(whole, part):
        return False
    inside = part.masks.background.counts
    drawn = (covered_pixels(whole.mechanism, whole.camera, q, margin=0.0) for q in whole.key_positions)
    left = [np.sum(pixels & ~inside) > LEFT_SHARE * np.sum(pixels) for pixels in drawn]
    return float(np.mean(left)) > LEFT_FRAMES


def agreement(scene: Scene) -> float:
    """Return how well mechanism and foreground agree in the key frames.

    The share of the foreground that the mechanism covers and that of the mechanism on the foreground, the
    lesser of the two, each with the other made wider by ``NEAR_PX``; the median over the frames. It is lower
    where most of the mechanism is outside of the picture: a sliver of something large lies on anything.

    Args:
        scene: A located mechanism.

    Returns:
        From 0 to 1.
    """
    import cv2

    frames = {frame.index: frame for frame in scene.masks.samples.frames}
    rows = [i for i, number in enumerate(scene.key_frames) if number in frames]
    wider = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * int(NEAR_PX) + 1,) * 2)
    shares = []
    for i in rows[:: max(1, len(rows) // JUDGED_FRAMES)]:
        shown = scene.masks.of(frames[scene.key_frames[i]]).coverage > FULL // 2
        position, known = scene.key_positions[i], scene.masks.background.known
        drawn = covered_pixels(scene.mechanism, scene.camera, position, margin=0.0)
        outlines = [polygon for _, polygon in outline(scene.mechanism, scene.camera, position)]
        area = sum(cv2.contourArea(polygon.astype(np.float32)) for polygon in outlines)
        inside = min(1.0, float(np.sum(drawn)) / max(1.0, LEAST_IN_PICTURE * area))
        shown, drawn = shown & known, drawn & known
        explained = shown & (cv2.dilate(drawn.astype(np.uint8), wider) > 0)
        met = drawn & (cv2.dilate(shown.astype(np.uint8), wider) > 0)
        agrees = min(np.sum(explained) / max(1, np.sum(shown)), np.sum(met) / max(1, np.sum(drawn)))
        shares.append(inside * agrees)
    return float(np.median(shares)) if shares else 0.0


def _are_one(one: Scene, other: Scene) -> bool:
    """Return whether two scenes show the same lengths before the same camera, the common scale aside."""
    names = [p.name for p in one.mechanism.parameters if p.kind == "length"]
    sizes = []
    for scene in (one, other):
        values, camera = scene.mechanism.values, scene.camera
        sizes.append(np.array([camera.x, camera.y, *(values[name] for name in names)]) / camera.depth)
    near = ONE_SHARE * float(np.abs(sizes[0][2:]).max(initial=0.0))
    return bool(np.all(np.abs(sizes[0] - sizes[1]) <= near))
