"""The claims of the 2012 paper, each with its rule, judged with every pendulum.

A claim has a rule, fixed before the numbers are known, and a function that judges one method by it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from monodyn.reproduce import case_claims, series_claims
from monodyn.reproduce.evidence import Evidence, Verdict
from monodyn.reproduce.vision import BOTH_METHODS


@dataclass(frozen=True)
class Judgement:
    """What became of a claim with one method.

    Attributes:
        verdicts: The verdict with each pendulum, in their order.
    """

    verdicts: tuple[Verdict, ...]

    @property
    def held(self) -> int:
        """Number of pendulums with which it held."""
        return sum(bool(verdict.held) for verdict in self.verdicts)

    @property
    def decided(self) -> int:
        """Number of pendulums with which it could be decided."""
        return sum(verdict.held is not None for verdict in self.verdicts)

    @property
    def words(self) -> str:
        """Whether it held, in how many."""
        if not self.decided:
            return "no verdict"
        return f"held in {self.held} of {self.decided}"

    @property
    def basis(self) -> str:
        """What it rests on: pendulums, fits, starts, frames."""
        counted = [verdict for verdict in self.verdicts if verdict.held is not None]
        if not counted:
            return ""
        parts = [_counted(len(counted), "pendulum")]
        for total, name in (
            (sum(verdict.fits for verdict in counted), "fit"),
            (sum(verdict.starts for verdict in counted), "start"),
            (sum(verdict.frames for verdict in counted), "frame"),
        ):
            if total:
                parts.append(_counted(total, name))
        return ", ".join(parts)


def _counted(number: int, name: str) -> str:
    return f"{number} {name}" + "s" * (number != 1)


@dataclass(frozen=True)
class Claim:
    """A claim of the paper.

    Attributes:
        text: The claim.
        place: Where the paper makes it.
        rule: When it counts as held here.
        judged: What became of it, by method.
    """

    text: str
    place: str
    rule: str
    judged: Mapping[str, Judgement]


class Criterion(NamedTuple):
    """How a claim is judged.

    Attributes:
        text: The claim.
        place: Where the paper makes it.
        rule: When it counts as held here.
        judge: Judges what one method found with one pendulum.
    """

    text: str
    place: str
    rule: str
    judge: Callable[[Evidence], Verdict]


def claims(found: Sequence[Mapping[str, Evidence]]) -> list[Claim]:
    """Return every claim with its verdicts for both methods.

    Args:
        found: What each method found, by method, for each pendulum.
    """
    return [
        Claim(
            c.text,
            c.place,
            c.rule,
            {
                method: Judgement(tuple(c.judge(evidence[method]) for evidence in found))
                for method in BOTH_METHODS
            },
        )
        for c in CLAIMS
    ]


JUDGES: Mapping[str, Callable[[Evidence], Verdict]] = {**vars(series_claims), **vars(case_claims)}
"""What judges a claim, by name."""
CLAIMS = tuple(
    Criterion(one["claim"], one["place"], one["rule"], JUDGES[one["judge"]])
    for one in json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
)
"""Every claim of ``claims.json``, in the order of the page."""
