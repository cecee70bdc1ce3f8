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
from monodyn.vision.locating.advice import UNEXPLAINED_SHARE
from monodyn.vision.locating.parallax import scene_sway
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
    lost = unmeasured_joints([part], pictures=True) or _unshown_bodies(sight)
    if lost:
        return lost
    # what lies badly on its mask and was lost again and again may be something else
    if sight.mismatch > MOST_MISMATCH * min(seen / max(count, 1), 1.0):
        return _mismatched(sight, count - seen, count)
    sway_px = scene_sway(sight.scene).rms_px if sight.scene and sight.scene.masks.video.bare else 0.0
    if sway_px > MOST_SWAY_PX:
        return (
            f"Beside its motion the whole mechanism sways by {sway_px:.1f} px in the picture: the camera "
            "moves, or what holds the mechanism, or it is another one, and the background shows too little "
            "to tell. Put the camera on a tripod, film before a background with edges and patterns over much "
            "of the picture, or run the clip without --model: the bundled mechanisms are tried."
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


def _unshown_bodies(sight: Sight) -> str | None:
    """Name the bodies of which the picture shows nothing, and of which nobody has given a size.

    Where it shows none of them the mechanism is elsewhere, which the outlines as a whole say.
    """
    if sight.scene is None or not sight.unshown:
        return None
    mechanism = sight.scene.mechanism
    chosen = [p.name for p in mechanism.parameters if p.name in mechanism.chosen and not p.free]
    given = {name.partition(".")[0] for name in chosen}
    bodies = [repr(body) for body in sight.unshown if body not in given]
    if not bodies or len(sight.unshown) == len(set(mechanism.shapes.body)):
        return None
    return (
        f"The picture shows nothing of {listed(bodies)}: where it was looked for it lies outside of the "
        "picture, behind the rest of the mechanism, or where nothing stands out from the background, so that "
        "nothing of it can be estimated. Take a mechanism without it, or, where it is there, give its sizes "
        "with --fix; diagnosis.png shows where it was looked for."
    )


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


def unmeasured_joints(records: Sequence[Poses], *, pictures: bool = False) -> str | None:
    """Name the joints that were hardly ever measured while others were.

    Args:
        records: Records of the same joints.
        pictures: Whether they are of a clip; else they are tables.

    Returns:
        A sentence for the user; None where every joint was measured often enough.
    """
    rows = sum(int(np.sum(record.measured.any(axis=1))) for record in records)
    counts = np.sum([record.measured.sum(axis=0) for record in records], axis=0).tolist()
    joints = zip(records[0].joints, counts, strict=True)
    few = {joint: count for joint, count in joints if rows and count <= LEAST_JOINT * rows}
    if not few:
        return None
    what = "frames" if pictures else "rows"
    said = (
        f"{listed(list(few))} could be measured in at most {max(few.values())} of the {rows} {what} in which "
        "another joint was: "
    )
    if pictures:
        return (
            f"{said}what it moves does not lie on anything that stands out from the background. The clip may "
            "show a mechanism without such a link; diagnosis.png shows where it was looked for."
        )
    return (
        f"{said}so few do not show that the mechanism moves there as it was identified. Measure it in more "
        "rows, or take a mechanism without it."
    )


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
    import cv2

    low, cell = own.min(axis=0), np.ptp(own, axis=0) / (CELLS - 1)
    covered = np.zeros((1 + len(others), CELLS, CELLS), np.uint8)
    for picture, points in zip(covered, (own, *others), strict=True):
        # four bits after the point, which is the ``shift``
        corners = cv2.convexHull((16.0 * (points - low) / cell).astype(np.float32))
        cv2.fillConvexPoly(picture, np.round(corners).astype(np.int32), 1, cv2.LINE_8, 4)
    return 1.0 - float(np.mean(covered[1:].max(axis=0)[covered[0] > 0]))


def _part_name(mechanism: Mechanism, geom: int) -> str:
    """Return the name under which a geom has its parameters: the body's, or its own in between."""
    table, plan = mechanism.plan.table, mechanism.plan
    rows = [plan.radius[geom], *plan.outline[3 * plan.first[geom] : 3 * plan.first[geom + 1]]]
    used = np.flatnonzero(np.any(np.asarray(rows)[:, :-1] != 0.0, axis=0))
    own = [table.names[i].rsplit(".", 1)[0] for i in used if table.names[i].count(".") == 2]
    return own[0] if own else mechanism.shapes.body[geom]
