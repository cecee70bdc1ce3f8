"""What one method found with one pendulum, and what a claim's rule makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.reproduce.cases import Case
from monodyn.reproduce.plans import Design, FitPlan, own_form
from monodyn.reproduce.pose_starts import PoseStarts
from monodyn.reproduce.vision import Seen


@dataclass(frozen=True)
class Verdict:
    """Whether a claim held for one method with one pendulum.

    Attributes:
        held: True or False; None where it cannot be decided.
        numbers: What decides it.
        fits: Fits that it rests on.
        starts: Starts of searches that it rests on, in addition to the fits.
        frames: Frames of poses that it rests on, where it rests on no fit.
    """

    held: bool | None
    numbers: str
    fits: int = 0
    starts: int = 0
    frames: int = 0


@dataclass(frozen=True, eq=False)
class Evidence:
    """Everything one method found with one pendulum.

    Attributes:
        seen: What it saw.
        cases: Its fits.
        design: What was fitted.
        interval: Time between two frames [s].
        pose_starts: Searches for the first pose from starts all around it, or None.
        processes: Processes that worked side by side, so that times are longer than those of one alone.
    """

    seen: Seen
    cases: Sequence[Case]
    design: Design
    interval: float = 0.0
    pose_starts: PoseStarts | None = None
    processes: int = 1

    def case(
        self, name: str = "I", frames: int = 0, compared: str = "measured", start: int = 0
    ) -> Case | None:
        """Return one fit that has a motion, a torque over time in the method's own form, or None.

        Args:
            name: ``I``, ``II`` or ``III``.
            frames: Fitted frames; 0 is the usual number.
            compared: One of ``plans.COMPARED``.
            start: Number of the drawn start values.
        """
        own = own_form(self.seen.method, name, frames or self.design.frames)
        return self.made(FitPlan(own.method, name, own.frames, compared, own.series, start))

    def made(self, plan: FitPlan) -> Case | None:
        """Return the fit of a plan, if it has a motion, or None.

        Args:
            plan: The plan.
        """
        return next((case for case in self.cases if case.plan == plan and case.motion is not None), None)

    def overall(self, error: np.ndarray | None) -> float | None:
        """Return one rms over all hinges [rad], or None where there are none.

        Args:
            error: Rms by joint, (dof,), or None.
        """
        hinges = self.seen.hinges
        return None if error is None or not hinges else float(np.sqrt(np.mean(error[hinges] ** 2)))


FIT_MISSING = Verdict(None, "a fit that it requires is missing")
TRUTH_UNKNOWN = Verdict(None, "the truth of this clip is not known")


NEAR_LIMIT = 0.25
"""A value is near its limit when they differ by less than this share of the limit."""


def refused(*cases: Case | None) -> Verdict | None:
    """Return that a fit cannot be used, with its reason, or None where all can or are missing.

    Args:
        cases: The fits that a claim rests on.
    """
    for case in cases:
        if case is not None and not case.ok:
            status = case.status.rstrip(".")
            return Verdict(None, f"the fit of Case {case.plan.case} cannot be used: {status}")
    return None


def near(value: float, limit: float, words: str) -> str:
    """Return a remark where a value is so near to its limit that the verdict may turn, else nothing.

    Args:
        value: The value.
        limit: What it is compared with.
        words: The limit in words.
    """
    return f" (near the limit of {words})" if abs(value - limit) < NEAR_LIMIT * limit else ""


def degrees(value: float) -> str:
    """Return an angle in degrees with three digits, as text.

    Args:
        value: The angle [rad].
    """
    shown = float(np.degrees(value))
    return f"{shown:.3g}°" if shown == 0.0 or shown >= 1e-3 else "under 0.001°"


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return Pearson's correlation; 0 where one of the two is constant.

    Args:
        a: Numbers, (sample,).
        b: As many others, (sample,).
    """
    if np.std(a) == 0.0 or np.std(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
