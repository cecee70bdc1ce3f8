"""The claims of the 2012 paper, each with its rule, judged with every pendulum.

A claim has a rule, fixed before the numbers are known, and a function that judges one method by it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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


CLAIMS = (
    Criterion(
        "Any suitable start of the first pose leads to the same pose.",
        "Discussion",
        "the search (3) ends within 2° of the pose from every start up to 90° away",
        series_claims.start_pose_is_unique,
    ),
    Criterion(
        "The estimated pose is very close to the actual pose.",
        "Case I, Fig. 5 and 7",
        "every frame has a pose, and they are within 1° of the truth, rms",
        series_claims.poses_are_close,
    ),
    Criterion(
        "A faster implementation might follow the motion in real time.",
        "Discussion",
        "the median time for a pose is below the time between two frames",
        series_claims.fast_enough_in_time,
    ),
    Criterion(
        "Filtered states make the prediction worse than unfiltered ones.",
        "Case I, Fig. 6",
        "the prediction error over the next frames is larger with the filter as printed",
        case_claims.filtered_is_worse,
    ),
    Criterion(
        "The fit of the dynamics filters the noise of the poses out by itself.",
        "Case I",
        "over the fitted frames the simulated motion is nearer to the truth than the poses",
        case_claims.noise_is_filtered_out,
    ),
    Criterion(
        "Accuracy grows with the number of frames.",
        "Case I, Fig. 7",
        "on the same late frames the most frames do better than the fewest, rank correlation below −0.5",
        series_claims.more_frames_are_better,
    ),
    Criterion(
        "The estimate is sensitive to where the search starts.",
        "Case I",
        "drawn starts end in more than one place, or a length or ratio differs by more than 5 %",
        series_claims.starts_end_apart,
    ),
    Criterion(
        "Whatever the start, the system that is found moves equivalently.",
        "Case I, Fig. 7",
        "from every drawn start the motion, fitted and predicted, stays within 1° of the best",
        series_claims.starts_agree_in_motion,
    ),
    Criterion(
        "Angles and their derivatives together improve the estimate.",
        "Discussion",
        "the prediction error over the next frames is smaller",
        case_claims.rates_are_better,
    ),
    Criterion(
        "Case II tracks the estimated poses but deviates.",
        "Case II, Fig. 8",
        "residual below 1°, prediction error above that of Case I",
        case_claims.fourier_deviates,
    ),
    Criterion(
        "Case II predicts reliably only from poses over multiple periods.",
        "Case II",
        "with two periods or more in the fitted frames the prediction error is less than half of that "
        "with fewer",
        series_claims.several_periods_are_needed,
    ),
    Criterion(
        "Case III tracks the estimated poses exactly but follows their noise.",
        "Case III, Fig. 9",
        "residual below a quarter of the poses' error, correlation of the two errors above 0.9",
        case_claims.free_torque_follows_noise,
    ),
    Criterion(
        "In Case III the prediction requires the torques.",
        "Case III",
        "without them the prediction error is larger than with the friction of Case I",
        case_claims.prediction_needs_torques,
    ),
    Criterion(
        "The system that is found has comparable physical dimensions.",
        "Results, Cases II and III",
        "the lengths in Cases II and III are within 20 % of the true ones",
        case_claims.sizes_are_comparable,
    ),
    Criterion(
        "There are 6, 36 and 2k + 4 unknowns.",
        "Cases I, II, III",
        "the numbers are those",
        case_claims.unknowns_as_printed,
    ),
)
"""Every claim, in the order of the page."""
