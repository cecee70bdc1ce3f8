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
    assert [(c.text, c.place, c.rule) for c in CLAIMS] == [CLAIMROWS]
