"""A fit in, the motion to film next out: the one whose record narrows what is known worst.

Candidates are motions of the identified mechanism, let go from rest. What a record of each would tell is
computed (``information``), and the shortest and easiest is taken that at least halves the interval of the
quantity that is known worst among those that a motion can tell.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit, Start
from monodyn.estimation.wording import listed, percent
from monodyn.mechanism.simulate import energy, rollout_derivatives
from monodyn.mechanism.tree import HINGE, STIFFNESS, Directions
from monodyn.results.fill import carried_from
from monodyn.results.information import (
    Quantities,
    information_along,
    noise_of,
    quantities,
    root_of,
    variances,
)

AMPLITUDES = (30.0, 60.0, 90.0, 135.0)
"""Angles from hanging at rest from which hinges are let go [deg]."""
SECONDS = (2.0, 4.0, 8.0)
"""Lengths of records that are tried [s]."""
RELEASE = float(np.radians(3.0))
"""What a hand is off when it lets go [rad]; of slides in metres as well."""
PARTED = 1.0
"""Motions that are so far from one another are two motions, of which each tells other things [rad or m]."""
HALVED = 0.5
"""Share of the interval that is to be left."""
SURE = 0.4
"""Share that has to be computed for it: a motion that is let go by hand tells somewhat less, or more."""
WORTH = 0.9
"""Share from which on a further record is not worth its while."""
ALIKE = 1.2
"""Motions of which one leaves so much more than the other tell about as much."""
COARSE = 4
"""Integration steps between stamps with which motions that part are looked for."""
ERROR_BOUND = 1e-3
"""Largest integration error of a candidate that is aimed at [rad or m]."""
SHORTEST = 0.5
"""Motions that part sooner than that are left out [s]."""
MEASURABLE = ("length", "width", "tail", "tip", "extent", "thickness", "mass")
"""Kinds of parameters that one can measure on the mechanism."""
QUANTILE = 1.96
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion from rest.

    Attributes:
        position: Joint positions at which it is let go [rad or m], (dof,).
        away: How far joints are lifted from where they hang [rad or m], zero for those that hang by
            themselves, (dof,).
        held: True for joints that have to be held there, the others hang by themselves, bool (dof,).
        seconds: For how long it is filmed [s].
    """

    position: np.ndarray
    away: np.ndarray
    held: np.ndarray
    seconds: float


@dataclass(frozen=True, eq=False)
class Advised:
    """What to film next, or what to measure.

    Attributes:
        name: What is known worst of what can be known better: a parameter, or a combination.
        relative: Half width of its 95 % interval, as a share of its value.
        share: How much of the interval would be left with the record of the motion in addition.
        motion: The motion; None where no motion narrows anything.
        measure: A parameter which, once measured and given with ``--fix``, narrows the quantity as well;
            empty where there is none.
        measured_share: How much of the interval that would leave.
        said: All of this, in sentences.
    """

    name: str
    relative: float
    share: float
    motion: Motion | None
    measure: str
    measured_share: float
    said: str

    @property
    def halves(self) -> bool:
        """True where the motion at least halves the interval."""
        return self.motion is not None and self.share <= HALVED


class _Tried(NamedTuple):
    """A candidate, and how much of each quantity's interval it leaves, (quantity,)."""

    motion: Motion
    left: np.ndarray

    @property
    def effort(self) -> tuple[float, int]:
        """What it takes: a longer record, then more joints to hold."""
        return self.motion.seconds, int(self.motion.held.sum())

    @property
    def amplitude(self) -> float:
        """How far a joint is lifted at most [rad or m]."""
        return float(np.max(np.abs(self.motion.away)))


def next_motion(fit: Fit, *, seconds: Sequence[float] = SECONDS) -> Advised | None:
    """Choose what to film next of an identified mechanism.

    Args:
        fit: The identified mechanism, from memory or read back from its folder.
        seconds: Lengths of records that are tried [s].

    Returns:
        The advice; None where nothing was identified, where there are no intervals, or where torques act of
        which nothing is known after the record.

    Raises:
        SettingsError: A length is not above zero.

    Source:
        Choosing what to measure by the information matrix of candidates: Fedorov, Theory of optimal
        experiments, 1972.

    Example:
        >>> advised = monodyn.next_motion(monodyn.open_run("run"))  # doctest: +SKIP
        >>> print(advised.said)  # doctest: +SKIP
    """
    if not seconds or not min(seconds) > 0.0:
        raise SettingsError(
            f"next_motion: expected lengths of records above zero, got {list(seconds)}; give seconds."
        )
    if not fit.starts or fit.torque == "free" or not np.all(np.isfinite(fit.shared_covariance)):
        return None
    known = _apart(quantities(fit))
    if not known.names:
        return None
    root = root_of(fit)
    # a motor that is off: what its torques tell cannot be counted on
    loose = replace(fit, torques=())
    tried = _tried(loose, known, root, tuple(sorted(seconds)))
    relative = known.std / np.abs(known.values)
    chosen, best = _chosen(tried, relative)
    name, measure = known.names[chosen], _measured(fit, known, chosen, root)
    motion = None if best is None else best.motion
    left = 1.0 if best is None else float(best.left[chosen])
    wide = QUANTILE * float(relative[chosen])
    said = _said(fit, name, wide, motion, left, measure)
    return Advised(name, wide, left, motion, *measure, said)


def hanging_at_rest(fit: Fit) -> np.ndarray:
    """Return the positions in which the mechanism hangs at rest [rad or m], (dof,): the least of its energy.

    What nothing pulls, a slide without a spring, stays where the record begins.

    Args:
        fit: The identified mechanism.
    """
    tree, begin = fit.mechanism.tree, fit.starts[0].position
    pulled = (tree.kind == HINGE) | (tree.links[:, STIFFNESS] > 0.0)
    # a joint that begins exactly upright would stay there
    rest = _hanging(fit, np.where(pulled, begin + 0.1, begin), pulled)
    free = [joint.kind == "hinge" and np.isinf(joint.upper - joint.lower) for joint in fit.mechanism.joints]
    return np.where(free, np.remainder(rest + np.pi, 2.0 * np.pi) - np.pi, rest)


def _hanging(fit: Fit, begin: np.ndarray, loose: np.ndarray) -> np.ndarray:
    """Return the positions of least energy next to others, of which those of loose joints may change."""
    from scipy.optimize import minimize

    tree, rest, still = fit.mechanism.tree, begin.copy(), np.zeros((1, len(begin)))
    if not loose.any():
        return rest

    def height(q: np.ndarray) -> float:
        rest[loose] = q
        return float(energy(tree, rest[None], still)[0])

    first = begin[loose]
    unit = max(abs(height(first + 1.0) - height(first)), abs(height(first - 1.0) - height(first)), 1e-9)
    rest[loose] = minimize(lambda q: height(q) / unit, first, method="BFGS", options={"gtol": 1e-5}).x
    return rest


def _apart(known: Quantities) -> Quantities:
    """Return the quantities without those that divide by another reference what one that is known better has:
    a damping by a thickness, where it is known by an inertia."""
    relative = known.std / np.abs(known.values)
    best: dict[str, int] = {}
    for at in np.argsort(relative, kind="stable").tolist():
        best.setdefault(known.names[at].partition(" / ")[0], at)
    kept = sorted(best.values())
    return Quantities(
        tuple(known.names[at] for at in kept), known.values[kept], known.std[kept], known.slopes[kept]
    )


def _tried(fit: Fit, known: Quantities, root: np.ndarray, seconds: tuple[float, ...]) -> list[_Tried]:
    """Compute what a record of every candidate would leave of the intervals."""
    noise, found = noise_of(fit), []
    step = float(np.median(np.diff(fit.time[0])))
    own = np.sum((known.slopes @ root) ** 2, axis=1)
    # what gravity, and what the model lacks, add to an interval stays in it
    more = np.maximum(known.std**2 - own, 0.0)
    for position, away, held in _releases(fit):
        start = Start(fit.starts[0].time, position, 0.0 * position, np.zeros((2 * len(position),) * 2))
        times = _until_parted(fit, start, start.time + step * np.arange(round(seconds[-1] / step) + 1))
        together = times[-1] - start.time
        if together < SHORTEST:
            continue
        motion = carried_from(fit, start, 0, times, error_bound=ERROR_BOUND)
        if not np.all(np.isfinite(motion.slopes)):
            continue
        information = information_along(fit, motion, noise)
        for length in seconds:
            # what comes after motions have parted is not counted on
            row = min(round(length / step), len(times) - 1)
            left = variances(known.slopes, root, information[row])
            share = np.sqrt((left + more) / np.maximum(own + more, 1e-300))
            found.append(_Tried(Motion(position, away, held, length), share))
            if length >= together:
                break
    return found


def _releases(fit: Fit) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return positions from which the mechanism can be let go, how far joints are lifted in each, and which
    ones have to be held."""
    tree, joints, hanging = fit.mechanism.tree, fit.mechanism.joints, hanging_at_rest(fit)
    is_hinge = tree.kind == HINGE
    # of a slide on a spring the largest amplitude is the one that was seen
    far = np.where(is_hinge, np.radians(max(AMPLITUDES)), np.abs(fit.starts[0].position - hanging))
    lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
    found = []
    for way, loose, held in _ways(fit):
        for amplitude in AMPLITUDES:
            for sign in (1.0, -1.0):
                away = sign * way * far * amplitude / max(AMPLITUDES)
                # a hinge behind one that is lifted turns back as far before it hangs
                begin = hanging + away - np.where(loose, away.sum(), 0.0)
                position = _hanging(fit, begin, loose)
                position = np.where(is_hinge, _whole_degrees(position), position)
                if away.any() and np.all((lower <= position) & (position <= upper)):
                    # the other side tells about the same
                    found.append((position, away, held))
                    break
    return found


def _ways(fit: Fit) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return which joints are lifted, as shares of an amplitude, which ones then come to hang by themselves
    elsewhere, and which ones have to be held."""
    tree = fit.mechanism.tree
    is_hinge, springs = tree.kind == HINGE, (tree.kind != HINGE) & (tree.links[:, STIFFNESS] > 0.0)
    count, none = len(is_hinge), np.zeros(len(is_hinge), dtype=bool)
    ways = []
    for i in np.flatnonzero(is_hinge | springs):
        behind = none.copy()
        for k in range(int(i) + 1, count):
            behind[k] = is_hinge[i] and is_hinge[k] and (tree.parent[k] == i or behind[tree.parent[k]])
        ways.append((np.eye(count)[i], behind, np.eye(count)[i] > 0.0))
    hinges = np.flatnonzero(is_hinge)
    if len(hinges) > 1:
        # straight on from the first hinge is a way of its own, and so are all bent one way, and to and fro
        bent = is_hinge.astype(float)
        fro = np.where(np.cumsum(bent) % 2 == 1, bent, -bent)
        ways += [(way, none, is_hinge) for way in (np.eye(count)[hinges[0]], bent, fro)]
    return ways


def _whole_degrees(angle: np.ndarray) -> np.ndarray:
    # a zero without its sign
    return np.radians(np.round(np.degrees(angle))) + 0.0


def _until_parted(fit: Fit, start: Start, times: np.ndarray) -> np.ndarray:
    """Return the times up to which motions let go nearby stay together, and within the joints' limits."""
    tree, joints, dofs = fit.mechanism.tree, fit.mechanism.joints, len(start.position)
    none, drive = np.zeros(0), fit.mechanism.drive
    nothing = Directions(
        np.zeros((*tree.links.shape, 0)), np.zeros((2, 0)), np.full(drive.table.shape, -1), none, none, none
    )
    clock = times * fit.mechanism.values["time_scale"]
    q, _, dq, _ = rollout_derivatives(
        tree, nothing, clock, start.position, start.velocity, substeps=COARSE, drive=drive
    )
    off = RELEASE * np.linalg.norm(dq[:, :, :dofs], axis=2)
    lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
    apart = ~(off <= PARTED) | (q < lower - 1e-9) | (q > upper + 1e-9)
    gone = apart.any(axis=1)
    return times[: int(np.argmax(gone))] if gone.any() else times


def _chosen(tried: list[_Tried], relative: np.ndarray) -> tuple[int, _Tried | None]:
    """Return the quantity that is known worst of those that a motion halves, and that motion; where none is
    halved the one of which the least is left, and where nothing is narrowed the one that is known worst."""
    if not tried:
        return int(np.argmax(relative)), None
    left = np.array([one.left for one in tried])
    least = left.min(axis=0)
    for limit in (SURE, HALVED):
        if np.any(least <= limit):
            chosen = int(np.argmax(np.where(least <= limit, relative, -1.0)))
            good = [one for one in tried if one.left[chosen] <= limit]
            effort = min(one.effort for one in good)
            easy = [one for one in good if one.effort == effort]
            # of those that tell about as much the gentlest: the farther it is let go the sooner motions part
            most = ALIKE * min(float(one.left[chosen]) for one in easy)
            alike = [one for one in easy if one.left[chosen] <= most]
            return chosen, min(alike, key=lambda one: one.amplitude)
    if np.any(least <= WORTH):
        chosen = int(np.argmin(least))
        return chosen, tried[int(np.argmin(left[:, chosen]))]
    return int(np.argmax(relative)), None


def _measured(fit: Fit, known: Quantities, chosen: int, root: np.ndarray) -> tuple[str, float]:
    """Return the parameter whose exact value would narrow a quantity most, and how much of it that leaves;
    an empty name where none does."""
    kinds = {p.name: p.kind for p in fit.mechanism.parameters}
    slope, total = known.slopes[chosen] @ root, known.std[chosen] ** 2
    best, least = "", WORTH
    for at, name in enumerate(fit.shared):
        own = float(root[at] @ root[at])
        # one that the fit does not determine at all fixes a scale, and nothing else
        if kinds[name] not in MEASURABLE or name == known.names[chosen] or not own > 0.0:
            continue
        if not np.isfinite(fit.parameter(name).std):
            continue
        left = float(np.sqrt(max(1.0 - (slope @ root[at]) ** 2 / own / total, 0.0)))
        if left < least:
            best, least = name, left
    return best, least if best else 1.0


def _said(
    fit: Fit, name: str, wide: float, motion: Motion | None, left: float, measure: tuple[str, float]
) -> str:
    """Write the advice."""
    given, given_left = measure
    fix = f"{given} measured and given with --fix {given}=VALUE leaves" if given else ""
    if motion is None:
        said = f"No further motion tells much more. What is known worst is {name} (+- {percent(wide)})"
        if fix:
            return f"{said}; {fix} {given_left:.2g} of its interval."
        return f"{said}; only what is measured on the mechanism itself, given with --fix, would narrow it."
    said = (
        f"Film it once more: hold it still at {_pose(fit, motion)}, let go, and film {motion.seconds:g} s. "
        f"Of the interval of {name} (+- {percent(wide)} now) about {left:.2g} is left then"
    )
    if left <= HALVED:
        return f"{said}."
    said += "; no motion that was tried halves it."
    return f"{said} In its place, {fix} {given_left:.2g}." if fix else said


def _pose(fit: Fit, motion: Motion) -> str:
    """Write where the joints are when it is let go."""
    words = []
    each = zip(fit.mechanism.joints, motion.position, motion.away, motion.held, strict=True)
    for joint, position, away, held in each:
        hinge = joint.kind == "hinge"
        if not hinge and not held:
            continue  # a slide that nothing pulls may stand anywhere
        place = f"{joint.name} = " + (f"{np.degrees(position):.0f} deg" if hinge else f"{position:.3g} m")
        if away:
            lifted = f"{abs(np.degrees(away)):.0f} deg" if hinge else f"{1000.0 * abs(away):.0f} mm"
            place += f" ({lifted} from where it hangs)"
        elif hinge and not held:
            place += " (hanging by itself)"
        words.append(place)
    return listed(words, len(words))


def next_commands(
    first: str, *, clip: str | None = None, second: str = "second", out: str = "both"
) -> tuple[str, ...]:
    """Write the commands that identify the mechanism from its run and a further record together.

    Args:
        first: The run folder.
        clip: The further clip; None where the further record is a table already, in ``second``.
        second: The folder of the further record.
        out: The folder of the run of both.

    Returns:
        Command lines.

    Example:
        >>> for line in next_commands("run", clip="again.mp4"):
        ...     print(line)
        monodyn track again.mp4 --model run --out second
        monodyn identify run/poses.csv second/poses.csv --model run --out both
    """
    run, other, both = shlex.quote(first), shlex.quote(second), shlex.quote(out)
    track = () if clip is None else (f"monodyn track {shlex.quote(clip)} --model {run} --out {other}",)
    return (*track, f"monodyn identify {run}/poses.csv {other}/poses.csv --model {run} --out {both}")
