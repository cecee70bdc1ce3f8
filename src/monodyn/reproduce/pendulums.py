"""Pendulums drawn from a seed: other lengths, sections, friction, starts, colours and camera than the
usual one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.reproduce.clip import ClipSettings, Pendulum, faces, simulated

LENGTHS, SECOND = (0.18, 0.27), (0.65, 1.05)
"""Range of the first rod's length [m], and of the second one's as a share of it."""
WIDTHS, THICKNESSES = (0.020, 0.034), (0.004, 0.008)
"""Ranges of the rods' sections [m]."""
DAMPINGS, SECOND_DAMPING = (4e-4, 1.0e-3), (0.3, 0.7)
"""Range of the first hinge's friction [N m s/rad], and of the second one's as a share of it."""
STARTS = ((-0.75, -0.10), (-0.60, 0.40))
"""Ranges of the joint positions at rest [rad]; half of the pendulums start on the other side."""
CAMERAS = ((-0.05, 0.05), (-0.20, -0.14), (1.05, 1.30))
"""Ranges of the camera's place to the right of the hinge, above it and before it [m]."""
BRIGHT, TINT, WALLS = (0.70, 0.95), 0.12, (50.0, 85.0)
"""Ranges of the rods' brightness from 0 to 1, of its part in a colour, and of the wall's from 0 to 255."""
MARGIN = 0.012
"""The pendulum stays so far inside of the picture, as a share of its width."""
MOST_DRAWN = 200
"""Pendulums that are drawn until one stays inside of the picture."""


def drawn_clip(settings: ClipSettings, number: int) -> ClipSettings:
    """Return the clip of one pendulum: the usual one first, then drawn ones.

    Args:
        settings: The usual clip, with the seed of all.
        number: Which pendulum; 0 is the usual one.

    Returns:
        The same clip of another pendulum before another camera, inside of the picture in every frame.
    """
    if number == 0:
        return settings
    rng = np.random.default_rng([settings.seed, number])
    for _ in range(MOST_DRAWN):
        drawn = _drawn(settings, rng)
        if inside(drawn):
            return replace(drawn, seed=settings.seed + number)
    raise AssertionError("no pendulum of these ranges stays inside of the picture")


def _drawn(settings: ClipSettings, rng: np.random.Generator) -> ClipSettings:
    """Draw one pendulum, its colours and its camera, in the picture or not."""

    def pair(low: float, high: float) -> tuple[float, float]:
        first, second = rng.uniform(low, high, 2)
        return float(first), float(second)

    length, damping = rng.uniform(*LENGTHS), np.exp(rng.uniform(*np.log(DAMPINGS)))
    thickness, start = pair(*THICKNESSES), [float(rng.uniform(*limits)) for limits in STARTS]
    if rng.random() < 0.5:
        # the mirror image of a pose: the first angle is measured from the right, the second from the first
        start = [-np.pi - start[0], -start[1]]
    rods = Pendulum(
        length=(float(length), float(length * rng.uniform(*SECOND))),
        width=pair(*WIDTHS),
        thickness=thickness,
        # the rods do not touch: half of each, and two millimetres of air
        layer=sum(thickness) / 2 + 0.002,
        damping=(float(damping), float(damping * rng.uniform(*SECOND_DAMPING))),
        start=(start[0], start[1]),
    )
    x, y, depth = (float(rng.uniform(*limits)) for limits in CAMERAS)
    colours = [np.clip(rng.uniform(*BRIGHT) + rng.uniform(-TINT, TINT, 3), 0.0, 1.0) for _ in range(2)]
    wall = rng.uniform(*WALLS) + rng.uniform(-10.0, 10.0, 3)
    return replace(
        settings,
        pendulum=rods,
        camera=replace(settings.camera, x=x, y=y, depth=depth),
        colour=tuple((float(r), float(g), float(b)) for r, g, b in colours),
        wall=(float(wall[0]), float(wall[1]), float(wall[2])),
    )


def inside(settings: ClipSettings) -> bool:
    """Return whether the pendulum stays inside of the picture in every frame.

    Args:
        settings: Pendulum and camera.
    """
    side = np.array([settings.camera.width, settings.camera.height]) - 1.0
    margin = MARGIN * settings.camera.width
    for position in simulated(settings).position:
        corners = np.concatenate([polygon for rod in faces(settings, position) for polygon, _ in rod])
        if not ((corners > margin) & (corners < side - margin)).all():
            return False
    return True
