"""The counterparts of the paper's figures as plain data: panels of series, which the page's script draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.plans import Design
from monodyn.reproduce.repetition import Repetition
from monodyn.reproduce.units import JointUnit, shared_unit, units_of
from monodyn.reproduce.vision import BOTH_METHODS, TITLES

PENDULUM_COLOURS = ("pose", "ratios", "depth", "place", "paper", "fast")
"""Colours of the pendulums, in turn."""


@dataclass(frozen=True)
class Figure:
    """One figure of the page.

    Attributes:
        title: Heading.
        caption: What it shows, and what to look at.
        columns: Panels in a row.
        panels: Plain data for the script: title, quantity, unit, window, log, across and series.
        legend: Kind, colour and text of what is drawn.
    """

    title: str
    caption: str
    columns: int
    panels: Sequence[Mapping[str, Any]]
    legend: Sequence[tuple[str, str, str]] = ()


@dataclass(frozen=True, eq=False)
class Column:
    """One column of the figure of a case.

    Attributes:
        title: Heading of its panels.
        case: The fit.
        states: The filtered states that were fitted, one row a fitted frame (frame, dof), or None where
            the poses were.
    """

    title: str
    case: Case
    states: np.ndarray | None = None


LEGEND = (
    ("dot", "observed", "estimated pose"),
    ("dot", "fitted", "filtered state"),
    ("line", "paper", "simulated, published method"),
    ("line", "fast", "simulated, default method"),
    ("line", "truth", "truth"),
    ("box", "fitted", "fitted frames"),
)


def series(kind: str, colour: str, x: np.ndarray, y: np.ndarray, name: str = "") -> dict[str, Any]:
    """Return one series of a panel.

    Args:
        kind: ``dots``, ``line``, ``marks`` or ``steps``.
        colour: Name of a colour of the page.
        x: Abscissa, (sample,).
        y: Ordinate, (sample,); NaN is left out.
        name: Shown when the mouse is over it.
    """
    return {"kind": kind, "colour": colour, "x": numbers(x), "y": numbers(y), "name": name}


def numbers(values: np.ndarray) -> list[float | None]:
    """Return numbers short enough for a figure; unknown ones as null.

    Args:
        values: Numbers, (sample,).
    """
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def panel(
    title: str, quantity: str, unit: str, content: Sequence[Mapping[str, Any]], **more: Any
) -> dict[str, Any]:
    """Return one panel.

    Args:
        title: Heading.
        quantity: What the ordinate is.
        unit: Its unit; empty where the quantity names it.
        content: Series.
        more: ``window`` (first and last fitted time [s]), ``log`` and ``across`` (title of the abscissa).
    """
    across = {"across": "time [s]", **more}
    return {"title": title, "quantity": quantity, "unit": unit, "series": content, **across}


def case_figure(
    title: str, caption: str, columns: Sequence[Column], units: Sequence[JointUnit], design: Design
) -> Figure:
    """Return the figure of simulated, estimated and true motion of one case.

    Args:
        title: Heading.
        caption: What to look at.
        columns: The fits side by side.
        units: How each joint is shown.
        design: Frames.
    """
    drawn = [_case_panels(column, units, design) for column in columns]
    # row by row: the grid of the page is filled so, and each fit keeps a column of its own
    panels = [column[row] for row in range(len(drawn[0]) if drawn else 0) for column in drawn]
    return Figure(title, caption, max(len(drawn), 1), panels, legend_of(panels, units))


def legend_of(panels: Sequence[Mapping[str, Any]], units: Sequence[JointUnit]) -> list[tuple[str, str, str]]:
    """Return the entries of the legend that are drawn.

    Args:
        panels: Panels of a case.
        units: How each joint is shown.
    """
    drawn = {(line["kind"] == "dots", line["colour"]) for content in panels for line in content["series"]}
    entries = [*LEGEND, *joint_legend(units)]
    kept = [entry for entry in entries if (entry[0] == "dot", entry[1]) in drawn and entry[0] != "box"]
    return kept + ([LEGEND[-1]] if panels else [])


def joint_legend(units: Sequence[JointUnit]) -> list[tuple[str, str, str]]:
    """Return the entries of the errors of each joint.

    Args:
        units: How each joint is shown.
    """
    return [("line", f"joint{i}", f"error of {unit.symbol}") for i, unit in enumerate(units, start=1)]


def _case_panels(column: Column, units: Sequence[JointUnit], design: Design) -> list[dict[str, Any]]:
    """Return one panel for each joint and one of the errors."""
    case = column.case
    assert case.motion is not None
    assert case.poses is not None
    # the clip may end before the predicted frames do
    stop = min(case.plan.frames + design.ahead, len(case.motion.time))
    time, position, measured = case.motion.time[:stop], case.motion.position[:stop], case.poses[:stop]
    true = None if case.true is None else case.true[:stop]
    window = [float(time[0]), float(time[case.plan.frames - 1])]
    panels = []
    for dof, unit in enumerate(units):
        content = []
        if true is not None:
            content.append(series("line", "truth", time, unit.factor * true[:, dof], "truth"))
        if column.states is None:
            content.append(series("dots", "observed", time, unit.factor * measured[:, dof], "estimated"))
        else:
            fitted = unit.factor * column.states[:, dof]
            content.append(series("dots", "fitted", time[: len(fitted)], fitted, "filtered, fitted"))
        content.append(series("line", case.plan.method, time, unit.factor * position[:, dof], "simulated"))
        panels.append(panel(f"{column.title}: {unit.symbol}", unit.symbol, unit.unit, content, window=window))
    against = "truth" if true is not None else "estimated"
    error = (position - (measured if true is None else true)) * [unit.factor for unit in units]
    content = [
        series("line", f"joint{dof + 1}", time, error[:, dof], unit.symbol) for dof, unit in enumerate(units)
    ]
    shown = shared_unit(units) or ", ".join(dict.fromkeys(unit.unit for unit in units))
    title = f"{column.title}: simulated less {against}"
    panels.append(panel(title, "error", shown, content, window=window))
    return panels


def frames_figure(evidence: Mapping[str, Evidence]) -> Figure:
    """Return the figure of the error on the same late frames over the number of fitted frames.

    Args:
        evidence: What each method found.
    """
    panels = []
    for which, title in (
        ("late", "error on the last frames"),
        ("residual", "residual over the fitted frames"),
    ):
        content = []
        for method in BOTH_METHODS:
            own = evidence[method]
            found = [(n, own.case(frames=n)) for n in own.design.lengths]
            # a length that failed with one method is left out there alone
            points = [(n, own.overall(getattr(case, which))) for n, case in found if case is not None]
            points = [(n, np.degrees(value)) for n, value in points if value is not None]
            if points:
                x, y = np.array(points).T
                content.append(series("marks", method, x, y, TITLES[method]))
        panels.append(panel(title, "rms error", "deg", content, log=True, across="fitted frames"))
    design = next(iter(evidence.values())).design
    first = design.longest
    return Figure(
        "Number of frames",
        "Case I. Left: simulated against true motion (the poses where the truth is not known) on frames "
        f"{first} to {first + design.ahead - 1}, which no fit has used. Right: simulated against estimated "
        "motion on the frames that were fitted.",
        2,
        panels if any(each["series"] for each in panels) else [],
        tuple(("line", method, TITLES[method]) for method in BOTH_METHODS),
    )


def periods_figure(repetitions: Sequence[Repetition]) -> Figure:
    """Return the figure of the prediction of Case II over the periods that the fitted frames hold.

    Args:
        repetitions: The experiment with each pendulum.
    """
    content = []
    for number, repetition in enumerate(repetitions):
        evidence, points = repetition.evidence["paper"], []
        for frames in evidence.design.periods:
            case = evidence.case("II", frames=frames)
            error = None if case is None else evidence.overall(case.ahead)
            if case is not None and case.periods is not None and error is not None:
                points.append((case.periods, np.degrees(error)))
        if points:
            x, y = np.array(points).T
            content.append(series("marks", pendulum_colour(number), x, y, repetition.name))
    across = "periods in the fitted frames"
    panels = [panel("prediction error", "rms error", "deg", content, log=True, across=across)]
    return Figure(
        "Periods of Case II",
        "Published form, each pendulum: error of the prediction over the frames after the fitted ones, by "
        "how many periods of the poses these hold.",
        1,
        panels if content else [],
        pendulum_legend(repetitions),
    )


def pendulum_colour(number: int) -> str:
    """Return the colour of a pendulum.

    Args:
        number: Which one.
    """
    return PENDULUM_COLOURS[number % len(PENDULUM_COLOURS)]


def pendulum_legend(repetitions: Sequence[Repetition]) -> list[tuple[str, str, str]]:
    """Return one entry for each pendulum.

    Args:
        repetitions: The experiment with each pendulum.
    """
    return [("line", pendulum_colour(i), each.name) for i, each in enumerate(repetitions)]


def poses_figure(evidence: Mapping[str, Evidence]) -> Figure:
    """Return the figure of the errors of the estimated poses over time.

    Args:
        evidence: What each method found.
    """
    panels, units = [], units_of(evidence["paper"].seen.joints)
    shown = shared_unit(units) or ", ".join(dict.fromkeys(unit.unit for unit in units))
    for method in BOTH_METHODS:
        found = evidence[method].seen
        if found.errors is None or found.poses is None:
            continue
        content = [
            series("line", f"joint{i + 1}", found.poses.time, unit.factor * found.errors[:, i], unit.symbol)
            for i, unit in enumerate(units)
        ]
        panels.append(panel(f"{TITLES[method]}: estimated less true", "error", shown, content))
    caption = "Estimated less true joint positions in every frame."
    return Figure("Errors of the poses", caption, max(len(panels), 1), panels, joint_legend(units))
