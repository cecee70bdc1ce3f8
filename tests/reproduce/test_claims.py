"""Claims: judged with every pendulum, and what they rest on."""

from __future__ import annotations

from experiments import evidence, lost, moved
from monodyn.reproduce.claims import CLAIMS, Judgement, claims
from monodyn.reproduce.evidence import Verdict


def test_a_judgement_counts_pendulums_fits_starts_and_frames() -> None:
    found = Judgement((Verdict(True, "", fits=1, starts=5), Verdict(False, "", fits=2), Verdict(None, "")))
    assert (found.held, found.decided, found.words) == (1, 2, "held in 1 of 2")
    assert found.basis == "2 pendulums, 3 fits, 5 starts"
    assert Judgement((Verdict(True, "", frames=1),)).basis == "1 pendulum, 1 frame"
    nothing = Judgement((Verdict(None, ""),))
    assert (nothing.words, nothing.basis) == ("no verdict", "")


def test_every_claim_is_judged_with_every_pendulum() -> None:
    both = {"paper": lost(), "fast": evidence(moved("I", 1e-3))}
    found = claims([both, both])
    assert len(found) == len(CLAIMS) >= 11
    assert all(len(claim.judged[method].verdicts) == 2 for claim in found for method in both)
    assert all(claim.judged["paper"].decided == 0 for claim in found)


def test_every_claim_has_its_place_and_rule() -> None:
    assert [(c.text, c.place, c.rule) for c in CLAIMS] == [
        (
            "Any suitable start of the first pose leads to the same pose.",
            "Discussion",
            "the search (3) ends within 2° of the pose from every start up to 90° away",
        ),
        (
            "The estimated pose is very close to the actual pose.",
            "Case I, Fig. 5 and 7",
            "every frame has a pose, and they are within 1° of the truth, rms",
        ),
        (
            "A faster implementation might follow the motion in real time.",
            "Discussion",
            "the median time for a pose is below the time between two frames",
        ),
        (
            "Filtered states make the prediction worse than unfiltered ones.",
            "Case I, Fig. 6",
            "the prediction error over the next frames is larger with the filter as printed",
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
            "The estimate is sensitive to where the search starts.",
            "Case I",
            "drawn starts end in more than one place, or a length or ratio differs by more than 5 %",
        ),
        (
            "Whatever the start, the system that is found moves equivalently.",
            "Case I, Fig. 7",
            "from every drawn start the motion, fitted and predicted, stays within 1° of the best",
        ),
        (
            "Angles and their derivatives together improve the estimate.",
            "Discussion",
            "the prediction error over the next frames is smaller",
        ),
        (
            "Case II tracks the estimated poses but deviates.",
            "Case II, Fig. 8",
            "residual below 1°, prediction error above that of Case I",
        ),
        (
            "Case II predicts reliably only from poses over multiple periods.",
            "Case II",
            "with two periods or more in the fitted frames the prediction error is less than half of that "
            "with fewer",
        ),
        (
            "Case III tracks the estimated poses exactly but follows their noise.",
            "Case III, Fig. 9",
            "residual below a quarter of the poses' error, correlation of the two errors above 0.9",
        ),
        (
            "In Case III the prediction requires the torques.",
            "Case III",
            "without them the prediction error is larger than with the friction of Case I",
        ),
        (
            "The system that is found has comparable physical dimensions.",
            "Results, Cases II and III",
            "the lengths in Cases II and III are within 20 % of the true ones",
        ),
        (
            "There are 6, 36 and 2k + 4 unknowns.",
            "Cases I, II, III",
            "the numbers are those",
        ),
    ]
