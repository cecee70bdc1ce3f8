"""The fits of the experiment: cases, filtered states, numbers of frames and start values; both methods."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.torque.periods import PeriodSearch
from monodyn.mechanism import Mechanism
from monodyn.paper.settings import PaperIdentifySettings
from monodyn.reproduce.clip import Pendulum, Truth
from monodyn.reproduce.vision import BOTH_METHODS, CASE_FAILURES, Seen, aligned
from monodyn.results.fill import States, fill
from monodyn.stages import identify
from monodyn.types import Poses, Progress

CASE_TORQUES = {"I": "friction", "II": "fourier", "III": "free"}
"""Torque model of each case of the paper."""
SERIES_TERMS = 7
"""Harmonics of the paper's series."""


@dataclass(frozen=True)
class Design:
    """What is fitted.

    Attributes:
        frames: Frames of a fit.
        ahead: Frames after them that are predicted.
        lengths: Numbers of frames that are compared.
        starts: Start values in Case I that are compared, the usual one among them.
        seed: Seed of the start values.
        gains: Gains alpha, beta, gamma of the filter.
    """

    frames: int = 40
    ahead: int = 40
    lengths: tuple[int, ...] = (20, 30, 40, 60, 80)
    starts: int = 5
    seed: int = 0
    gains: tuple[float, float, float] = (0.4, 0.1, 0.05)


@dataclass(frozen=True)
class FitPlan:
    """One fit to make.

    Attributes:
        method: ``paper`` or ``fast``.
        case: ``I``, ``II`` or ``III``.
        states: ``measured`` or ``filtered``.
        frames: Frames to fit, from the first one.
        start: Number of the start values; 0 are those of the model as it was seen.
    """

    method: str
    case: str
    states: str
    frames: int
    start: int = 0


@dataclass(frozen=True, eq=False)
class Case:
    """One fit, and how far its motion is from what was seen and from the truth.

    Errors are root mean squares by joint [rad or m], or None where they are not known.

    Attributes:
        plan: What was to be fitted.
        status: The fit's own status, or why there is none.
        fit: The fit, or None.
        motion: Its motion from the first frame to the last predicted one, or None.
        residual: Of the simulated motion against the poses over the fitted frames, (dof,).
        error: Of the simulated motion against the truth over the fitted frames, (dof,).
        ahead: Of the prediction over the frames after, against the truth, or the poses where that is unknown,
            (dof,).
        late: The same over the frames that no fit has used, (dof,).
        parameters: Relative errors against the truth by name.
        seconds: Wall time [s].
        clip_period: True where the period is that of the whole clip, predicted frames included.
    """

    plan: FitPlan
    status: str
    fit: Fit | None = None
    motion: States | None = None
    residual: np.ndarray | None = None
    error: np.ndarray | None = None
    ahead: np.ndarray | None = None
    late: np.ndarray | None = None
    parameters: dict[str, float] | None = None
    seconds: float = 0.0
    clip_period: bool = False

    @property
    def unknowns(self) -> int | None:
        """Number of estimated parameters, the start state not counted."""
        if self.fit is None or not self.fit.starts:
            return None
        return len(self.fit.shared)


def plans(design: Design, count: int) -> list[FitPlan]:
    """List the fits of the experiment, each once.

    Args:
        design: What is fitted.
        count: Frames of the clip.
    """
    found: list[FitPlan] = []
    for method in BOTH_METHODS:
        usual = [FitPlan(method, case, "measured", design.frames) for case in CASE_TORQUES]
        if method == "paper":  # the default method has no filtered states
            usual.append(FitPlan(method, "I", "filtered", design.frames))
        # a fit is compared with the others only where the frames that it predicts are in the clip
        frames = [FitPlan(method, "I", "measured", n) for n in design.lengths if n + design.ahead <= count]
        starts = [FitPlan(method, "I", "measured", design.frames, i) for i in range(1, design.starts)]
        found += dict.fromkeys([*usual, *frames, *starts])
    return found


def run_cases(
    seen: dict[str, Seen], truth: Truth | None, design: Design, progress: Progress | None = None
) -> list[Case]:
    """Make every fit of the experiment.

    Args:
        seen: What each method saw, by method.
        truth: The true motion, or None.
        design: What is fitted.
        progress: Called as ``progress("fits", done, total)``.

    Returns:
        The fits in the order of ``plans``; a failed one has a status and nothing else.
    """
    count = max((len(found.poses) for found in seen.values() if found.poses is not None), default=0)
    todo = plans(design, count)
    # one fit of each kind loads and compiles what it needs; it is not among those that are timed
    first = [
        FitPlan(method, case, "measured", design.frames) for method in BOTH_METHODS for case in CASE_TORQUES
    ]
    found = []
    for done, plan in enumerate([*first, *todo]):
        if progress is not None:
            progress("fits", done, len(first) + len(todo))
        found.append(run_case(plan, seen[plan.method], truth, design))
    if progress is not None:
        progress("fits", len(found), len(found))
    return found[len(first) :]


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
        fit, clip_period = _fitted(plan, mechanism, seen.poses, design)
        seconds = time.perf_counter() - began
        if not fit.starts:
            return Case(plan, fit.status, fit, seconds=seconds)
        # beyond the fitted frames, to the end of the last ones that any fit is compared on
        last = min(len(seen.poses), max(design.lengths) + design.ahead)
        motion = fill(fit, seen.poses.time[:last])
    except CASE_FAILURES as error:
        return Case(plan, f"failed: {error}", seconds=time.perf_counter() - began)
    found = Case(plan, str(fit.status), fit, motion, seconds=seconds, clip_period=clip_period)
    return _measured(found, seen.poses, truth, design)


def _fitted(plan: FitPlan, mechanism: Mechanism, clip: Poses, design: Design) -> tuple[Fit, bool]:
    """Identify; True where the frames are too few for the period of Case II and the clip's is taken."""
    settings, poses = identify_settings(plan, design), clip.part(0, plan.frames)
    fit = identify(poses, mechanism, settings)
    if fit.starts or plan.case != "II":
        return fit, False
    # the period is searched for in the accelerations of all poses; the fit itself keeps to its own frames
    whole = ordered(clip, mechanism)
    guesses = PeriodSearch.of(mechanism, prepare((whole,), mechanism), (smooth(whole),)).guesses(0)
    if not guesses:
        return fit, False
    period = guesses[0].period
    driven = mechanism.with_torque("fourier", terms=SERIES_TERMS, period=period)
    known = identify(poses, driven.with_choices(fix={"torque.period": period}), settings)
    return known, bool(known.starts)


def identify_settings(plan: FitPlan, design: Design) -> IdentifySettings:
    """Return the settings of one fit.

    Args:
        plan: What to fit.
        design: Gains and seed.
    """
    torque: Any = CASE_TORQUES[plan.case]
    if plan.method == "fast":
        return IdentifySettings(torque=torque, seed=design.seed)
    states = "filtered" if plan.states == "filtered" else "measured"
    return PaperIdentifySettings(
        method="paper", torque=torque, seed=design.seed, gains=design.gains, states=states
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
    scale = _factor(rng)
    values = {}
    for parameter in mechanism.parameters:
        if parameter.kind in ("length", "width", "tail", "tip", "offset"):
            values[parameter.name] = parameter.value * scale
        elif parameter.kind in ("thickness", "damping") and parameter.free:
            values[parameter.name] = parameter.value * _factor(rng)
    return mechanism.with_values(values)


def _factor(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(0.4), np.log(2.5))))


def _measured(case: Case, poses: Poses, truth: Truth | None, design: Design) -> Case:
    """Add the errors of a fit's motion."""
    assert case.motion is not None
    position, frames = case.motion.position, case.plan.frames
    measured = poses.position[: len(position)]
    true = None if truth is None else aligned(truth.position[: len(position)], measured)
    target = measured if true is None else true
    # the frames after the longest fit are the only ones that no fit has used, whatever its length
    late = slice(max(design.lengths), max(design.lengths) + design.ahead)
    return replace(
        case,
        residual=rms(position[:frames] - measured[:frames]),
        error=None if true is None else rms(position[:frames] - true[:frames]),
        ahead=rms((position - target)[frames : frames + design.ahead]),
        late=rms((position - target)[late]),
        parameters=None if truth is None else parameter_errors(case, truth.pendulum),
    )


def rms(error: np.ndarray) -> np.ndarray | None:
    """Return the root mean square by joint, (dof,); None where nothing was measured.

    Args:
        error: Errors, NaN where not measured, (frame, dof).
    """
    measured = error[np.isfinite(error).all(axis=1)]
    return np.sqrt(np.mean(measured**2, axis=0)) if len(measured) else None


def identifiable(mechanism: Mechanism) -> dict[str, float]:
    """Return what the motion of a double pendulum determines: lengths and ratios, but no scale of the masses.

    Args:
        mechanism: With bodies ``link1``, ``link2`` and hinges ``joint1``, ``joint2``.
    """
    values = mechanism.values
    mass = values["link1.mass"]
    return {
        "l1": values["link1.length"],
        "l2": values["link2.length"],
        "m2/m1": values["link2.mass"] / mass,
        "b1/m1": values["joint1.damping"] / mass,
        "b2/m1": values["joint2.damping"] / mass,
    }


def true_values(rods: Pendulum) -> dict[str, float]:
    """Return the same of the true pendulum.

    Args:
        rods: What moved.
    """
    mass = rods.density * np.prod([rods.length, rods.width, rods.thickness], axis=0)
    return {
        "l1": rods.length[0],
        "l2": rods.length[1],
        "m2/m1": float(mass[1] / mass[0]),
        "b1/m1": float(rods.damping[0] / mass[0]),
        "b2/m1": float(rods.damping[1] / mass[0]),
    }


def parameter_errors(case: Case, rods: Pendulum) -> dict[str, float]:
    """Return the relative errors of what the motion determines; of damping only where nothing else acts.

    Args:
        case: A fit.
        rods: What moved.
    """
    assert case.fit is not None
    found, true = identifiable(case.fit.mechanism), true_values(rods)
    names = [name for name in true if case.plan.case == "I" or not name.startswith("b")]
    return {name: found[name] / true[name] - 1.0 for name in names}
