"""The verdicts on claims about single fits, from fits that are off by a known amount."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from experiments import evidence, lost, moved, seen
from monodyn.reproduce.case_claims import (
    filtered_is_worse,
    fourier_deviates,
    free_torque_follows_noise,
    noise_is_filtered_out,
    prediction_needs_torques,
    rates_are_better,
    sizes_are_comparable,
    unknowns_as_printed,
)
from monodyn.reproduce.cases import Case
from monodyn.reproduce.evidence import FIT_MISSING, TRUTH_UNKNOWN, Verdict, degrees
from monodyn.reproduce.plans import FitPlan


def published(name: str, error: float, **more: Any) -> Case:
    """Return a fit of the published method that is off by a known amount."""
    return moved(name, error, method="paper", **more)


def judged(judge: Any, *cases: Case) -> Verdict:
    """Judge made fits of the published method."""
    return judge(evidence(*cases, method="paper"))


def test_filtered_states_are_judged_by_the_prediction() -> None:
    both = published("I", 2e-3, compared="filtered"), published("I", 3e-3, compared="consistent")
    worse = judged(filtered_is_worse, published("I", 1e-3), *both)
    assert worse.held is True
    assert worse.fits == 3
    assert worse.numbers == (
        "prediction error 0.115° from filtered states (printed filter), 0.172° from filtered states "
        "(consistent filter), 0.0573° from unfiltered"
    )
    assert judged(filtered_is_worse, published("I", 2.5e-3), *both).held is False
    assert judged(filtered_is_worse, published("I", 1e-3)) == FIT_MISSING
    # the consistent filter alone does not decide
    assert judged(filtered_is_worse, published("I", 1e-3), both[1]) == FIT_MISSING
    default = filtered_is_worse(evidence(moved("I", 1e-3)))
    assert default == Verdict(None, "it does not filter: every pose is weighted with its covariance")


def test_a_fit_that_does_not_follow_its_states_is_named_in_the_verdict() -> None:
    off = published("I", 2e-3, compared="filtered")
    bad: Any = SimpleNamespace(**{**vars(off.fit), "ok": False})
    verdict = judged(filtered_is_worse, published("I", 1e-3), replace(off, fit=bad))
    assert verdict.numbers == (
        "prediction error 0.115° from filtered states (printed filter), which the fit does not follow, "
        "0.0573° from unfiltered"
    )


def test_the_fit_is_judged_by_its_distance_from_the_truth() -> None:
    near = judged(noise_is_filtered_out, published("I", 1e-3))
    assert near == Verdict(True, "simulated motion 0.0573° from the truth, poses 0.201°", fits=1)
    assert judged(noise_is_filtered_out, published("I", 1e-2)).held is False
    assert noise_is_filtered_out(lost()) == FIT_MISSING
    untold = replace(evidence(moved("I", 1e-3)), seen=replace(seen(), errors=None))
    assert noise_is_filtered_out(untold) == TRUTH_UNKNOWN


def test_rates_are_judged_by_the_prediction() -> None:
    better = judged(rates_are_better, published("I", 2e-3), published("I", 1e-3, compared="rates"))
    assert better == Verdict(True, "prediction error 0.0573° with rates, 0.115° from angles alone", fits=2)
    assert rates_are_better(evidence(moved("I", 1e-3))).held is None


def test_case_two_tracks_and_deviates() -> None:
    good = judged(fourier_deviates, published("I", 1e-3), published("II", 5e-3))
    assert good.held is True
    assert good.numbers.endswith(
        "error against the truth 0.286°, prediction error 0.286° where Case I has 0.0573°"
    )
    assert judged(fourier_deviates, published("I", 5e-3), published("II", 1e-3)).held is False
    refused = Case(FitPlan("paper", "II", 40, series="alone"), "No period.")
    assert judged(fourier_deviates, published("I", 1e-3), refused) == Verdict(None, "Case II: No period")


def test_case_three_follows_the_noise_and_needs_its_torques() -> None:
    noisy = judged(free_torque_follows_noise, published("III", 0.0, noise=1.0))
    assert noisy.held is True
    assert noisy.numbers.startswith("residual under 0.001°; ")
    assert noisy.numbers.endswith("correlation 1.00")
    assert judged(free_torque_follows_noise, published("III", 0.0)).held is False
    needed = judged(prediction_needs_torques, published("I", 1e-3), published("III", 0.1))
    assert needed == Verdict(
        True,
        "prediction error 5.73° without torques, 0.0573° with the friction of Case I; fitted with the "
        "torques alone, as published",
        fits=2,
    )
    default = prediction_needs_torques(evidence(moved("I", 1e-3), moved("III", 0.1)))
    assert default.numbers.endswith(
        "; fitted with friction in addition to the torques, where the published form has the torques alone"
    )


def test_a_fit_that_cannot_be_used_decides_nothing() -> None:
    def unusable(case: Case) -> Case:
        fit: Any = SimpleNamespace(**{**vars(case.fit), "ok": False})
        return replace(case, fit=fit, status="It does not follow.")

    one, two, three = (published(name, 1e-3) for name in ("I", "II", "III"))
    told = Verdict(None, "the fit of Case II cannot be used: It does not follow")
    assert judged(fourier_deviates, one, unusable(two)) == told
    assert judged(sizes_are_comparable, unusable(two), three) == told
    told = Verdict(None, "the fit of Case I cannot be used: It does not follow")
    for judge in (noise_is_filtered_out, fourier_deviates, prediction_needs_torques, filtered_is_worse):
        assert judged(judge, unusable(one), two, three) == told
    told = Verdict(None, "the fit of Case III cannot be used: It does not follow")
    assert judged(free_torque_follows_noise, unusable(three)) == told


def test_sizes_are_comparable_within_a_fifth() -> None:
    def sized(name: str, share: float) -> Case:
        return replace(published(name, 1e-3), parameters={"l1": share, "l2": 0.0, "m2/m1": 3.0})

    near = judged(sizes_are_comparable, sized("I", 0.5), sized("II", 0.1), sized("III", -0.19))
    assert near == Verdict(
        True,
        "Case I l1 +50 %, l2 +0 %; Case II l1 +10 %, l2 +0 %; Case III l1 −19 %, l2 +0 %; −19 % is near the "
        "limit of 20 %",
        fits=3,
    )
    assert judged(sizes_are_comparable, sized("II", 0.1), sized("III", 0.21)).held is False
    assert judged(sizes_are_comparable, published("I", 1e-3)) == FIT_MISSING
    held = replace(moved("III", 1e-3), parameters={"l1": 0.0})
    assert sizes_are_comparable(evidence(held)).numbers == (
        "Case III l1 +0 %; in Case III it holds the lengths of a fit made before, without the torques"
    )


def test_unknowns_are_compared_with_the_printed_ones() -> None:
    def counted(name: str, count: int) -> Case:
        case = published(name, 0.0)
        fit: Any = SimpleNamespace(**{**vars(case.fit), "shared": ("x",) * count})
        return replace(case, fit=fit)

    fits = counted("I", 6), counted("II", 36), counted("III", 84)
    assert judged(unknowns_as_printed, *fits) == Verdict(
        True, "Case I 6, Case II 36, Case III 84 with k = 40", fits=3
    )
    by_formula = judged(unknowns_as_printed, counted("I", 6), counted("II", 34), counted("III", 84))
    assert by_formula.held is False
    assert by_formula.numbers.endswith(
        "; with seven terms 2 s1 + 2 s2 + 2 coefficients and 4 sizes are 34, the paper's own formula, "
        "which 36 alone contradicts: 6 and 2k + 4 hold; 36 "
        "with the two dampings, a period for each joint, omega and a phase, a and b for j = 0 to 7, or two "
        "values of the start state"
    )
    default = unknowns_as_printed(evidence(moved("I", 0.0)))
    assert default.held is None
    assert default.numbers == "Case I 6: it has other unknowns, in addition to the start state"


def test_angles_are_written_with_three_digits() -> None:
    assert degrees(np.radians(0.12345)) == "0.123°"
    assert degrees(1e-9) == "under 0.001°"
    assert degrees(0.0) == "0°"
