"""From a located mechanism to the sentences for the user about it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from monodyn.types import Camera
from monodyn.vision.drawing.camera import CAMERA_TURNS
from monodyn.vision.locating.bundle import Bundle

VAGUE_FOCAL, VAGUE_TURN = 0.2, 0.1
"""Standard deviation of the focal length as a share of it, and of a turn [rad], from which it is called
vague."""
UNEXPLAINED_SHARE = 0.35
"""Share of the foreground outside of the mechanism, or of the mechanism outside of it, from which there is
advice."""
LEAST_MATCHED, LEAST_INSIDE = 0.55, 0.65
"""Share of outline samples on an edge and coverage inside of the outline above which a pose lies on its
mask."""
LEAST_FITTING = 0.7
"""Share of the key frames in which the mechanism should lie on its mask."""


def scene_advice(bundle: Bundle, std: Mapping[str, float], outside: float, *, varied: bool) -> list[str]:
    """Write the sentences for the user about a located mechanism.

    Args:
        bundle: The refined mechanism over its key frames.
        std: Standard deviations of the camera parameters that the user freed, by name [m, rad, px].
        outside: Share of the foreground outside of the mechanism, or of the mechanism outside of it.
        varied: True where any difference from the background counts as foreground.

    Returns:
        The sentences; none where all is well.
    """
    advice = []
    share = float(np.mean((bundle.matched > LEAST_MATCHED) & (bundle.inside > LEAST_INSIDE)))
    if share < LEAST_FITTING:
        advice.append(
            f"The mechanism lies on its mask in only {share:.0%} of the key frames: look in "
            "diagnosis.png whether the outline is in the right place and what else moves (--roi and "
            "--time-range leave that out), and check the mechanism file."
        )
    vague = [name for name, value in std.items() if value > vague_from(bundle.camera, name)]
    if vague:
        advice.append(
            f"The clip hardly determines {', '.join(vague)}: leave out --free, or give the value with --fix."
        )
    if outside > UNEXPLAINED_SHARE and not varied:
        advice.append(
            f"{min(outside, 1.0):.0%} of what stands out from the background is not the mechanism as it "
            "was found: it may be in the wrong place or of the wrong size, or other things move; look at "
            "diagnosis.png. --roi and --time-range leave other things out; where the background shows parts "
            "of the mechanism, give --background a picture without it."
        )
    return advice


def vague_from(camera: Camera, name: str) -> float:
    """Return the deviation from which a freed camera parameter is called vague [px or rad]; places never are.

    Args:
        camera: The camera.
        name: Name of the parameter.
    """
    if name == "camera.focal":
        return VAGUE_FOCAL * camera.focal
    return VAGUE_TURN if name in CAMERA_TURNS else np.inf
