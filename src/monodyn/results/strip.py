"""The clip along its time: in which frames each joint was seen, and how well the outline lay on its mask."""

from __future__ import annotations

import numpy as np

from monodyn.results import sheet
from monodyn.results.sheet import mark
from monodyn.results.sight import Judged, Sight
from monodyn.vision.locating.advice import UNEXPLAINED_SHARE

LABELS = 130
"""Room for the names at the left [px]."""
BAR, SCORES = 16, 110
"""Height of a bar and of the part with the scores [px]."""
MEASURES: dict[str, tuple[str, sheet.Colour, str]] = {
    "inside": ("covered inside of it", sheet.BLUE, "triangle"),
    "matched": ("outline on an edge", sheet.ORANGE, "dot"),
    "mismatch": ("mismatch with the mask", sheet.PURPLE, "square"),
}
"""What is shown of a judged frame: in words, and how it is drawn."""


def strip(sight: Sight) -> sheet.Picture:
    """Return the strip along the clip: title, one bar a joint, scores, legend.

    Args:
        sight: What the run saw.
    """
    head = sheet.blank(30)
    sheet.write(head, "Along the clip", (sheet.MARGIN, 19), sheet.TITLE)
    below = [_scores(sight)] if sight.tracks is None else _point_bars(sight)
    parts = [head, *_bars(sight), *below, _axis(sight)]
    keys = _keys(sight)
    drawn = sheet.legend(keys, sheet.WIDTH - LABELS - 2 * sheet.MARGIN)
    foot = sheet.blank(drawn.shape[0])
    foot[:, sheet.MARGIN + LABELS : sheet.WIDTH - sheet.MARGIN] = drawn
    return np.concatenate([*parts, foot])


def _column(sight: Sight, frame: float) -> int:
    """Return where a frame begins on the page [px]."""
    left, right = sheet.MARGIN + LABELS, sheet.WIDTH - sheet.MARGIN
    return left + round((right - left) * frame / sight.video.count)


def _bars(sight: Sight) -> list[sheet.Picture]:
    """Draw one bar a joint: filled where it was seen, hatched where not; before them those of the frames in
    which the mechanism moves freely and of the fitted ones."""
    bars = []
    if sight.free_frames is not None:
        bars.append(_bar(sight, "moves freely", [sight.free_frames], sheet.GREEN, hatched=False))
    if sight.fit_frames is not None:
        bars.append(_bar(sight, "fitted frames", [sight.fit_frames], sheet.ORANGE, hatched=False))
    if sight.poses is None:
        bar = sheet.blank(3 * BAR)
        text = sheet.absent(
            f"{sight.stage}: no frame was tracked", sheet.WIDTH - LABELS - 2 * sheet.MARGIN, 3 * BAR - 6
        )
        bar[: text.shape[0], sheet.MARGIN + LABELS : sheet.WIDTH - sheet.MARGIN] = text
        return [*bars, bar]
    seen, frames = sight.poses.measured, sight.poses.frame
    for joint, column in zip(sight.poses.joints, seen.T, strict=True):
        bars.append(_bar(sight, joint, _runs(frames[column]), sheet.BLUE, hatched=True))
    return bars


def _point_bars(sight: Sight) -> list[sheet.Picture]:
    """Draw one bar a point: filled where it lies on its mark, or where it was found while nothing is
    located."""
    tracks, scene = sight.tracks, sight.points
    assert tracks is not None
    names, shown = tracks.names, tracks.found
    if scene is not None:
        names, shown = tuple(mark.track for mark in scene.adjustment.places.marks), scene.lying
    return [
        # a point may have the name of its joint, which has a bar of its own
        _bar(sight, f"at {name}", _runs(tracks.frame[column]), sheet.GREEN, hatched=True)
        for name, column in zip(names, shown.T, strict=True)
    ]


def _bar(
    sight: Sight, name: str, runs: list[tuple[int, int]], colour: sheet.Colour, *, hatched: bool
) -> sheet.Picture:
    bar = sheet.blank(BAR + 6)
    label = name if len(name) <= 16 else f"{name[:15]}."
    sheet.write(
        bar,
        label,
        (sheet.MARGIN + LABELS - 10 - sheet.length(label, sheet.SMALL), 13),
        sheet.SMALL,
        sheet.INK,
    )
    ground = bar[:BAR, _column(sight, 0) : _column(sight, sight.video.count)]
    ground[:] = sheet.GROUND
    if hatched:
        sheet.hatch(ground, np.ones(ground.shape[:2], dtype=bool), sheet.RED)
    for first, stop in runs:
        # a single frame of a long clip is less than a pixel wide, and must not vanish
        bar[:BAR, _column(sight, first) : max(_column(sight, stop), _column(sight, first) + 1)] = colour
    return bar


def _runs(frames: np.ndarray) -> list[tuple[int, int]]:
    """Return stretches of frame numbers without a gap, each with the number after its last."""
    if not len(frames):
        return []
    cuts = np.flatnonzero(np.diff(frames) > 1) + 1
    return [(int(part[0]), int(part[-1]) + 1) for part in np.split(frames, cuts)]


def _scores(sight: Sight) -> sheet.Picture:
    """Draw the measures of the judged frames, from 0 at the bottom to 1 at the top."""
    part = sheet.blank(SCORES + 22)
    left, right, top = _column(sight, 0), _column(sight, sight.video.count), 12
    for value in (0.0, 0.5, 1.0):
        y = top + round((1.0 - value) * SCORES)
        part[y, left:right] = sheet.LINE
        label = f"{value:g}"
        sheet.write(
            part, label, (left - 10 - sheet.length(label, sheet.SMALL), y + 4), sheet.SMALL, sheet.SOFT
        )
    if not sight.judged:
        text = sheet.absent(f"{sight.stage}: no outline to judge", right - left, SCORES - 2)
        part[top + 1 : top + 1 + text.shape[0], left:right] = text
        return part
    sheet.dashed(part, top + round((1.0 - UNEXPLAINED_SHARE) * SCORES), (left, right), sheet.PURPLE)
    for judged in sight.judged:
        x = _column(sight, judged.frame.index + 0.5)
        for measure, (_, colour, shape) in MEASURES.items():
            value = min(max(float(getattr(judged, measure)), 0.0), 1.05)
            mark(part, np.array([x, top + (1.0 - value) * SCORES]), colour, _shape(judged, shape), 4)
    return part


def _shape(judged: Judged, shape: str) -> str:
    """Return the marker of a judged frame: located ones that were not tracked are crosses."""
    return shape if judged.tracked else "cross"


def _axis(sight: Sight) -> sheet.Picture:
    """Write frame numbers, and the time in seconds below them."""
    axis = sheet.blank(44)
    count = sight.video.count
    step = _round_step(count / 10)
    for frame in range(0, count, step):
        x = _column(sight, frame + 0.5)
        axis[0:5, x] = sheet.SOFT
        for text, y in ((str(frame), 18), (f"{sight.video.times[frame]:.2f} s", 34)):
            sheet.write(axis, text, (x - sheet.length(text, sheet.SMALL) // 2, y), sheet.SMALL, sheet.SOFT)
    sheet.write(axis, "frame", (sheet.MARGIN, 18), sheet.SMALL, sheet.SOFT)
    sheet.write(axis, "time", (sheet.MARGIN, 34), sheet.SMALL, sheet.SOFT)
    return axis


def _round_step(least: float) -> int:
    """Return 1, 2 or 5 times a power of ten, at least as large as wanted."""
    power = 10 ** int(np.floor(np.log10(max(least, 1.0))))
    return next(int(k * power) for k in (1, 2, 5, 10) if k * power >= least)


def _keys(sight: Sight) -> list[sheet.Key]:
    keys = []
    if sight.poses is not None:
        seen = sight.poses.measured
        shares = ", ".join(
            f"{joint} {int(column.sum())}" for joint, column in zip(sight.poses.joints, seen.T, strict=True)
        )
        keys += [
            sheet.Key(f"seen (frames of {len(seen)}: {shares})", sheet.BLUE),
            sheet.Key("not seen", sheet.RED, "hatch"),
        ]
    if sight.tracks is not None:
        keys.append(sheet.Key("point found" if sight.points is None else "point on its mark", sheet.GREEN))
    if sight.judged:
        keys += [sheet.Key(text, colour, shape) for text, colour, shape in MEASURES.values()]
        keys.append(sheet.Key("mismatch that calls for advice", sheet.PURPLE, "line"))
        if any(not judged.tracked for judged in sight.judged):
            keys.append(sheet.Key("located, not tracked (in the colour of each)", sheet.SOFT, "cross"))
    return keys or [sheet.Key("")]
