"""The verdicts on claims about many fits and searches."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments import DESIGN, evidence, lost, mechanism, moved, seen
from monodyn.reproduce.cases import Case
from monodyn.reproduce.evidence import FIT_MISSING, TRUTH_UNKNOWN, Verdict
from monodyn.reproduce.pose_starts import PoseStarts
from monodyn.reproduce.series_claims import (
    fast_enough_in_time,
    more_frames_are_better,
    poses_are_close,
    several_periods_are_needed,
    start_pose_is_unique,
    starts_agree_in_motion,
    starts_end_apart,
)


@pytest.mark.parametrize(
    ("errors", "held"), [((4e-3, 2e-3, 1e-3), True), ((1e-3, 2e-3, 4e-3), False), ((1e-3, 1e-3, 1e-3), False)]
)
def test_the_number_of_frames_is_judged_on_the_same_late_frames(errors: tuple, held: bool) -> None:
    cases = [moved("I", error, frames=n) for n, error in zip(DESIGN.lengths, errors, strict=True)]
    verdict = more_frames_are_better(evidence(*cases))
    assert verdict.held is held
    shown = [f"{n} frames {np.degrees(error):.3g}°" for n, error in zip(DESIGN.lengths, errors, strict=True)]
    assert verdict.numbers == f"error on frames 40 to 79: {', '.join(shown)}"
    assert more_frames_are_better(lost()) == FIT_MISSING
    off: Any = SimpleNamespace(**{**vars(cases[1].fit), "ok": False})
    cases[1] = replace(cases[1], fit=off, status="It does not follow.")
    told = "the fit of Case I cannot be used: It does not follow"
    assert more_frames_are_better(evidence(*cases)) == Verdict(None, told)


def periodic(frames: int, error: float) -> Case:
    """Return a fit of Case II with a period of 0.5 s."""
    case = moved("II", error, frames=frames, method="paper")
    driven = mechanism().with_torque("fourier", terms=1, period=0.5)
    fit: Any = SimpleNamespace(**{**vars(case.fit), "mechanism": driven})
    return replace(case, fit=fit)


def test_periods_are_counted_in_the_fitted_frames() -> None:
    found = evidence(periodic(20, 0.1), periodic(40, 0.02), method="paper")
    verdict = several_periods_are_needed(found)
    assert verdict == Verdict(
        True,
        "prediction error 5.73° from 20 frames, 1.3 periods of 0.5 s, 1.15° from 40 frames, 2.6 periods "
        "of 0.5 s",
        fits=2,
    )
    assert several_periods_are_needed(evidence(periodic(40, 0.02), method="paper")).held is None
    off: Any = SimpleNamespace(**{**vars(periodic(20, 0.1).fit), "ok": False})
    lost_one = replace(periodic(20, 0.1), fit=off, status="It does not follow.")
    told = "the fit of Case II cannot be used: It does not follow"
    unusable = several_periods_are_needed(evidence(lost_one, periodic(40, 0.02), method="paper"))
    assert unusable == Verdict(None, told)
    refused = Case(replace(periodic(20, 0.1).plan), "No period.")
    assert several_periods_are_needed(evidence(refused, method="paper")) == Verdict(
        None, "Case II: No period"
    )


def test_starts_that_end_in_one_place_are_not_sensitive() -> None:
    one, other = moved("I", 1e-3, start=1), moved("I", 1e-3, start=2)
    assert starts_end_apart(evidence(one, other)) == Verdict(
        False,
        "2 of 2 end at residual 0.206°; where the fit follows the poses l1 differs most, by under 0.01 %",
        starts=2,
    )
    values = {"joint1.damping": 2.0 * mechanism().values["joint1.damping"]}
    fit: Any = SimpleNamespace(**{**vars(other.fit), "mechanism": mechanism().with_values(values)})
    apart = starts_end_apart(evidence(one, replace(other, fit=fit)))
    assert apart.held is True
    assert apart.numbers.endswith("b1/m1 differs most, by 67 %")
    values = {"joint1.damping": 3.5 * mechanism().values["joint1.damping"]}
    fit = SimpleNamespace(**{**vars(other.fit), "mechanism": mechanism().with_values(values)})
    apart = starts_end_apart(evidence(one, replace(other, fit=fit)))
    assert apart.numbers.endswith("b1/m1 differs most, by a factor of 3.5")


def test_starts_that_end_elsewhere_are_counted() -> None:
    one, other = moved("I", 1e-3, start=1), moved("I", 0.3, start=2)
    lost_one = SimpleNamespace(**{**vars(other.fit), "ok": False})
    cases = one, replace(other, fit=lost_one)  # type: ignore[arg-type]
    apart = starts_end_apart(evidence(*cases))
    assert apart == Verdict(True, "1 of 2 end at residual 0.206°, 1 at residual 17.2°", starts=2)
    assert starts_agree_in_motion(evidence(*cases)) == Verdict(
        False, "1 of 2 within 1° of the best over 80 frames, the farthest 17.1°", starts=2
    )
    assert starts_agree_in_motion(evidence(one, moved("I", 1e-3, start=2))).held is True
    assert starts_end_apart(evidence(one)) == FIT_MISSING


def test_starts_of_the_pose_are_judged_up_to_a_quarter_turn() -> None:
    found = PoseStarts((np.radians(10.0), np.radians(90.0), np.pi), (24, 24, 4), 24)
    assert start_pose_is_unique(evidence(method="paper", starts=found)) == Verdict(
        True, "same pose from 24 of 24 at 10°, 24 of 24 at 90°, 4 of 24 at 180°", starts=72
    )
    found = replace(found, same=(24, 23, 4))
    assert start_pose_is_unique(evidence(method="paper", starts=found)).held is False
    assert start_pose_is_unique(evidence()).held is None
    assert start_pose_is_unique(lost()) == FIT_MISSING


def test_poses_are_judged_by_their_errors_in_every_frame() -> None:
    close = poses_are_close(evidence())
    assert close.held is True
    assert close.numbers.startswith("0.19° rms")
    assert "over 90 of 90 frames" in close.numbers
    errors = np.full((90, 2), np.nan)
    errors[3] = np.radians(1.1)
    few = poses_are_close(replace(evidence(), seen=replace(seen(), errors=errors)))
    assert few == Verdict(
        False,
        "1.1° (near the limit of 1°) rms over 1 of 90 frames, at most 1.1°; 90 have a pose, of the others "
        "the truth is not known",
        frames=1,
    )
    assert poses_are_close(lost()) == Verdict(None, "no poses: failed: x")
    assert poses_are_close(replace(evidence(), seen=replace(seen(), errors=None))) == TRUTH_UNKNOWN


def test_time_is_compared_with_that_between_frames() -> None:
    found = fast_enough_in_time(evidence(replace(moved("I", 1e-3), seconds=0.2)))
    told = "20 ms a frame where frames are 33.3 ms apart; first pose 1 s, Case I 0.2 s"
    assert found == Verdict(True, told, frames=90)
    shared = fast_enough_in_time(replace(evidence(), processes=2))
    assert shared.numbers.endswith("first pose 1 s; 2 processes, each with a pendulum, share the processor")
    slow = replace(evidence(), seen=replace(seen(), seconds_a_frame=0.05))
    assert fast_enough_in_time(slow).held is False
    assert fast_enough_in_time(lost()).held is None
