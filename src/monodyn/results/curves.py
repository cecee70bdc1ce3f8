"""Motion, torques and the camera's way as the data of figures: measured, fitted and predicted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.results.numbers import shown_in
from monodyn.results.trace import Trace

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit
    from monodyn.results.fill import States
    from monodyn.vision.clip.steady import CameraPath

BAND = 1.96
"""Standard deviations from the middle of a 95 % band to its edge."""


def motion_curves(
    fit: Fit, trace: Trace, motion: States | None = None, *, several: bool
) -> list[dict[str, Any]]:
    """Return the data of one figure per joint: measured, fitted, predicted and filled positions.

    Args:
        fit: The fit.
        trace: A record and its motion.
        motion: The motion with its gaps filled; None fills none.
        several: True puts the record's name into the titles.
    """
    poses, states = trace.poses, trace.states
    first, stop = trace.rows
    plots = []
    for dof, joint in enumerate(fit.mechanism.joints):
        scale, unit = shown_in(joint)
        # null leaves a gap in the curve
        observed = np.where(poses.measured[:, dof], poses.position[:, dof], np.nan) * scale
        error = states.position[:, dof] * scale - observed
        curve = (states.time, states.position[:, dof] * scale, states.std[:, dof] * scale)
        plots.append(
            {
                "title": f"{trace.name}: {joint.name}" if several else joint.name,
                "unit": unit,
                "time": _list(poses.time),
                "observed": _list(observed),
                "window": [float(poses.time[first]), float(poses.time[stop - 1])],
                # after the fitted frames the curve is the prediction, which has not used them
                "fitted": _band(*(values[:stop] for values in (*curve, poses.time, error))),
                "predicted": _predicted(trace, dof, scale, (poses.time[stop:], error[stop:])),
                "filled": None if motion is None else _filled(trace, motion, dof, scale),
            }
        )
    return plots


def torque_curves(fit: Fit, trace: Trace, *, several: bool) -> list[dict[str, Any]]:
    """Return the data of one figure per joint for the torques other than friction; none without a drive.

    Args:
        fit: The fit.
        trace: A record and its motion.
        several: True puts the record's name into the titles.
    """
    found = trace.torques
    if found is None:
        return []
    first, stop = trace.rows
    # free torques are known at the fitted frames alone, a periodic one at all times
    rows = slice(first, stop) if fit.torque == "free" else slice(None)
    nothing = np.zeros(0)
    plots = []
    for dof, joint in enumerate(fit.mechanism.joints):
        curve = _band(found.time[rows], found.torque[rows, dof], found.std[rows, dof], nothing, nothing)
        plots.append(
            {
                "title": f"{trace.name}: torque at {joint.name}" if several else f"torque at {joint.name}",
                "unit": "N m" if joint.kind == "hinge" else "N",
                "time": [],
                "observed": [],
                "window": [float(found.time[first]), float(found.time[stop - 1])],
                "fitted": curve,
                "predicted": None,
                "alone": True,
            }
        )
    return plots


def camera_curves(times: np.ndarray, path: CameraPath | None) -> list[dict[str, Any]]:
    """Return the data of the figures of a camera's way: displacement, turn and zoom of the still scene.

    Args:
        times: Time stamps of the clip [s], (frame,).
        path: The way, or None.

    Returns:
        One figure each; none for a camera that stands still.
    """
    if path is None:
        return []
    nothing, reach = np.zeros(0), 0.5 * math.hypot(*path.size)
    shown = [
        ("still scene, to the right", "px", path.shift[:, 0], path.std),
        ("still scene, down", "px", path.shift[:, 1], path.std),
        ("turn of the still scene", "deg", np.degrees(path.turn), np.degrees(path.std / reach)),
        ("zoom", "%", 100.0 * path.zoom, 100.0 * path.std / reach),
    ]
    plots = []
    for title, unit, values, std in shown:
        curve = _band(times, values, np.where(path.registered, std, np.nan), nothing, nothing)
        window = [float(times[0]), float(times[-1])]
        plots.append(
            {"title": title, "unit": unit, "time": [], "observed": [], "window": window, "fitted": curve,
             "predicted": None, "alone": True}
        )  # fmt: skip
    return plots


def _predicted(
    trace: Trace, dof: int, scale: float, late: tuple[np.ndarray, np.ndarray]
) -> dict[str, Any] | None:
    """Return the curve of the prediction with its error where the record goes on (time stamps, error)."""
    future = trace.future
    if future is None or not len(future.time):
        return None
    return _band(future.time, future.position[:, dof] * scale, future.std[:, dof] * scale, *late)


def _filled(trace: Trace, motion: States, dof: int, scale: float) -> dict[str, Any]:
    """Return the positions that were hidden, with half the width of their 95 % band."""
    rows = np.flatnonzero(~trace.poses.measured[:, dof] & np.isfinite(motion.std[:, dof]))
    value, half = motion.position[rows, dof] * scale, BAND * motion.std[rows, dof] * scale
    return {"time": _list(motion.time[rows]), "value": _list(value), "half": _list(half)}


def _band(
    time: np.ndarray, value: np.ndarray, std: np.ndarray, error_time: np.ndarray, error: np.ndarray
) -> dict[str, Any]:
    """Return a curve with its 95 % band, and an error; an infinite band is left out."""
    half = BAND * np.where(np.isfinite(std), std, 0.0)
    return {
        "time": _list(time),
        "value": _list(value),
        "lower": _list(value - half),
        "upper": _list(value + half),
        "error_time": _list(error_time),
        "error": _list(error),
    }


def _list(values: np.ndarray) -> list[float | None]:
    """Return numbers short enough for a figure; unknown ones as null."""
    return [float(f"{v:.6g}") if math.isfinite(v) else None for v in np.asarray(values, dtype=float).tolist()]
