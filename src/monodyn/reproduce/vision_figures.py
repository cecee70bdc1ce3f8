"""Figures of what the published method sees: its framework, its filter and its starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.paper.filter import Filtered, Gains, filtered
from monodyn.reproduce.evidence import Evidence
from monodyn.reproduce.figures import Figure, panel, pendulum_colour, pendulum_legend, series
from monodyn.reproduce.plans import FILTERED, Design
from monodyn.reproduce.repetition import Repetition
from monodyn.reproduce.truth import Truth
from monodyn.reproduce.units import units_of
from monodyn.reproduce.vision import TITLES, FrameworkFound, Seen

PROBLEMS = {
    "pose": (0, "pose", "(3) initial pose"),
    "ratios": (0, "ratios", "(4) aspect ratios"),
    "depth": (1, "depth", "(1) camera depth"),
    "place": (1, "place", "(2) camera place"),
}
"""Panel, colour and name of each sub-problem of the sequential framework."""
KEPT = "fitted"
"""Colour of the mismatch that is kept."""
LEAST_SHOWN = 1e-9
"""Objectives below this are zero for any practical purpose; a logarithmic axis leaves them out."""
READING_COLOURS = {"filtered": "paper", "consistent": "fitted"}
"""Colour of the states of each reading of the filter."""


def history_figure(forms: Sequence[FrameworkFound]) -> Figure | None:
    """Return the objectives of both forms of the sequential framework, Fig. 2, or None where there are none.

    Args:
        forms: What each form found.
    """
    panels, drawn = [], set()
    for form in forms:
        contents: tuple[list, list] = ([], [])
        done, across = 0, "silhouettes drawn"
        for history in form.history:
            # the abscissa runs on over all sub-problems, so that their alternation is visible
            which, colour, name = PROBLEMS[history.problem]
            shown = history.values >= LEAST_SHOWN
            if shown.any():
                drawings, values = (done + history.evaluations)[shown], history.values[shown]
                contents[which].append(series("steps", colour, drawings, values, name))
                drawn.add(colour)
            done += int(history.evaluations[-1])
        if form.mismatch is not None and done:
            kept = np.array([form.mismatch, form.mismatch])
            contents[0].append(series("line", KEPT, np.array([0, done]), kept, "kept"))
        if form.history:
            for title, quantity, unit, content in (
                (f"{form.name}: (3) and (4), area of |I_a − I_m|", "area", "px²", contents[0]),
                (f"{form.name}: (1) in px⁴, (2) in px²", "objective", "px⁴, px²", contents[1]),
            ):
                panels.append(panel(title, quantity, unit, content, log=True, across=across))
    if not panels:
        return None
    return Figure(
        "Figure 2: objectives of the sequential framework",
        "Least value so far of each sub-problem, each time it is solved, over the silhouettes drawn. "
        "Strict: (1) and (2) alternate with (3) until they have converged, then (4), the whole again until "
        "nothing gains, as published. Interleaved, ours: each trial of (3) and (4) has its own camera. The "
        "alternation may lead away from the least mismatch: the best turn counts, whose value is the level "
        "line. Most silhouettes are not shown: those of the choice of the start, for which poses and "
        "proportions are spread over their ranges and the framework runs in a reduced picture. Values below "
        "a billionth are left out.",
        2,
        panels,
        [("line", colour, name) for _, colour, name in PROBLEMS.values() if colour in drawn]
        + [("line", KEPT, "kept mismatch")] * any(form.mismatch is not None for form in forms),
    )


def filtered_states(seen: Seen, design: Design, compared: str) -> Filtered:
    """Return the filtered states that were fitted: those of the fitted frames, in one reading of the filter.

    Args:
        seen: What a method saw.
        design: Frames and gains.
        compared: A key of ``plans.FILTERED``.
    """
    assert seen.poses is not None
    poses = seen.poses[: design.frames]
    position = np.where(poses.measured, poses.position, np.nan)
    return filtered(poses.time, position, Gains.of(design.gains, FILTERED[compared]))


def states_figure(evidence: Evidence, truth: Truth | None) -> Figure:
    """Return the figure of the filtered states in both readings, the counterpart of Fig. 3.

    Args:
        evidence: What a method found.
        truth: The true motion, or None.
    """
    seen, design = evidence.seen, evidence.design
    assert seen.poses is not None
    stop, units = design.frames, units_of(seen.joints)
    time, panels = seen.poses.time[:stop], []
    found = {compared: filtered_states(seen, design, compared) for compared in FILTERED}
    true = None if seen.errors is None else seen.poses.position[:stop] - seen.errors[:stop]
    for rate in (False, True):
        for dof, unit in enumerate(units):
            content = []
            # later series are drawn over earlier ones: the truth must not hide what was found; a picture
            # shows slides in another scale than the truth's
            exact = true if not rate else None if truth is None else truth.velocity[:stop]
            if exact is not None and unit.unit == "deg":
                content.append(series("line", "truth", time, unit.factor * exact[:, dof], "truth"))
            for compared, reading in FILTERED.items():
                states = found[compared].velocity if rate else found[compared].position
                colour = READING_COLOURS[compared]
                content.append(series("line", colour, time, unit.factor * states[:, dof], reading))
            if not rate:
                measured = unit.factor * seen.poses.position[:stop, dof]
                content.append(series("dots", "observed", time, measured, "estimated"))
            title = f"rate of {unit.symbol}" if rate else unit.symbol
            shown = f"{unit.unit}/s" if rate else unit.unit
            panels.append(panel(title, title, shown, content))
    alpha, beta, gamma = design.gains
    return Figure(
        "Figure 3: filtered states",
        f"Poses of the {TITLES[seen.method]} method through the α-β-γ filter, α = {alpha:g}, β = {beta:g}, "
        f"γ = {gamma:g}, over {stop} frames, in both readings of (6) and (7). As printed the acceleration "
        f"takes γ/T² "
        f"of what was not predicted, and errors die out for γ below 2αβ/(2 − α) = "
        f"{2 * alpha * beta / (2 - alpha):.3g} alone; at that limit it rings without end. With γ/(2T²), "
        f"to which the "
        "bound of (7) belongs, they die out for twice as much.",
        len(units),
        panels,
        (
            ("dot", "observed", "estimated pose"),
            ("line", READING_COLOURS["filtered"], "filtered as printed"),
            ("line", READING_COLOURS["consistent"], "filtered consistently with (7)"),
            *((("line", "truth", "truth"),) if true is not None else ()),
        ),
    )


def starts_figure(repetitions: Sequence[Repetition]) -> Figure | None:
    """Return the figure of how many searches for the first pose end in it, over the distance of their starts.

    Args:
        repetitions: The experiment with each pendulum.
    """
    content, starts = [], 0
    for number, repetition in enumerate(repetitions):
        found = repetition.evidence["paper"].pose_starts
        if found is not None:
            starts = found.starts
            share = 100.0 * np.array(found.same) / found.starts
            distances = np.degrees(found.distances)
            content.append(series("marks", pendulum_colour(number), distances, share, repetition.name))
    if not content:
        return None
    return Figure(
        "Starts of the first pose",
        f"Share of {starts} searches (3) that end in the pose, to 2° in every joint, by how far from it "
        f"they start: "
        "the largest turn of any hinge, in random directions. Camera and sizes are those that were found.",
        1,
        [panel("searches that end in the pose", "share", "%", content, across="distance of the start [deg]")],
        pendulum_legend(repetitions),
    )
