"""An identified mechanism in, its motion after the fitted frames out, from the fitted frames alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.mechanism.steps import spacing
from monodyn.results.fill import MOST_ROWS, States, fill


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(States):
    """Motion at times that the identification did not use; fields as in `States`."""


def predict(
    fit: Fit, until: float | None = None, times: np.ndarray | None = None, *, record: int = 0
) -> Prediction:
    """Roll the identified mechanism out from the fitted start state.

    Args:
        fit: The identified mechanism.
        until: Last time stamp [s]; without it and without ``times`` the prediction is as long as the record.
        times: Time stamps [s], (frame,), increasing; those of the clip, for instance. Without them the usual
            spacing of the record goes on from its end.
        record: Which record is carried on.

    Returns:
        The motion at ``times``, or from the end of the fitted frames on.

    Raises:
        SettingsError: ``until`` lies before the end of the fitted frames or too far after it, times do not
            increase, there is no such record, or nothing was identified.

    Example:
        ``future = predict(fit, until=10.0)`` goes on to 10 s on the clock of the record.
    """
    if times is None:
        fit.start_of(record, "predict")
        stamps = fit.time[record]
        end = float(stamps[-1])
        stop = end + (end - float(stamps[0])) if until is None else float(until)
        if not stop > end:
            raise SettingsError(
                f"predict: expected a time after the last fitted frame at {end:g} s, got {stop:g} s."
            )
        times = evenly(end, stop, spacing(stamps))[1:]
        if len(times) == 0:
            times = np.array([stop])
    elif until is not None:
        times = np.asarray(times, dtype=float)
        times = times[times <= until]
    found = fill(fit, times, record=record)
    return Prediction(found.joints, found.time, found.position, found.velocity, found.std, found.velocity_std)


def evenly(begin: float, end: float, step: float) -> np.ndarray:
    """Return equally spaced times from a beginning up to an end.

    Args:
        begin: The first of them [s].
        end: What none of them is after [s].
        step: Between two of them [s].

    Returns:
        Times [s], (frame,).

    Raises:
        SettingsError: There are too many of them.
    """
    # 1e-6 of a step: an end that rounding puts just below a whole number of steps still counts
    rows = np.floor((end - begin) / step + 1e-6) + 1.0
    if rows > MOST_ROWS:
        raise SettingsError(
            f"until: expected at most {MOST_ROWS} rows of {step:g} s, got {rows:.0f}; end it earlier."
        )
    return begin + step * np.arange(int(rows))
