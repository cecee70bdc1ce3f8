"""What is reported about a fit, before it is written: the content of ``fit.json`` and of the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from monodyn.choices import Tolerance
from monodyn.mechanism.dimensions import MASS_KINDS
from monodyn.mechanism.torques import LAG
from monodyn.results.export import jsonable
from monodyn.results.filmed import Filmed
from monodyn.results.gaps import filled
from monodyn.results.horizon import Horizon, horizon_of, horizon_said
from monodyn.results.log import Compared, RunLog
from monodyn.results.trace import Trace
from monodyn.types import Poses

if TYPE_CHECKING:
    from monodyn.estimation.fit import Estimate, Fit
    from monodyn.estimation.parts import Start
    from monodyn.mechanism import Mechanism
    from monodyn.results.fill import States

SCHEMA = 2
"""Version of the form of ``fit.json``: one more whenever a reader of the old form would misread the new."""
FORMULAS = {
    "fourier": "torque = mean + sum over k from 1 to harmonics of cos[k - 1] * cos(2 pi k t / period) + "
    "sin[k - 1] * sin(2 pi k t / period), with t = time stamp * time_scale",
    "free": "torque = values, linear between knots and zero before and after them, at t = time stamp * "
    "time_scale",
    "known": "torque = that of the log at time stamp - lag, linear between its rows",
}
"""How torques over time follow from what ``fit.json`` has of them, by their model."""

Openness = Literal["factor", "combined", "open"]
"""What is left open of a parameter that is not determined."""

REFUSED = "A refused fit tells nothing of the mechanism: neither values nor intervals are to be relied on."
"""What stands before its numbers."""


@dataclass(frozen=True, eq=False)
class Findings:
    """A fit with its records, and what else a report states about it.

    Attributes:
        fit: The fit.
        traces: The records next to their motion; none where nothing was identified.
        title: Heading of the page.
        subtitle: One line under it.
        notes: Sentences after the fit's own advice (from the clip, the camera, the tracking).
        record: The whole record, written as ``poses.csv``; None writes none.
        filmed: Clip and camera; None for encoder records.
        fit_frames: First fitted frame and the one after the last; None takes them from the first record.
        log: Settings, versions and seconds of the run, or None.
        tolerance: How far off a prediction may be.
        drawn: How many models are drawn from what the data allow.
    """

    fit: Fit
    traces: Sequence[Trace] = ()
    title: str = ""
    subtitle: str = ""
    notes: Sequence[str] = ()
    record: Poses | None = None
    filmed: Filmed | None = None
    fit_frames: tuple[int, int] | None = None
    log: RunLog | None = None
    tolerance: Tolerance = field(default_factory=Tolerance)
    drawn: int = 0

    @cached_property
    def ensemble(self) -> list[Mechanism]:
        """The models that are drawn; none where there is nothing to rely on."""
        from monodyn.results.draws import drawn

        seed = 0 if self.log is None else int(self.log.settings.get("seed") or 0)
        return drawn(self.fit, self.drawn, seed=seed) if self.fit.ok and self.drawn else []

    @cached_property
    def horizons(self) -> list[Horizon]:
        """How long the prediction of each record holds; none where there is nothing to rely on."""
        if not self.fit.ok:
            return []
        pairs = enumerate(self.traces)
        return [horizon_of(self.fit, trace, self.tolerance, record=number) for number, trace in pairs]

    @cached_property
    def motions(self) -> list[States]:
        """The motion that stands for each record, its gaps filled."""
        return [filled(self.fit, trace.poses, record=number) for number, trace in enumerate(self.traces)]

    def noted(self, notes: Sequence[str]) -> Findings:
        """Return the same with further notes; what was worked out already is not worked out again.

        Args:
            notes: Sentences.
        """
        found = replace(self, notes=[*self.notes, *notes])
        known = ("ensemble", "horizons", "motions")
        found.__dict__.update({name: value for name, value in self.__dict__.items() if name in known})
        return found

    @property
    def advice(self) -> list[str]:
        """What else speaks against the fit, its own advice and the notes after it."""
        drawn = [] if len(self.ensemble) == self.drawn else [_fewer(len(self.ensemble), self.drawn)]
        return [*(doubt.reason for doubt in self.fit.doubts[1:]), *self.fit.advice, *self.notes, *drawn]

    @property
    def comparison(self) -> Sequence[Compared]:
        """The mechanisms that were tried, the chosen one first; none where the user named it."""
        return () if self.log is None else self.log.comparison

    @property
    def frames(self) -> list[int] | None:
        """First fitted frame and the one after the last, or None where nothing was identified."""
        if self.fit_frames is not None:
            return list(self.fit_frames)
        return frames_of(self.traces[0]) if self.traces else None


def _fewer(found: int, wanted: int) -> str:
    """Say that fewer models were drawn than were asked for."""
    return (
        f"{found} of {wanted} models of the ensemble were drawn: the fit does not say well enough what the "
        "mechanism may be, or nearly all that it allows lies beyond the bounds of the parameters."
    )


def fit_document(findings: Findings) -> dict[str, Any]:
    """Return the content of ``fit.json`` as JSON types, which ``fit.schema.json`` describes; ``opened`` reads
    it back. Null stands for a number that is infinite or unknown, whether or not the file is written.

    Args:
        findings: The fit and its records.
    """
    fit, filmed = findings.fit, findings.filmed
    joints = [joint.name for joint in fit.mechanism.joints]
    names, covariance = fit.spread
    measured = fit.mechanism.measured
    return jsonable(
        {
            "schema": SCHEMA,
            "status": str(fit.status),
            "grade": fit.grade,
            "ok": fit.ok,
            "doubts": [asdict(doubt) for doubt in fit.doubts],
            "advice": findings.advice,
            "torque": fit.torque,
            "drive": _drive_document(fit),
            "acting": list(fit.acting),
            "tried_torques": [tried._asdict() for tried in fit.tried_torques],
            "unknowns": sum(estimate.free for estimate in fit.parameters),
            "evaluations": fit.evaluations,
            "parameters": [parameter_row(estimate, fit) for estimate in fit.parameters],
            "alternatives": [dict(values) for values in fit.alternatives],
            "combinations": [asdict(one) for one in fit.combinations],
            "covariance": {"names": list(names), "matrix": covariance},
            "initial_state": [start_row(joints, start) for start in fit.starts],
            "fitted": [_fitted_row(stamps) for stamps in fit.time[: len(fit.starts)]],
            "units": {joint.name: "rad" if joint.kind == "hinge" else "m" for joint in fit.mechanism.joints},
            "rms": dict(fit.rms),
            "heldout_rms": [trace.heldout() for trace in findings.traces],
            "measured": None if measured is None else asdict(measured),
            "unmodelled": None if fit.unmodelled is None else fit.unmodelled._asdict(),
            "horizon": [_horizon_row(findings, found) for found in findings.horizons],
            "scale": fit.scale,
            "mass_scale": fit.mass_scale,
            "stamp_error": fit.stamp_error,
            "camera": None if filmed is None else _camera_document(filmed),
            "fit_frames": findings.frames,
            "comparison": [asdict(one) for one in findings.comparison],
        }
    )


def _horizon_row(findings: Findings, found: Horizon) -> dict[str, Any]:
    """Return how long the prediction of a record holds, as ``fit.json`` lists it; null seconds are more than
    were looked at."""
    fit, tolerance = findings.fit, findings.tolerance
    return {
        "seconds": found.seconds,
        "joint": found.joint or None,
        "shown": found.shown,
        "tolerance": {joint.name: tolerance.of(joint.kind) for joint in fit.mechanism.joints},
        "said": horizon_said(fit, found, tolerance),
    }


def _camera_document(filmed: Filmed) -> dict[str, Any]:
    """Return the camera as ``fit.json`` has it, how it exposes a picture [s]; ``parallax`` where it moves."""
    shutter = filmed.shutter
    exposed = {
        "exposure": 0.0 if shutter is None else shutter.exposure,
        "readout": 0.0 if shutter is None else shutter.readout,
    }
    document = {**asdict(filmed.camera), **exposed, "std": dict(filmed.camera_std)}
    masks = None if filmed.sight is None else filmed.sight.shown_masks
    if filmed.video.camera_path is not None and masks is not None:
        document["parallax"] = masks.parallax.share
    # in the fit a thickness may stand for a mass: these are what the picture was explained with
    thick = (p for p in filmed.mechanism.parameters if p.kind == "thickness")
    document["thickness"] = {p.name: p.value for p in thick}
    lengths = ("x", "y", "depth")
    pixels = ("width", "height", "focal")
    document["units"] = {
        **dict.fromkeys(lengths, "m"),
        **dict.fromkeys(pixels, "px"),
        **dict.fromkeys(("roll", "pitch", "yaw"), "rad"),
        **dict.fromkeys(("exposure", "readout"), "s"),
    }
    return document


def _drive_document(fit: Fit) -> dict[str, Any]:
    """Return what acts at the joints over time, whole: another program needs nothing else to evaluate it."""
    mechanism = fit.mechanism
    torques, values = mechanism.torques, mechanism.values
    series, table = fit.torque == "fourier", mechanism.numbers[torques.rows]
    rows = {}
    for joint, row in zip(mechanism.joints, table.tolist(), strict=True):
        rows[joint.name] = {
            "unit": "N m" if joint.kind == "hinge" else "N",
            "mean": row[0] if series else None,
            "cos": row[1::2] if series else [],
            "sin": row[2::2] if series else [],
            "values": row if fit.torque == "free" else [],
        }
    return {
        "model": fit.torque,
        "formula": FORMULAS.get(fit.torque),
        "time_scale": values["time_scale"],
        "period": values["torque.period"] if series else None,
        "harmonics": (torques.rows.shape[1] - 1) // 2 if series else 0,
        "knots": torques.knots if fit.torque == "free" else [],
        "lag": values.get(LAG),
        "joints": rows if fit.torque in ("fourier", "free") else {},
    }


def _fitted_row(stamps: np.ndarray) -> dict[str, Any]:
    """Return which part of a record was fitted [s]."""
    return {"first": float(stamps[0]), "last": float(stamps[-1]), "rows": len(stamps)}


def origin(estimate: Estimate, fit: Fit) -> str:
    """Return where the value of a parameter comes from.

    Args:
        estimate: A parameter of a fit.
        fit: The fit.

    Returns:
        ``"estimated"``; ``"derived"`` from estimated ones; ``"assumed"``, in the file's proportion to an
        estimated one; or ``"given"`` by the file or the user.
    """
    if estimate.free:
        return "estimated"
    if estimate.name in {name for name, _ in fit.tied}:
        return "derived" if fit.mechanism.parameter(estimate.name).kind == "lead" else "assumed"
    return "derived" if estimate.name in fit.spread[0] else "given"


def openness(fit: Fit) -> dict[str, Openness]:
    """Return what is left open of the parameters that are not determined, by name.

    ``"factor"``: known up to the one factor of all masses; ``"combined"``: known in combinations with others
    alone; ``"open"``: nothing is known of it.

    Args:
        fit: The fit.
    """
    kinds = {parameter.name: parameter.kind for parameter in fit.mechanism.parameters}
    # a name is followed by a power, or by the next factor
    factors = {factor.partition("^")[0] for one in fit.combinations for factor in one.name.split(" ")}
    found: dict[str, Openness] = {}
    for row in fit.parameters:
        if row.free and not row.identifiable:
            known = "factor" if kinds[row.name] in MASS_KINDS else "combined"
            found[row.name] = known if row.name in factors else "open"
    return found


def parameter_row(estimate: Estimate, fit: Fit) -> dict[str, Any]:
    """Return one parameter as ``fit.json`` lists it.

    Args:
        estimate: A parameter of a fit.
        fit: The fit.
    """
    names = ("name", "value", "std", "lower", "upper", "unit", "free", "identifiable", "at_bound")
    row: dict[str, Any] = {name: getattr(estimate, name) for name in names} | {
        "origin": origin(estimate, fit)
    }
    if not estimate.identifiable and not math.isfinite(estimate.std):
        # where nothing limits it the ends are those of the search, which say nothing; zero is one of nature
        bounds = fit.mechanism.parameter(estimate.name)
        row["lower"] = None if estimate.lower <= bounds.lower and estimate.lower != 0.0 else estimate.lower
        row["upper"] = None if estimate.upper >= bounds.upper else estimate.upper
    return row


def start_row(joints: Sequence[str], start: Start) -> dict[str, Any]:
    """Return one start state as ``fit.json`` lists it.

    Args:
        joints: Joint names.
        start: A start of a fit: time, positions and rates with their covariance.
    """
    # rounding may leave a variance slightly below zero
    std = np.sqrt(np.maximum(np.diagonal(start.covariance), 0.0))
    dofs = len(joints)
    return {
        "time": float(start.time),
        "position": dict(zip(joints, np.asarray(start.position).tolist(), strict=True)),
        "velocity": dict(zip(joints, np.asarray(start.velocity).tolist(), strict=True)),
        "position_std": dict(zip(joints, std[:dofs].tolist(), strict=True)),
        "velocity_std": dict(zip(joints, std[dofs:].tolist(), strict=True)),
    }


def frames_of(trace: Trace) -> list[int]:
    """Return the first fitted frame number and the one after the last.

    Args:
        trace: The record.
    """
    first, stop = trace.rows
    return [int(trace.poses.frame[first]), int(trace.poses.frame[stop - 1]) + 1]


def listed_rows(fit: Fit) -> list[Estimate]:
    """Return the parameters of the first table: the estimated ones, and those that free torques hold.

    Torques at single time stamps, of which there are hundreds, have a figure and a file of their own.

    Args:
        fit: The fit.
    """
    kinds = {parameter.name: parameter.kind for parameter in fit.mechanism.parameters}
    if fit.torque != "free":
        # what follows is listed where it is what was asked for: masses that a known torque determines
        heavy = fit.torque == "known"
        return [
            row
            for row in fit.parameters
            if row.free or (heavy and row.std > 0.0 and kinds[row.name] in ("mass", "inertia", "density"))
        ]
    rows = [row for row in fit.parameters if kinds[row.name] != "torque"]
    # an offset shows in the picture alone: the motion gives no information about it, held or not
    held = [
        row.name
        for row in rows
        if not row.identifiable and row.unit in ("m", "kg", "kg m^2") and kinds[row.name] != "offset"
    ]
    return [row for row in rows if row.free or row.name in held]
