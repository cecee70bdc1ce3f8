"""Frames kept back: what a fit to the beginnings of its records alone predicts of their ends.

Where a whole record is fitted nothing is left to judge the fit by, but how well the same mechanism goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.errors import MonodynError
from monodyn.estimation.fit import Doubt, Fit
from monodyn.mechanism import Mechanism
from monodyn.results.heldout import heldout_doubts
from monodyn.results.predict import predict
from monodyn.results.trace import trace_of
from monodyn.settings import IdentifySettings
from monodyn.stages import identify
from monodyn.types import Poses, Progress

KEPT = 0.2
"""Share of the measured rows of each record that is kept back."""
FEWEST = 10
"""Rows that are kept back of a record, at least: fewer say nothing."""


def kept_doubts(
    fit: Fit,
    records: Sequence[Poses],
    mechanism: Mechanism,
    settings: IdentifySettings,
    progress: Progress | None = None,
) -> list[Doubt]:
    """Return what the ends of fitted records say against their fit.

    Args:
        fit: The fit.
        records: The records, each fitted in whole.
        mechanism: The mechanism as it was before.
        settings: How it was identified.
        progress: Called as the identification goes.
    """
    stops = [_stop(record) for record in records]
    if not fit.ok or all(stop is None for stop in stops):
        return []
    parts = [
        record if stop is None else record.part(0, stop) for record, stop in zip(records, stops, strict=True)
    ]
    try:
        # the prediction rests on the covariance, wherever the intervals come from
        quick = replace(settings, starts=1, uncertainty="linear")
        shorter = identify(parts, *_as_chosen(fit, mechanism, quick), progress=progress)
    except MonodynError:
        return []
    doubts: list[Doubt] = []
    for k, (record, stop) in enumerate(zip(records, stops, strict=True)):
        if stop is not None and shorter.starts:
            trace = trace_of(shorter, record, predict(shorter, times=record.time[stop:], record=k), record=k)
            doubts += heldout_doubts(shorter, trace, kept=True)
    # one of a kind is enough: many records would say the same many times
    return list({doubt.grade: doubt for doubt in reversed(doubts)}.values())


def _as_chosen(
    fit: Fit, mechanism: Mechanism, settings: IdentifySettings
) -> tuple[Mechanism, IdentifySettings]:
    """Return how the kind of torque, and of bodies, is identified that the evidence of the whole record was
    for."""
    if any(p.free and fit.mechanism.parameter(p.name).kind == "inertia" for p in fit.parameters):
        settings = replace(settings, bodies="free")
    if settings.torque != "auto" or fit.torque == "known":
        return mechanism, settings
    if fit.torque == "fourier":
        return mechanism, replace(
            settings, torque="fourier", terms=(fit.mechanism.drive.table.shape[1] - 1) // 2
        )
    kinds = {p.name: p.kind for p in fit.mechanism.parameters}
    drags = [p.name for p in fit.parameters if p.free and kinds[p.name] in ("drag", "air")]
    return mechanism.with_choices(free=drags), replace(settings, torque=fit.torque)


def _stop(record: Poses) -> int | None:
    """Return the first row that is kept back of a record; None where it is too short."""
    rows = np.flatnonzero(record.measured.any(axis=1))
    count = round(KEPT * len(rows))
    return int(rows[-count]) if count >= FEWEST else None
