"""Which assumptions of the paper about the film hold, each judged by numbers measured in the film itself.

The paper lists none; they are what its method rests on: one threshold divides the mechanism from a background
that stays as it is, nothing hides the mechanism, and the drawn bodies in a plane parallel to the picture give
its silhouette.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.paper.filmed import FAR_PX, Film, Outlook, background_drift, measured, outlook
from monodyn.paper.silhouettes import ClipSilhouettes
from monodyn.paper.threshold import LEAST_THRESHOLD
from monodyn.types import Poses
from monodyn.vision.locating.scene import Scene

DIVIDES, STILL, ALONE, IN_VIEW, AS_GIVEN, PARALLEL = (
    "One threshold divides the mechanism from the background.",
    "The camera stands still.",
    "The mechanism moves alone and is seen in one piece.",
    "All of the mechanism is in the picture and nothing is in front of it.",
    "The bodies have the shapes of the model.",
    "The mechanism moves in a plane parallel to the picture.",
)
"""What is assumed."""
DISTURBED = "This cannot be judged where another assumption fails."
"""Said of the plane."""
MOST_UNDECIDED = 0.4
"""Pixels near the threshold, as a share of those above it, with which it still divides."""
MOST_CUT = 0.1
"""Share of the frames in which the silhouette may end at the border of the picture."""
MOST_APART = 0.15
"""Share of the silhouette that may lie apart from its largest patch."""
MOST_ELSEWHERE = 0.05
"""Share of the mechanism's area that may change far from it."""
FOLLOWED = 0.3
"""Share of the frames with a pose from which the poses are relied on."""
LEAST_SEEN = 0.95
"""Share of the frames in which the mechanism should be seen."""
PARTLY = 0.9
"""A frame shows a part of the mechanism when its silhouette is smaller than this share of the usual one."""
HIDDEN, MOST_HIDDEN = 0.1, 0.05
"""A part is hidden in a frame when this share of the drawn mechanism is missing there, and share of the
frames in which that may be so."""
MOST_DRIFT_PX = 0.5
"""Displacement of the background up to which the camera stands still [px]."""
MOST_SHIFTING, LEAST_CLEAN = 0.1, 8
"""Share of the mechanism's area, missed or uncovered, up to which a frame's centroid is used, and fewest such
frames."""
MOST_STRETCH = 0.06
"""Difference of the picture's scale between two directions up to which the planes count as parallel."""
LEAST_SPREAD, LEAST_SPREAD_PX = 0.25, 10.0
"""Standard deviation of the centroid across its main direction from which the scales of two directions can be
compared: a share of that along it, and pixels."""


@dataclass(frozen=True)
class Assumption:
    """An assumption of the paper about the film.

    Attributes:
        name: What is assumed, a sentence.
        held: Whether it holds; None where the film does not show that.
        numbers: The measured numbers that this rests on, a sentence.
    """

    name: str
    held: bool | None
    numbers: str


def film_assumptions(scene: Scene, poses: Poses) -> tuple[Assumption, ...]:
    """Judge the assumptions that the paper's method makes about a film.

    Args:
        scene: Mechanism, camera and masks, as they were located; the threshold is Otsu's, or the scene's.
        poses: The poses that were tracked before that camera, slides in the scene's scale.

    Returns:
        One record for each assumption: the threshold, the camera, the rest of the picture, the view of the
        mechanism, its bodies, its plane.
    """
    # a scene of the published method has the level that the user set; that of another method has none
    level = float(getattr(scene, "level", 0.0))
    film = measured(scene, poses, ClipSilhouettes(scene.masks, level))
    divides, alone, in_view = silhouette_assumptions(film.outlook)
    if film.drawn_well and film.seen >= FOLLOWED:
        # with the mechanism found, its own pixels tell more than the silhouettes alone
        alone, in_view = _alone(film), _in_view(film)
    others = (divides, _still_camera(film.drift), alone, in_view, _as_given(film))
    # what disturbs the silhouette or moves the picture would pass for a plane at a slant
    disturbed = any(own.held is False for own in others)
    plane = Assumption(PARALLEL, None, DISTURBED) if disturbed else _parallel(film)
    return *others, plane


def silhouette_assumptions(seen: Outlook) -> tuple[Assumption, Assumption, Assumption]:
    """Judge what the silhouettes show without a pose; they can disprove the last two, but not prove them.

    Args:
        seen: The silhouettes, measured.

    Returns:
        The threshold, the rest of the picture, the view of the mechanism.
    """
    return (
        Assumption(
            DIVIDES,
            seen.level >= LEAST_THRESHOLD * seen.noise and seen.undecided <= MOST_UNDECIDED,
            f"The threshold is {seen.level:.0f} grey levels, the noise of a pixel {seen.noise:.1f}; for each "
            f"100 pixels above it {100.0 * seen.undecided:.0f} are near it.",
        ),
        Assumption(
            ALONE,
            None if seen.apart <= MOST_APART else False,
            f"{seen.apart:.0%} of the silhouette lie apart from its largest patch.",
        ),
        Assumption(
            IN_VIEW,
            None if seen.cut <= MOST_CUT else False,
            f"The silhouette ends at the border of the picture in {seen.cut:.0%} of the frames.",
        ),
    )


def failed(silhouettes: ClipSilhouettes) -> tuple[Assumption, ...]:
    """Return the assumptions that a clip disproves without any pose.

    Args:
        silhouettes: The silhouettes of the clip.
    """
    divides, alone, in_view = silhouette_assumptions(outlook(silhouettes))
    still = _still_camera(background_drift(silhouettes))
    return tuple(own for own in (divides, still, alone, in_view) if own.held is False)


def failed_advice(silhouettes: ClipSilhouettes) -> tuple[str, ...]:
    """Return a sentence for each assumption that a clip disproves, for the user.

    Args:
        silhouettes: The silhouettes of the clip.
    """
    return tuple(
        f'The published method assumes: "{own.name}" This film is otherwise. {own.numbers}'
        for own in failed(silhouettes)
    )


def _still_camera(drift: tuple[float, ...]) -> Assumption:
    """Judge the camera by the displacement of the background."""
    if not drift:
        return Assumption(STILL, None, "The background shows too little that could be aligned.")
    # the median: a picture in which something large moves may be aligned with that
    usual = float(np.median(drift))
    return Assumption(
        STILL,
        usual <= MOST_DRIFT_PX,
        f"The background is displaced by {usual:.1f} px in the median of {len(drift)} frames.",
    )


def _alone(film: Film) -> Assumption:
    """Judge the rest of the picture by what changes far from the mechanism."""
    far = max(look.far for look in film.looks)
    return Assumption(
        ALONE,
        far <= MOST_ELSEWHERE,
        f"Farther than {FAR_PX} px from the drawn mechanism up to {far:.0%} of its area differ from the "
        "background.",
    )


def _in_view(film: Film) -> Assumption:
    """Judge the view of the mechanism by the frames without a pose and by what is drawn but not seen."""
    outside = max(look.outside for look in film.looks)
    hidden = float(np.mean([look.missed > HIDDEN for look in film.looks]))
    part = min(film.unseen, default=np.inf) / film.usual("area")
    lost = film.seen < LEAST_SEEN and part < PARTLY
    unseen = f", in the others down to {part:.0%} of its usual silhouette is left" if film.unseen else ""
    return Assumption(
        IN_VIEW,
        not (lost or outside > 0.0 or hidden > MOST_HIDDEN),
        f"It is followed in {film.seen:.0%} of the frames{unseen}; more than {HIDDEN:.0%} of it are hidden "
        f"in {hidden:.0%} of them, and {outside:.0%} of its outline leave the picture.",
    )


def _as_given(film: Film) -> Assumption:
    """Judge the bodies by what the drawn mechanism misses of the silhouette and what it covers beside it."""
    if not film.looks:
        return Assumption(AS_GIVEN, None, "The mechanism was followed in no frame.")
    return Assumption(
        AS_GIVEN,
        film.drawn_well,
        f"The drawn mechanism leaves {film.usual('excess'):.0%} of its area of the silhouette uncovered and "
        f"covers {film.usual('missed'):.0%} outside of it, pixels at the outline aside.",
    )


def _parallel(film: Film) -> Assumption:
    """Judge the plane by the scales of the picture in two directions, seen against drawn."""
    unknown = Assumption(
        PARALLEL, None, "The motion covers too few directions to compare the picture's scales."
    )
    # what hides a part of the mechanism, or touches it, would shift the centroid
    clean = [look.centroids for look in film.looks if look.missed + look.excess <= MOST_SHIFTING]
    if len(clean) < LEAST_CLEAN:
        return unknown
    offset = np.array(clean)
    offset = offset - offset.mean(axis=0)
    # A plane at a slant is shortened across its axis: the centroid of the silhouette then moves less than
    # the drawn one in that direction. The drawn sizes do not matter, they stretch both directions alike.
    spread = np.linalg.svd(offset[:, 2:], compute_uv=False)
    if not spread[1] > max(LEAST_SPREAD * spread[0], LEAST_SPREAD_PX * np.sqrt(len(offset))):
        return unknown
    scales = np.linalg.svd(np.linalg.lstsq(offset[:, 2:], offset[:, :2])[0], compute_uv=False)
    stretch = float(scales[0] / scales[1] - 1.0)
    return Assumption(
        PARALLEL,
        stretch <= MOST_STRETCH,
        f"The centroid of the silhouette moves as that of the drawn mechanism, with scales that differ by "
        f"{stretch:.0%} between directions.",
    )
