"""The claims of the 2012 paper, each with the numbers that decide whether it held here.

A claim has a rule, fixed before the numbers are known, and a function that judges one method by it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monodyn.reproduce.cases import Case, Design, identifiable, rms
from monodyn.reproduce.vision import BOTH_METHODS, Seen

TRACKING = np.radians(1.0)
"""A simulated motion tracks the estimated poses when it stays as near as this, rms [rad]."""
EXACT = 0.25
"""It tracks them exactly when it is nearer to them than this share of their own error."""
FOLLOWS = 0.9
"""It follows their noise when its errors and theirs have a correlation above this."""
RISING = 0.5
"""Accuracy grows when errors and numbers of frames have a rank correlation below the negative of this."""
OTHER = 0.05
"""Parameters of two fits differ when one of them differs by more than this share."""
SAME = np.radians(1.0)
"""Motions of two fits are equivalent when they stay as near as this, rms [rad]."""


@dataclass(frozen=True)
class Verdict:
    """Whether a claim held for one method.

    Attributes:
        held: True or False; None where it cannot be decided.
        numbers: What decides it.
    """

    held: bool | None
    numbers: str


@dataclass(frozen=True)
class Claim:
    """A claim of the paper.

    Attributes:
        text: The claim.
        place: Where the paper makes it.
        rule: When it counts as held here.
        verdicts: The verdict by method.
    """

    text: str
    place: str
    rule: str
    verdicts: Mapping[str, Verdict]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Everything one method found.

    Attributes:
        seen: What it saw.
        cases: Its fits.
        design: What was fitted.
    """

    seen: Seen
    cases: Sequence[Case]
    design: Design

    def case(self, name: str = "I", states: str = "measured", frames: int = 0, start: int = 0) -> Case | None:
        """Return one fit that has a motion, or None.

        Args:
            name: ``I``, ``II`` or ``III``.
            states: ``measured`` or ``filtered``.
            frames: Fitted frames; 0 is the usual number.
            start: Number of the start values.
        """
        wanted = (name, states, frames or self.design.frames, start)
        for case in self.cases:
            plan = case.plan
            if (plan.case, plan.states, plan.frames, plan.start) == wanted and case.motion is not None:
                return case
        return None


FIT_MISSING = Verdict(None, "a fit that it requires is missing")
TRUTH_UNKNOWN = Verdict(None, "the truth of this clip is not known")


def claims(seen: Mapping[str, Seen], cases: Sequence[Case], design: Design) -> list[Claim]:
    """Return every claim with its verdict for both methods.

    Args:
        seen: What each method saw.
        cases: All fits.
        design: What was fitted.
    """
    evidence = {
        method: Evidence(seen[method], [c for c in cases if c.plan.method == method], design)
        for method in BOTH_METHODS
    }
    return [
        Claim(c.text, c.place, c.rule, {method: c.judge(evidence[method]) for method in BOTH_METHODS})
        for c in CLAIMS
    ]


def overall(error: np.ndarray | None) -> float | None:
    """Return one rms over all joints [rad].

    Args:
        error: Rms by joint, (dof,), or None.
    """
    return None if error is None else float(np.sqrt(np.mean(error**2)))


def degrees(value: float) -> str:
    """Return an angle in degrees with three digits, as text.

    Args:
        value: The angle [rad].
    """
    shown = float(np.degrees(value))
    return f"{shown:.3g}°" if shown == 0.0 or shown >= 1e-3 else "under 0.001°"


def filtered_is_worse(evidence: Evidence) -> Verdict:
    """Return whether filtered states give worse predictions than unfiltered ones.

    Args:
        evidence: What one method found.
    """
    if evidence.seen.method == "fast":
        return Verdict(None, "it does not filter: every pose is weighted with its covariance")
    plain, smooth = evidence.case(), evidence.case(states="filtered")
    if plain is None or smooth is None:
        return FIT_MISSING
    a, b = overall(plain.ahead), overall(smooth.ahead)
    if a is None or b is None:
        return FIT_MISSING
    told = f"prediction error {degrees(b)} from filtered states, {degrees(a)} from unfiltered"
    for case, which in ((smooth, "filtered"), (plain, "unfiltered")):
        if case.fit is not None and not case.fit.ok:
            told += f"; the fit to {which} states does not follow them"
    return Verdict(b > a, told)


def noise_is_filtered_out(evidence: Evidence) -> Verdict:
    """Return whether the fitted motion is nearer to the truth than the poses that it was fitted to.

    Args:
        evidence: What one method found.
    """
    case = evidence.case()
    if case is None:
        return FIT_MISSING
    if evidence.seen.errors is None:
        return TRUTH_UNKNOWN
    # The poses of the fitted frames alone: later ones were not seen by the fit that they are compared with.
    seen = overall(rms(evidence.seen.errors[: evidence.design.frames]))
    error = overall(case.error)
    if seen is None or error is None:
        return FIT_MISSING
    return Verdict(error < seen, f"simulated motion {degrees(error)} from the truth, poses {degrees(seen)}")


def more_frames_are_better(evidence: Evidence) -> Verdict:
    """Return whether fits of more and more frames have smaller errors on the same late frames.

    Args:
        evidence: What one method found.
    """
    numbers, errors = [], []
    for frames in evidence.design.lengths:
        case = evidence.case(frames=frames)
        error = None if case is None else overall(case.late)
        if error is not None:
            numbers.append(frames)
            errors.append(error)
    if len(errors) < 3:
        return FIT_MISSING
    # the rank of each error; correlated with the order of the lengths this is Spearman's coefficient
    rank = _correlation(np.arange(len(errors)), np.argsort(np.argsort(errors)))
    first = max(evidence.design.lengths)
    told = ", ".join(f"{n} frames {degrees(e)}" for n, e in zip(numbers, errors, strict=True))
    return Verdict(
        bool(errors[-1] < errors[0] and rank < -RISING),
        f"error on frames {first} to {first + evidence.design.ahead - 1}: {told}",
    )


def starts_agree_in_motion(evidence: Evidence) -> Verdict:
    """Return whether different start values give different parameters and the same motion.

    Args:
        evidence: What one method found.
    """
    found = [evidence.case(start=i) for i in range(evidence.design.starts)]
    fits = [(c.fit, c.motion) for c in found if c is not None and c.fit is not None and c.motion is not None]
    if len(fits) < 2:
        return FIT_MISSING
    # The motion is compared beyond the fitted frames too: there nothing pulls fits together but the dynamics.
    stop = evidence.design.frames + evidence.design.ahead
    motions = np.array([motion.position[:stop] for _, motion in fits])
    apart = max(overall(rms(motion - motions[0])) or 0.0 for motion in motions[1:])
    factor = parameter_factors([fit.mechanism.values for fit, _ in fits], fits[0][0].shared)
    most = max(factor, key=lambda name: factor[name])
    told = f"{len(fits)} starts: {most} differs by a factor of {factor[most]:.3g}"
    if evidence.seen.errors is not None:
        told += _ratios([identifiable(fit.mechanism) for fit, _ in fits])
    told += f"; largest difference of motion over {stop} frames {degrees(apart)}"
    return Verdict(bool(factor[most] > 1.0 + OTHER and apart < SAME), told)


def _ratios(values: Sequence[Mapping[str, float]]) -> str:
    """Write the largest difference between fits in what the motion determines."""
    shares = {}
    for name in values[0]:
        numbers = [found[name] for found in values]
        shares[name] = (max(numbers) - min(numbers)) / max(abs(float(np.mean(numbers))), 1e-12)
    most = max(shares, key=lambda name: shares[name])
    share = f"{100.0 * shares[most]:.2g} %" if shares[most] >= 1e-4 else "under 0.01 %"
    return f"; of lengths and ratios {most} differs most, by {share}"


def parameter_factors(values: Sequence[Mapping[str, float]], names: Sequence[str]) -> dict[str, float]:
    """Return by what factor each unknown differs between fits.

    Args:
        values: Parameter values of each fit.
        names: Unknowns; names that are not parameters are left out.
    """
    found = {}
    for name in names:
        if name in values[0]:
            numbers = [abs(v[name]) for v in values]
            # a damping may end at zero, where no factor exists
            found[name] = max(numbers) / max(min(numbers), 1e-12)
    return found


def fourier_deviates(evidence: Evidence) -> Verdict:
    """Return whether Case II tracks the poses and predicts worse than Case I.

    Args:
        evidence: What one method found.
    """
    case, usual = evidence.case("II"), evidence.case()
    if case is None or usual is None:
        return FIT_MISSING
    # To track is a matter of the fitted frames, to deviate one of the frames after them. Both are needed: a
    # series that does not even follow the poses says nothing about its prediction.
    residual, ahead, known = overall(case.residual), overall(case.ahead), overall(usual.ahead)
    if residual is None or ahead is None or known is None:
        return FIT_MISSING
    error = overall(case.error)
    told = f"residual {degrees(residual)}"
    if error is not None:
        told += f", error against the truth {degrees(error)}"
    told += f", prediction error {degrees(ahead)} where Case I has {degrees(known)}"
    if case.clip_period:
        told += "; the period is from the whole clip, predicted frames included"
    return Verdict(bool(residual < TRACKING and ahead > known), told)


def free_torque_follows_noise(evidence: Evidence) -> Verdict:
    """Return whether Case III tracks the poses exactly and has their errors.

    Args:
        evidence: What one method found.
    """
    case, seen = evidence.case("III"), evidence.seen
    if case is None or case.motion is None or seen.poses is None:
        return FIT_MISSING
    if seen.errors is None:
        return TRUTH_UNKNOWN
    frames = evidence.design.frames
    noise = seen.errors[:frames]
    # errors of the fit against those of the poses: a fit that follows the noise has the same ones
    true = seen.poses.position[:frames] - noise
    error = case.motion.position[:frames] - true
    use = np.isfinite(noise)
    together = _correlation(noise[use], error[use])
    residual = overall(case.residual)
    if residual is None:
        return FIT_MISSING
    own, theirs = overall(rms(error)) or 0.0, overall(rms(noise)) or 0.0
    return Verdict(
        bool(residual < EXACT * theirs and together > FOLLOWS),
        f"residual {degrees(residual)}; {degrees(own)} from the truth where the poses are {degrees(theirs)} "
        f"from it, correlation {together:.2f}",
    )


def unknowns_as_printed(evidence: Evidence) -> Verdict:
    """Return whether the numbers of unknowns are those of the paper.

    Args:
        evidence: What one method found.
    """
    found = [evidence.case(name) for name in ("I", "II", "III")]
    if any(case is None for case in found):
        return FIT_MISSING
    counts = [case.unknowns for case in found if case is not None]
    poses = evidence.seen.poses
    stamps = 0 if poses is None else int(poses.seen[: evidence.design.frames].sum())
    # as printed for two links, with k time stamps in Case III
    expected = [6, 36, 2 * stamps + 4]
    told = ", ".join(f"Case {n} {c}" for n, c in zip(("I", "II", "III"), counts, strict=True))
    if evidence.seen.method != "paper":
        return Verdict(None, f"{told}: it has other unknowns, in addition to the start state")
    return Verdict(counts == expected, f"{told} with k = {stamps}")


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return Pearson's correlation; 0 where one of the two is constant."""
    if np.std(a) == 0.0 or np.std(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


class Criterion(NamedTuple):
    """How a claim is judged.

    Attributes:
        text: The claim.
        place: Where the paper makes it.
        rule: When it counts as held here.
        judge: Judges what one method found.
    """

    text: str
    place: str
    rule: str
    judge: Callable[[Evidence], Verdict]


CLAIMS = (
    Criterion(
        "Filtered states make the prediction worse than unfiltered ones.",
        "Case I, Fig. 6",
        "the prediction error over the next frames is larger",
        filtered_is_worse,
    ),
    Criterion(
        "The fit of the dynamics filters the noise of the poses out by itself.",
        "Case I",
        "over the fitted frames the simulated motion is nearer to the truth than the poses",
        noise_is_filtered_out,
    ),
    Criterion(
        "Accuracy grows with the number of frames.",
        "Case I, Fig. 7",
        "on the same late frames the most frames do better than the fewest, rank correlation below −0.5",
        more_frames_are_better,
    ),
    Criterion(
        "Different starts give different parameters but equivalent motion.",
        "Case I",
        "a parameter differs by more than 5 %, no motion by more than 1°",
        starts_agree_in_motion,
    ),
    Criterion(
        "Case II tracks the estimated poses but deviates.",
        "Case II, Fig. 8",
        "residual below 1°, prediction error above that of Case I",
        fourier_deviates,
    ),
    Criterion(
        "Case III tracks the estimated poses exactly but follows their noise.",
        "Case III, Fig. 9",
        "residual below a quarter of the poses' error, correlation of the two errors above 0.9",
        free_torque_follows_noise,
    ),
    Criterion(
        "There are 6, 36 and 2k + 4 unknowns.",
        "Cases I, II, III",
        "the numbers are those",
        unknowns_as_printed,
    ),
)
"""Every claim, in the order of the page."""
