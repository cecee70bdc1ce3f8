"""The experiment as one self-contained page: claims first, then tables, then the counterparts of the figures.

The page works without a network: the plotting script is written into it.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from monodyn.reproduce import page_tables
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.evidence import Verdict
from monodyn.reproduce.figures import Figure
from monodyn.reproduce.repetition import Repetition
from monodyn.reproduce.tables import main_cases
from monodyn.reproduce.units import units_of
from monodyn.reproduce.vision import BOTH_METHODS, TITLES, Seen
from monodyn.results.overlay import Drawing, still
from monodyn.results.page import plotting_script, template
from monodyn.types import Frame
from monodyn.vision.drawing.outline import outline
from monodyn.vision.locating.scene import Scene

SHADES = (150, 220)
"""Grey of the bodies in a picture that the model draws, in turn."""
EARLY = ("Figure 2:", "Figure 3:", "Starts of")
"""How the titles of the figures begin that stand before the pictures."""
UNDER = {"Figure 2": "frameworks", "Number of": "lengths"}
"""Table that stands under a figure, by how its title begins."""


@dataclass(frozen=True, eq=False)
class PageContent:
    """What the page shows.

    Attributes:
        subtitle: One line about the clip.
        repetitions: The experiment with each pendulum; figures show the first.
        claims: The claims with their verdicts.
        figures: The plots, in order.
        pictures: Rows of pictures, each a title and JPEG files with a caption.
        settings: Names and values for the end of the page.
    """

    subtitle: str
    repetitions: Sequence[Repetition]
    claims: Sequence[Claim]
    figures: Sequence[Figure]
    pictures: Sequence[tuple[str, Sequence[tuple[bytes, str]]]]
    settings: Mapping[str, str] = field(default_factory=dict)


def page_text(content: PageContent) -> str:
    """Return the page as HTML text.

    Args:
        content: What it shows.
    """
    from markupsafe import Markup

    first = content.repetitions[0]
    plots = [(number, _plot(figure, content.repetitions)) for number, figure in enumerate(content.figures)]
    early = [plot for plot in plots if plot[1]["title"].startswith(EARLY)]
    return template("monodyn.reproduce", "page.html.j2").render(
        subtitle=content.subtitle,
        methods=[(method, TITLES[method]) for method in BOTH_METHODS],
        claims=[_claim(claim, content.repetitions) for claim in content.claims],
        pendulums=[_pendulum(repetition) for repetition in content.repetitions],
        assumptions=page_tables.assumptions_table(first),
        starts=[(each.name, page_tables.starts_table(each)) for each in content.repetitions],
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


def _plot(figure: Figure, repetitions: Sequence[Repetition]) -> dict[str, Any]:
    """Return a figure with the table that stands under it, or None."""
    name = next((table for start, table in UNDER.items() if figure.title.startswith(start)), "")
    table: page_tables.PageTable | None = None
    if name == "frameworks":
        table = page_tables.frameworks_table(repetitions)
    elif name == "lengths":
        table = page_tables.lengths_table(repetitions[0])
    return {**asdict(figure), "table": table}


def _pendulum(repetition: Repetition) -> dict[str, Any]:
    """Return the tables of one pendulum."""
    main = main_cases(repetition)
    return {
        "name": repetition.name,
        "fits": page_tables.fits_table(repetition),
        "poses": page_tables.poses_table(repetition),
        "remarks": page_tables.remarks(repetition),
        "statuses": [
            (page_tables.case_name(case), TITLES[case.plan.method], case.status, case.ok) for case in main
        ],
    }


def _claim(claim: Claim, repetitions: Sequence[Repetition]) -> dict[str, Any]:
    """Return one claim with what became of it by method, the same words of several pendulums once."""
    cells = []
    for method in BOTH_METHODS:
        judged = claim.judged[method]
        told = [(verdict, [number]) for number, verdict in enumerate(judged.verdicts)]
        if len({verdict.numbers for verdict in judged.verdicts}) == 1:
            told = [(judged.verdicts[0], [])]
        kind = "" if not judged.decided else "held" if judged.held == judged.decided else "not"
        if 0 < judged.held < judged.decided:
            kind = "part"
        cells.append({
            "words": judged.words, "kind": kind, "basis": judged.basis,
            "lines": [_line(verdict, at, len(repetitions)) for verdict, at in told],
        })  # fmt: skip
    return {"text": claim.text, "place": claim.place, "rule": claim.rule, "cells": cells}


def _line(verdict: Verdict, numbers: Sequence[int], count: int) -> tuple[str, str, str]:
    """Return the mark of a verdict, its pendulum and its numbers."""
    mark = {True: "✓", False: "✗", None: ""}[None if verdict.held is None else bool(verdict.held)]
    return mark, f"{numbers[0]}: " if numbers and count > 1 else "", verdict.numbers


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
            shown = [
                f"{unit.factor * value:.1f}{unit.sign}".replace("-", "−")
                for unit, value in zip(units_of(found.joints), position, strict=True)
            ]
            pictures.append((model_picture(found.scene, position), ", ".join(shown)))
        rows.append((f"Drawn by the model, {TITLES[method]} method", pictures))
    return rows


def model_picture(scene: Scene, position: np.ndarray) -> bytes:
    """Return a picture of the mechanism as a method found it, as the bytes of a JPEG file.

    Args:
        scene: Mechanism and camera.
        position: Joint positions [rad or m], (dof,).
    """
    import cv2

    picture = np.full((scene.camera.height, scene.camera.width), 24, np.uint8)
    if np.all(np.isfinite(position)):
        for i, (_, polygon) in enumerate(outline(scene.mechanism, scene.camera, position)):
            # four bits of fractions: the outline is drawn to a sixteenth of a pixel
            points = [np.round(polygon * 16.0).astype(np.int32)]
            cv2.fillPoly(picture, points, SHADES[i % len(SHADES)], cv2.LINE_AA, 4)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()
