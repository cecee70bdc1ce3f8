"""The experiment as one self-contained page: claims first, then tables, then the counterparts of the figures.

The page needs no network: the plotting script of the installed plotly package is written into it.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from monodyn.reproduce.cases import Case
from monodyn.reproduce.claims import Claim
from monodyn.reproduce.figures import Figure
from monodyn.reproduce.tables import ERRORS, RATIOS, case_row, main_cases, parameter_values, seen_row
from monodyn.reproduce.vision import METHODS, TITLES, Seen
from monodyn.results.overlay import Drawing, still
from monodyn.types import Frame
from monodyn.vision.locate import Scene
from monodyn.vision.outline import outline

SHADES = (150, 220)
"""Grey of the bodies in a picture that the model draws, in turn."""


@dataclass(frozen=True, eq=False)
class Content:
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


def page_text(content: Content) -> str:
    """Return the page as HTML text.

    Args:
        content: What it shows.
    """
    from importlib.resources import files

    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    script = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    environment = Environment(
        loader=PackageLoader("monodyn.reproduce", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    return environment.get_template("page.html.j2").render(
        subtitle=content.subtitle,
        notes=content.notes,
        methods=[(method, TITLES[method]) for method in METHODS],
        claims=content.claims,
        fits=[_fit_cells(case, content.joints) for case in main_cases(content.cases)],
        poses=[_pose_cells(content.seen[method], content.joints) for method in METHODS],
        lengths=_lengths(content.cases, content.joints),
        starts=_starts(content.cases, content.joints),
        figures=[asdict(figure) for figure in content.figures],
        pictures=[
            (title, [(base64.b64encode(data).decode("ascii"), caption) for data, caption in row])
            for title, row in content.pictures
        ],
        settings=content.settings,
        plotly=Markup(script.replace("</script", "<\\/script")),
    )


def _number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        text = f"{value:.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"
        return text.replace("-", "−")
    return str(value)


def _percent(value: float | None) -> str:
    if value is None:
        return "–"
    return (f"{value:+.0f}" if abs(value) >= 10 else f"{value:+.2g}").replace("-", "−")


def _joints(row: Mapping[str, Any], name: str, joints: Sequence[str]) -> str:
    values = [row[f"{name}_{joint}_deg"] for joint in joints]
    return "–" if all(v is None for v in values) else " · ".join(_number(v, 2) for v in values)


def _fit_cells(case: Case, joints: Sequence[str]) -> dict[str, Any]:
    """Return the cells of one fit in the main table."""
    row = case_row(case, joints)
    name = f"Case {row['case']}" + (", filtered" if row["states"] == "filtered" else "")
    return {
        "case": name,
        "method": row["method"],
        "title": TITLES[row["method"]],
        "counts": [_number(row[k]) for k in ("unknowns", "evaluations", "seconds")],
        "errors": [_joints(row, k, joints) for k in ERRORS[:3]],
        "ratios": [_percent(row[f"{k.replace('/', '_')}_error_percent"]) for k in RATIOS],
        "ok": row["ok"],
        "status": row["status"],
    }


def _pose_cells(seen: Seen, joints: Sequence[str]) -> dict[str, Any]:
    """Return the cells of one method in the table of pose estimation."""
    row = seen_row(seen, joints)
    per_frame = row["seconds_a_frame"]
    return {
        "title": TITLES[seen.method],
        "seen": f"{row['frames_seen']} of {row['frames']}",
        "errors": _joints(row, "error", joints),
        "cells": [
            _number(row["silhouettes_a_frame"]),
            _number(None if per_frame is None else 1000.0 * per_frame),
            _number(row["silhouettes_locate"]),
            _number(row["seconds_locate"]),
        ],
        "status": row["status"],
    }


def _lengths(cases: Sequence[Case], joints: Sequence[str]) -> list[list[str]]:
    """Return the rows of the table by number of frames."""
    chosen = [c for c in cases if (c.plan.case, c.plan.states, c.plan.start) == ("I", "measured", 0)]
    rows = []
    for case in sorted(chosen, key=lambda c: (c.plan.frames, METHODS.index(c.plan.method))):
        row = case_row(case, joints)
        errors = [_joints(row, k, joints) for k in ("residual", "ahead", "late")]
        ratios = [_percent(row[f"{k.replace('/', '_')}_error_percent"]) for k in RATIOS]
        cells = [_number(row["evaluations"]), _number(row["seconds"])]
        rows.append([str(case.plan.frames), TITLES[case.plan.method], *cells, *errors, *ratios])
    return rows


def _starts(cases: Sequence[Case], joints: Sequence[str]) -> dict[str, Any]:
    """Return the table by start values: its columns and rows."""
    frames = next((c.plan.frames for c in cases if c.plan.case == "II"), 0)
    chosen = [c for c in cases if (c.plan.case, c.plan.states, c.plan.frames) == ("I", "measured", frames)]
    chosen.sort(key=lambda c: (METHODS.index(c.plan.method), c.plan.start))
    values = [parameter_values(case) for case in chosen]
    names = list(dict.fromkeys(name for found in values for name in found if not name.endswith(".offset")))
    rows = []
    for case, found in zip(chosen, values, strict=True):
        row = case_row(case, joints)
        cells = [_number(found.get(name), 4) for name in names]
        errors = [_joints(row, k, joints) for k in ("residual", "ahead")]
        rows.append([TITLES[case.plan.method], str(case.plan.start), *cells, *errors])
    return {"names": names, "rows": rows}


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
    for method in METHODS:
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
    """Draw the mechanism as a method found it, as a JPEG file.

    Args:
        scene: Mechanism and camera.
        position: Joint positions [rad], (dof,).
    """
    import cv2

    picture = np.full((scene.camera.height, scene.camera.width), 24, np.uint8)
    if np.all(np.isfinite(position)):
        for i, (_, polygon) in enumerate(outline(scene.mechanism, scene.camera, position)):
            points = [np.round(polygon * 16.0).astype(np.int32)]
            cv2.fillPoly(picture, points, SHADES[i % len(SHADES)], cv2.LINE_AA, 4)
    return cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()
