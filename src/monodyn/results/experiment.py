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

from monodyn.arrays import usual_step
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Start
from monodyn.estimation.wording import listed, percent
from monodyn.results.fill import carried_from
from monodyn.results.information import (
    Quantities,
    information_along,
    noise_of,
    quantities,
    root_of,
    variances,
)
from monodyn.results.releases import Release, releases, until_parted

SECONDS = (2.0, 4.0, 8.0)
"""Lengths of records that are tried [s]."""
LONGEST = 3600.0
"""Longest of a record that is tried [s]: its motion is simulated from many releases."""
HALVED = 0.5
"""Share of the interval that is to be left."""
SURE = 0.4
"""Share that has to be computed for it: a motion that is let go by hand tells somewhat less, or more."""
WORTH = 0.9
"""Share from which on a further record is not worth its while."""
ALIKE = 1.2
"""Motions of which one leaves so much more than the other tell about as much."""
ERROR_BOUND = 1e-3
"""Largest integration error of a candidate that is aimed at [rad or m]."""
SHORTEST = 0.5
"""Motions that part sooner than that are left out [s]."""
BLIND = 1e-12
"""Directions of which all motions tell less than this share of the most are scales that none depends on."""
LOADED = 1e-3
"""Share of such a direction from which on a parameter is of that scale."""
MEASURABLE = ("length", "width", "tail", "tip", "extent", "thickness", "mass")
"""Kinds of parameters that one can measure on the mechanism."""
QUANTILE = 1.96
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True, eq=False)
class Advised:
    """What to film next, or what to measure.

    Attributes:
        name: What is known worst of what can be known better: a parameter, or a combination.
        relative: Half width of its 95 % interval, as a share of its value.
        share: How much of the interval would be left with the record of the motion in addition.
        release: From where it is let go; None where no motion narrows anything.
        seconds: For how long it is filmed then [s].
        measure: A parameter which, once measured and given with ``--fix``, narrows the quantity as well;
            empty where there is none.
        measured_share: How much of the interval that would leave.
        scaled: Parameters that no motion tells one by one, because none depends on their scale: one of them,
            measured, would fix it.
        said: All of this, in sentences.
    """

    name: str
    relative: float
    share: float
    release: Release | None
    seconds: float
    measure: str
    measured_share: float
    scaled: tuple[str, ...]
    said: str

    @property
    def halves(self) -> bool:
        """True where the motion at least halves the interval."""
        return self.release is not None and self.share <= HALVED


class _Tried(NamedTuple):
    """A candidate, how much of each quantity's interval it leaves, (quantity,), and what it tells, (param,
    param)."""

    release: Release
    seconds: float
    left: np.ndarray
    information: np.ndarray

    @property
    def effort(self) -> tuple[float, int]:
        """What it takes: a longer record, then more joints to hold."""
        return self.seconds, int(self.release.held.sum())


def next_motion(fit: Fit, *, seconds: Sequence[float] = SECONDS) -> Advised | None:
    """Choose what to film next of an identified mechanism.

    Args:
        fit: The identified mechanism, from memory or read back from its folder.
        seconds: Lengths of records that are tried [s].

    Returns:
        The advice; None where nothing was identified that can be used, where there are no intervals, or where
        torques act of which nothing is known after the record.

    Raises:
        SettingsError: A length is not above zero, or too long.

    Source:
        Choosing what to measure by the information matrix of candidates: Fedorov, Theory of optimal
        experiments, 1972.

    Example:
        >>> advised = monodyn.next_motion(monodyn.open_run("run"))  # doctest: +SKIP
        >>> print(advised.said)  # doctest: +SKIP
    """
    if not seconds or not 0.0 < min(seconds) <= max(seconds) <= LONGEST:
        raise SettingsError(
            f"next_motion: expected lengths of records above 0 and up to {LONGEST:g} s, got {list(seconds)}; "
            "give seconds."
        )
    if not fit.starts or not fit.ok or fit.torque == "free" or not np.all(np.isfinite(fit.shared_covariance)):
        return None
    known = _apart(quantities(fit))
    if not known.names:
        return None
    root = root_of(fit)
    # a motor that is off: what its torques tell cannot be counted on
    loose = replace(fit, torques=())
    tried = _tried(loose, known, root, tuple(sorted(seconds)))
    relative = _relative(known)
    chosen, best = _chosen(tried, relative)
    name, measure = known.names[chosen], _measured(fit, known, chosen, root)
    left = 1.0 if best is None else float(best.left[chosen])
    wide = QUANTILE * float(relative[chosen])
    scaled = _scaled(fit, tried)
    own = float(np.sum((known.slopes[chosen] @ root) ** 2))
    # what the model lacks adds to an interval what no record takes away
    lacking = fit.unmodelled is not None and own < 0.5 * float(known.std[chosen]) ** 2
    said = _said(fit, name, wide, best, left, measure, scaled, lacking=lacking)
    release, long = (None, 0.0) if best is None else (best.release, best.seconds)
    return Advised(name, wide, left, release, long, *measure, scaled, said)


def _relative(known: Quantities) -> np.ndarray:
    """Return standard deviations as shares of the values, (quantity,); of where a centre of mass is across a
    body, as shares of how far it is from the hinge."""
    values = dict(zip(known.names, np.abs(known.values).tolist(), strict=True))
    along = [values.get(name.replace(".my", ".mx"), 0.0) for name in known.names]
    return known.std / np.hypot(known.values, np.where([".my" in name for name in known.names], along, 0.0))


def _apart(known: Quantities) -> Quantities:
    """Return the quantities without those that divide by another reference what one that is known better has:
    a damping by a thickness, where it is known by an inertia."""
    relative = _relative(known)
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
    step = usual_step(fit.time[0])
    own = np.sum((known.slopes @ root) ** 2, axis=1)
    # what gravity, and what the model lacks, add to an interval stays in it
    more = np.maximum(known.std**2 - own, 0.0)
    for release in releases(fit):
        position = release.position
        start = Start(fit.starts[0].time, position, 0.0 * position, np.zeros((2 * len(position),) * 2))
        times = until_parted(fit, start, start.time + step * np.arange(round(seconds[-1] / step) + 1))
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
            found.append(_Tried(release, length, share, information[row]))
            if length >= together:
                break
    return found


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
            return chosen, min(alike, key=lambda one: one.release.amplitude)
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


def _scaled(fit: Fit, tried: list[_Tried]) -> tuple[str, ...]:
    """Name the parameters without an interval that all candidates together do not tell either."""
    unknown = [name for name in fit.shared if np.isinf(fit.parameter(name).std)]
    if not tried or not unknown:
        return ()
    values = np.array([fit.parameter(name).value for name in fit.shared])
    unit = np.where(values != 0.0, np.abs(values), 1.0)
    told = sum(one.information for one in tried) * np.outer(unit, unit)
    size = np.sqrt(np.maximum(np.diag(told), 1e-300))
    strength, vectors = np.linalg.eigh(told / np.outer(size, size))
    blind = vectors[:, strength < BLIND * strength[-1]] / size[:, None]
    blind /= np.maximum(np.linalg.norm(blind, axis=0), 1e-300)
    loaded = np.linalg.norm(blind, axis=1) > LOADED
    return tuple(name for name in unknown if loaded[fit.shared.index(name)])


def _said(
    fit: Fit, name: str, wide: float, best: _Tried | None, left: float, measure: tuple[str, float],
    scaled: tuple[str, ...], *, lacking: bool = False,
) -> str:  # fmt: skip
    """Write the advice."""
    given, given_left = measure
    fix = f"{given} measured and given with --fix {given}=VALUE leaves" if given else ""
    if best is None:
        said = f"No further motion tells much more. What is known worst is {name} ({_known_to(wide)})"
        if lacking:
            said += ": what the model lacks limits it, not what was filmed"
        if fix:
            said += f"; {fix} {percent(given_left)} of its interval"
        if scaled:
            said += (
                f". No motion depends on the scale of {listed(scaled)}: one of them, measured and given with "
                "--fix, fixes it"
            )
        return f"{said}."
    said = (
        f"Film it once more: hold it still at {_pose(fit, best.release)}, let go, and film "
        f"{best.seconds:g} s. Of the interval of {name} ({_known_to(wide)} now) about {percent(left)} "
        "is left then"
    )
    if left <= HALVED:
        return f"{said}."
    said += "; no motion that was tried halves it."
    return f"{said} In its place, {fix} {percent(given_left)}." if fix else said


def _known_to(wide: float) -> str:
    """Write how well something is known."""
    return f"+- {percent(wide)}" if wide < 1.0 else "not told from zero"


def _pose(fit: Fit, release: Release) -> str:
    """Write where the joints are when it is let go."""
    words = []
    each = zip(fit.mechanism.joints, release.position, release.away, release.held, strict=True)
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
    run: str,
    *,
    tables: Sequence[str] = (),
    clip: str | None = None,
    second: str = "second",
    out: str = "both",
) -> tuple[str, ...]:
    """Write the commands that identify the mechanism from the records of a run and a further one together.

    Args:
        run: The run folder.
        tables: The tables that were identified in it; none where it is the run of a clip.
        clip: The further clip; None where the further record is a table.
        second: The folder in which the further clip is tracked; without a clip the further table.
        out: The folder of the run of all of them.

    Returns:
        Command lines.

    Example:
        >>> for line in next_commands("run", clip="again.mp4"):
        ...     print(line)
        monodyn track again.mp4 --model run --out second
        monodyn identify run/poses.csv second/poses.csv --model run --out both
    """
    track = () if clip is None else (shlex.join(("monodyn", "track", clip, "--model", run, "--out", second)),)
    records = (*(tables or (f"{run}/poses.csv",)), second if clip is None else f"{second}/poses.csv")
    return (*track, shlex.join(("monodyn", "identify", *records, "--model", run, "--out", out)))
