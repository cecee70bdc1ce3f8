"""What is known at one frame as plain numbers: a line of NDJSON, and what the page shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.live.step import Step
from monodyn.results.findings import listed_rows, parameter_row
from monodyn.results.predict import Prediction
from monodyn.results.trace import metric
from monodyn.types import Poses

SCHEMA = 1
"""Version of the form: one more whenever a reader of the old form would misread the new."""
MOST_AHEAD = 20
"""Rows of the prediction, at most."""
KNOWN = 0.05
"""Half width of a length's 95 % interval, as a share of the length, up to which the motion was enough."""


def step_document(step: Step) -> dict[str, Any]:
    """Return what is known at one frame, which ``step.schema.json`` describes; every number is finite.

    Args:
        step: What is known.
    """
    fit, pose = step.fit, shown_pose(step)
    seen = pose is not None and bool(pose.measured.all())
    return {
        "schema": SCHEMA,
        "frame": step.index,
        "time": _finite(step.time),
        "phase": step.phase,
        "seen": seen,
        "pose": None if pose is None else _by_joint(pose.joints, pose.position[0]),
        "std": None if pose is None else _by_joint(pose.joints, _std(pose)),
        "parameters": {} if fit is None else _parameters(fit),
        "enough_motion": None if fit is None else not hardly_known(fit),
        "future": [] if fit is None else _future(fit, step.future),
        "verdict": step.verdict,
        "said": step.said,
        "error": None if pose is None or not len(step.error) else _by_joint(pose.joints, step.error),
        "latency": _finite(step.latency),
        "fresh": _finite(step.fresh),
        "skipped": step.skipped,
    }


def shown_pose(step: Step) -> Poses | None:
    """Return the pose as it is shown: in metres and against gravity as soon as these are known, as the
    prediction is; None before the mechanism is followed.

    Args:
        step: What is known.
    """
    fit = step.fit
    if step.pose is None or fit is None or not fit.starts:
        return step.pose
    return metric(step.pose, fit.mechanism, fit.scale)


@lru_cache(maxsize=4)
def hardly_known(fit: Fit) -> tuple[tuple[str, float], ...]:
    """Return the estimated lengths that the motion has not determined within ``KNOWN`` yet, the worst first.

    Args:
        fit: What was identified.

    Returns:
        Name and half width of the 95 % interval as a share of the length, infinite where nothing is known.
        A mechanism without such a length is known once its fit can be used: else its name stands here.
    """
    kinds = {p.name: p.kind for p in fit.mechanism.parameters}
    lengths = [row for row in fit.parameters if row.free and kinds[row.name] == "length"]
    if not lengths:
        return () if fit.ok else ((fit.mechanism.name, math.inf),)
    shares = [(row.name, 0.5 * (row.upper - row.lower) / (abs(row.value) or 1.0)) for row in lengths]
    wide = [(name, share if math.isfinite(share) else math.inf) for name, share in shares]
    # a refused fit may have narrow intervals about wrong values
    wide = [pair for pair in wide if not pair[1] <= KNOWN or not fit.ok]
    return tuple(sorted(wide, key=lambda pair: -pair[1]))


# most frames of a fast stream share their fit with the one before
@lru_cache(maxsize=4)
def _parameters(fit: Fit) -> dict[str, dict[str, Any]]:
    """Return the estimated parameters by name."""
    rows = [parameter_row(row, fit) for row in listed_rows(fit)]
    numbers = ("value", "std", "lower", "upper")
    return {row["name"]: {n: _finite(row[n]) for n in numbers} | {"unit": row["unit"]} for row in rows}


@lru_cache(maxsize=4)
def _future(fit: Fit, future: Prediction | None) -> list[dict[str, Any]]:
    """Return rows of the prediction at about equal distances, the first and the last among them."""
    if future is None:
        return []
    joints = [joint.name for joint in fit.mechanism.joints]
    count = len(future.time)
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_AHEAD)).round().astype(int))
    parts = (future.time, future.position, future.std)
    return [
        {
            "time": time,
            "position": dict(zip(joints, position, strict=True)),
            "std": dict(zip(joints, std, strict=True)),
        }
        for time, position, std in zip(*(_listed(part[rows]) for part in parts), strict=True)
    ]


def _std(pose: Poses) -> np.ndarray:
    """Return the standard deviations of a pose [rad or m], (dof,)."""
    return np.sqrt(np.maximum(np.diagonal(pose.covariance[0]), 0.0))


def _by_joint(joints: Sequence[str], values: np.ndarray) -> dict[str, float | None]:
    """Return a number for each joint, (dof,), by its name."""
    return dict(zip(joints, _listed(values), strict=True))


def _listed(values: np.ndarray) -> list[Any]:
    """Return the numbers of an array (row,) or (row, dof), None where one has no end."""
    finite, listed = np.isfinite(values), values
    if not finite.all():
        listed = values.astype(object)
        listed[~finite] = None
    return listed.tolist()


def _finite(value: float | None) -> float | None:
    """Return a number, None where it is none or has no end."""
    return float(value) if value is not None and math.isfinite(value) else None
