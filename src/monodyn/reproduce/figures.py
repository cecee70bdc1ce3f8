"""The counterparts of the paper's figures as plain data: panels of series, which the page's script draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monodyn.paper.locate import PaperScene
from monodyn.reproduce.cases import Case, Design
from monodyn.reproduce.claims import Evidence, overall
from monodyn.reproduce.vision import BOTH_METHODS, TITLES, Seen
from monodyn.types import Poses

PROBLEMS = {
    "pose": (0, "pose", "(3) initial pose"),
    "ratios": (0, "ratios", "(4) aspect ratios"),
    "depth": (1, "depth", "(1) camera depth"),
    "place": (1, "place", "(2) camera place"),
}
"""Panel, colour and name of each sub-problem of the sequential framework."""
LEAST_SHOWN = 1e-9
"""Objectives below this are zero for any practical purpose; a logarithmic axis leaves them out."""


@dataclass(frozen=True)
class Figure:
    """One figure of the page.

    Attributes:
        title: Heading.
        caption: What it shows, and what to look at.
        columns: Panels in a row.
        panels: Plain data for the script: title, unit, window, log, time and series.
        legend: Kind, colour and text of what is drawn.
    """

    title: str
    caption: str
    columns: int
    panels: Sequence[Mapping[str, Any]]
    legend: Sequence[tuple[str, str, str]] = ()


LEGEND = (
    ("dot", "observed", "estimated pose"),
    ("line", "paper", "simulated, published method"),
    ("line", "fast", "simulated, default method"),
    ("line", "truth", "truth"),
    ("box", "fitted", "fitted frames"),
    ("line", "joint1", "error of θ1"),
    ("line", "joint2", "error of θ2"),
)


def series(kind: str, colour: str, x: np.ndarray, y: np.ndarray, name: str = "") -> dict[str, Any]:
    """Return one series of a panel.

    Args:
        kind: ``dots`` or ``line``.
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


def panel(title: str, unit: str, content: Sequence[Mapping[str, Any]], **more: Any) -> dict[str, Any]:
    """Return one panel.

    Args:
        title: Heading.
        unit: Unit of the ordinate.
        content: Series.
        more: ``window`` (first and last fitted time [s]), ``log`` and ``across`` (title of the abscissa).
    """
    return {"title": title, "unit": unit, "series": content, "across": "time [s]", **more}


def states_figure(seen: Seen, true: np.ndarray | None, rates: np.ndarray | None, design: Design) -> Figure:
    """Return the figure of the filtered states, the counterpart of Fig. 3.

    Args:
        seen: What a method saw.
        true: True joint positions [rad], (frame, dof), or None.
        rates: True joint rates [rad/s], (frame, dof), or None.
        design: Frames and gains.
    """
    assert seen.poses is not None
    assert seen.states is not None
    stop = design.frames
    time, panels = seen.poses.time[:stop], []
    for kind, found, exact in (
        ("", seen.states.position, true),
        ("rate of ", seen.states.velocity, rates),
    ):
        for dof in range(len(seen.poses.joints)):
            content = []
            # later series are drawn over earlier ones: the truth must not hide what was found
            if exact is not None:
                content.append(series("line", "truth", time, np.degrees(exact[:stop, dof]), "truth"))
            content.append(series("line", "fitted", time, np.degrees(found[:stop, dof]), "filtered"))
            if not kind:
                measured = np.degrees(seen.poses.position[:stop, dof])
                content.append(series("dots", "observed", time, measured, "estimated"))
            panels.append(panel(f"{kind}θ{dof + 1}", "deg/s" if kind else "deg", content))
    alpha, beta, gamma = design.gains
    return Figure(
        "Figure 3: filtered states",
        f"Poses of the {TITLES[seen.method]} method through the α-β-γ filter, α = {alpha:g}, β = {beta:g}, "
        f"γ = {gamma:g}, over {stop} frames. In eq. (6) an error of the states dies out for γ below "
        f"2αβ/(2 − α) = {2 * alpha * beta / (2 - alpha):.3g}; at that limit it rings without end.",
        len(seen.poses.joints),
        panels,
        (
            ("dot", "observed", "estimated pose"),
            ("line", "fitted", "filtered"),
            ("line", "truth", "truth"),
        ),
    )


def case_figure(
    title: str, caption: str, cases: Mapping[str, Case | None], seen: Mapping[str, Seen], design: Design
) -> Figure:
    """Return the figure of simulated, estimated and true motion of one case for both methods.

    Args:
        title: Heading.
        caption: What to look at.
        cases: The fit by method, or None.
        seen: What each method saw.
        design: Frames.
    """
    shown = [m for m in BOTH_METHODS if cases[m] is not None and seen[m].poses is not None]
    columns = [_case_panels(cases[m], seen[m], design) for m in shown]
    # row by row: the grid of the page is filled so, and each method keeps a column of its own
    panels = [column[row] for row in range(len(columns[0]) if columns else 0) for column in columns]
    return Figure(title, caption, max(len(columns), 1), panels, legend_of(panels))


def legend_of(panels: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """Return the entries of the legend that are drawn.

    Args:
        panels: Panels of a case.
    """
    drawn = {line["colour"] for content in panels for line in content["series"]}
    return [entry for entry in LEGEND if entry[1] in drawn or (entry[0] == "box" and panels)]


def _case_panels(case: Case | None, seen: Seen, design: Design) -> list[dict[str, Any]]:
    """Return one panel for each joint and one of the errors."""
    assert case is not None
    assert case.motion is not None
    assert seen.poses is not None
    # the clip may end before the predicted frames do
    stop = min(case.plan.frames + design.ahead, len(case.motion.time))
    time, position = case.motion.time[:stop], case.motion.position[:stop]
    measured = seen.poses.position[:stop]
    # the true angles, turned to the measured ones, are what the errors were taken against
    true = None if seen.errors is None else measured - seen.errors[:stop]
    window = [float(time[0]), float(time[case.plan.frames - 1])]
    name, panels = TITLES[seen.method], []
    for dof in range(position.shape[1]):
        content = []
        if true is not None:
            content.append(series("line", "truth", time, np.degrees(true[:, dof]), "truth"))
        content.append(series("dots", "observed", time, np.degrees(measured[:, dof]), "estimated"))
        content.append(series("line", seen.method, time, np.degrees(position[:, dof]), "simulated"))
        panels.append(panel(f"{name}: θ{dof + 1}", "deg", content, window=window))
    against = "truth" if true is not None else "estimated"
    error = np.degrees(position - (measured if true is None else true))
    content = [
        series("line", f"joint{dof + 1}", time, error[:, dof], f"θ{dof + 1}") for dof in range(error.shape[1])
    ]
    panels.append(panel(f"{name}: simulated less {against}", "deg", content, window=window))
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
            found = [(n, evidence[method].case(frames=n)) for n in evidence[method].design.lengths]
            # a length that failed with one method is left out there alone
            points = [(n, overall(getattr(case, which))) for n, case in found if case is not None]
            points = [(n, np.degrees(value)) for n, value in points if value is not None]
            if points:
                x, y = np.array(points).T
                content.append(series("marks", method, x, y, TITLES[method]))
        panels.append(panel(title, "deg", content, log=True, across="fitted frames"))
    design = next(iter(evidence.values())).design
    first = max(design.lengths)
    return Figure(
        "Number of frames",
        "Case I. Left: simulated against true motion (the poses where the truth is not known) on frames "
        f"{first} to {first + design.ahead - 1}, which no fit has used. Right: simulated against estimated "
        "motion on the frames that were fitted.",
        2,
        panels,
        tuple(("line", method, TITLES[method]) for method in BOTH_METHODS),
    )


def history_figure(seen: Seen) -> Figure | None:
    """Return the objectives of the sequential framework, Fig. 2, or None where there are none.

    Args:
        seen: What the published method saw.
    """
    if not isinstance(seen.scene, PaperScene) or not seen.scene.history:
        return None
    contents: tuple[list, list] = ([], [])
    done, across = 0, "silhouettes drawn"
    for history in seen.scene.history:
        # the abscissa runs on over all sub-problems, so that their alternation is visible
        which, colour, name = PROBLEMS[history.problem]
        shown = history.values >= LEAST_SHOWN
        if shown.any():
            drawings, values = (done + history.evaluations)[shown], history.values[shown]
            contents[which].append(series("steps", colour, drawings, values, name))
        done += int(history.evaluations[-1])
    drawn = {line["colour"] for content in contents for line in content}
    return Figure(
        "Figure 2: objectives of the sequential framework",
        "Least value so far of each sub-problem, each time it is solved, over the silhouettes drawn. The "
        "choice of the start, before it, drew further ones. Values below a billionth are left out.",
        2,
        [
            panel("(3) and (4): area of |I_a − I_m|", "px", contents[0], log=True, across=across),
            panel("(1) in px⁴, (2) in px²", "", contents[1], log=True, across=across),
        ],
        [("line", colour, name) for _, colour, name in PROBLEMS.values() if colour in drawn],
    )


def poses_figure(seen: Mapping[str, Seen]) -> Figure:
    """Return the figure of the errors of the estimated poses over time.

    Args:
        seen: What each method saw.
    """
    panels = []
    for method in BOTH_METHODS:
        found = seen[method]
        if found.errors is None or found.poses is None:
            continue
        poses: Poses = found.poses
        content = [
            series("line", f"joint{dof + 1}", poses.time, np.degrees(found.errors[:, dof]), f"θ{dof + 1}")
            for dof in range(found.errors.shape[1])
        ]
        panels.append(panel(f"{TITLES[method]}: estimated less true", "deg", content))
    return Figure(
        "Errors of the poses", "Estimated less true joint angles in every frame.", 2, panels, LEGEND[-2:]
    )
