"""Claims of the paper about many fits or searches: numbers of frames, periods, starts, poses, time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.reproduce.cases import Case, rms
from monodyn.reproduce.endings import Ending, endings
from monodyn.reproduce.evidence import (
    FIT_MISSING,
    TRUTH_UNKNOWN,
    Evidence,
    Verdict,
    correlation,
    degrees,
    near,
    refused,
)
from monodyn.reproduce.truth import identifiable

RISING = 0.5
"""Accuracy grows when errors and numbers of frames have a rank correlation below the negative of this."""
OTHER = 0.05
"""Parameters of two fits differ when one of them differs by more than this share."""
SAME = np.radians(1.0)
"""Motions of two fits are equivalent when they stay as near as this, rms [rad]."""
CLOSE = np.radians(1.0)
"""Estimated poses are very close to the actual ones when they are as near as this, rms [rad]."""
SEVERAL = 2.0
"""Multiple periods are at least so many."""
RELIABLE = 0.5
"""A prediction becomes reliable when its error falls below this share."""
SUITABLE = np.radians(90.0)
"""Starts up to this far from the pose are suitable ones [rad]."""


def more_frames_are_better(evidence: Evidence) -> Verdict:
    """Return whether fits of more and more frames have smaller errors on the same late frames.

    Args:
        evidence: What one method found.
    """
    numbers, errors = [], []
    for frames in evidence.design.lengths:
        case = evidence.case(frames=frames)
        if unusable := refused(case):
            return unusable
        error = None if case is None else evidence.overall(case.late)
        if error is not None:
            numbers.append(frames)
            errors.append(error)
    if len(errors) < 3:
        return FIT_MISSING
    # the rank of each error; correlated with the order of the lengths this is Spearman's coefficient
    rank = correlation(np.arange(len(errors)), np.argsort(np.argsort(errors)))
    first = evidence.design.longest
    told = ", ".join(f"{n} frames {degrees(e)}" for n, e in zip(numbers, errors, strict=True))
    return Verdict(
        bool(errors[-1] < errors[0] and rank < -RISING),
        f"error on frames {first} to {first + evidence.design.ahead - 1}: {told}",
        fits=len(errors),
    )


def several_periods_are_needed(evidence: Evidence) -> Verdict:
    """Return whether Case II predicts reliably only where the fitted frames hold multiple periods.

    Args:
        evidence: What one method found.
    """
    few, several, told = [], [], []
    for frames in evidence.design.periods:
        case = evidence.case("II", frames=frames)
        error = None if case is None else evidence.overall(case.ahead)
        held = None if case is None else case.periods
        if case is None or held is None or error is None:
            continue
        if unusable := refused(case):
            return unusable
        (several if held >= SEVERAL else few).append(error)
        told.append(f"{degrees(error)} from {frames} frames, {held:.2g} periods of {case.period:.3g} s")
    if not told:
        made = [case for case in evidence.cases if case.plan.case == "II" and case.motion is None]
        return Verdict(None, f"Case II: {made[0].status.rstrip('.')}") if made else FIT_MISSING
    numbers = f"prediction error {', '.join(told)}"
    if not few or not several:
        return Verdict(None, numbers, fits=len(told))
    return Verdict(min(several) < RELIABLE * min(few), numbers, fits=len(told))


def drawn_fits(evidence: Evidence) -> list[Case]:
    """Return the fits from drawn start values that have a motion.

    Args:
        evidence: What one method found.
    """
    found = [evidence.case(start=i) for i in range(1, evidence.design.starts + 1)]
    return [case for case in found if case is not None]


def starts_end_apart(evidence: Evidence) -> Verdict:
    """Return whether searches from different start values end in different places.

    Args:
        evidence: What one method found.
    """
    fits, drawn = drawn_fits(evidence), evidence.design.starts
    if len(fits) < 2 or not evidence.seen.hinges:
        return FIT_MISSING
    places = endings(fits, evidence.seen.hinges)
    # what a fit that does not follow the poses says of the parameters is no estimate
    values = [identifiable(case.fit.mechanism) for case in fits if case.fit is not None and case.ok]
    name, share, factor = _most_different(values)
    told = ended(places, drawn)
    if name:
        told += f"; where the fit follows the poses {name} differs most, by {_difference(share, factor)}"
    return Verdict(len(places) > 1 or share > OTHER, told, starts=drawn)


def ended(places: Sequence[Ending], drawn: int) -> str:
    """Return how many searches ended where, in words.

    Args:
        places: The places, the one with the least residual first.
        drawn: Starts drawn.
    """
    parts = [f"{len(place.cases)} at residual {degrees(place.residual)}" for place in places[:4]]
    parts[0] = parts[0].replace(" at", f" of {drawn} end at", 1)
    others = sum(len(place.cases) for place in places[4:])
    if others:
        parts.append(f"{others} elsewhere, up to {degrees(places[-1].residual)}")
    lost = drawn - sum(len(place.cases) for place in places)
    if lost:
        parts.append(f"{lost} without a motion")
    return ", ".join(parts)


def _most_different(values: Sequence[Mapping[str, float]]) -> tuple[str, float, float]:
    """Return which of the numbers that the motion determines differs most, by what share of its median, and
    the greatest over the least."""
    shares: dict[str, float] = {}
    if len(values) < 2:
        return "", 0.0, 1.0
    for name in values[0]:
        numbers = [found[name] for found in values]
        shares[name] = (max(numbers) - min(numbers)) / max(abs(float(np.median(numbers))), 1e-12)
    most = max(shares, key=lambda name: shares[name])
    numbers = [found[most] for found in values]
    return most, shares[most], max(numbers) / min(numbers) if min(numbers) > 0.0 else np.inf


def _difference(share: float, factor: float) -> str:
    """Write a difference: in per cent of the median, from 100 % on as the greatest over the least."""
    if share < 1.0:
        return "under 0.01 %" if share < 1e-4 else f"{100.0 * share:.2g} %"
    return f"a factor of {factor:.2g}" if factor < np.inf else f"{100.0 * share:.3g} %"


def starts_agree_in_motion(evidence: Evidence) -> Verdict:
    """Return whether fits from different start values move alike.

    Args:
        evidence: What one method found.
    """
    fits, hinges = drawn_fits(evidence), evidence.seen.hinges
    if len(fits) < 2 or not hinges:
        return FIT_MISSING
    best = endings(fits, hinges)[0].cases[0]
    # The motion is compared beyond the fitted frames too: there nothing pulls fits together but the dynamics.
    stop = evidence.design.frames + evidence.design.ahead
    motions = [case.motion.position[:stop] for case in fits if case.motion is not None]
    assert best.motion is not None
    apart = [evidence.overall(rms(motion - best.motion.position[:stop])) or 0.0 for motion in motions]
    near = sum(bool(value < SAME) for value in apart)
    told = f"{near} of {evidence.design.starts} within 1° of the best over {stop} frames, "
    told += f"the farthest {degrees(max(apart))}"
    return Verdict(near == evidence.design.starts, told, starts=evidence.design.starts)


def start_pose_is_unique(evidence: Evidence) -> Verdict:
    """Return whether the search for the first pose ends in the same one from wherever it starts.

    Args:
        evidence: What one method found.
    """
    found = evidence.pose_starts
    if found is None:
        told = "it starts from no pose of the user's: it searches all of them"
        return Verdict(None, told) if evidence.seen.method == "fast" else FIT_MISSING
    told = [
        f"{count} of {found.starts} at {np.degrees(distance):.0f}°"
        for distance, count in zip(found.distances, found.same, strict=True)
    ]
    suitable = [count for d, count in zip(found.distances, found.same, strict=True) if d <= SUITABLE + 1e-9]
    return Verdict(
        all(count == found.starts for count in suitable),
        f"same pose from {', '.join(told)}",
        starts=found.starts * len(found.distances),
    )


def poses_are_close(evidence: Evidence) -> Verdict:
    """Return whether the estimated poses are very close to the actual ones.

    Args:
        evidence: What one method found.
    """
    seen = evidence.seen
    if seen.poses is None:
        return Verdict(None, f"no poses: {seen.status}")
    if seen.errors is None:
        return TRUTH_UNKNOWN
    error, frames = evidence.overall(rms(seen.errors)), int(seen.poses.seen.sum())
    known = int(np.isfinite(seen.errors).all(axis=1).sum())
    if error is None:
        return TRUTH_UNKNOWN
    most = float(np.nanmax(np.abs(seen.errors[:, seen.hinges])))
    told = f"{degrees(error)}{near(error, CLOSE, '1°')} rms over {known} of {len(seen.poses)} frames, "
    told += f"at most {degrees(most)}"
    if known < frames:
        told += f"; {frames} have a pose, of the others the truth is not known"
    return Verdict(bool(error < CLOSE and frames == len(seen.poses)), told, frames=known)


def fast_enough_in_time(evidence: Evidence) -> Verdict:
    """Return whether an implementation that is compiled follows the motion in real time.

    Args:
        evidence: What one method found.
    """
    seen, usual = evidence.seen, evidence.case()
    if seen.poses is None:
        return Verdict(None, f"no poses: {seen.status}")
    told = (
        f"{1e3 * seen.seconds_a_frame:.3g} ms a frame where frames are {1e3 * evidence.interval:.3g} ms "
        f"apart; first pose {seen.seconds_locate:.2g} s"
    )
    if usual is not None:
        told += f", Case I {usual.seconds:.2g} s"
    if evidence.processes > 1:
        told += f"; {evidence.processes} processes, each with a pendulum, share the processor"
    return Verdict(0.0 < seen.seconds_a_frame < evidence.interval, told, frames=len(seen.poses))
