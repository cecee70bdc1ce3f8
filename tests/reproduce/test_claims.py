"""The verdicts on the claims of the paper, from fits that are off by a known amount."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import DESIGN, FAILED, mechanism, moved, seen
from monodyn.reproduce.cases import CASE_TORQUES, Case, rms
from monodyn.reproduce.claims import CLAIMS, Evidence, claims, degrees, filtered_is_worse, overall


def verdicts(*cases: Case) -> dict[str, Any]:
    """Judge made fits of the default method."""
    found = claims({"fast": seen(), "paper": FAILED}, cases, DESIGN)
    assert all(claim.verdicts["paper"].held is None for claim in found)
    return {claim.text.split()[0] + " " + claim.text.split()[1]: claim.verdicts["fast"] for claim in found}


def test_filtered_states_are_judged_by_the_prediction() -> None:
    def judged(*cases: Case) -> Any:
        return filtered_is_worse(Evidence(replace(seen(), method="paper"), cases, DESIGN))

    worse = judged(moved("I", 1e-3), moved("I", 2e-3, "filtered"))
    assert worse.held is True
    assert worse.numbers == "prediction error 0.115° from filtered states, 0.0573° from unfiltered"
    assert judged(moved("I", 2e-3), moved("I", 1e-3, "filtered")).held is False
    assert judged(moved("I", 1e-3)).held is None
    default = verdicts(moved("I", 1e-3), moved("I", 2e-3, "filtered"))["Filtered states"]
    assert default.held is None
    assert default.numbers == "it does not filter: every pose is weighted with its covariance"


def test_a_fit_that_does_not_follow_its_states_is_named_in_the_verdict() -> None:
    lost = moved("I", 2e-3, "filtered")
    assert lost.fit is not None
    bad: Any = SimpleNamespace(**{**vars(lost.fit), "ok": False})
    evidence = Evidence(replace(seen(), method="paper"), [moved("I", 1e-3), replace(lost, fit=bad)], DESIGN)
    verdict = filtered_is_worse(evidence)
    assert verdict.held is True
    assert verdict.numbers == (
        "prediction error 0.115° from filtered states, 0.0573° from unfiltered; "
        "the fit to filtered states does not follow them"
    )


def test_a_verdict_that_is_missing_says_what_is_missing() -> None:
    untold = {"fast": replace(seen(), errors=None), "paper": FAILED}
    found = claims(untold, [moved("I", 1e-3), moved("III", 1e-3)], DESIGN)
    told = {claim.text.split()[1]: claim.verdicts["fast"].numbers for claim in found}
    assert told["fit"] == told["III"] == "the truth of this clip is not known"
    assert told["II"] == "a fit that it requires is missing"
    assert all(claim.verdicts["paper"].numbers == "a fit that it requires is missing" for claim in found)


def test_the_fit_is_judged_by_its_distance_from_the_truth() -> None:
    near = verdicts(moved("I", 1e-3))["The fit"]
    assert near.held is True
    assert near.numbers == "simulated motion 0.0573° from the truth, poses 0.201°"
    assert verdicts(moved("I", 1e-2))["The fit"].held is False


def test_starts_are_judged_by_parameters_and_motion() -> None:
    """The same parameters do not differ; others with the same motion do; another motion is not equivalent."""
    made = moved("I", 1e-3)
    assert made.fit is not None
    fit: Any = SimpleNamespace(**{**vars(made.fit), "shared": ("link1.thickness", "joint1.damping")})
    first = replace(made, fit=fit)
    again = replace(first, plan=replace(first.plan, start=1))
    same = verdicts(first, again)["Different starts"]
    assert same.held is False
    values = {"joint1.damping": 2.0 * mechanism().values["joint1.damping"]}
    other: Any = SimpleNamespace(**{**vars(fit), "mechanism": mechanism().with_values(values)})
    changed = verdicts(first, replace(again, fit=other))["Different starts"]
    assert changed.held is True
    assert changed.numbers == (
        "2 starts: joint1.damping differs by a factor of 2; of lengths and ratios b1/m1 differs most, by "
        "67 %; largest difference of motion over 80 frames 0°"
    )
    far = replace(moved("I", 2e-1), plan=again.plan, fit=other)
    assert verdicts(first, far)["Different starts"].held is False


@pytest.mark.parametrize(
    ("errors", "held"), [((4e-3, 2e-3, 1e-3), True), ((1e-3, 2e-3, 4e-3), False), ((1e-3, 1e-3, 1e-3), False)]
)
def test_the_number_of_frames_is_judged_on_the_same_late_frames(errors: tuple, held: bool) -> None:
    cases = [moved("I", error, frames=n) for n, error in zip(DESIGN.lengths, errors, strict=True)]
    verdict = verdicts(*cases)["Accuracy grows"]
    assert verdict.held is held
    shown = [f"{n} frames {np.degrees(error):.3g}°" for n, error in zip(DESIGN.lengths, errors, strict=True)]
    assert verdict.numbers == f"error on frames 40 to 79: {', '.join(shown)}"


def test_cases_two_and_three_are_judged() -> None:
    case_two = moved("II", 5e-3)
    good = verdicts(moved("I", 1e-3), case_two, moved("III", 0.0, noise=1.0))
    assert good["Case II"].held is True
    assert good["Case III"].held is True
    noise = f"{np.degrees(overall(rms(seen().errors[:40]))):.3g}°"
    assert good["Case II"].numbers == (
        f"residual {degrees(overall(case_two.residual))}, error against the truth 0.286°, prediction error "
        "0.286° where Case I has 0.0573°"
    )
    assert good["Case III"].numbers == (
        f"residual under 0.001°; {noise} from the truth where the poses are {noise} from it, correlation 1.00"
    )
    bad = verdicts(moved("I", 5e-3), moved("II", 1e-3), moved("III", 0.0))
    assert bad["Case II"].held is False
    assert bad["Case III"].held is False


def test_unknowns_are_compared_with_the_printed_ones() -> None:
    found = verdicts(moved("I", 0.0), moved("II", 0.0), moved("III", 0.0))["There are"]
    assert found.held is None
    assert found.numbers == (
        "Case I 6, Case II 6, Case III 6: it has other unknowns, in addition to the start state"
    )
    fits = [
        replace(c, plan=replace(c.plan, method="paper")) for c in map(partial(moved, error=0.0), CASE_TORQUES)
    ]
    claim = claims({"fast": seen(), "paper": replace(seen(), method="paper")}, fits, DESIGN)[-1]
    assert claim.verdicts["paper"].held is False
    assert claim.verdicts["paper"].numbers == "Case I 6, Case II 6, Case III 6 with k = 40"


def test_every_claim_has_its_place_and_rule() -> None:
    assert [(c.text, c.place, c.rule) for c in CLAIMS] == [
        (
            "Filtered states make the prediction worse than unfiltered ones.",
            "Case I, Fig. 6",
            "the prediction error over the next frames is larger",
        ),
        (
            "The fit of the dynamics filters the noise of the poses out by itself.",
            "Case I",
            "over the fitted frames the simulated motion is nearer to the truth than the poses",
        ),
        (
            "Accuracy grows with the number of frames.",
            "Case I, Fig. 7",
            "on the same late frames the most frames do better than the fewest, rank correlation below −0.5",
        ),
        (
            "Different starts give different parameters but equivalent motion.",
            "Case I",
            "a parameter differs by more than 5 %, no motion by more than 1°",
        ),
        (
            "Case II tracks the estimated poses but deviates.",
            "Case II, Fig. 8",
            "residual below 1°, prediction error above that of Case I",
        ),
        (
            "Case III tracks the estimated poses exactly but follows their noise.",
            "Case III, Fig. 9",
            "residual below a quarter of the poses' error, "
            "with which that of the motion correlates above 0.9",
        ),
        ("There are 6, 36 and 2k + 4 unknowns.", "Cases I, II, III", "the numbers are those"),
    ]
