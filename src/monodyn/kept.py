"""Frames kept back: what a fit to the beginnings of its records alone predicts of their ends.

Where hardly a row is left after the fitted ones nothing judges the fit, but how well the same mechanism,
identified without the last of them, goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from monodyn.errors import MonodynError
from monodyn.estimation.fit import GRADES, Doubt, Fit
from monodyn.mechanism import Mechanism
from monodyn.mechanism.upright import ROLL
from monodyn.results.heldout import missed
from monodyn.results.predict import predict
from monodyn.results.trace import fitted_rows, trace_of
from monodyn.settings import IdentifySettings
from monodyn.stages import identify
from monodyn.types import Poses, Progress

KEPT = 0.2
"""Share of the measured rows of each record that is kept back."""
FEWEST = 10
"""Measured rows by which a fit is judged, at least: fewer say nothing."""


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
        records: The whole records; those of which enough is left after the fitted rows keep nothing back.
        mechanism: The mechanism as it was before.
        settings: How it was identified.
        progress: Called as the identification goes.
    """
    if not (fit.ok and fit.starts):
        return []
    fitted, stops = [], []
    for k, record in enumerate(records):
        first, after = fitted_rows(fit, record, k)
        fitted.append(record[first:after])
        stops.append(None if np.sum(record[after:].measured.any(axis=1)) >= FEWEST else _stop(fitted[-1]))
    if all(stop is None for stop in stops):
        return []
    parts = [record if stop is None else record[:stop] for record, stop in zip(fitted, stops, strict=True)]
    try:
        # the prediction rests on the covariance, wherever the intervals come from
        quick = replace(settings, starts=1, uncertainty="linear")
        shorter = identify(parts, *_as_chosen(fit, _turned(fit, mechanism), quick), progress=progress)
    except MonodynError as error:
        return [_unidentified(str(error))]
    if not shorter.starts:
        return [_unidentified(shorter.status)]
    found = [
        doubt
        for k, (record, stop) in enumerate(zip(fitted, stops, strict=True))
        if stop is not None and (doubt := _judged(shorter, record, stop, k))
    ]
    # the gravest is enough: many records would say the same many times
    return [min(found, key=lambda doubt: (-GRADES.index(doubt.grade), doubt.holds))] if found else []


def _judged(shorter: Fit, record: Poses, stop: int, k: int) -> Doubt | None:
    """Return what the rows of a record from ``stop`` on say against a fit to those before."""
    future = predict(shorter, times=record.time[stop:], record=k)
    doubt = missed(shorter, trace_of(shorter, record, future, record=k))
    without = f"Identified without the last {record.time[-1] - record.time[stop - 1]:.2g} s of the record: "
    return doubt and replace(doubt, reason=f"{without}{doubt.reason}")


def _unidentified(reason: str) -> Doubt:
    """Return the doubt about a fit that rests on the end of its records."""
    return Doubt(
        "approximate",
        f"Without the last {KEPT:.0%} of what was measured, kept back to judge the fit by, the mechanism "
        f"cannot be identified: {reason}",
    )


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


def _turned(fit: Fit, mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with the roll that was found where the user freed it: a zero of the angles that
    hangs down is a quarter turn from what is tried first, and one search alone does not find it."""
    if ROLL not in mechanism.chosen or not mechanism.parameter(ROLL).free:
        return mechanism
    return mechanism.with_values({ROLL: fit.parameter(ROLL).value})


def _stop(record: Poses) -> int | None:
    """Return the first row that is kept back of a record; None where it is too short."""
    rows = np.flatnonzero(record.measured.any(axis=1))
    count = round(KEPT * len(rows))
    return int(rows[-count]) if count >= FEWEST else None
