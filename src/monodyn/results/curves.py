"""Motion, torques and the camera's way as the data of figures: measured, fitted and predicted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from monodyn.numbers import shown_in
from monodyn.results.trace import Trace

if TYPE_CHECKING:
    from collections.abc import Sequence

    from monodyn.estimation.fit import Fit
    from monodyn.mechanism import Joint, Mechanism
    from monodyn.results.closed import ClosedLoop
    from monodyn.results.fill import States
    from monodyn.vision.clip.steady import CameraPath

BAND = 1.96
"""Standard deviations from the middle of a 95 % band to its edge."""
DOTS = 40
"""Dots by which a planned way is shown."""
MOST = 5_000
"""Points of a curve: more than a screen has columns; with 20,000 a page of two joints was 8 MB."""
_NO_ERROR = (np.zeros(0), np.zeros(0))


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
                "quantity": _quantity(joint),
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


def state_curves(mechanism: Mechanism, states: States) -> list[dict[str, Any]]:
    """Return the data of one figure per joint for a prediction, with its 95 % band.

    Args:
        mechanism: Gives the joints.
        states: The motion.
    """
    plots = []
    for dof, joint in enumerate(mechanism.joints):
        scale, unit = shown_in(joint)
        band = _band(states.time, states.position[:, dof] * scale, states.std[:, dof] * scale, *_NO_ERROR)
        plots.append(_alone(joint.name, _quantity(joint), unit, predicted=band))
    return plots


def loop_curves(
    mechanism: Mechanism, loop: ClosedLoop, motors: Sequence[str], plan: tuple[np.ndarray, np.ndarray] | None
) -> list[dict[str, Any]]:
    """Return the data of one figure per joint, and per motor, for a mechanism under its controller.

    Args:
        mechanism: Gives the joints.
        loop: The mechanism under its controller.
        motors: Joints with a motor.
        plan: Time stamps [s], (frame,), and states [SI], (frame, 2 dof), of a way that is followed; None of
            no way.
    """
    plots = []
    for dof, joint in enumerate(mechanism.joints):
        scale, unit = shown_in(joint)
        curve = _band(loop.time, loop.position[:, dof] * scale, 0.0 * loop.time, *_NO_ERROR)
        way: dict[str, list[float | None]] = {}
        if plan is not None:
            # as many dots as are apart from one another
            rows = slice(None, None, max(1, len(plan[0]) // DOTS))
            way = {"time": _list(plan[0][rows]), "observed": _list(plan[1][rows, dof] * scale)}
        plots.append(_alone(joint.name, _quantity(joint), unit, fitted=curve) | way)
    kinds = {joint.name: _effort(joint) for joint in mechanism.joints}
    for motor, name in enumerate(motors):
        curve = _band(loop.time, loop.torque[:, motor], 0.0 * loop.time, *_NO_ERROR)
        plots.append(_alone(f"torque at {name}", *kinds[name], fitted=curve))
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
    window = [float(found.time[first]), float(found.time[stop - 1])]
    plots = []
    for dof, joint in enumerate(fit.mechanism.joints):
        title = f"{trace.name}: torque at {joint.name}" if several else f"torque at {joint.name}"
        curve = _band(found.time[rows], found.torque[rows, dof], found.std[rows, dof], *_NO_ERROR)
        plots.append({**_alone(title, *_effort(joint), fitted=curve), "window": window})
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
    reach, window = 0.5 * math.hypot(*path.size), [float(times[0]), float(times[-1])]
    shown = [
        ("still scene, to the right", "displacement", "px", path.shift[:, 0], path.std),
        ("still scene, down", "displacement", "px", path.shift[:, 1], path.std),
        ("turn of the still scene", "turn", "deg", np.degrees(path.turn), np.degrees(path.std / reach)),
        ("zoom", "zoom", "%", 100.0 * path.zoom, 100.0 * path.std / reach),
    ]
    plots = []
    for title, quantity, unit, values, std in shown:
        curve = _band(times, values, np.where(path.registered, std, np.nan), *_NO_ERROR)
        plots.append({**_alone(title, quantity, unit, fitted=curve), "window": window})
    return plots


def _alone(title: str, quantity: str, unit: str, **curves: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a figure without observations and errors: a ``fitted`` curve, or a ``predicted``."""
    bare = {"time": [], "observed": [], "window": None, "fitted": None, "predicted": None, "alone": True}
    return {"title": title, "quantity": quantity, "unit": unit, **bare, **curves}


def _quantity(joint: Joint) -> str:
    """Return what the position of a joint is, for its axis."""
    return "angle" if joint.kind == "hinge" else "position"


def _effort(joint: Joint) -> tuple[str, str]:
    """Return what acts along a joint, and its unit."""
    return ("torque", "N m") if joint.kind == "hinge" else ("force", "N")


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
    """Return numbers short enough, and few enough, for a figure; unknown ones as null."""
    shown = np.asarray(values, dtype=float)[:: max(1, -(-len(values) // MOST))]
    return [float(f"{v:.6g}") if math.isfinite(v) else None for v in shown.tolist()]
