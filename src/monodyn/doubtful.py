"""What a run saw, judged before anything is fitted: whether it is the mechanism, and what of it is not there.

A wrong model shows in the picture first. It is followed in the wrong place, or something moves along outside
of its outline; a part of it shrinks into another one, because the picture has no place for it; a joint that
the clip has not never bends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from monodyn.checks import tracked_share
from monodyn.estimation.wording import listed
from monodyn.results.sight import Sight
from monodyn.types import Poses
from monodyn.vision.drawing.silhouette import convex_hull
from monodyn.vision.locating.advice import UNEXPLAINED_SHARE
from monodyn.vision.points.scene import PointScene

if TYPE_CHECKING:
    from monodyn.mechanism import Mechanism

LEAST_SEEN = 0.25
"""Share of the frames to fit that have to be tracked."""
LEAST_JOINT = 0.05
"""Share of these up to which a joint was hardly measured: what is hidden now and then is not missing."""
MOST_MISMATCH = 0.5
"""Mismatch of outline and mask, as a share of the mask's area, above which no fit is trusted: as much as the
published method allows. Where only a part of the frames was tracked, only that part of it."""
MOST_SWAY_PX = 1.5
"""Sway of the whole mechanism before a background that does not show how the camera moves, above which no fit
is trusted [px]; a camera that stands still leaves less than a tenth of that."""
MOST_BESIDE = 0.05
"""What moves along with a body outside of its outline, as a share of the foreground, above which no fit of
uniform bodies is trusted."""
MOST_OUTSIDE = 0.4
"""Share of tracked points away from the mechanism above which no fit is trusted."""
MOST_OFF = 0.04
"""Distance of tracked points from the mechanism, over its size in the picture, above which no fit is
trusted."""
INSIDE, SHOWS = 0.02, 0.15
"""Share of a geom outside of the others of its body up to which no outline of it is left, and from which on
one that the file has would show."""
THIN = 1e-3
"""Least radius of a geom that is compared with others, as a share of the mechanism's extent."""
CELLS = 60
"""Places along a geom, and across it, at which it is compared with the others."""


def doubtful_sight(sight: Sight, part: Poses, *, uniform: bool = True) -> str | None:
    """Find a reason not to trust any fit to the poses: what was followed is hardly the mechanism.

    Args:
        sight: What the run saw of its clip.
        part: The poses that are fitted.
        uniform: Whether masses follow from the geoms; free masses take in what no geom stands for.

    Returns:
        The reason, a sentence for the user; None where the outline explains what was seen.
    """
    if sight.points is not None:
        return _doubtful_points(sight.points, part)
    # pictures that repeat the one before are not expected to be measured
    repeats = () if sight.scene is None else sight.scene.masks.video.repeats.frames
    seen, count = int(np.sum(part.measured.any(axis=1))), int(np.sum(~np.isin(part.frame, repeats)))
    if seen < LEAST_SEEN * count:
        return (
            f"Only {tracked_share(part, f'the {count} frames to fit')}: too few to trust that the mechanism "
            "was followed and not something like it; diagnosis.png shows what was seen. --time-range A:B and "
            "--roi X,Y,W,H choose frames and a part of the picture in which it shows."
        )
    lost = unfound_links(part, seen)
    if lost:
        return lost
    # what lies badly on its mask and was lost again and again may be something else
    if sight.mismatch > MOST_MISMATCH * min(seen / max(count, 1), 1.0):
        return _mismatched(sight, count - seen, count)
    if sight.scene is not None and sight.scene.masks.video.bare and sight.sway_px > MOST_SWAY_PX:
        return (
            f"The whole mechanism sways by {sight.sway_px:.1f} px in the picture, and the background "
            "shows too little to follow the camera by: put the camera on a tripod, or film before a "
            "background with edges and patterns over much of the picture."
        )
    beside = {} if sight.scene is None else sight.scene.beside
    body = max(beside, key=lambda name: beside[name], default="")
    if uniform and body and beside[body] > MOST_BESIDE:
        return (
            f"Something moves along with '{body}' outside of its outline, {beside[body]:.0%} of what stands "
            "out from the background: the mechanism file has no geom for it, or a geom was found in another "
            "place, and masses and lengths would come out wrong. Give the file a geom for it, about as it "
            "is, or take --identify.bodies free; diagnosis.png shows it."
        )
    return None


def likely_sight(sight: Sight) -> str | None:
    """Find what the picture says of a motion that the mechanism does not follow.

    Args:
        sight: What the run saw of its clip.

    Returns:
        The reason, a sentence for the user; None where the outline explains what was seen.
    """
    if sight.points is None and sight.mismatch > UNEXPLAINED_SHARE:
        return _mismatched(sight, 0, 0)
    return None


def _mismatched(sight: Sight, lost: int, count: int) -> str:
    """Return the sentence on a mechanism that lies badly on its mask, and was lost in some frames."""
    untracked = f", and {lost} of {count} frames were not tracked" if lost else ""
    if sight.beyond > 0.5 * sight.mismatch:
        where = (
            "most of that is outside of the mechanism. The clip may show a link or a part more than it has, "
            "other things may move with it, or it is in the wrong place, of the wrong size or blurred by its "
            "motion"
        )
    else:
        where = (
            "most of that is of the mechanism, where nothing stands out. It may have a link or a part that "
            "the clip does not show, or it is in the wrong place or of the wrong size"
        )
    return (
        "The mechanism as it was located differs from what stands out from the background by "
        f"{sight.mismatch:.0%} of its area{untracked}; {where}. diagnosis.png shows what was seen: check the "
        "mechanism file; --roi X,Y,W,H and --time-range A:B leave other things out."
    )


def unfound_links(part: Poses, seen: int) -> str | None:
    """Name the joints of a clip that were hardly ever measured while others were.

    Args:
        part: The poses that are fitted.
        seen: Frames in which any joint was measured.

    Returns:
        A sentence for the user; None where every joint was measured often enough.
    """
    few = hardly_measured([part])
    if not few:
        return None
    return (
        f"{listed(list(few))} could be measured in at most {max(few.values())} of the {seen} frames in which "
        "another joint was: what it moves does not lie on anything that stands out from the background. The "
        "clip may show a mechanism without such a link; diagnosis.png shows where it was looked for."
    )


def unmeasured_joints(records: Sequence[Poses]) -> str | None:
    """Name the joints of which tables hold hardly a position while they do of others.

    Args:
        records: The tables.

    Returns:
        A sentence for the user; None where every joint was measured often enough.
    """
    few = hardly_measured(records)
    if not few:
        return None
    rows = sum(int(np.sum(record.measured.any(axis=1))) for record in records)
    return (
        f"{listed(list(few))} could be measured in at most {max(few.values())} of the {rows} rows in which "
        "another joint was: so few do not show that the mechanism moves there as it was identified. Measure "
        "it in more rows, or take a mechanism without it."
    )


def hardly_measured(records: Sequence[Poses]) -> dict[str, int]:
    """Count in how many rows the joints were measured that hardly ever were while others were.

    Args:
        records: Records of the same joints.

    Returns:
        Number of rows by joint; none where every joint was measured often enough.
    """
    rows = sum(int(np.sum(record.measured.any(axis=1))) for record in records)
    counts = np.sum([record.measured.sum(axis=0) for record in records], axis=0).tolist()
    joints = zip(records[0].joints, counts, strict=True)
    return {joint: count for joint, count in joints if rows and count <= LEAST_JOINT * rows}


def _doubtful_points(scene: PointScene, part: Poses) -> str | None:
    """Find a reason not to trust any fit to tracked points."""
    seen, count = int(np.sum(part.measured.any(axis=1))), len(part)
    if seen < LEAST_SEEN * count:
        return (
            f"Only {seen} of the {count} frames to fit show a joint: too few points to trust the fit; "
            "diagnosis.png shows which were found."
        )
    if scene.outside > MOST_OUTSIDE:
        return (
            f"{scene.outside:.0%} of the tracked points do not lie where the mechanism can have them: "
            "names may belong to other points (--points.map), or the mechanism file is another one; "
            "diagnosis.png shows it."
        )
    if scene.rms_px > MOST_OFF * scene.extent_px:
        return (
            f"The tracked points lie {scene.rms_px:.1f} px from where the mechanism can have them, "
            f"{scene.rms_px / scene.extent_px:.0%} of its size in the picture: names may belong to other "
            "points (--points.map), the camera may move without a point of the scene that shows it, or the "
            "mechanism file is another one; diagnosis.png shows it."
        )
    return None


def unshown_parts(file: Mechanism, found: Mechanism) -> str | None:
    """Name the parts that were shrunk into the rest of their body, though in the file they stand out.

    Args:
        file: The mechanism as in its file.
        found: The same as it was located.

    Returns:
        A sentence for the user; None where every part shows that should.
    """
    parts = [
        _part_name(found, geom)
        for geom, (before, after) in enumerate(zip(_standing_out(file), _standing_out(found), strict=True))
        if before > SHOWS and after < INSIDE
    ]
    if not parts:
        return None
    return (
        f"The picture shows nothing of {listed(parts)}: it was found inside of the rest of its body, where "
        "it changes no outline, although it stands out in the mechanism file. The file may be that of "
        "another mechanism: take one without it, or, where it is there, give its sizes with --fix."
    )


def _standing_out(mechanism: Mechanism) -> list[float]:
    """Return the share of each geom that is outside of the other geoms of its body, by geom."""
    shapes, shares = mechanism.shapes, []
    turns = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    # a thread and a ball of no size have no hull: everything is drawn a little thicker
    least = THIN * max(float(np.ptp(shapes.points[:, :2], axis=0).max(initial=0.0)), 1e-12)
    outlines = [
        (shapes.points[a:b, None, :2] + max(radius, least) * around).reshape(-1, 2)
        for a, b, radius in zip(shapes.first[:-1], shapes.first[1:], shapes.radius, strict=True)
    ]
    for geom, link in enumerate(shapes.link):
        others = [outlines[k] for k in np.flatnonzero(shapes.link == link) if k != geom]
        shares.append(_outside(outlines[geom], others) if others else 1.0)
    return shares


def _outside(own: np.ndarray, others: Sequence[np.ndarray]) -> float:
    """Return the share of the hull of some points, (point, 2), that is outside of the hulls of others."""
    # a regular grid over the points, and the half planes that bound each hull
    low, high = own.min(axis=0), own.max(axis=0)
    x, y = (np.linspace(a, b, CELLS) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inside = [_within(grid, points, float(np.ptp(own))) for points in (own, *others)]
    return float(np.mean(~np.any(inside[1:], axis=0)[inside[0]]))


def _within(places: np.ndarray, points: np.ndarray, unit: float) -> np.ndarray:
    """Return which places, (place, 2), are within the hull of some points, (point, 2), bool (place,)."""
    corners, order = np.empty((2, len(points) + 1), dtype=np.int64)
    ends = points[corners[: convex_hull(points / unit, 0, len(points), corners, order)]]
    edges = np.roll(ends, -1, axis=0) - ends
    off = places[:, None] - ends
    return np.all(off[..., 0] * edges[:, 1] <= off[..., 1] * edges[:, 0], axis=1)


def _part_name(mechanism: Mechanism, geom: int) -> str:
    """Return the name under which a geom has its parameters: the body's, or its own in between."""
    table, plan = mechanism.plan.table, mechanism.plan
    rows = [plan.radius[geom], *plan.outline[3 * plan.first[geom] : 3 * plan.first[geom + 1]]]
    used = np.flatnonzero(np.any(np.asarray(rows)[:, :-1] != 0.0, axis=0))
    own = [table.names[i].rsplit(".", 1)[0] for i in used if table.names[i].count(".") == 2]
    return own[0] if own else mechanism.shapes.body[geom]
