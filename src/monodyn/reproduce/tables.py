"""The fits and the poses as rows of numbers: for ``table.csv``, for ``reproduce.json`` and for the
terminal."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case, rms
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.plans import plan_order
from monodyn.reproduce.repetition import Repetition
from monodyn.reproduce.units import JointUnit, shared_unit, units_of
from monodyn.reproduce.vision import BOTH_METHODS, TITLES, Seen

ERRORS = ("residual", "error", "ahead", "late")
"""Errors of a fit that have a column for each joint."""
SHOWN_ERRORS = ERRORS[:3]
"""Errors that the main table shows."""
WORDS = {
    "measured": "",
    "filtered": "filtered, as printed",
    "consistent": "filtered, consistent",
    "rates": "with rates",
    "alone": "torque alone",
    "with-friction": "with friction",
}
"""What is compared, and what acts beside a torque over time, in words."""


REFUSED = " *"
"""Marks a fit that has a motion but cannot be used."""


def labels(cases: Sequence[Case]) -> list[str]:
    """Return the names of what the motion determines and the truth states, in order.

    Args:
        cases: The fits.
    """
    found = dict.fromkeys(name for case in cases for name in case.parameters or {})
    # lengths, masses, dampings: the order of the letters in the first fit that has all of them
    return sorted(found, key=lambda name: ("lmb".index(name[0]), name))


def case_row(case: Case, units: Sequence[JointUnit], names: Sequence[str] = ()) -> dict[str, Any]:
    """Return one fit as a flat row; what is not known is None.

    Args:
        case: The fit.
        units: How each joint is shown.
        names: What the truth states.
    """
    plan, fit = case.plan, case.fit
    row: dict[str, Any] = {
        "method": plan.method,
        "case": plan.case,
        "states": plan.compared,
        "series": plan.series,
        "frames": plan.frames,
        "start": plan.start,
        "unknowns": case.unknowns,
        "evaluations": None if fit is None else fit.evaluations,
        "seconds": round(case.seconds, 4),
        "ok": case.ok,
        "period": None if case.period is None else _short(case.period),
    }
    for name in ERRORS:
        values = getattr(case, name)
        for dof, unit in enumerate(units):
            value = None if values is None else _short(unit.factor * values[dof])
            row[f"{name}_{unit.name}_{unit.unit}"] = value
    for name in names:
        value = (case.parameters or {}).get(name)
        row[f"{name.replace('/', '_')}_error_percent"] = None if value is None else _short(100.0 * value)
    row["status"] = case.status
    return row


def _short(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def gain_row(published: Mapping[str, Any], default: Mapping[str, Any]) -> dict[str, float | None]:
    """Return by how much the default method is better: published over default, by column.

    Args:
        published: A row of the published method.
        default: The same row of the default one.

    Returns:
        Ratios of evaluations, seconds and errors; None where one of the two is not known or zero.
    """
    found: dict[str, float | None] = {}
    for name, above in published.items():
        if name == "evaluations" or name.startswith("seconds") or name.endswith(("_deg", "_mm")):
            below = default[name]
            # a zero is a count that was not taken or an exact solution; neither has a ratio
            found[name] = _short(above / below) if above and below else None
    return found


def comparable(group: Sequence[Case]) -> bool:
    """Return whether the fits of both methods follow the same information: friction model, frames with poses.

    Args:
        group: Fits that differ in the method alone.
    """
    if len(group) != 2 or any(not case.ok or case.residual is None for case in group):
        return False
    first, second = (np.isfinite(case.poses[: case.plan.frames]) for case in group if case.poses is not None)
    return bool((first == second).all())


def grouped(cases: Sequence[Case]) -> list[list[Case]]:
    """Return groups of neighbours that differ in the method alone.

    Args:
        cases: Fits, methods side by side.
    """
    groups = groupby(
        cases, key=lambda c: (c.plan.case, c.plan.compared, c.plan.series, c.plan.frames, c.plan.start)
    )
    return [list(group) for _, group in groups]


def main_cases(repetition: Repetition) -> list[Case]:
    """Return the fits of the usual frames from the usual start, methods side by side.

    Args:
        repetition: The experiment with one pendulum.
    """
    chosen = [
        case
        for evidence in repetition.evidence.values()
        for case in evidence.cases
        if case.plan.frames == evidence.design.frames and case.plan.start == 0
    ]
    return sorted(chosen, key=lambda case: plan_order(case.plan))


def pose_gain(published: Seen, default: Seen) -> dict[str, float | None]:
    """Return by how much the default method sees better: published over default, by column.

    Args:
        published: What the published method saw.
        default: What the default method saw.

    Returns:
        Ratios of times and errors, these over the frames that both have seen; None where there is none.
    """
    one, other, among = published.errors, default.errors, None
    # a frame that one of the two has lost is a hard one: with it the other would be judged by other frames
    if one is not None and other is not None:
        among = np.asarray(np.isfinite(one + other).all(axis=1))
    return gain_row(seen_row(published, among), seen_row(default, among))


def seen_row(seen: Seen, among: np.ndarray | None = None) -> dict[str, Any]:
    """Return what one method saw as a flat row; what is not known is None.

    Args:
        seen: What it saw.
        among: Frames that the error is taken over, bool (frame,); None: those that were seen.
    """
    scene, poses, units = seen.scene, seen.poses, units_of(seen.joints)
    frames = 0 if poses is None else len(poses)
    row: dict[str, Any] = {
        "method": seen.method,
        "frames": frames,
        "frames_seen": 0 if poses is None else int(poses.seen.sum()),
        "seconds_locate": round(seen.seconds_locate, 4),
        "silhouettes_locate": getattr(scene, "evaluations", 0) or None,
        "seconds_a_frame": _short(seen.seconds_a_frame) if frames else None,
        "silhouettes_a_frame": seen.silhouettes,
    }
    errors = None if seen.errors is None else rms(seen.errors if among is None else seen.errors[among])
    for dof, unit in enumerate(units):
        value = None if errors is None else _short(unit.factor * errors[dof])
        row[f"error_{unit.name}_{unit.unit}"] = value
    row["status"] = seen.status
    return row


def csv_text(repetitions: Sequence[Repetition]) -> str:
    """Return all fits as CSV.

    Args:
        repetitions: The experiment with each pendulum.
    """
    rows = [row for number, repetition in enumerate(repetitions) for row in _fit_rows(number, repetition)]
    file = io.StringIO()
    # a pendulum without fits has no columns of parameters, which another one may have
    columns = list(dict.fromkeys(name for row in rows for name in row))
    columns.sort(key="status".__eq__)
    writer = csv.DictWriter(file, fieldnames=columns, lineterminator="\n")
    writer.writeheader()
    # what is missing or unbounded is an empty cell
    for row in rows:
        lost = {name for name, cell in row.items() if isinstance(cell, float) and not math.isfinite(cell)}
        writer.writerow({name: "" if name in lost else cell for name, cell in row.items()})
    return file.getvalue()


def _fit_rows(number: int, repetition: Repetition) -> list[dict[str, Any]]:
    """Return all fits with one pendulum."""
    cases = [case for evidence in repetition.evidence.values() for case in evidence.cases]
    units = units_of(next(iter(repetition.evidence.values())).seen.joints)
    names = labels(cases)
    seed = None if repetition.settings is None else repetition.settings.seed
    return [{"pendulum": number, "seed": seed, **case_row(case, units, names)} for case in cases]


def document(repetitions: Sequence[Repetition], found: Sequence[Claim]) -> dict[str, Any]:
    """Return everything that was found as a JSON document.

    Args:
        repetitions: The experiment with each pendulum.
        found: The claims.
    """
    return {
        "pendulums": [_pendulum(number, repetition) for number, repetition in enumerate(repetitions)],
        "claims": [
            {
                "claim": claim.text,
                "place": claim.place,
                "rule": claim.rule,
                **{
                    method: {
                        "held": judged.held,
                        "of": judged.decided,
                        "rests_on": judged.basis,
                        "verdicts": [{"held": v.held, "numbers": v.numbers} for v in judged.verdicts],
                    }
                    for method, judged in claim.judged.items()
                },
            }
            for claim in found
        ],
    }


def _pendulum(number: int, repetition: Repetition) -> dict[str, Any]:
    """Return what was found with one pendulum."""
    settings, evidence = repetition.settings, repetition.evidence
    cases = [case for found in evidence.values() for case in found.cases]
    rows = _fit_rows(number, repetition)
    poses = [seen_row(evidence[method].seen) for method in BOTH_METHODS]
    units = units_of(evidence["paper"].seen.joints)
    pairs = [group for group in grouped(main_cases(repetition)) if comparable(group)]
    starts = evidence["paper"].pose_starts
    return {
        "name": repetition.name,
        "seed": None if settings is None else settings.seed,
        "pendulum": None if settings is None else asdict(settings.pendulum),
        "poses": poses,
        "frameworks": [
            {
                "framework": form.name,
                "status": form.status,
                "mismatch_px2": None if form.mismatch is None else _short(form.mismatch),
                "silhouettes": form.drawings,
                "seconds": round(form.seconds, 4),
                **{
                    f"error_{unit.name}_{unit.unit}": None
                    if form.error is None
                    else _short(unit.factor * form.error[dof])
                    for dof, unit in enumerate(units)
                },
            }
            for form in evidence["paper"].seen.frameworks
        ],
        "pose_starts": None if starts is None else asdict(starts),
        "published_over_default": {
            "poses": pose_gain(*(evidence[method].seen for method in BOTH_METHODS)),
            "fits": [
                {
                    "case": pair[0].plan.case,
                    "series": pair[0].plan.series,
                    **gain_row(*(case_row(case, units) for case in pair)),
                }
                for pair in pairs
            ],
        },
        "fits": [
            {**row, "parameters": parameter_values(case), "advice": advice(case)}
            for row, case in zip(rows, cases, strict=True)
        ],
        "assumptions": [
            {"assumption": each.name, "held": each.held, "numbers": each.numbers}
            for each in repetition.assumptions
        ],
    }


def parameter_values(case: Case) -> dict[str, float]:
    """Return the estimated parameters of a fit by name.

    Args:
        case: The fit.
    """
    return {} if case.fit is None else {p.name: p.value for p in case.fit.parameters if p.free}


def advice(case: Case) -> list[str]:
    """Return the advice of a fit.

    Args:
        case: The fit.
    """
    return [] if case.fit is None else list(case.fit.advice)


def plain_rows(repetition: Repetition) -> tuple[list[str], list[list[str]]]:
    """Return the table of the three cases for the terminal: column names and cells.

    Args:
        repetition: The experiment with one pendulum.
    """
    units = units_of(repetition.evidence["paper"].seen.joints)
    unit = shared_unit(units)
    columns = ["case", "states", "method", "unknowns", "evaluations", "seconds"]
    columns += [f"{name} [{unit}]" if unit else name for name in ("residual", "against truth", "prediction")]
    rows = []
    for group in grouped(main_cases(repetition)):
        found = [case_row(case, units) for case in group]
        for case, row in zip(group, found, strict=True):
            star = REFUSED if case.motion is not None and not case.ok else ""
            title = TITLES[case.plan.method] + star
            cells = [case.plan.case, WORDS[case.plan.series or case.plan.compared], title]
            cells += [_cell(row[name]) for name in ("unknowns", "evaluations", "seconds")]
            rows.append([*cells, *(_joined(row, name, units) for name in SHOWN_ERRORS)])
        if comparable(group):
            gain = gain_row(*found)
            cells = [
                "",
                "",
                "published / default",
                "–",
                *(_cell(gain[k]) for k in ("evaluations", "seconds")),
            ]
            rows.append([*cells, *(_joined(gain, name, units, signed=False) for name in SHOWN_ERRORS)])
    # a column without a number is left out; the names of the fits, the first three, stay in any case
    empty = {"–", ""}
    kept = [i for i in range(len(columns)) if i < 3 or any(row[i] not in empty for row in rows)]
    return [columns[i] for i in kept], [[row[i] for i in kept] for row in rows]


def legend(repetitions: Sequence[Repetition]) -> list[str]:
    """Return the lines that explain the tables of the terminal.

    Args:
        repetitions: The experiment with each pendulum.
    """
    main = [case for repetition in repetitions for case in main_cases(repetition)]
    names = " · ".join(joint.name for joint in repetitions[0].evidence["paper"].seen.joints)
    found = [
        f"Errors are rms by joint: {names}. Published / default: above one the default method is better.",
    ]
    if any(case.motion is None for case in main):
        found.append("–: no fit; its reason is on the page.")
    if any(case.motion is not None and not case.ok for case in main):
        found.append("*: the simulated motion does not follow the poses; claims do not rest on such a fit.")
    return found


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _joined(row: Mapping[str, Any], name: str, units: Sequence[JointUnit], *, signed: bool = True) -> str:
    """Write an error of every joint into one cell, with units where they differ."""
    values = [row[f"{name}_{unit.name}_{unit.unit}"] for unit in units]
    if all(value is None for value in values):
        return "–"
    signs = [unit.sign if signed and not shared_unit(units) else "" for unit in units]
    return " · ".join(
        _cell(value) + ("" if value is None else sign) for value, sign in zip(values, signs, strict=True)
    )
