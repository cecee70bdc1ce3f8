"""The tables of the page: cells as text."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monodyn.reproduce import tables
from monodyn.reproduce.cases import Case
from monodyn.reproduce.endings import endings
from monodyn.reproduce.plans import start_scale
from monodyn.reproduce.repetition import Repetition
from monodyn.reproduce.series_claims import drawn_fits
from monodyn.reproduce.units import JointUnit, shared_unit, units_of
from monodyn.reproduce.vision import BOTH_METHODS, TITLES

NO_NUMBER = "–"
"""Stands where there is no number."""
HELD = {True: "held", False: "does not hold", None: "not decided"}
"""What is said of an assumption."""


@dataclass(frozen=True)
class PageTable:
    """A table of the page.

    Attributes:
        head: Column titles; those of columns of text are in ``text``.
        rows: Class of the row and its cells.
        text: Titles of the columns that are text, not numbers.
        wide: Titles of the columns of text whose lines are broken.
    """

    head: Sequence[str]
    rows: Sequence[tuple[str, Sequence[str]]]
    text: Sequence[str] = ("case", "method", "status", "framework", "assumption", "here", "numbers", "start")
    wide: Sequence[str] = ("status", "assumption", "numbers")

    @classmethod
    def of(cls, head: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> PageTable:
        """Return a table without the columns that are empty in every row.

        Args:
            head: Column titles.
            rows: Class of the row and its cells.
        """
        kept = [i for i in range(len(head)) if any(cells[i] not in ("", NO_NUMBER) for _, cells in rows)]
        return cls([head[i] for i in kept], [(kind, [cells[i] for i in kept]) for kind, cells in rows])


def fits_table(repetition: Repetition) -> PageTable:
    """Return the main table, with ratios where both methods had the same information.

    Args:
        repetition: The experiment with one pendulum.
    """
    units, main = _units(repetition), tables.main_cases(repetition)
    names = tables.labels(main)
    head = ["case", "method", "unknowns", "evaluations", "seconds"]
    head += [_titled(name, units) for name in ("residual", "truth", "prediction")]
    head += [f"{name} [%]" for name in names]
    rows: list[tuple[str, Sequence[str]]] = []
    for group in tables.grouped(main):
        found = [tables.case_row(case, units, names) for case in group]
        for case, row in zip(group, found, strict=True):
            cells = [case_name(case), TITLES[case.plan.method]]
            cells += [_number(row[k]) for k in ("unknowns", "evaluations", "seconds")]
            cells += [_joints(row, k, units) for k in tables.SHOWN_ERRORS]
            rows.append(("", [*cells, *_shares(row, names)]))
        if tables.comparable(group):
            gain = tables.gain_row(*found)
            cells = ["", "ratio", "", *(_times(gain[k]) for k in ("evaluations", "seconds"))]
            cells += [_joints(gain, k, units, _times) for k in tables.SHOWN_ERRORS]
            rows.append(("gain", [*cells, *("" for _ in names)]))
        rows[-1] = (f"{rows[-1][0]} last", rows[-1][1])
    return PageTable.of(head, rows)


def poses_table(repetition: Repetition) -> PageTable:
    """Return the table of pose estimation.

    Args:
        repetition: The experiment with one pendulum.
    """
    units, seen = _units(repetition), {m: repetition.evidence[m].seen for m in BOTH_METHODS}
    head = [
        "method",
        "frames seen",
        _titled("rms error", units),
        "silhouettes a frame",
        "milliseconds a frame",
    ]
    head += ["silhouettes for the first pose", "seconds for the first pose", "status"]
    found = {method: tables.seen_row(seen[method]) for method in BOTH_METHODS}
    rows: list[tuple[str, Sequence[str]]] = []
    for method, row in found.items():
        each, first = row["seconds_a_frame"], row["silhouettes_locate"]
        counted = method == "paper" or seen[method].scene is None
        cells = [TITLES[method], f"{row['frames_seen']} of {row['frames']}", _joints(row, "error", units)]
        cells += [_number(row["silhouettes_a_frame"]), _number(None if each is None else 1000.0 * each)]
        cells += [_number(first) if counted else "not counted", _number(row["seconds_locate"])]
        rows.append(("", [*cells, row["status"]]))
    if all(seen[method].poses is not None for method in BOTH_METHODS):
        # the default method draws no silhouettes while it tracks: without a quotient both numbers are shown
        gain = tables.pose_gain(seen["paper"], seen["fast"])
        drawn = [_number(row["silhouettes_a_frame"]) for row in found.values()]
        cells = ["ratio", "", _joints(gain, "error", units, _times)]
        cells += ["" if NO_NUMBER in drawn else " : ".join(drawn), _times(gain["seconds_a_frame"])]
        rows.append(("gain", [*cells, "", _times(gain["seconds_locate"]), ""]))
    return PageTable.of(head, rows)


def frameworks_table(repetitions: Sequence[Repetition]) -> PageTable:
    """Return the table of both forms of Figure 2.

    Args:
        repetitions: The experiment with each pendulum.
    """
    units = _units(repetitions[0])
    head = [
        "pendulum",
        "framework",
        "mismatch [px²]",
        "of the silhouette [%]",
        "silhouettes drawn",
        "seconds",
    ]
    head += [_titled("error of the first pose", units), "status"]
    rows: list[tuple[str, Sequence[str]]] = []
    for number, repetition in enumerate(repetitions):
        for form in repetition.evidence["paper"].seen.frameworks:
            share = None if form.mismatch is None or not form.area else 100.0 * form.mismatch / form.area
            row = {
                f"error_{unit.name}_{unit.unit}": None
                if form.error is None or not np.isfinite(form.error[dof])
                else unit.factor * abs(form.error[dof])
                for dof, unit in enumerate(units)
            }
            cells = [
                str(number),
                form.name,
                _number(form.mismatch),
                _number(share),
                _number(form.drawings or None),
            ]
            cells += [_number(form.seconds or None), _joints(row, "error", units)]
            rows.append(("", [*cells, form.status]))
        if rows:
            rows[-1] = ("last", rows[-1][1])
    return PageTable.of(head, rows)


def lengths_table(repetition: Repetition) -> PageTable:
    """Return the table by number of frames.

    Args:
        repetition: The experiment with one pendulum.
    """
    units = _units(repetition)
    chosen = [
        case
        for method in BOTH_METHODS
        for case in _series(repetition, method)
    ]  # fmt: skip
    names = tables.labels(chosen)
    head = ["case", "frames", "method", "evaluations", "seconds"]
    head += [_titled(name, units) for name in ("residual", "next frames", "last frames")]
    rows = []
    order = {"I": 0, "II": 1}
    for case in sorted(
        chosen, key=lambda c: (order[c.plan.case], c.plan.frames, BOTH_METHODS.index(c.plan.method))
    ):
        row = tables.case_row(case, units, names)
        cells = [f"Case {case.plan.case}", str(case.plan.frames), TITLES[case.plan.method]]
        cells += [_number(row["evaluations"]), _number(row["seconds"])]
        cells += [_joints(row, k, units) for k in ("residual", "ahead", "late")]
        rows.append(("", [*cells, *_shares(row, names)]))
    return PageTable.of([*head, *(f"{name} [%]" for name in names)], rows)


def _series(repetition: Repetition, method: str) -> list[Case]:
    """Return the fits of one method that differ in the number of frames."""
    evidence = repetition.evidence[method]
    found = [evidence.case(frames=n) for n in (*evidence.design.lengths, evidence.design.frames)]
    found += [evidence.case("II", frames=n) for n in evidence.design.periods]
    return list(dict.fromkeys(case for case in found if case is not None))


def starts_table(repetition: Repetition) -> PageTable:
    """Return the table by start values, sorted by where the searches ended.

    Args:
        repetition: The experiment with one pendulum.
    """
    units, rows = _units(repetition), []
    fits = {m: drawn_fits(repetition.evidence[m]) for m in BOTH_METHODS}
    usual = {m: repetition.evidence[m].case() for m in BOTH_METHODS}
    names = list(
        dict.fromkeys(
            p.name
            for method in BOTH_METHODS
            for case in (usual[method], *fits[method])
            if case is not None and case.fit is not None
            for p in case.fit.parameters
            if p.free and case.fit.mechanism.parameter(p.name).kind != "offset"
        )
    )
    for method in BOTH_METHODS:
        first = usual[method]
        placed = [("as seen, matched", first)] if first is not None else []
        seed = repetition.evidence[method].design.seed
        hinges = repetition.evidence[method].seen.hinges
        for place, ending in enumerate(endings(fits[method], hinges) if hinges else ()):
            placed += [(f"{case.plan.start}, place {place + 1}", case) for case in ending.cases]
        for start, case in placed:
            row, found = tables.case_row(case, units), tables.parameter_values(case)
            scale = start_scale(case.plan.start, seed) if case.plan.start else None
            cells = [TITLES[method], start, _number(scale), *(_number(found.get(n), 4) for n in names)]
            cells += [_number(row["evaluations"]), *(_joints(row, k, units) for k in ("residual", "ahead"))]
            rows.append(("", cells))
        if rows:
            rows[-1] = ("last", rows[-1][1])
    head = [
        "method",
        "start",
        "sizes ×",
        *names,
        "evaluations",
        _titled("residual", units),
        _titled("prediction", units),
    ]
    return PageTable.of(head, rows)


def assumptions_table(repetition: Repetition) -> PageTable:
    """Return the table of the paper's assumptions.

    Args:
        repetition: The experiment with one pendulum.
    """
    from markupsafe import Markup

    kinds = {True: "held", False: "not", None: ""}
    rows = [
        (
            "",
            [
                each.name,
                Markup('<span class="{}">{}</span>').format(kinds[each.held], HELD[each.held]),
                each.numbers,
            ],
        )
        for each in repetition.assumptions
    ]
    return PageTable(["assumption", "here", "numbers"], rows)


def case_name(case: Case) -> str:
    """Return the name of a fit in a table.

    Args:
        case: The fit.
    """
    words = tables.WORDS[case.plan.series or case.plan.compared]
    return f"Case {case.plan.case}" + (f", {words}" if words else "")


def _units(repetition: Repetition) -> tuple[JointUnit, ...]:
    return units_of(repetition.evidence["paper"].seen.joints)


def _titled(name: str, units: Sequence[JointUnit]) -> str:
    """Return a column title with the joints' unit, where they share one."""
    unit = shared_unit(units)
    shown = {"deg": " [°]", "mm": " [mm]", "": ""}[unit]
    return f"{name}{shown}"


def _number(value: float | None, digits: int = 3) -> str:
    """Write a number with a few digits and a true minus sign."""
    if value is None:
        return NO_NUMBER
    if isinstance(value, float):
        text = f"{value:.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"
        return text.replace("-", "−")
    return str(value)


def _percent(value: float | None) -> str:
    """Write a signed share in per cent, two digits."""
    if value is None:
        return NO_NUMBER
    return (f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.2g}").replace("-", "−")


def _times(value: float | None) -> str:
    from markupsafe import Markup

    if value is None:
        return NO_NUMBER
    # the flag depends on the number as it is shown: what reads as 1 is not below 1
    text = f"{_number(value, 2)}×"
    return text if float(f"{value:.2g}") >= 1.0 else Markup(f'<span class="flag">{text}</span>')


def _joints(
    row: Mapping[str, Any],
    name: str,
    units: Sequence[JointUnit],
    shown: Callable[[Any], str] | None = None,
) -> str:
    """Write an error of every joint into one cell, with units where they differ."""
    from markupsafe import Markup

    values = [row[f"{name}_{unit.name}_{unit.unit}"] for unit in units]
    if all(value is None for value in values):
        return NO_NUMBER
    if shown is not None:
        return Markup(" · ").join(shown(value) for value in values)
    signs = ["" if shared_unit(units) else unit.sign for unit in units]
    return " · ".join(
        _number(value, 2) + ("" if value is None else sign) for value, sign in zip(values, signs, strict=True)
    )


def _shares(row: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    return [_percent(row[f"{name.replace('/', '_')}_error_percent"]) for name in names]


def remarks(repetition: Repetition) -> list[str]:
    """Return the sentences that explain the main table.

    Args:
        repetition: The experiment with one pendulum.
    """
    main, found = tables.main_cases(repetition), []
    tried = [c for c in main if c.plan.case == "II" and c.plan.method == "fast"]
    refused = [c for c in tried if c.motion is None]
    if refused:
        made = [c for c in tried if c.motion is not None]
        forms = "Case II" if not made else " and ".join(case_name(c) for c in refused)
        told = (
            f"The default method refuses {forms} where no period shows that explains the motion better than "
            "friction alone: a freely swinging pendulum has no periodic torque."
        )
        found.append(told if made else f"{told} So there is no ratio for it.")
    free = {
        case.plan.method: case.residual
        for case in main
        if case.plan.case == "III" and case.plan.series == "alone"
    }
    published, default = free.get("paper"), free.get("fast")
    if published is not None and default is not None and np.any(default > published):
        found.append(
            "In Case III the default method has the larger residual where it does not follow the noise of "
            "the poses from frame to frame. The errors against the truth and of the prediction are the ones "
            "to compare."
        )
    both = any(c.plan.method == "paper" and c.plan.series == "with-friction" for c in main)
    ways = (
        "Cases II and III are fitted both ways: with the torque over time alone, the published form, and "
        "with friction in addition to it, the default method's."
        if both
        else "By the published method Cases II and III are fitted in its own form alone, without friction in "
        "addition to the torque over time, to save time; by the default method both ways."
    )
    found.append(
        f"{ways} Ratios compare fits that follow the poses, with the same friction and poses of the same "
        "frames."
    )
    return found
