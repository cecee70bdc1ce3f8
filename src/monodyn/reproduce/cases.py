"""The fits of the experiment, made: how far each one's motion is from what was seen and from the truth."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism
from monodyn.reproduce.plans import Design, FitPlan, identify_settings, plans, start_scale, started
from monodyn.reproduce.truth import Truth, errors_of, identifiable
from monodyn.reproduce.vision import CASE_FAILURES, Seen
from monodyn.results.fill import States, fill
from monodyn.results.trace import metric
from monodyn.stages import identify
from monodyn.types import Poses, Progress


@dataclass(frozen=True, eq=False)
class Case:
    """One fit, and how far its motion is from what was seen and from the truth.

    Errors are root mean squares by joint [rad or m], or None where they are not known.

    Attributes:
        plan: What was to be fitted.
        status: The fit's own status, or why there is none.
        fit: The fit, or None.
        motion: Its motion from the first frame to the last predicted one, or None.
        poses: The estimated poses at the same frames, slides in the fit's metres, (frame, dof), or None.
        true: True poses up to whole turns at the same frames, (frame, dof), or None where they are not known.
        residual: Of the simulated motion against the poses over the fitted frames, (dof,).
        error: Of the simulated motion against the truth over the fitted frames, (dof,).
        ahead: Of the prediction over the frames after, against the truth, or the poses where that is unknown,
            (dof,).
        late: The same over the frames that no fit has used, (dof,).
        parameters: Relative errors against the truth by name.
        seconds: Wall time [s].
    """

    plan: FitPlan
    status: str
    fit: Fit | None = None
    motion: States | None = None
    poses: np.ndarray | None = None
    true: np.ndarray | None = None
    residual: np.ndarray | None = None
    error: np.ndarray | None = None
    ahead: np.ndarray | None = None
    late: np.ndarray | None = None
    parameters: dict[str, float] | None = None
    seconds: float = 0.0

    @property
    def unknowns(self) -> int | None:
        """Number of estimated parameters, the start state not counted."""
        if self.fit is None or not self.fit.starts:
            return None
        return len(self.fit.shared)

    @property
    def ok(self) -> bool:
        """True when there is a fit and it can be used."""
        return self.fit is not None and bool(self.fit.ok)

    @property
    def period(self) -> float | None:
        """Period of the torque [s]; None in a case without one."""
        if self.plan.case != "II" or self.motion is None or self.fit is None:
            return None
        return self.fit.mechanism.values.get("torque.period")

    @property
    def periods(self) -> float | None:
        """How many of its periods the fitted frames span, from the first to the last; None without one."""
        if not self.period or self.motion is None:
            return None
        return float(np.ptp(self.motion.time[: self.plan.frames])) / self.period


def run_cases(
    seen: Seen, truth: Truth | None, design: Design, progress: Progress | None = None
) -> list[Case]:
    """Make every fit of one method.

    Args:
        seen: What the method saw.
        truth: The true motion, or None.
        design: What is fitted.
        progress: Called as ``progress("fits", done, total)``.

    Returns:
        The fits in the order of ``plans``; a failed one has a status and nothing else.
    """
    todo = plans(design, 0 if seen.poses is None else len(seen.poses), seen.method)
    found = []
    for done, plan in enumerate(todo):
        if progress is not None:
            progress("fits", done, len(todo))
        found.append(run_case(plan, seen, truth, design))
    if progress is not None:
        progress("fits", len(found), len(todo))
    return found


def run_case(plan: FitPlan, seen: Seen, truth: Truth | None, design: Design) -> Case:
    """Return one fit and how far its motion is from poses and truth.

    Args:
        plan: What to fit.
        seen: What the method saw.
        truth: The true motion, or None.
        design: Frames, gains and seeds.
    """
    if seen.poses is None or seen.scene is None:
        return Case(plan, f"no poses: {seen.status}")
    began = time.perf_counter()
    try:
        mechanism = started(seen.scene.mechanism, plan.start, design.seed)
        # slides are seen in the scale of the sizes: left in the old one they would be another motion, not
        # the same from another start
        poses = slides_scaled(seen.poses, mechanism, start_scale(plan.start, design.seed))
        seen = replace(seen, poses=poses)
        # the fitted frames alone, also for the period of Case II: what is predicted was not seen
        fit = identify(poses[: plan.frames], mechanism, identify_settings(plan, design))
        seconds = time.perf_counter() - began
        if not fit.starts:
            return Case(plan, fit.status, fit, seconds=seconds)
        # beyond the fitted frames, to the end of the last ones that any fit is compared on
        last = min(len(poses), design.longest + design.ahead)
        motion = fill(fit, poses.time[:last])
    except CASE_FAILURES as error:
        return Case(plan, f"failed: {error}", seconds=time.perf_counter() - began)
    return _measured(Case(plan, str(fit.status), fit, motion, seconds=seconds), seen, truth, design)


def slides_scaled(poses: Poses, mechanism: Mechanism, factor: float) -> Poses:
    """Return poses whose slides are in the scale of other start values; those in metres stay.

    Args:
        poses: Joint positions, slides in metres or in the scale of the mechanism file.
        mechanism: Its joints.
        factor: The other scale's sizes over the file's.
    """
    if poses.metric:
        return poses
    # only the slides change: hinges stay as the camera shows them
    return replace(metric(replace(poses, roll=None), mechanism, factor), metric=False, roll=poses.roll)


def _measured(case: Case, seen: Seen, truth: Truth | None, design: Design) -> Case:
    """Add the errors of a fit's motion."""
    assert case.fit is not None
    assert case.motion is not None
    assert seen.poses is not None
    position, frames = case.motion.position, case.plan.frames
    joints = case.fit.mechanism.joints
    measured = metric(seen.poses, case.fit.mechanism, case.fit.scale).position[: len(position)]
    true = None
    if truth is not None:
        # the truth is turned to where the poses are, not to where a motion that went astray ends
        true = measured - errors_of(measured, truth.position[: len(position)], joints)
    target = measured if true is None else true
    # the frames after the longest fit are the only ones that no fit has used, whatever its length
    first = design.longest
    found = replace(
        case,
        poses=measured,
        true=true,
        residual=rms(position[:frames] - measured[:frames]),
        error=None if true is None else rms(position[:frames] - true[:frames]),
        ahead=rms((position - target)[frames : frames + design.ahead]),
        late=rms((position - target)[first : first + design.ahead]),
    )
    return found if truth is None else replace(found, parameters=parameter_errors(found, truth))


def rms(error: np.ndarray) -> np.ndarray | None:
    """Return the root mean square by joint, (dof,); None where nothing was measured.

    Args:
        error: Errors, NaN where not measured, (frame, dof).
    """
    measured = error[np.isfinite(error).all(axis=1)]
    return np.sqrt(np.mean(measured**2, axis=0)) if len(measured) else None


def parameter_errors(case: Case, truth: Truth) -> dict[str, float]:
    """Return the relative errors of what the motion determines; of damping only where nothing else acts.

    Args:
        case: A fit.
        truth: What is true.
    """
    assert case.fit is not None
    found = identifiable(case.fit.mechanism)
    names = [name for name in truth.values if case.plan.case == "I" or not name.startswith("b")]
    # of a true value of zero, a hinge without friction, there is no share
    return {
        name: found[name] / truth.values[name] - 1.0
        for name in names
        if found.get(name) and truth.values[name]
    }
