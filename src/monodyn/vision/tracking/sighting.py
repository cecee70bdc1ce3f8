"""numba kernels: what an outline that was moved onto a mask says of each link and of each joint.

A link lies on the mask where most of its outline samples have an edge nearby and most of what is just inside
is covered. A joint was seen where the links that lie on the mask determine it.
"""

# elements of typed arrays are arrays to the type checker and numbers to numba
# pyright: reportArgumentType=false
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from monodyn.solving import inverted
from monodyn.uncounted import UNCOUNTED
from monodyn.vision.drawing.edges import BEHIND, COVERED, NEAR, SAMPLES, SQUARES, TRUST
from monodyn.vision.drawing.follow import EdgeSearch, MoveLimits, follow_kernel
from monodyn.vision.drawing.rig import Rig
from monodyn.vision.foreground.masks import View

CORRELATION = 2.0
"""Neighbouring edge samples share the codec's blocks: their errors count as if there were half as many."""
LEAST_NOISE_PX = 0.05
"""Least standard deviation of an edge sample [px]."""
LEAST_SAMPLES = 8
"""Outline samples below which a link was not seen."""
LEAST_SHOWN = 0.25
"""Share of a link's outline that stands out from the other links below which the link was not seen: where
they cover it, it seems to lie on the mask whatever its pose, unless it has a colour of its own."""
OF_A_LINK = 0.8
"""Share of ``matched`` and ``inside`` that a single link must reach: it varies more than the whole."""
DETERMINED = 0.3
"""A joint that the mask determines less well than this share of the move limit was not seen."""
UNSURE = 8.0
"""A joint whose standard deviation is this many times the usual one is mostly hidden, and was not seen."""
USUAL_GAIN = 0.1
"""Share of a frame in what is usual."""


class Rule(NamedTuple):
    """What a link and a joint are judged by.

    Attributes:
        matched: Least share of outline samples on an edge.
        inside: Least mean coverage just inside of the outline.
        move: Move limit of each joint, (dof,).
        coloured: True for the links that show in planes in which no other link shows, bool (dof,).
    """

    matched: float
    inside: float
    move: np.ndarray
    coloured: np.ndarray


@njit(cache=True, nogil=True)
def sighted(
    planes: np.ndarray,
    view: View,
    rig: Rig,
    start: np.ndarray,
    limits: MoveLimits,
    search: EdgeSearch,
    margin: float,
    rule: Rule,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, bool]:
    """Move a pose onto a mask, and judge each link and joint.

    Args:
        planes: Mask by colour, uint8 (colour, height, width).
        view: How its planes are to be read.
        rig: The mechanism and its camera.
        start: Joint positions to start from, (dof,).
        limits: What holds the pose.
        search: How the edges are looked for.
        margin: How far around the outline of the start the mask is known [px].
        rule: What links and joints are judged by.

    Returns:
        Joint positions (dof,) and covariance (dof, dof) from all links; the joints that the mask determines
        and the links that lie on it, each bool (dof,); how well the outline does, 0 to 2; and whether only
        the known part of the mask was looked at, see ``follow_kernel``.
    """
    q, information, links, kept = follow_kernel(planes, view, rig, start, limits, search, margin)
    covariance, joints, score = _weighed(information, links, rule)
    return q, covariance, joints, _lying(links, rule), score, kept


@njit(cache=True)
def _lying(links: np.ndarray, rule: Rule) -> np.ndarray:
    """Return which links lie on the mask, bool (dof,), from what is found on each (dof, column)."""
    shown = np.zeros(links.shape[0], dtype=np.bool_)
    for i in range(links.shape[0]):
        found = links[i]
        trust = max(found[TRUST], 1e-9)
        stands_out = found[SAMPLES] >= LEAST_SHOWN * (found[SAMPLES] + found[BEHIND])
        shown[i] = (
            found[SAMPLES] >= LEAST_SAMPLES
            and (rule.coloured[i] or stands_out)
            and found[NEAR] >= OF_A_LINK * rule.matched * trust
            and found[COVERED] >= OF_A_LINK * rule.inside * trust
        )
    return shown


@njit(cache=True)
def _weighed(information: np.ndarray, links: np.ndarray, rule: Rule) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the covariance of a pose, from its information for unit noise (dof, dof) and what is found on
    each link (dof, column); which joints the picture determines, none where the outline as a whole does not
    lie on the mask; and how well it does."""
    trust, near = max(links[:, TRUST].sum(), 1e-9), links[:, NEAR].sum()
    matched, inside = near / trust, links[:, COVERED].sum() / trust
    noise = CORRELATION * max(links[:, SQUARES].sum() / max(near, 1e-9), LEAST_NOISE_PX * LEAST_NOISE_PX)
    known = information / noise
    # where the picture does not show a joint, the move limit is all that is known of it
    for j in range(known.shape[0]):
        known[j, j] += 1.0 / (rule.move[j] * rule.move[j])
    covariance = inverted(known)
    joints = np.zeros(known.shape[0], dtype=np.bool_)
    if matched >= rule.matched and inside >= rule.inside:
        for j in range(known.shape[0]):
            joints[j] = np.sqrt(covariance[j, j]) < DETERMINED * rule.move[j]
    return covariance, joints, matched + inside


@njit(cache=True, nogil=True)
def sure(covariance: np.ndarray, joints: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Return which of the joints are about as well determined as they usually are, bool (dof,).

    Args:
        covariance: Covariance of the pose, (dof, dof).
        joints: The joints, bool (dof,).
        usual: Their usual standard deviation, NaN where there is none, (dof,).
    """
    seen = joints.copy()
    for j in range(len(seen)):
        seen[j] = seen[j] and not np.sqrt(covariance[j, j]) > UNSURE * usual[j]
    return seen


@njit(cache=True, nogil=True, **UNCOUNTED)
def take_as_usual(covariance: np.ndarray, usual: np.ndarray) -> None:
    """Take the standard deviation of a pose into what is usual.

    Args:
        covariance: Its covariance, (dof, dof).
        usual: Changed in place, NaN before the first, (dof,).
    """
    for j in range(len(usual)):
        std = np.sqrt(covariance[j, j])
        usual[j] = std if np.isnan(usual[j]) else usual[j] + USUAL_GAIN * (std - usual[j])
