"""Turns and focal length of the camera: estimated where the points determine them, else held and doubted.

The rule is like that of outlines: marks that keep their places on the links come nearer and go away before a
camera that looks obliquely. Before one that looks squarely turns would only take up the errors of the points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.vision.locating.oblique import open_turns, std_about, turned_by, with_camera
from monodyn.vision.points.adjust import Adjustment, Fitted, refine
from monodyn.vision.points.rest import Named
from monodyn.vision.points.start import SoughtPoints, unexplained

CLEAR = 6.0
"""Standard deviations from a camera that looks squarely, and by which the points come nearer, from which its
turns are estimated: errors of a tracker are the same from frame to frame, more than those of outlines."""


@dataclass(frozen=True, eq=False)
class Looking:
    """How a camera looks at the plane, as far as the points tell.

    Attributes:
        clear: True where the points show that it is turned.
        doubted: What is refined where the camera is free to turn.
        away: Where that refinement ended.
    """

    clear: bool
    doubted: Adjustment
    away: Fitted

    def off(self, fitted: Fitted) -> np.ndarray:
        """Return how far the camera would turn, and all else with it, if it were free to, (param,).

        Args:
            fitted: Where all stands with its turns held, in the scale of ``away``.
        """
        return self.doubted.read(self.away) - self.doubted.read(fitted)

    def camera_std(self, adjustment: Adjustment, fitted: Fitted, *, scale_free: bool) -> dict[str, float]:
        """Return the standard deviations of the camera's parameters [m, rad, px].

        Args:
            adjustment: What was refined.
            fitted: Where it ended.
            scale_free: True where nothing pins the common scale.

        Returns:
            Standard deviation by name; of what is held, about the value that it is held at.
        """
        held = known = adjustment.bundle(fitted)
        if not self.clear:
            known = self.doubted.bundle(replace(fitted, information=self.away.information))
        return std_about(held, known, self.away.camera, scale_free=scale_free)


def looking(sought: SoughtPoints, found: Named) -> Looking:
    """Find out whether the camera looks obliquely.

    Args:
        sought: The mechanism, and what is known of the camera.
        found: What was refined before a camera that looks squarely, or as it was given.

    Returns:
        What was found.
    """
    adjustment, fitted = found.adjustment, found.fitted
    before = adjustment.variables
    names = open_turns(
        sought.mechanism, {*sought.fix, *before.names, *(["camera.focal"] if sought.focal else [])}
    )
    if not names:
        return Looking(False, adjustment, fitted)
    # turned about the mechanism's origin the camera goes on seeing it where it is
    given = {"camera.x", "camera.y", "camera.depth"} & {*sought.fix}
    variables = replace(with_camera(before, fitted.mechanism, names), about_origin=not given)
    doubted = replace(adjustment, variables=variables)
    away = refine(doubted, fitted, found.seen)
    turned = turned_by(doubted.bundle(away), adjustment.bundle(fitted), names)
    fall = 2.0 * (
        unexplained(adjustment, fitted, found.seen, away.noise)
        - unexplained(doubted, away, found.seen, away.noise)
    )
    return Looking(min(turned, float(np.sqrt(max(fall, 0.0)))) > CLEAR, doubted, away)
