"""Claims of the paper about single fits of its three cases, each judged for one method and one pendulum."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from monodyn.reproduce.cases import Case, rms
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
from monodyn.reproduce.plans import FILTERED, FitPlan

TRACKING = np.radians(1.0)
"""A simulated motion tracks the estimated poses when it stays as near as this, rms [rad]."""
EXACT = 0.25
"""It tracks them exactly when it is nearer to them than this share of their own error."""
FOLLOWS = 0.9
"""It follows their noise when its errors and theirs have a correlation above this."""
FORMS = {
    "paper": "with the torques alone, as published",
    "fast": "with friction in addition to the torques, where the published form has the torques alone",
}
"""Form in which each method fits Case III."""
COMPARABLE = 0.20
"""Lengths are comparable to the true ones when they differ by less than this share."""


def filtered_is_worse(evidence: Evidence) -> Verdict:
    """Return whether filtered states give worse predictions than unfiltered ones.

    Args:
        evidence: What one method found.
    """
    if evidence.seen.method == "fast":
        return Verdict(None, "it does not filter: every pose is weighted with its covariance")
    usual = evidence.case()
    # of the filtered fits this is what is asked: only the fit that they are compared with must be usable
    if unusable := refused(usual):
        return unusable
    plain = None if usual is None else evidence.overall(usual.ahead)
    if usual is None or plain is None:
        return FIT_MISSING
    errors, told = {}, []
    for compared, reading in FILTERED.items():
        case = evidence.case(compared=compared)
        error = None if case is None else evidence.overall(case.ahead)
        if case is None or error is None:
            continue
        errors[compared] = error
        lost = "" if case.ok else ", which the fit does not follow"
        told.append(f"{degrees(error)} from filtered states ({reading} filter){lost}")
    # the verdict is that of the equations as printed; the other reading is shown beside it
    if "filtered" not in errors:
        return FIT_MISSING
    return Verdict(
        bool(errors["filtered"] > plain),
        f"prediction error {', '.join(told)}, {degrees(plain)} from unfiltered",
        fits=1 + len(told),
    )


def noise_is_filtered_out(evidence: Evidence) -> Verdict:
    """Return whether the fitted motion is nearer to the truth than the poses that it was fitted to.

    Args:
        evidence: What one method found.
    """
    case = evidence.case()
    if case is None:
        return FIT_MISSING
    if unusable := refused(case):
        return unusable
    if evidence.seen.errors is None:
        return TRUTH_UNKNOWN
    # The poses of the fitted frames alone: later ones were not seen by the fit that they are compared with.
    seen = evidence.overall(rms(evidence.seen.errors[: evidence.design.frames]))
    error = evidence.overall(case.error)
    if seen is None or error is None:
        return FIT_MISSING
    return Verdict(
        error < seen, f"simulated motion {degrees(error)} from the truth, poses {degrees(seen)}", fits=1
    )


def rates_are_better(evidence: Evidence) -> Verdict:
    """Return whether angles and rates together give a better prediction than angles alone.

    Args:
        evidence: What one method found.
    """
    if evidence.seen.method == "fast":
        return Verdict(None, "it compares angles alone, weighted with their covariance")
    plain, both = evidence.case(), evidence.case(compared="rates")
    if unusable := refused(plain, both):
        return unusable
    one = None if plain is None else evidence.overall(plain.ahead)
    other = None if both is None else evidence.overall(both.ahead)
    if one is None or other is None:
        return FIT_MISSING
    return Verdict(
        other < one, f"prediction error {degrees(other)} with rates, {degrees(one)} from angles alone", fits=2
    )


def fourier_deviates(evidence: Evidence) -> Verdict:
    """Return whether Case II tracks the poses and predicts worse than Case I.

    Args:
        evidence: What one method found.
    """
    case, usual = evidence.case("II"), evidence.case()
    if case is None or usual is None:
        return _missing(evidence, "II")
    if unusable := refused(case, usual):
        return unusable
    # To track is a matter of the fitted frames, to deviate one of the frames after them. Both are needed: a
    # series that does not even follow the poses says nothing about its prediction.
    residual, ahead = evidence.overall(case.residual), evidence.overall(case.ahead)
    known, error = evidence.overall(usual.ahead), evidence.overall(case.error)
    if residual is None or ahead is None or known is None:
        return FIT_MISSING
    told = f"residual {degrees(residual)}{near(residual, TRACKING, '1°')}"
    if error is not None:
        told += f", error against the truth {degrees(error)}"
    told += f", prediction error {degrees(ahead)} where Case I has {degrees(known)}"
    return Verdict(bool(residual < TRACKING and ahead > known), told, fits=2)


def _missing(evidence: Evidence, name: str) -> Verdict:
    """Return that a case is missing, with the fit's own reason where it has one."""
    made = [case for case in evidence.cases if case.plan.case == name and case.motion is None]
    return Verdict(None, f"Case {name}: {made[0].status.rstrip('.')}") if made else FIT_MISSING


def free_torque_follows_noise(evidence: Evidence) -> Verdict:
    """Return whether Case III tracks the poses exactly and has their errors.

    Args:
        evidence: What one method found.
    """
    case, seen = evidence.case("III"), evidence.seen
    if case is None or case.motion is None or case.poses is None:
        return _missing(evidence, "III")
    if unusable := refused(case):
        return unusable
    if case.true is None or not seen.hinges:
        return TRUTH_UNKNOWN
    frames, hinges = evidence.design.frames, seen.hinges
    true = case.true[:frames, hinges]
    noise = case.poses[:frames, hinges] - true
    # errors of the fit against those of the poses: a fit that follows the noise has the same ones
    error = case.motion.position[:frames, hinges] - true
    use = np.isfinite(noise)
    together = correlation(noise[use], error[use])
    residual, own, theirs = evidence.overall(case.residual), rms(error), rms(noise)
    if residual is None or own is None or theirs is None:
        return FIT_MISSING
    apart, scatter = (float(np.sqrt(np.mean(part**2))) for part in (own, theirs))
    return Verdict(
        bool(residual < EXACT * scatter and together > FOLLOWS),
        f"residual {degrees(residual)}; {degrees(apart)} from the truth where the poses are "
        f"{degrees(scatter)} from it, correlation {together:.2f}",
        fits=1,
    )


def prediction_needs_torques(evidence: Evidence) -> Verdict:
    """Return whether Case III predicts worse than Case I, because nothing says which torques will act.

    Args:
        evidence: What one method found.
    """
    case, usual = evidence.case("III"), evidence.case()
    if case is None or usual is None:
        return _missing(evidence, "III")
    if unusable := refused(case, usual):
        return unusable
    without, known = evidence.overall(case.ahead), evidence.overall(usual.ahead)
    if without is None or known is None:
        return FIT_MISSING
    return Verdict(
        without > known,
        f"prediction error {degrees(without)} without torques, {degrees(known)} with the friction of Case I; "
        f"fitted {FORMS[evidence.seen.method]}",
        fits=2,
    )


def sizes_are_comparable(evidence: Evidence) -> Verdict:
    """Return whether the lengths of Cases II and III are comparable to the true ones.

    Args:
        evidence: What one method found.
    """
    found = [(name, evidence.case(name)) for name in ("I", "II", "III")]
    if unusable := refused(*(case for name, case in found if name != "I")):
        return unusable
    shares = [(name, _lengths(case)) for name, case in found if case is not None]
    judged = [share for name, lengths in shares if name != "I" for share in lengths.values()]
    if not judged:
        return TRUTH_UNKNOWN if evidence.seen.errors is None else FIT_MISSING
    told = [f"Case {name} {_written(lengths)}" for name, lengths in shares if lengths]
    numbers = "; ".join(told).replace("-", "−")
    nearest = min(judged, key=lambda share: abs(abs(share) - COMPARABLE))
    if near(abs(nearest), COMPARABLE, "20 %"):
        numbers += f"; {100.0 * nearest:+.0f} % is near the limit of 20 %".replace("-", "−")
    if evidence.seen.method == "fast" and any(name == "III" and lengths for name, lengths in shares):
        numbers += "; in Case III it holds the lengths of a fit made before, without the torques"
    return Verdict(all(abs(share) < COMPARABLE for share in judged), numbers, fits=len(told))


def _written(shares: Mapping[str, float]) -> str:
    """Write signed shares in per cent, two digits."""
    parts = [(label, 100.0 * share) for label, share in shares.items()]
    return ", ".join(f"{label} {v:+.0f} %" if abs(v) >= 10.0 else f"{label} {v:+.2g} %" for label, v in parts)


def _lengths(case: Case) -> dict[str, float]:
    """Return the relative errors of the lengths."""
    return {name: share for name, share in (case.parameters or {}).items() if name.startswith("l")}


def unknowns_as_printed(evidence: Evidence) -> Verdict:
    """Return whether the numbers of unknowns are those of the paper.

    Args:
        evidence: What one method found.
    """
    found = [evidence.case(name) for name in ("I", "II", "III")]
    counts = {
        name: case.unknowns for name, case in zip(("I", "II", "III"), found, strict=True) if case is not None
    }
    if not counts:
        return FIT_MISSING
    poses = evidence.seen.poses
    stamps = 0 if poses is None else int(poses.seen[: evidence.design.frames].sum())
    # as printed for two links, with k time stamps in Case III
    expected = {"I": 6, "II": 36, "III": 2 * stamps + 4}
    told = ", ".join(f"Case {name} {count}" for name, count in counts.items())
    if evidence.seen.method != "paper":
        return Verdict(
            None, f"{told}: it has other unknowns, in addition to the start state", fits=len(counts)
        )
    if len(evidence.seen.joints) != 2:
        return Verdict(None, f"{told}; the paper has two links", fits=len(counts))
    told += f" with k = {stamps}"
    if counts.get("II") == 34:
        told += "; with seven terms 2 s1 + 2 s2 + 2 coefficients and 4 sizes are 34, the paper's own formula"
        if all(counts.get(name) == expected[name] for name in ("I", "III")):
            told += ", which 36 alone contradicts: 6 and 2k + 4 hold"
        told += (
            "; 36 with the two dampings, a period for each joint, omega and a phase, a and b for j = 0 to 7, "
            "or two values of the start state"
        )
    both = evidence.made(FitPlan("paper", "II", evidence.design.frames, series="with-friction"))
    if both is not None:
        told += f"; Case II with friction in addition to the series {both.unknowns}"
    return Verdict(counts == expected, told, fits=len(counts))
