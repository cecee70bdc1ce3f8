"""Which fits the experiment makes: cases, what they are compared with, numbers of frames, start values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from monodyn.estimation.settings import IdentifySettings
from monodyn.mechanism import Mechanism
from monodyn.paper.settings import PAPER_GAINS, PaperIdentifySettings
from monodyn.reproduce.vision import BOTH_METHODS

CASE_TORQUES = {"I": "friction", "II": "fourier", "III": "free"}
"""Torque model of each case of the paper."""
OVER_TIME = ("II", "III")
"""Cases with a torque over time, beside which friction may act or not."""
COMPARED = ("measured", "filtered", "consistent", "rates")
"""What simulated states are compared with: poses, filtered ones in either reading of the filter, poses
and rates."""
FILTERED = {"filtered": "printed", "consistent": "consistent"}
"""Reading of the filter's equations by what is compared."""
LEAST_FRAMES = 10
"""Frames of the shortest clip that the experiment takes."""


@dataclass(frozen=True)
class Design:
    """What is fitted.

    Attributes:
        frames: Frames of a fit.
        ahead: Frames after them that are predicted.
        lengths: Numbers of frames that are compared in Case I.
        periods: Numbers of frames that are compared in Case II.
        starts: Drawn start values in Case I.
        seed: Seed of the start values.
        gains: Gains alpha, beta, gamma of the filter.
        both_ways: Fit Cases II and III by the published method with friction too, not in its own form alone.
    """

    frames: int = 40
    ahead: int = 40
    lengths: tuple[int, ...] = (20, 30, 40, 60, 80)
    periods: tuple[int, ...] = (40, 80)
    starts: int = 10
    seed: int = 0
    gains: tuple[float, float, float] = PAPER_GAINS
    both_ways: bool = True

    @property
    def longest(self) -> int:
        """Frames of the longest fit: what comes after them no fit has used."""
        return max((self.frames, *self.lengths, *self.periods))

    def within(self, count: int) -> Design:
        """Return the same for a clip that may be too short for it: half of the frames are fitted then, and
        only numbers of frames are compared that the clip has with those to predict.

        Args:
            count: Frames of the clip.
        """
        design = self
        if count < self.frames + self.ahead:
            frames = min(self.frames, max(count // 2, LEAST_FRAMES // 2))
            design = replace(self, frames=frames, ahead=count - frames, periods=(frames,))
        # a fit is compared with the others only where the frames that it predicts are in the clip
        lengths, periods = (
            tuple(n for n in numbers if n + design.ahead <= count)
            for numbers in (design.lengths, design.periods)
        )
        return replace(design, lengths=lengths, periods=periods)


@dataclass(frozen=True)
class FitPlan:
    """One fit to make.

    Attributes:
        method: ``paper`` or ``fast``.
        case: ``I``, ``II`` or ``III``.
        frames: Frames to fit, from the first one.
        compared: One of ``COMPARED``.
        series: ``alone`` or ``with-friction`` for a torque over time; empty in Case I.
        start: Number of the drawn start values; 0 are those of the model as it was seen.
    """

    method: str
    case: str
    frames: int
    compared: str = "measured"
    series: str = ""
    start: int = 0


def plans(design: Design, count: int, method: str) -> list[FitPlan]:
    """List the fits of one method, each once.

    Args:
        design: What is fitted.
        count: Frames of the clip.
        method: ``paper`` or ``fast``.
    """
    found = [FitPlan(method, "I", design.frames)]
    for case in OVER_TIME:
        # both ways for both methods: only fits with the same friction model have the same information
        ways = ("alone", "with-friction") if design.both_ways or method == "fast" else ("alone",)
        found += [FitPlan(method, case, design.frames, series=series) for series in ways]
    if method == "paper":  # the default method has neither filtered states nor rates
        found += [FitPlan(method, "I", design.frames, compared) for compared in COMPARED[1:]]
    # a fit is compared with the others only where the frames that it predicts are in the clip
    found += [FitPlan(method, "I", n) for n in design.lengths if n + design.ahead <= count]
    found += [own_form(method, "II", n) for n in design.periods if n + design.ahead <= count]
    found += [FitPlan(method, "I", design.frames, start=i) for i in range(1, design.starts + 1)]
    return list(dict.fromkeys(found))


def own_form(method: str, case: str, frames: int) -> FitPlan:
    """Return the fit of a case in the form that is the method's own.

    Args:
        method: ``paper`` or ``fast``.
        case: ``I``, ``II`` or ``III``.
        frames: Frames to fit.
    """
    series = {"paper": "alone", "fast": "with-friction"}[method] if case in OVER_TIME else ""
    return FitPlan(method, case, frames, series=series)


def identify_settings(plan: FitPlan, design: Design) -> IdentifySettings:
    """Return the settings of one fit.

    Args:
        plan: What to fit.
        design: Gains and seed.
    """
    torque: Any = CASE_TORQUES[plan.case]
    series: Any = plan.series or None
    if plan.method == "fast":
        return IdentifySettings(torque=torque, series=series, seed=design.seed)
    reading: Any = FILTERED.get(plan.compared, "printed")
    return PaperIdentifySettings(
        method="paper",
        torque=torque,
        series=series,
        seed=design.seed,
        gains=design.gains,
        states="filtered" if plan.compared in FILTERED else "measured",
        filter=reading,
        rates=plan.compared == "rates",
        # drawn values are kept as they are: matched to the accelerations all of them would become the same
        begin="given" if plan.start else "matched",
    )


def started(mechanism: Mechanism, number: int, seed: int) -> Mechanism:
    """Return the mechanism with other start values.

    All sizes change by one factor, each thickness and each damping by its own; they are spread evenly on a
    logarithmic scale from 0.4 to 2.5.

    Args:
        mechanism: With the start values of the file.
        number: Which start; 0 leaves the values as they are.
        seed: Seed of the factors.
    """
    if number == 0:
        return mechanism
    rng = np.random.default_rng([seed, number])
    # sizes keep their proportions, which the pictures determine; their scale and a thickness are not seen
    scale = _factor(rng)  # the first draw: start_scale makes it again
    values = {}
    for parameter in mechanism.parameters:
        if parameter.kind in ("length", "width", "tail", "tip", "extent", "along", "across", "offset"):
            if not parameter.follows:
                values[parameter.name] = parameter.value * scale
        elif parameter.kind in ("thickness", "damping") and parameter.free:
            values[parameter.name] = parameter.value * _factor(rng)
    return mechanism.with_values(values)


def start_scale(number: int, seed: int) -> float:
    """Return the factor of all sizes in other start values, of ``started``.

    Args:
        number: Which start; 0 leaves the values as they are.
        seed: Seed of the factors.
    """
    return _factor(np.random.default_rng([seed, number])) if number else 1.0


def _factor(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(0.4), np.log(2.5))))


def plan_order(plan: FitPlan) -> tuple[int, ...]:
    """Return by what fits are sorted: case, what is compared, friction, method.

    Args:
        plan: The fit.
    """
    return (
        list(CASE_TORQUES).index(plan.case),
        COMPARED.index(plan.compared),
        ("", "alone", "with-friction").index(plan.series),
        BOTH_METHODS.index(plan.method),
    )
