"""What a model lacks that does not follow its record: one further freedom after the other, the best named.

Each freedom is something that is often forgotten: quadratic drag, weight where the file's hinges turn about
the vertical, gravity that does not act straight down where the angles are measured, a clock that runs at
another rate, a base that swings. Along smooth motion the accelerations show in a moment which of them comes
closest; the best ``TRIED`` are fitted to the record. Where none of these leaves only noise, a link more is.

The rule: a cause is named if with it the residuals are at most half as large. With chance alone a further
unknown takes off a few thousandths.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from monodyn.arrays import usual_step
from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import Smoothed, smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.accelerations import SmoothMotion, mismatch_cost, smooth_motion
from monodyn.estimation.shooting.problem import Problem, posed
from monodyn.estimation.shooting.search import difference_size
from monodyn.estimation.shooting.shoot import ROUGH, Optimum, Route, multiple_shooting
from monodyn.estimation.shooting.starts import from_sides, match, matched
from monodyn.estimation.shooting.swinging import Swing, swing_of
from monodyn.estimation.torque.laws import AIR, QUADRATIC, drag_laws
from monodyn.estimation.verdict.advice import weightless
from monodyn.estimation.verdict.further import COARSE, NOISE_ALONE, further_link
from monodyn.estimation.verdict.stretches import other_rate
from monodyn.estimation.wording import listed, two_digits
from monodyn.mechanism import Mechanism
from monodyn.mechanism.mounted import mounted
from monodyn.mechanism.upright import ROLL, feels_roll, in_metres
from monodyn.types import Poses, Progress

HALVED = 2.0
"""Factor by which a cause makes the residuals smaller, at least, to be named."""
TRIED = 2
"""Causes that are fitted to the record: those that come closest to its accelerations."""
STANDARD_GRAVITY = 9.80665
"""Gravity that a file without any may have forgotten [m/s^2]; the standard one (3rd CGPM, 1901)."""
FARTHEST_SWING = 3.0
"""How far a base swings at most, as a multiple of the lengths of all links together."""
PSEUDO = 0.4
"""Deviation of the base's positions about those that the accelerations call for, as a share of its largest:
they only begin the fit."""

DRAGS = (QUADRATIC, AIR)
"""The causes that are torques."""

Sentence = Callable[[Problem, Optimum, float], str]
"""Names a cause, from its fit and the factor by which it makes the residuals smaller."""


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that the model may lack.

    Attributes:
        name: What it is, in words.
        mechanism: The mechanism with it, at values that match the accelerations.
        records: The records, of a base's motion too.
        left: What it leaves of the accelerations, a sum of weighed squares.
        said: Names it.
    """

    name: str
    mechanism: Mechanism
    records: tuple[Poses, ...]
    left: float
    said: Sentence


def lacking(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, fit: Fit,
    progress: Progress | None = None,
) -> tuple[str, bool]:  # fmt: skip
    """Say what explains that a motion is not followed, or that nothing usual does.

    Args:
        records: The records.
        mechanism: The mechanism, its bodies chosen.
        settings: How it was identified.
        fit: The fit that does not follow.
        progress: Called with the causes tried.

    Returns:
        A sentence for the user, empty where nothing could be tried; and whether a cause was found.
    """
    before, tried = _size(records, fit), _causes(records, mechanism)
    if not tried or not np.isfinite(before):
        return "", False
    joints, names = [joint.name for joint in mechanism.joints], [cause.name for cause in tried]
    said, after = _named(tried, before, joints, settings, progress)
    # what leaves only noise is the cause; what halves the residuals may stand for a link that nobody saw.
    # Without that a motion is missed by far: what misses it by little has other sizes
    missed = after > NOISE_ALONE and not fit.ok
    further = further_link(records, mechanism, settings) if missed else None
    if further is not None:
        names, before = [*names, further.name], _size(records, fit, further.rows)
        if HALVED * further.left < before and further.left < after:
            return further.said(before / further.left), True
    if said:
        return said, True
    return (
        f"None of the usual causes halves what is left over ({listed(names)}): look whether something else "
        "moves along with the mechanism or acts on it, and whether the file is that of this mechanism."
    ), False


def explained_otherwise(
    settings: IdentifySettings, records: tuple[Poses, ...], problem: Problem, optimum: Optimum
) -> float:
    """Find out whether tilted gravity, another clock or a base that swings explains what is left over.

    Bodies whose mass may lie anywhere, and torques over time, explain some of these as well: one further
    unknown is asked first.

    Args:
        settings: How the records were identified.
        records: The records.
        problem: The problem that was solved.
        optimum: Its optimum.

    Returns:
        Mean size of the residuals that the likeliest of them leaves, in units of the noise; infinite where
        none halves it.
    """
    joints = [joint.name for joint in problem.mechanism.joints]
    tried = [cause for cause in _causes(records, problem.mechanism) if cause.name not in DRAGS]
    return _named(tried, difference_size(problem, optimum, joints), joints, settings)[1]


def _named(
    tried: Sequence[Cause], before: float, joints: Sequence[str], settings: IdentifySettings,
    progress: Progress | None = None,
) -> tuple[str, float]:  # fmt: skip
    """Return the sentence of what comes closest of the likeliest causes that halve the residuals, and the
    size that it leaves; empty and infinite for none."""
    said, least = "", np.inf
    likely = sorted(tried, key=lambda cause: cause.left)[:TRIED]
    for count, cause in enumerate(likely):
        if progress is not None:
            progress("causes", count, len(likely))
        problem, optimum = _fitted(cause, settings)
        after = difference_size(problem, optimum, joints) if optimum.complete else np.inf
        if HALVED * after < before and after < least:
            said, least = cause.said(problem, optimum, before / after), after
        # nothing comes closer than that
        if least < NOISE_ALONE:
            break
    return said, least


def _causes(records: tuple[Poses, ...], mechanism: Mechanism) -> list[Cause]:
    """Return what the model may lack, with what it leaves of the accelerations."""
    plain = mechanism.with_torque("friction")
    problem = posed(plain, prepare(records, plain))
    smoothed = tuple(smooth(ordered(record, plain)) for record in records)
    motion = smooth_motion(problem, smoothed)
    if not len(motion.time):
        return []
    x = matched(problem, motion)
    found = [
        _freed(name, plain.with_choices(free=names), said, (problem, x), records, smoothed)
        for name, names, said in _freedoms(plain, problem)
    ]
    if weightless(plain):
        heavy = plain.with_choices(fix={"gravity": STANDARD_GRAVITY})
        found.append(_freed("weight", heavy, weighing, (problem, x), records, smoothed))
    base = _based((problem, x), motion, records)
    return [*found, *([base] if base else [])]


def _freedoms(mechanism: Mechanism, problem: Problem) -> list[tuple[str, list[str], Sentence]]:
    """Return what the mechanism has no unknown for: its name, the parameters that it takes, its sentence."""
    found: list[tuple[str, list[str], Sentence]] = []
    unknown = set(problem.unknowns.names)
    for law, names in drag_laws(mechanism).items():
        further = [name for name in names if name not in unknown]
        if further:
            found.append((law, further, partial(dragged, law, further)))
    if ROLL not in unknown and problem.data.by_roll.any() and feels_roll(mechanism):
        found.append(
            (
                "tilted gravity",
                [ROLL],
                lambda p, o, times: tilted(p.mechanism_at(o.x).values[ROLL] - mechanism.values[ROLL], times),
            )
        )
    given = [p.name for p in mechanism.parameters if p.kind == "length" and not p.free]
    # with either of them open it would have taken up what the clock lacks
    if given and not unknown & {"gravity", "time_scale"}:
        step = usual_step(problem.data.times)

        def rate(p: Problem, o: Optimum, _: float) -> str:
            scale = p.mechanism_at(o.x).values["time_scale"]
            return other_rate(scale, 1.0 / (step * scale), given)

        found.append(("another clock", ["time_scale"], rate))
    return found


def _freed(
    name: str,
    freed: Mechanism,
    said: Sentence,
    near: tuple[Problem, np.ndarray],
    records: tuple[Poses, ...],
    smoothed: tuple[Smoothed, ...],
) -> Cause:
    """Match accelerations with a mechanism that has more unknowns, or weight; gravity may act from any side,
    for encoders have their zero where a mechanism hangs, stands or lies."""
    problem, x = near
    larger = posed(freed, problem.data)
    motion = smooth_motion(larger, smoothed)
    sides = from_sides(larger, larger.unknowns.carried(x, problem.unknowns))
    matches = [match(larger, motion, side) for side in sides]
    left, x = min(((mismatch_cost(larger, x, motion), x) for x in matches), key=lambda pair: pair[0])
    return Cause(name, larger.mechanism_at(x), records, left, said)


def _based(
    near: tuple[Problem, np.ndarray], motion: SmoothMotion, records: tuple[Poses, ...]
) -> Cause | None:
    """Match accelerations with a base that swings; None where the mechanism does not hang on one hinge."""
    problem, x = near
    swing = swing_of(problem, x, motion) if len(records) == 1 and not problem.data.torques else None
    if swing is None:
        return None
    lengths = sum(p.value for p in problem.mechanism_at(x).parameters if p.kind == "length")
    if float(np.ptp(swing.at(motion.time))) > FARTHEST_SWING * lengths:
        # no base: angles that are not what they are taken for call for anything
        return None
    mechanism, joint = mounted(problem.mechanism_at(x), swing.rate)
    record = _with_base(ordered(records[0], problem.mechanism), joint, swing)
    return Cause(
        "a base that swings", mechanism, (record,), swing.left,
        lambda p, o, times: swung(float(np.ptp(p.simulated(o.trial)[:, 0])), swing.rate, times),
    )  # fmt: skip


def _with_base(record: Poses, joint: str, swing: Swing) -> Poses:
    """Return a record with the positions of the base that its accelerations call for, loosely."""
    place = swing.at(record.time)
    frames, dofs = record.position.shape
    covariance = np.zeros((frames, dofs + 1, dofs + 1))
    covariance[:, 1:, 1:] = record.covariance
    covariance[:, 0, 0] = (PSEUDO * float(np.abs(place).max())) ** 2
    seen = record.joint_seen
    return replace(
        record,
        joints=(joint, *record.joints),
        position=np.column_stack([place, record.position]),
        covariance=covariance,
        joint_seen=None if seen is None else np.column_stack([seen.any(axis=1), seen]),
        roll=None,
        shifts=None,
    )


def _fitted(cause: Cause, settings: IdentifySettings) -> tuple[Problem, Optimum]:
    """Fit the records with a cause, roughly."""
    problem = posed(cause.mechanism, prepare(cause.records, cause.mechanism))
    smoothed = tuple(smooth(ordered(record, cause.mechanism)) for record in cause.records)
    route = Route(settings.piece, max(settings.error_bound, COARSE), ROUGH)
    return problem, multiple_shooting(problem, problem.unknowns.x0, smoothed, route)


def _size(records: Sequence[Poses], fit: Fit, rows: int | None = None) -> float:
    """Return the mean size of a fit's residuals in units of the stated noise, over the first rows of each
    record or over all; infinite without any."""
    sizes = []
    for record, residual in zip((ordered(r, fit.mechanism) for r in records), fit.residual, strict=True):
        noise = np.sqrt(np.maximum(np.diagonal(record.covariance, axis1=1, axis2=2), 1e-300))
        # a fit has the residuals of slides in metres, a picture's positions are in the start scale
        unit = 1.0 if record.metric else in_metres(fit.mechanism, fit.scale)
        size = (np.abs(residual) / (unit * noise))[:rows]
        sizes.append(size[np.isfinite(size)])
    every = np.concatenate(sizes) if sizes else np.zeros(0)
    return float(np.mean(every)) if len(every) else np.inf


def dragged(law: str, names: Sequence[str], _: Problem, __: Optimum, times: float) -> str:
    """Name a drag as what is lacking.

    Args:
        law: Which, ``QUADRATIC`` or ``AIR``.
        names: Its parameters.
        times: How many times as close to the record the motion comes with it.
    """
    what = "the drag of the air on its links" if law == AIR else "quadratic drag at its joints"
    return (
        f"With {what} the motion comes {two_digits(times)} times as close to the record: "
        f"--free {' '.join(names)} estimates it."
    )


def weighing(_: Problem, __: Optimum, times: float) -> str:
    """Name weight as what is lacking.

    Args:
        times: How many times as close to the record the motion comes with it.
    """
    return (
        f"With weight, gravity of {STANDARD_GRAVITY:.3g} m/s^2 in the plane of motion, the motion comes "
        f"{two_digits(times)} times as close to the record."
    )


def tilted(roll: float, times: float) -> str:
    """Name a tilt of gravity as what is lacking.

    Args:
        roll: The tilt [rad].
        times: How many times as close to the record the motion comes with it.
    """
    return (
        f"With gravity {two_digits(abs(np.degrees(roll)))} deg from straight down where the angles are "
        f"measured the motion comes {two_digits(times)} times as close to the record: a camera is out of "
        "level by that much, or the zero of an encoder is; --free camera.roll estimates it, "
        "--fix camera.roll=VALUE [rad] gives it."
    )


def swung(reach: float, rate: float, times: float) -> str:
    """Name a base that swings as what is lacking.

    Args:
        reach: How far it swings from one side to the other [m].
        rate: Rate of the oscillation [rad/s].
        times: How many times as close to the record the motion comes with it.
    """
    return (
        f"On a base that swings to the right and back, over {1e3 * reach:.2g} mm at "
        f"{rate / (2.0 * np.pi):.2g} Hz, the motion comes {two_digits(times)} times as close to the record: "
        "what holds the mechanism moves. Fasten it, or give the file a body on a slide with a spring for it."
    )
