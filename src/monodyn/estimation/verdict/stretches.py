"""What a refused record still says: a beginning that fits, halves that disagree, a rate that would fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.estimation.fit import Estimate, Fit
from monodyn.estimation.verdict.trust import LOST_SHARE
from monodyn.estimation.wording import amounts, listed
from monodyn.mechanism import Mechanism
from monodyn.types import Poses

APART_STD, APART_SHARE = 5.0, 0.02
"""Estimates from two stretches of a record differ when they are apart by more than this many standard
deviations, and by more than this share of their value."""


def beginning(mechanism: Mechanism, frames: Sequence[int], rms: Mapping[str, float]) -> str:
    """Report that the beginning of a record fits though the whole does not.

    Args:
        mechanism: Gives the joints.
        frames: Frame numbers of the beginning.
        rms: Root mean square of its residual by joint [rad or m].

    Returns:
        The sentence.
    """
    return (
        f"The first {len(frames)} frames alone do fit, with rms residual {amounts(mechanism, rms)}: "
        f"--fit-frames {frames[0]}:{frames[-1] + 1} for a clip, or a table that ends there. Small faults of "
        "the model grow along a long or chaotic record."
    )


def explained(part: Poses, fit: Fit) -> bool:
    """Return whether a fit explains the motion of a stretch, and not merely its stated noise.

    Args:
        part: The stretch, a record.
        fit: Its fit.

    Returns:
        True where the residual of each joint is at most ``LOST_SHARE`` of the deviation of its motion.
    """
    for joint in fit.mechanism.joints:
        at = part.joints.index(joint.name)
        moved = float(np.std(part.position[part.measured[:, at], at]))
        # residuals of slides are in metres of the identified scale
        unit = fit.scale if joint.kind == "slide" else 1.0
        if fit.rms[joint.name] > LOST_SHARE * unit * moved:
            return False
    return True


def disagreeing(one: Fit, other: Fit) -> list[tuple[Estimate, Estimate]]:
    """List the parameters that two stretches of a record determine differently.

    Args:
        one: The fit of a stretch.
        other: The fit of another.

    Returns:
        Both estimates of each, the largest difference first; none where they agree.
    """
    apart = []
    for a, b in zip(one.parameters, other.parameters, strict=True):
        if not (a.free and a.identifiable and b.identifiable) or a.at_bound or b.at_bound:
            continue
        away, size = abs(a.value - b.value), max(abs(a.value), abs(b.value), 1e-300)
        if away > APART_STD * np.hypot(a.std, b.std) and away > APART_SHARE * size:
            apart.append((away / size, a, b))
    return [(a, b) for _, a, b in sorted(apart, key=lambda row: -row[0])]


def disagreement(frames: int, apart: Sequence[tuple[Estimate, Estimate]]) -> str:
    """Report that the beginning of a record fits, but with parameters that do not hold over it.

    Args:
        frames: Frames of the beginning.
        apart: What its halves determine differently, from ``disagreeing``.

    Returns:
        The sentence.
    """
    values = [f"{a.name} {a.value:.3g} and {b.value:.3g} {b.unit}".rstrip() for a, b in apart]
    return (
        f"The first {frames} frames alone do fit, but their halves call for different values "
        f"({listed(values, 3)}): a shorter record would hide the fault; check that the mechanism is the one "
        "in the record, and of a clip that its outline lies where it should (diagnosis.png)."
    )


def other_rate(scale: float, rate: float, given: Sequence[str]) -> str:
    """Return the sentence on gravity and given lengths that contradict the time stamps.

    Args:
        scale: Seconds per stamped second with which the motion fits.
        rate: Samples a second that this makes [Hz].
        given: Names of the lengths that are given.
    """
    return (
        f"Gravity and {listed(given)}, as given, contradict the time stamps; the motion fits at {rate:.3g} "
        f"samples a second (time_scale {scale:.3g}). Give the true rate (--rate for a clip, --free "
        "time_scale for a table), or correct the length."
    )
