"""The experiment as one self-contained page: claims first, then tables, then the counterparts of the figures.

The page works without a network: the plotting script of the installed plotly package is written into it.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.figures import Figure
from monodyn.reproduce.tables import (
    RATIOS,
    SHOWN_ERRORS,
    case_row,
    gain_row,
    grouped,
    main_cases,
    parameter_values,
    seen_row,
)
from monodyn.reproduce.vision import BOTH_METHODS, TITLES, Seen
from monodyn.results.overlay import Drawing, still
from monodyn.results.page import plotting_script, template
from monodyn.types import Frame
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.scene import Scene

SHADES = (150, 220)
"""Grey of the bodies in a picture that the model draws, in turn."""

NO_NUMBER = "–"
"""Stands where there is no number."""


@dataclass(frozen=True, eq=False)
class PageContent:
    """What the page shows.

    Attributes:
        subtitle: One line about the clip.
        seen: What each method saw.
        cases: The fits.
        claims: The claims with their verdicts.
        figures: The plots, in order.
        pictures: Rows of pictures, each a title and JPEG files with a caption.
        joints: Joint names.
        settings: Names and values for the end of the page.
        notes: Sentences under the heading.
    """

    subtitle: str
    seen: Mapping[str, Seen]
    cases: Sequence[Case]
    claims: Sequence[Claim]
    figures: Sequence[Figure]
    pictures: Sequence[tuple[str, Sequence[tuple[bytes, str]]]]
    joints: Sequence[str]
    settings: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class PageTable:
    """A table of the page.

    Attributes:
        head: Column titles; those of columns of text are in ``text``.
        rows: Class of the row and its cells.
        text: Titles of the columns that are text, not numbers.
    """

    head: Sequence[str]
    rows: Sequence[tuple[str, Sequence[str]]]
    text: Sequence[str] = ("case", "method", "status")

    @classmethod
    def of(cls, head: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> PageTable:
        """Return a table without the columns that are empty in every row.

        Args:
            head: Column titles.
            rows: Class of the row and its cells.
        """
        kept = [i for i in range(len(head)) if any(cells[i] not in ("", NO_NUMBER) for _, cells in rows)]
        return cls([head[i] for i in kept], [(kind, [cells[i] for i in kept]) for kind, cells in rows])


def page_text(content: PageContent) -> str:
    """Return the page as HTML text.

    Args:
        content: What it shows.
    """
    from markupsafe import Markup

    main = main_cases(content.cases)
    plots = [(number, asdict(figure)) for number, figure in enumerate(content.figures)]
    early = [plot for plot in plots if plot[1]["title"].startswith(("Figure 2:", "Figure 3:"))]
    return template("monodyn.reproduce", "page.html.j2").render(
        subtitle=content.subtitle,
        notes=content.notes,
        methods=[(method, TITLES[method]) for method in BOTH_METHODS],
        claims=content.claims,
        fits=_fits(main, content.joints),
        statuses=[(_case_name(case), TITLES[case.plan.method], case.status, _ok(case)) for case in main],
        remarks=_remarks(main),
        poses=_poses(content.seen, content.joints),
        lengths=_lengths(content.cases, content.joints),
        starts=_starts(content.cases, content.joints),
        early=early,
        late=[plot for plot in plots if plot not in early],
        figures=[asdict(figure) for figure in content.figures],
        pictures=[
            (title, [(base64.b64encode(data).decode("ascii"), caption) for data, caption in row])
            for title, row in content.pictures
        ],
        settings=content.settings,
        plotly=Markup(plotting_script()),
    )


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


def _joined(values: Sequence[str]) -> str:
    from markupsafe import Markup

    return Markup(" · ").join(values)


def _joints(
    row: Mapping[str, Any], name: str, joints: Sequence[str], shown: Callable[[Any], str] | None = None
) -> str:
    """Write an error of every joint into one cell."""
    values = [row[f"{name}_{joint}_deg"] for joint in joints]
    return NO_NUMBER if all(v is None for v in values) else _joined([(shown or _angle)(v) for v in values])


def _angle(value: float | None) -> str:
    return _number(value, 2)


def _ratios(row: Mapping[str, Any]) -> list[str]:
    return [_percent(row[f"{name.replace('/', '_')}_error_percent"]) for name in RATIOS]


def _ok(case: Case) -> bool:
    return case.fit is not None and bool(case.fit.ok)


def _case_name(case: Case) -> str:
    return f"Case {case.plan.case}" + (", filtered" if case.plan.states == "filtered" else "")


def _fits(cases: Sequence[Case], joints: Sequence[str]) -> PageTable:
    """Return the main table; where both methods have a case, with how much better the default is."""
    from markupsafe import Markup

    head = ["case", "method", "unknowns", "evaluations", "seconds"]
    head += ["residual [°]", "truth [°]", "prediction [°]", *(f"{name} [%]" for name in RATIOS)]
    rows: list[tuple[str, Sequence[str]]] = []
    for group in grouped(cases):
        found = [case_row(case, joints) for case in group]
        for case, row in zip(group, found, strict=True):
            name = _case_name(case)
            if case.clip_period:
                name = Markup(f"{name}<small>period from<br>the whole clip</small>")
            cells = [name, TITLES[case.plan.method]]
            cells += [_number(row[k]) for k in ("unknowns", "evaluations", "seconds")]
            cells += [_joints(row, k, joints) for k in SHOWN_ERRORS]
            rows.append(("", [*cells, *_ratios(row)]))
        if len(found) == 2:
            gain = gain_row(*found)
            cells = ["", "ratio", "", *(_times(gain[k]) for k in ("evaluations", "seconds"))]
            cells += [_joints(gain, k, joints, _times) for k in SHOWN_ERRORS]
            rows.append(("gain", [*cells, *("" for _ in RATIOS)]))
        rows[-1] = (f"{rows[-1][0]} last", rows[-1][1])
    return PageTable.of(head, rows)


def _remarks(cases: Sequence[Case]) -> list[str]:
    """Return the sentences that explain the main table."""
    found = []
    free = {case.plan.method: case.residual for case in cases if case.plan.case == "III"}
    published, default = free.get("paper"), free.get("fast")
    if published is not None and default is not None and np.any(default > published):
        found.append(
            "In Case III the default method has the larger residual where it does not follow the noise of "
            "the poses from frame to frame. The errors against the truth and of the prediction are the ones "
            "to compare."
        )
    if any(case.clip_period for case in cases):
        found.append(
            "In Case II the fitted frames do not determine the period: it is taken from the whole clip, "
            "predicted frames included."
        )
    return found


def _poses(seen: Mapping[str, Seen], joints: Sequence[str]) -> PageTable:
    """Return the table of pose estimation."""
    head = ["method", "frames seen", "rms error [°], θ1 · θ2", "silhouettes a frame", "milliseconds a frame"]
    head += ["silhouettes for the first pose", "seconds for the first pose", "status"]
    found = {method: seen_row(seen[method], joints) for method in BOTH_METHODS}
    rows: list[tuple[str, Sequence[str]]] = []
    for method, row in found.items():
        each, first = row["seconds_a_frame"], row["silhouettes_locate"]
        counted = method == "paper" or seen[method].scene is None
        cells = [TITLES[method], f"{row['frames_seen']} of {row['frames']}", _joints(row, "error", joints)]
        cells += [_number(row["silhouettes_a_frame"]), _number(None if each is None else 1000.0 * each)]
        cells += [_number(first) if counted else "not counted", _number(row["seconds_locate"])]
        rows.append(("", [*cells, row["status"]]))
    # the default method draws no silhouettes while it tracks: without a quotient both numbers are shown
    gain = gain_row(found["paper"], found["fast"])
    drawn = [_number(row["silhouettes_a_frame"]) for row in found.values()]
    cells = ["ratio", "", _joints(gain, "error", joints, _times)]
    cells += ["" if NO_NUMBER in drawn else " : ".join(drawn), _times(gain["seconds_a_frame"])]
    rows.append(("gain", [*cells, "", _times(gain["seconds_locate"]), ""]))
    return PageTable.of(head, rows)


def _lengths(cases: Sequence[Case], joints: Sequence[str]) -> PageTable:
    """Return the table by number of frames."""
    head = [
        "frames",
        "method",
        "evaluations",
        "seconds",
        "residual [°]",
        "next frames [°]",
        "last frames [°]",
    ]
    chosen = [c for c in cases if (c.plan.case, c.plan.states, c.plan.start) == ("I", "measured", 0)]
    rows = []
    for case in sorted(chosen, key=lambda c: (c.plan.frames, BOTH_METHODS.index(c.plan.method))):
        row = case_row(case, joints)
        cells = [str(case.plan.frames), TITLES[case.plan.method]]
        cells += [_number(row["evaluations"]), _number(row["seconds"])]
        cells += [_joints(row, k, joints) for k in ("residual", "ahead", "late")]
        rows.append(("", [*cells, *_ratios(row)]))
    return PageTable.of([*head, *(f"{name} [%]" for name in RATIOS)], rows)


def _starts(cases: Sequence[Case], joints: Sequence[str]) -> PageTable:
    """Return the table by start values."""
    frames = next((c.plan.frames for c in cases if c.plan.case == "II"), 0)
    chosen = [c for c in cases if (c.plan.case, c.plan.states, c.plan.frames) == ("I", "measured", frames)]
    chosen.sort(key=lambda c: (BOTH_METHODS.index(c.plan.method), c.plan.start))
    values = [parameter_values(case) for case in chosen]
    # parameters of either method, in the order of the first fit that has them
    names = list(
        dict.fromkeys(
            p.name
            for case in chosen
            if case.fit is not None
            for p in case.fit.parameters
            if p.free and case.fit.mechanism.parameter(p.name).kind != "offset"
        )
    )
    rows = []
    for case, found in zip(chosen, values, strict=True):
        row = case_row(case, joints)
        cells = [TITLES[case.plan.method], str(case.plan.start), *(_number(found.get(n), 4) for n in names)]
        rows.append(("", [*cells, *(_joints(row, k, joints) for k in ("residual", "ahead"))]))
    return PageTable.of(["method", "start", *names, "residual [°]", "prediction [°]"], rows)


def picture_rows(
    frames: Sequence[Frame], seen: Mapping[str, Seen]
) -> list[tuple[str, list[tuple[bytes, str]]]]:
    """Return the actual pictures and those that the model draws, the counterpart of Fig. 5.

    Args:
        frames: Frames of the clip.
        seen: What each method saw.

    Returns:
        Rows of a title and JPEG files with a caption.
    """
    actual = [(still(frame, Drawing([])), f"frame {frame.index}, {frame.time:.2f} s") for frame in frames]
    rows = [("Actual", actual)]
    for method in BOTH_METHODS:
        found = seen[method]
        if found.poses is None or found.scene is None:
            continue
        pictures = []
        for frame in frames:
            row = int(np.searchsorted(found.poses.frame, frame.index))
            position = found.poses.position[row]
            angles = ", ".join(f"{value:.1f}°".replace("-", "−") for value in np.degrees(position))
            pictures.append((model_picture(found.scene, position), angles))
        rows.append((f"Drawn by the model, {TITLES[method]} method", pictures))
    return rows


def model_picture(scene: Scene, position: np.ndarray) -> bytes:
    """Return a picture of the mechanism as a method found it, as the bytes of a JPEG file.

    Args:
        scene: Mechanism and camera.
        position: Joint positions [rad], (dof,).
    """
    import cv2

    picture = np.full((scene.camera.height, scene.camera.width), 24, np.uint8)
    if np.all(np.isfinite(position)):
        for i, (_, polygon) in enumerate(outline(scene.mechanism, scene.camera, position)):
            # four bits of fractions: the outline is drawn to a sixteenth of a pixel
            points = [np.round(polygon * 16.0).astype(np.int32)]
            cv2.fillPoly(picture, points, SHADES[i % len(SHADES)], cv2.LINE_AA, 4)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()
