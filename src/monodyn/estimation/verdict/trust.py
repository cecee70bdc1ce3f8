"""The fit compared with the record: whether it is close enough to be used, and what speaks against it.

A record of angles states its own scatter at best, not how well the mechanism is known; so a fit is doubted
only where it misses the record by more than the scatter *and* by more than a share of the motion. What is
many times the scatter and changes as slowly as the motion is no scatter, however little it is.
"""

from __future__ import annotations

import numpy as np

from monodyn.estimation.fit import Doubt
from monodyn.estimation.record.samples import Data
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum, typical_differences
from monodyn.estimation.verdict.uncertainty import NoiseFactors
from monodyn.estimation.wording import amount, amounts, percent

FAR_SHARE = 0.015
"""Not to be used when a joint's rms residual is above this share of its range (at most one turn) ..."""
FAR_NOISE = 20.0
"""... and above this many times its stated noise."""
SHOWN_SHARE = 0.004
"""What the model lacks shows where a joint's rms residual is above this share of its range ..."""
SHOWN_NOISE = 3.0
"""... and above this many times its stated noise."""
EVEN = (
    "The joints move evenly, or not at all: no force shows in the record, and nothing can be told by it. "
    "Record a free swing."
)
"""Status of a record without accelerations."""
FEWEST_EVEN = 5
"""Fewest samples of a joint that can show whether it moves evenly."""
EVEN_NOISE = 3.0
"""A joint moves evenly where a straight line misses it by at most this many times its noise ..."""
EVEN_SHARE = 2e-3
"""... and by at most this share of its range."""
LOST_SHARE = 0.1
"""Does not follow at all when the typical residual is above this share of the motion's deviation ..."""
LOST_NOISE = 5.0
"""... and above this many times the stated noise."""


def verdict(problem: Problem, optimum: Optimum, rms: dict[str, float], against: NoiseFactors) -> Doubt | None:
    """Decide from its residuals whether a fit can be used.

    It cannot where, for some joint, rms residual > max(20 stated noise, 1.5 % of its range of motion), with a
    range of at most one turn; or typical residual > max(5 stated noise, 10 % of the standard deviation of
    its motion). It holds approximately where rms residual > max(3 stated noise, 0.4 % of the range), and,
    however small against the range, above 20 times the stated noise where it changes as slowly as the motion:
    no scatter does.

    Args:
        problem: The problem, gross errors left out, with the noise as stated.
        optimum: The optimum.
        rms: Root mean square of the residual by joint [rad or m].
        against: The same against the stated noise.

    Returns:
        What speaks against it; None for nothing.
    """
    usual, moved = typical_differences(problem, optimum.trial), problem.data.motion_size
    noise = np.array([_noise(problem.data, j) for j in range(len(usual))])
    unit = np.where(problem.data.slide.any(axis=0), problem.size(optimum.x), 1.0)
    names = [joint.name for joint in problem.mechanism.joints]
    # the typical residual shows a fit that does not follow at all, the rms one that is merely too far off;
    # either must be large against the noise and against the motion, for a record may state too little noise
    share = usual / np.maximum(moved, 1e-12)
    lost = (share > LOST_SHARE) & (usual > LOST_NOISE * noise)
    if lost.any():
        j = int(np.argmax(np.where(lost, share, 0.0)))
        return Doubt(
            "refused",
            f"The simulated motion does not follow the record: typically {names[j]} is off by "
            f"{amount(problem.mechanism, names[j], usual[j] * unit[j])}, {percent(share[j])} of its "
            "motion; check that the mechanism is the one in the record and that no other force acts on it.",
        )
    # rms is in metres of the identified scale, ranges are in the record's units
    residual = np.array([rms[name] for name in names]) / unit
    ranges = np.maximum(motion_ranges(problem), 1e-12)
    against_noise = against.size
    far = (residual > FAR_SHARE * ranges) & (against_noise > FAR_NOISE)
    if far.any():
        j = int(np.argmax(np.where(far, residual / ranges, 0.0)))
        return Doubt(
            "refused",
            f"The simulated motion is too far from the record to be used: rms residual of {names[j]} "
            f"{amount(problem.mechanism, names[j], rms[names[j]])}, "
            f"{percent(residual[j] / ranges[j])} of its range and {against_noise[j]:.3g} times the "
            "noise of its samples; the advice says what model or record may lack.",
        )
    shown = (residual > SHOWN_SHARE * ranges) & (against_noise > SHOWN_NOISE)
    shown |= against.slow & (against_noise > FAR_NOISE)
    if not shown.any():
        return None
    j = int(np.argmax(np.where(shown, residual / ranges, 0.0)))
    return Doubt(
        "approximate",
        f"The simulated motion misses the record by what noise does not explain: rms residual of {names[j]} "
        f"{amount(problem.mechanism, names[j], rms[names[j]])}, {percent(residual[j] / ranges[j])} of its "
        f"range and {against_noise[j]:.3g} times the noise of its samples. The model lacks something, and "
        "parameters may be off by more than their intervals say.",
    )


def moves_evenly(data: Data) -> bool:
    """Return whether straight lines over time follow all joints of all records within their noise.

    Args:
        data: The data, with the noise as stated.
    """
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        for j, use in enumerate(data.measured[first:stop].T):
            rows = first + np.flatnonzero(use)
            # two points always lie on a line
            if len(rows) < FEWEST_EVEN:
                continue
            time = data.times[rows] - data.times[rows].mean()
            slope, middle = np.polyfit(time, data.position[rows, j], 1)
            off = data.position[rows, j] - middle - slope * time
            noise, reach = float(np.median(data.std[rows, j])), float(np.ptp(data.position[rows, j]))
            if np.sqrt(np.mean(off**2)) > min(EVEN_NOISE * noise, EVEN_SHARE * reach):
                return False
    return True


def identified(problem: Problem, rms: dict[str, float]) -> str:
    """Return the sentence that states what was identified from.

    Args:
        problem: The problem, gross errors left out.
        rms: Root mean square of the residual by joint [rad or m].
    """
    frames = int(problem.data.measured.any(axis=1).sum())
    source = f"{frames} frames" + (f" of {problem.data.records} records" if problem.data.records > 1 else "")
    return f"Identified from {source}; rms residual {amounts(problem.mechanism, rms)}."


def motion_ranges(problem: Problem) -> np.ndarray:
    """Return the range of the measured positions of each joint within a record.

    Args:
        problem: Gives the data and the kinds of the joints.

    Returns:
        Ranges in the record's units [rad or m], of a hinge at most one turn, (dof,).
    """
    data = problem.data
    ranges = np.zeros(data.position.shape[1])
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        for j, use in enumerate(data.measured[first:stop].T):
            if use.any():
                ranges[j] = max(ranges[j], float(np.ptp(data.position[first:stop, j][use])))
    hinge = np.array([joint.kind == "hinge" for joint in problem.mechanism.joints])
    return np.where(hinge, np.minimum(ranges, 2.0 * np.pi), ranges)


def _noise(data: Data, dof: int) -> float:
    """Stated noise of one joint, its median [rad or m]."""
    use = data.measured[:, dof]
    return float(np.median(data.std[use, dof])) if use.any() else 0.0
