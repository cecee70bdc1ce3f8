"""The fits and the poses as rows of numbers: for the page, for ``table.csv`` and for ``reproduce.json``."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case, rms
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.vision import BOTH_METHODS, TITLES, Seen

ERRORS = ("residual", "error", "ahead", "late")
"""Errors of a fit that have a column for each joint."""
SHOWN_ERRORS = ERRORS[:3]
"""Errors that the main table shows."""
STAR = "*"
"""Marks a case whose period is that of the whole clip."""
PERIODS = {False: "fitted frames", True: "whole clip"}
"""Where the period of Case II is from."""
RATIOS = ("l1", "l2", "m2/m1", "b1/m1", "b2/m1")
"""What the motion of a double pendulum determines."""


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
        "period_from": "" if plan.case != "II" or fit is None else PERIODS[case.clip_period],
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
        if name == "evaluations" or name.startswith("seconds") or name.endswith("_deg"):
            below = default[name]
            # a zero is a count that was not taken or an exact solution; neither has a ratio
            found[name] = _short(above / below) if above and below else None
    return found


def gains(cases: Sequence[Case], joints: Sequence[str]) -> list[dict[str, Any]]:
    """Return by how much the default method is better in each case that both methods have.

    Args:
        cases: The fits.
        joints: Joint names.
    """
    pairs = [pair for pair in grouped(main_cases(cases)) if len(pair) == 2]
    return [
        {"case": pair[0].plan.case, **gain_row(*(case_row(case, joints) for case in pair))} for pair in pairs
    ]


def grouped(cases: Sequence[Case]) -> list[list[Case]]:
    """Return groups of neighbours that differ in the method alone.

    Args:
        cases: Fits, methods side by side.
    """
    groups = groupby(cases, key=lambda c: (c.plan.case, c.plan.states, c.plan.frames, c.plan.start))
    return [list(group) for _, group in groups]


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
    poses = [seen_row(seen[method], joints) for method in BOTH_METHODS]
    return {
        "poses": poses,
        "published_over_default": {"poses": gain_row(*poses), "fits": gains(cases, joints)},
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
    for group in grouped(main_cases(cases)):
        found = [case_row(case, joints) for case in group]
        for case, row in zip(group, found, strict=True):
            cells = [case.plan.case + STAR * case.clip_period, case.plan.states, TITLES[case.plan.method]]
            cells += [_cell(row[name]) for name in ("unknowns", "evaluations", "seconds")]
            rows.append(
                cells + [_joined([row[f"{name}_{joint}_deg"] for joint in joints]) for name in SHOWN_ERRORS]
            )
        if len(found) == 2:
            gain = gain_row(*found)
            cells = [
                "",
                "",
                "published / default",
                "–",
                *(_cell(gain[k]) for k in ("evaluations", "seconds")),
            ]
            rows.append(
                cells + [_joined([gain[f"{name}_{joint}_deg"] for joint in joints]) for name in SHOWN_ERRORS]
            )
    # a column without a number is left out; the names of the fits, the first three, stay in any case
    empty = {"–", ""}
    kept = [i for i in range(len(columns)) if i < 3 or any(row[i] not in empty for row in rows)]
    return [columns[i] for i in kept], [[row[i] for i in kept] for row in rows]


def main_cases(cases: Sequence[Case]) -> list[Case]:
    """Return the fits of the three cases and of the filtered states, methods side by side.

    Args:
        cases: All fits.
    """
    # Case II is fitted to the usual number of frames alone, so it shows which number that is
    frames = next((case.plan.frames for case in cases if case.plan.case == "II"), 0)
    chosen = [case for case in cases if case.plan.frames == frames and case.plan.start == 0]
    order = {("I", "measured"): 0, ("I", "filtered"): 1, ("II", "measured"): 2, ("III", "measured"): 3}
    return sorted(
        chosen, key=lambda c: (order[c.plan.case, c.plan.states], BOTH_METHODS.index(c.plan.method))
    )


def _cell(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _joined(values: Sequence[float | None]) -> str:
    return "–" if all(value is None for value in values) else " · ".join(_cell(value) for value in values)
