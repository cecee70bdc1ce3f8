"""numba kernel: how much the pose that fits an outline follows a change of sizes or of the camera.

A pose is where the outline lies best on its edges. If sizes and camera are a little wrong, the outline of the
best pose is the one that comes nearest to the true outline, along the normals.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from monodyn.solving import eliminate
from monodyn.vision.drawing.edges import POSE_STEP, Shifts, moved_points
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.drawing.silhouette import blank_outlines, draw

PLACES = (0.5 - np.sqrt(1.0 / 12.0), 0.5 + np.sqrt(1.0 / 12.0))
"""Gauss points of an edge, as shares of it: exact for squares of what changes linearly along it."""
RIDGE = 1e-9
"""Share of the largest information about a joint that is added to all, for joints that no edge shows."""


@njit(cache=True, nogil=True)
def pose_gains(rig: Rig, shifts: Shifts, positions: np.ndarray) -> np.ndarray:
    """Differentiate the pose that fits an outline by parameters that the outline was drawn with.

    With the displacements along the normals n = A dq + B dp over all edges of the outline, the pose that
    makes up for a change dp has dq = -(A'A)^-1 A'B dp.

    Args:
        rig: The mechanism and its camera.
        shifts: The same with each parameter shifted.
        positions: Joint positions [rad or m], (frame, dof).

    Returns:
        The derivatives, (frame, dof, param); zero in frames that cannot be drawn.
    """
    frames, dofs = positions.shape
    size = dofs + shifts.steps.shape[0]
    gains, row = np.zeros((frames, dofs, shifts.steps.shape[0])), np.zeros(size)
    outlines = blank_outlines(rig, rig.radius.shape[0])
    for f in range(frames):
        if not draw(rig, positions[f], outlines):
            continue
        px, moved = outlines.px, moved_points(rig, shifts, positions[f], outlines)
        normal = np.zeros((size, size))
        for g in range(outlines.first.shape[0] - 1):
            first, stop = outlines.first[g], outlines.first[g + 1]
            for e in range(first, stop):
                p = outlines.hull[e]
                r = outlines.hull[e + 1 if e + 1 < stop else first]
                dx, dy = px[r, 0] - px[p, 0], px[r, 1] - px[p, 1]
                length = np.sqrt(dx * dx + dy * dy)
                if length < 1e-9:
                    continue
                for share in PLACES:
                    for j in range(size):
                        h = POSE_STEP if j < dofs else shifts.steps[j - dofs]
                        x = (1.0 - share) * (moved[j, p, 0] - px[p, 0]) + share * (moved[j, r, 0] - px[r, 0])
                        y = (1.0 - share) * (moved[j, p, 1] - px[p, 1]) + share * (moved[j, r, 1] - px[r, 1])
                        row[j] = (x * dy - y * dx) / (length * h)
                    for j in range(size):
                        for k in range(size):
                            normal[j, k] += 0.5 * length * row[j] * row[k]
        ridge = RIDGE * np.diag(normal)[:dofs].max() + 1e-300
        own = normal[:dofs, :dofs] + ridge * np.eye(dofs)
        gain = -normal[:dofs, dofs:]
        if not eliminate(own, gain):
            gain[:] = np.nan
        gains[f] = gain
    return gains
