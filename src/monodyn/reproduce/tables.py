"""The fits and the poses as rows of numbers: for the page, for ``table.csv`` and for ``reproduce.json``."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case, rms
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.vision import METHODS, TITLES, Seen

ERRORS = ("residual", "error", "ahead", "late")
"""Errors of a fit that have a column for each joint."""
RATIOS = ("l1", "l2", "m2/m1", "b1/m1", "b2/m1")
"""What the motion can tell of a double pendulum."""


def case_row(case: Case, joints: Sequence[str]) -> dict[str, Any]:
    """Return one fit as a flat row; what is not known is None.

    Args:
        case: The fit.
        joints: Joint names.
    """
    plan, fit = case.plan, case.fit
    row: dict[str, Any] = {
        "method": plan.method,
        "case": plan.case,
        "states": plan.states,
        "frames": plan.frames,
        "start": plan.start,
        "unknowns": case.unknowns,
        "evaluations": None if fit is None else fit.evaluations,
        "seconds": round(case.seconds, 4),
        "ok": fit is not None and bool(fit.ok),
    }
    for name in ERRORS:
        values = getattr(case, name)
        for i, joint in enumerate(joints):
            row[f"{name}_{joint}_deg"] = None if values is None else _short(np.degrees(values[i]))
    for name in RATIOS:
        value = (case.parameters or {}).get(name)
        row[f"{name.replace('/', '_')}_error_percent"] = None if value is None else _short(100.0 * value)
    row["status"] = case.status
    return row


def _short(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def seen_row(seen: Seen, joints: Sequence[str]) -> dict[str, Any]:
    """Return what one method saw as a flat row; what is not known is None.

    Args:
        seen: What it saw.
        joints: Joint names.
    """
    scene, poses = seen.scene, seen.poses
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
    errors = None if seen.errors is None else rms(seen.errors)
    for i, joint in enumerate(joints):
        row[f"error_{joint}_deg"] = None if errors is None else _short(np.degrees(errors[i]))
    row["status"] = seen.status
    return row


def csv_text(cases: Sequence[Case], joints: Sequence[str]) -> str:
    """Return all fits as CSV.

    Args:
        cases: The fits.
        joints: Joint names.
    """
    rows = [case_row(case, joints) for case in cases]
    file = io.StringIO()
    writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return file.getvalue()


def document(
    seen: Mapping[str, Seen], cases: Sequence[Case], found: Sequence[Claim], joints: Sequence[str]
) -> dict[str, Any]:
    """Return everything that was found as a JSON document.

    Args:
        seen: What each method saw.
        cases: The fits.
        found: The claims.
        joints: Joint names.
    """
    return {
        "poses": [seen_row(seen[method], joints) for method in METHODS],
        "fits": [
            {**case_row(case, joints), "parameters": parameter_values(case), "advice": advice(case)}
            for case in cases
        ],
        "claims": [
            {
                "claim": claim.text,
                "place": claim.place,
                "rule": claim.rule,
                **{
                    method: {"held": verdict.held, "numbers": verdict.numbers}
                    for method, verdict in claim.verdicts.items()
                },
            }
            for claim in found
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


def plain_rows(cases: Sequence[Case], joints: Sequence[str]) -> tuple[list[str], list[list[str]]]:
    """Return the table of the three cases for the terminal: column names and cells.

    Args:
        cases: The fits.
        joints: Joint names.
    """
    columns = ["case", "states", "method", "unknowns", "evaluations", "seconds"]
    columns += ["residual [deg]", "against truth [deg]", "prediction [deg]"]
    rows = []
    for case in main_cases(cases):
        row = case_row(case, joints)
        cells = [case.plan.case, case.plan.states, TITLES[case.plan.method]]
        cells += [_cell(row[name]) for name in ("unknowns", "evaluations", "seconds")]
        cells += [_joined([row[f"{name}_{joint}_deg"] for joint in joints]) for name in ERRORS[:3]]
        rows.append(cells)
    return columns, rows


def main_cases(cases: Sequence[Case]) -> list[Case]:
    """Return the fits of the three cases and of the filtered states, methods side by side.

    Args:
        cases: All fits.
    """
    frames = next((case.plan.frames for case in cases if case.plan.case == "II"), 0)
    chosen = [case for case in cases if case.plan.frames == frames and case.plan.start == 0]
    order = {("I", "measured"): 0, ("I", "filtered"): 1, ("II", "measured"): 2, ("III", "measured"): 3}
    return sorted(chosen, key=lambda c: (order[c.plan.case, c.plan.states], METHODS.index(c.plan.method)))


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _joined(values: Sequence[float | None]) -> str:
    return " · ".join(_cell(value) for value in values)
