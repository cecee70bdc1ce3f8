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

from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.torque.task import EXPLAIN, Task
from monodyn.estimation.verdict.advice import beginning
from monodyn.estimation.verdict.conclude import conclude, refuse
from monodyn.mechanism import Mechanism
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
    t, plus what the picture knows of the sizes; the torque is what ``settings.torque`` says. Several records
    share the parameters.

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
        >>> from monodyn.mechanism.simulate import rollout
        >>> mechanism, time = load("single"), np.arange(40) / 30
        >>> start = np.array([0.5]), np.array([0.0])
        >>> swing, _ = rollout(mechanism.tree, time, *start, substeps=8)
        >>> std = np.full((40, 1, 1), 1e-3**2)
        >>> poses = Poses(("joint1",), np.arange(40), time, swing, std, np.ones(40, dtype=bool))
        >>> fit = identify(poses, mechanism).check()
        >>> round(fit.parameter("link1.length").value, 3)
        0.2
    """
    began = time.perf_counter()
    method = settings.method or "fast"
    settings = replace(settings, method=method)
    records = (poses,) if isinstance(poses, Poses) else tuple(poses)
    mechanism = mechanism.with_bodies(settings.bodies)
    fit = METHODS[method](records, mechanism, settings, progress)
    return replace(fit, seconds=time.perf_counter() - began)


def _fast(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify parameters and start states together; where that fails say which beginning fits."""
    fit = _identified(records, mechanism, settings, progress)
    if not fit.ok and fit.starts and settings.torque == "friction":
        fit = replace(fit, advice=(*_beginning(records, mechanism, settings), *fit.advice))
    return fit


def _paper(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify as published."""
    from monodyn.paper.identify import identify_published

    return identify_published(records, mechanism, settings, progress)


METHODS = {"fast": _fast, "paper": _paper}
"""How a mechanism is identified."""


def _identified(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify from whole records, bodies chosen."""
    began = time.perf_counter()
    data = prepare(records, mechanism)
    smoothed = tuple(smooth(ordered(record, mechanism)) for record in records)
    found = EXPLAIN[settings.torque](mechanism, Task(data, smoothed, settings, progress))
    if found.grown is None:
        return refuse(found.problem, found.reason, records, time.perf_counter() - began)
    fit = conclude(found.problem, found.grown, records, settings, tried=found.tried, began=began)
    return replace(fit, advice=(*found.advice, *fit.advice))


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
