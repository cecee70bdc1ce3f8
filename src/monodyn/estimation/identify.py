"""Tracked joint positions in, identified mechanism out.

The unknowns are the free parameters and the start state of every record; what is minimized is eq. (14) of the
2012 paper, the difference of simulated and measured positions, weighted with the covariance of the
measurements.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.advice import beginning, listed
from monodyn.estimation.conclude import conclude, refuse
from monodyn.estimation.data import Data, prepare
from monodyn.estimation.fit import Fit
from monodyn.estimation.grow import Grown, Route, grow
from monodyn.estimation.problem import Problem, smooth_motion
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.smooth import Smoothed, smooth
from monodyn.estimation.starts import starts
from monodyn.estimation.unknowns import choose_unknowns, size_prior
from monodyn.estimation.verdict import motion_sizes, typical_differences
from monodyn.mechanism import Mechanism
from monodyn.optimize import SearchSettings, first_good
from monodyn.types import Poses, Progress

USUAL = IdentifySettings()
SHORTEST = 20
"""Rows of the shortest beginning that is tried when the whole record does not fit."""


def identify(
    poses: Poses | Sequence[Poses],
    mechanism: Mechanism,
    settings: IdentifySettings = USUAL,
    *,
    progress: Progress | None = None,
) -> Fit:
    """Find the parameters and start states whose simulated motion is closest to the measured one.

    Minimizes sum_t |W_t (q_sim(t; parameters, start) - q_t)|^2 with W_t.W_t the inverse covariance of sample
    t, plus what the picture knows of the sizes; torque -b v at every joint. Several records share the
    parameters.

    Args:
        poses: One record or several.
        mechanism: Topology, start values, what is free and fixed.
        settings: How to search.
        progress: Called as ``progress("identify", done, total)`` with the stages done.

    Returns:
        The identified mechanism with intervals; ``ok`` is False when it is not to be trusted.

    Raises:
        VideoError: There is no record, or one that cannot be used.
        MechanismError: The joints of a record are not those of the mechanism.
        SettingsError: A setting is out of its range.

    Source:
        Eq. (14) and Case I (eq. 9, as a torque against the motion) of "Estimating dynamics on-the-fly using
        monocular video", 2012.

    Example:
        >>> import numpy as np
        >>> from monodyn.mechanism import load
        >>> from monodyn.mechanism.dynamics import rollout
        >>> mechanism, time = load("single"), np.arange(40) / 30
        >>> tree = mechanism.tree
        >>> start = np.array([0.5]), np.array([0.0])
        >>> swing, _ = rollout(tree.parent, tree.kind, tree.links, tree.gravity, time, 8, *start)
        >>> std = np.full((40, 1, 1), 1e-3**2)
        >>> poses = Poses(("joint1",), np.arange(40), time, swing, std, np.ones(40, dtype=bool))
        >>> fit = identify(poses, mechanism).check()
        >>> round(fit.parameter("link1.length").value, 3)
        0.2
    """
    began = time.perf_counter()
    _check(settings)
    records = (poses,) if isinstance(poses, Poses) else tuple(poses)
    mechanism = mechanism.with_bodies(settings.bodies)
    fit = _identified(records, mechanism, settings, progress)
    if not fit.ok and fit.starts:
        fit = replace(fit, advice=(*_beginning(records, mechanism, settings), *fit.advice))
    return replace(fit, seconds=time.perf_counter() - began)


def _identified(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify from whole records, bodies chosen."""
    began = time.perf_counter()
    data = prepare(records, mechanism)
    unknowns = choose_unknowns(mechanism)
    problem = Problem(mechanism, unknowns, size_prior(mechanism, unknowns), data)
    smoothed = tuple(smooth(_ordered(record, mechanism)) for record in records)
    reason = _hopeless(problem, smoothed)
    if reason is not None:
        return refuse(problem, reason, records, time.perf_counter() - began)
    grown, tried = _search(problem, smoothed, settings, progress)
    return conclude(problem, grown, records, settings, tried=tried, began=began)


def _beginning(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings
) -> tuple[str, ...]:
    """Say which first half, quarter, ... of a record fits; nothing where none does or there are several."""
    if len(records) != 1:
        return ()
    poses, quick = records[0], replace(settings, starts=1)
    measured = np.flatnonzero(poses.seen & np.isfinite(poses.position).any(axis=1))
    first, count = int(measured[0]), len(measured) // 2
    while count >= SHORTEST:
        part = poses.part(first, int(measured[count]))
        fit = _identified((part,), mechanism, quick, None)
        if fit.ok:
            return (beginning(mechanism, part.frame.tolist(), fit.rms),)
        count //= 2
    return ()


def _check(settings: IdentifySettings) -> None:
    ranges = (
        ("identify.starts", settings.starts, 1, 1000), ("identify.piece", settings.piece, 5, 10000),
        ("identify.error-bound", settings.error_bound, 1e-10, 1e-2),
        ("identify.evaluations", settings.evaluations, 5, 10000),
    )  # fmt: skip
    for name, value, low, high in ranges:
        if not low <= value <= high:
            raise SettingsError(f"{name}: expected {low:g} to {high:g}, got {value:g}.")
    if settings.outlier != 0 and not settings.outlier >= 3:
        raise SettingsError(f"identify.outlier: expected 0 or at least 3, got {settings.outlier:g}.")


def _ordered(record: Poses, mechanism: Mechanism) -> Poses:
    """Bring the joints of a record into the mechanism's order."""
    names = tuple(joint.name for joint in mechanism.joints)
    if names == record.joints:
        return record
    order = [record.joints.index(name) for name in names]
    covariance = record.covariance[:, order][:, :, order]
    return Poses(
        names, record.frame, record.time, record.position[:, order], covariance, record.seen, record.metric
    )


def _hopeless(problem: Problem, smoothed: tuple[Smoothed, ...]) -> str | None:
    """Say why there is no point in a search, or None."""
    data, unusable = problem.data, problem.prior.unusable
    records, dofs = data.slide.shape
    if unusable:
        verb = "is" if len(unusable) == 1 else "are"
        return (
            f"What the picture knows of {listed(unusable, 12)} {verb} not a finite number; locate the "
            "mechanism in a clearer part of the clip, or give measured values with --fix."
        )
    # what the picture knows of the sizes counts as data
    known = int(np.linalg.matrix_rank(problem.prior.information)) if len(problem.unknowns) else 0
    unknowns = len(problem.unknowns) - known + 2 * dofs * records
    if data.samples <= unknowns:
        return (
            f"{data.samples} measured joint positions cannot determine {unknowns} unknowns (parameters and "
            "start states); give more frames or fix parameters."
        )
    names = [joint.name for joint in problem.mechanism.joints]
    for i, found in enumerate(smoothed):
        for dof in range(dofs):
            if not np.isfinite(found.noise[dof]):
                return f"Joint {names[dof]!r} was measured under 5 times in record {i}; give more frames."
    if all(_still(data, dof) for dof in range(dofs)):
        return "Nothing moves in the record: no joint leaves its noise; give frames with motion."
    return None


def _still(data: Data, dof: int) -> bool:
    """True when a joint stays within four standard deviations of its noise in every record."""
    for first, stop in zip(data.first[:-1], data.first[1:], strict=True):
        use = data.measured[first:stop, dof]
        if use.any():
            values = data.position[first:stop, dof][use]
            if np.std(values) > 4.0 * np.median(data.std[first:stop, dof][use]):
                return False
    return True


def _search(
    problem: Problem, smoothed: tuple[Smoothed, ...], settings: IdentifySettings, progress: Progress | None
) -> tuple[Grown, int]:
    """Grow from one start after the other until the motion is explained."""
    fine = SearchSettings(evaluations=settings.evaluations, decrease=1e-4, relative=1e-7)
    route = Route(settings.piece, settings.error_bound, fine)
    motion = smooth_motion(problem, smoothed)
    motion_size = np.maximum(motion_sizes(problem.data), 1e-12)
    done = 0

    def report(_: Grown) -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress("identify", done, None)

    def unexplained(grown: Grown) -> float:
        return float((typical_differences(problem, grown) / motion_size).max())

    def hopeless(grown: Grown) -> bool:
        return not np.isfinite(grown.cost) or (grown.sigma > 10.0 and unexplained(grown) > 0.01)

    def good(grown: Grown) -> bool:
        return grown.complete and (grown.sigma < 3.0 or unexplained(grown) < 0.005)

    tried = starts(problem, motion, smoothed, route, settings.starts, settings.seed)
    best, count = first_good(
        lambda start: grow(problem, start[0], smoothed, start[1], report, hopeless),
        tried,
        cost=_price,
        good=good,
    )
    if not best.complete:
        best = grow(problem, best.x, smoothed, route, report)
    return best, count


def _price(grown: Grown) -> float:
    """Rank results: mean size of the whitened residuals, so that gross errors do not rule; abandoned last."""
    size = float(np.mean(np.abs(grown.residuals)))
    return size if grown.complete else 1e12 + size
