"""Tracked joint positions in, identified mechanism out.

The unknowns are the free parameters and the start state of every record; what is minimized is eq. (14) of the
2012 paper, the difference of simulated and measured positions, weighted with the covariance of the
measurements.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from monodyn.errors import VideoError
from monodyn.estimation.fit import Fit
from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.record.units import wrong_units
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.shoot import limited
from monodyn.estimation.torque.auto import fit_auto
from monodyn.estimation.torque.fourier import fit_series
from monodyn.estimation.torque.free import fit_free_torques
from monodyn.estimation.torque.friction import fit_friction
from monodyn.estimation.torque.known import fit_known
from monodyn.estimation.torque.laws import slackened
from monodyn.estimation.torque.many import fit_many
from monodyn.estimation.torque.task import Task
from monodyn.estimation.verdict import stretches
from monodyn.estimation.verdict.causes import explained_otherwise, lacking
from monodyn.estimation.verdict.summary import summarize
from monodyn.mechanism import Mechanism
from monodyn.types import Poses, Progress, under

TORQUE_MODELS = {
    "auto": fit_auto,
    "friction": fit_friction,
    "fourier": fit_series,
    "free": fit_free_torques,
    "known": fit_known,
}
"""How a motion is explained, by torque model; where torques are known that is the one."""
TORQUE_WORK, REASON_WORK = 80e6, 30e6
"""Work that all searches together may take, as a ``Budget`` counts it, for what acts and for the reason why
nothing explains the motion: some 20 s and 8 s of a processor; of more than ``USUAL_ROWS`` in proportion. What
was found took up to 27 million in made records and clips, and 56 in a real one."""
USUAL_ROWS = 1000
"""Rows up to which they do not depend on the rows."""
SHORTEST_BEGINNING = 20
"""Rows of the shortest beginning that is tried when the whole record does not fit."""
CUT_SHORT = (
    "The search for what acts ended before every kind of torque and every start had been followed to its "
    "end: nothing until then came near the record. --identify.torque names the kind to search for without "
    "this limit."
)
"""What is said where the budget was spent on a motion that nothing explains."""


def identify_jointly(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify parameters and start states together; where that fails, name the beginning that fits.

    Args:
        records: Records that share the parameters.
        mechanism: Topology, start values, what is free and fixed, its bodies chosen.
        settings: How to search.
        progress: Called as ``progress("identify", done, total)`` with the stages done.

    Returns:
        The identified mechanism with intervals.

    Raises:
        VideoError: A record is in degrees, or its times are not in seconds.
    """
    # a clip has its angles from a picture, and may be in slow motion
    wrong = wrong_units(records, mechanism) if records and mechanism.measured is None else None
    if wrong:
        raise VideoError(f"poses: {wrong}")
    mechanism = slackened(mechanism, records)
    fit = _identified(records, mechanism, settings, progress)
    usual = settings.torque in ("auto", "friction") and fit.torque == "friction"
    # with one start nobody wants to know more than how near it leads
    if fit.grade == "trusted" or not fit.starts or not usual or settings.starts == 1:
        return fit
    settings = replace(settings, torque="friction", uncertainty="linear")
    # a misfit is looked into; what else a fit is doubted for has its reason
    lacks = fit.unmodelled is not None or not fit.ok
    with limited(REASON_WORK * _size(records)):
        cause, named = lacking(records, mechanism, settings, fit, progress) if lacks else ("", False)
    if fit.ok:
        # what can be used at least approximately is no other mechanism
        return replace(fit, advice=(cause, *fit.advice)) if named else fit
    reason = () if named else _beginning(records, mechanism, settings, progress)
    # a beginning that fits says more than what does not explain the rest
    return replace(fit, advice=(*reason, *([cause] if cause else []), *fit.advice))


def _identified(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> Fit:
    """Identify from whole records, bodies chosen."""
    began = time.perf_counter()
    data = prepare(records, mechanism)
    smoothed = tuple(smooth(ordered(record, mechanism)) for record in records)
    model = "known" if data.torques else settings.torque
    task = Task(data, smoothed, settings, progress, partial(explained_otherwise, settings), records)
    # a torque that the user names is searched to the end, and what was found is refined and judged as ever
    with limited(TORQUE_WORK * _size(records) if model == "auto" else np.inf) as budget:
        solution = fit_many(TORQUE_MODELS[model], mechanism, task)
    fit = summarize(solution, records, settings, began, progress)
    return replace(fit, advice=(*fit.advice, CUT_SHORT)) if budget.remaining <= 0.0 and not fit.ok else fit


def _size(records: tuple[Poses, ...]) -> float:
    """Return the rows of records over the usual number, at least one."""
    return max(1.0, sum(len(record) for record in records) / USUAL_ROWS)


def _beginning(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings, progress: Progress | None
) -> tuple[str, ...]:
    """Name the first half, quarter, ... that fits of one record, where its own halves agree; nothing where
    none does."""
    if len(records) != 1:
        return ()
    poses, quick = records[0], replace(settings, starts=1)
    # a beginning is halved until it fits: a fault that grows with time leaves a short one untouched
    measured = np.flatnonzero(poses.measured.any(axis=1))
    first, count = int(measured[0]), len(measured) // 2
    halved = under(progress, "beginning")
    while count >= SHORTEST_BEGINNING:
        part = poses[first : int(measured[count])]
        fit = _identified((part,), mechanism, quick, halved)
        # a record that states much noise is met by many fits: to advise one it has to explain the motion
        if fit.ok and stretches.explained(part, fit):
            # A wrong mechanism, or one in a wrong place, follows any short motion with parameters of its own:
            # what holds over the beginning also holds over each half of it.
            middle = int(np.searchsorted(part.frame, poses.frame[measured[count // 2]]))
            halves = (part[:middle], part[middle:])
            fits = [_identified((half,), mechanism, quick, halved) for half in halves]
            if not all(half.ok for half in fits):
                return ()
            if apart := stretches.disagreeing(*fits):
                return (stretches.disagreement(len(part), apart),)
            return (stretches.beginning(mechanism, part.frame.tolist(), fit.rms),)
        count //= 2
    return ()
