"""Judge a run folder of a clip that is not ideal against the truth.

*Right*: graded trusted or approximate; the poses, drawn with the camera of the run, lie on the material
points as the picture shows them, within ``RIGHT_POSES`` of the outline's size, rms over the frames that are
seen; every length is right within ``RIGHT_LENGTH`` or ``SIGMAS`` of its deviations. *Wrong*: graded trusted,
and the poses are off by more than ``WRONG_POSES``, or a value by more than ``SIGMAS`` of its deviations.
*Refused*: no answer, or one graded refused. Else *inexact*; *failed* is a run that broke.

The outline's size is the diameter of the circle with the mechanism's usual area in the picture. The points
are the joints and the far end, of a ball on a thread its centre; outside of the picture they do not count. A
frame shows a point when its row is exposed. The values are the lengths, the widths that are wide enough to be
seen, and the camera's turns. What is true where it is not one number: of a thread that stretches any length
that it has during the clip; where a pivot gives way that no picture shows, that of the thread, that to the
point about which the ball swings, and any between; of a swing in an ellipse, whose plane turns, no yaw of the
camera. A length is that in space, whatever the plane. Masses and frictions are not judged: the scale of
masses is assumed, and what an imperfection adds to friction has no true value.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from imperfect_film import Film, lengths, material_points, names
from imperfections import Draw
from monodyn.types import Camera
from monodyn.vision.drawing.camera import pixels
from spec import view

OUTCOMES = ("right", "refused", "inexact", "wrong", "failed")
"""What can come of a run."""
RIGHT_POSES, WRONG_POSES = 0.03, 0.10
"""Largest error of poses that are right, and that are not wrong, rms over the outline's size."""
RIGHT_LENGTH = 0.02
"""Largest error of a length that is right without regard to its interval, as a share."""
SIGMAS = 4.0
"""Standard deviations by which a value may be off."""
SEEN_WIDTH = 3.0
"""Least width whose value is judged [px]: a thread's is not measured."""
CHECK = "the pictures: drawn again, ", "The pictures show "
"""What the doubts of the picture check have in them."""
GRADED = ("trusted", "approximate")
"""Grades of an answer."""


def judged(
    draw: Draw, film: Film, stamps: np.ndarray, area: float, run: Path, *, failed: bool = False
) -> dict[str, Any]:
    """Compare a run folder with the truth.

    Args:
        draw: What was filmed.
        film: What drew it.
        stamps: Times of the frames [s], (frame,).
        area: Of the mechanism in the picture [px].
        run: The run folder.
        failed: Whether the run broke.

    Returns:
        Outcome, grade, doubts, errors: plain values.
    """
    row: dict[str, Any] = {"grade": "none", "doubts": [], "within": False, "outcome": "refused"}
    if failed:
        return {**row, "outcome": "failed"}
    if not (run / "fit.json").exists():
        return row
    document = json.loads((run / "fit.json").read_text(encoding="utf-8"))
    row["grade"], row["doubts"] = document["grade"], [doubt["reason"] for doubt in document["doubts"]]
    row |= pose_errors(draw, film, stamps, area, run, document)
    row |= value_errors(draw, film, document)
    return {**row, **outcome(row)}


def outcome(row: dict[str, Any]) -> dict[str, Any]:
    """Return what came of a run, whether its figures are within the tolerance, and why it is wrong.

    Args:
        row: ``grade``, ``pose_share``, ``length_off`` and ``length_sigmas`` (of the worst length), ``worst``
            and ``worst_sigmas`` (of all values).
    """
    exact = row["length_off"] <= RIGHT_LENGTH or row["length_sigmas"] <= SIGMAS
    within = bool(exact and row["pose_share"] <= RIGHT_POSES)
    why = []
    # NaN, of poses that no frame shows, is not within anything
    if not row["pose_share"] <= WRONG_POSES:
        why.append(f"poses off by {100 * row['pose_share']:.0f} % of the outline")
    if row["worst_sigmas"] > SIGMAS:
        why.append(f"{row['worst']} off by {row['worst_sigmas']:.1f} standard deviations")
    kind = "inexact"
    if row["grade"] not in GRADED:
        kind = "refused"
    elif row["grade"] == "trusted" and why:
        kind = "wrong"
    elif within:
        kind = "right"
    return {"outcome": kind, "within": within, "why": "; ".join(why)}


def lost_to_check(row: dict[str, Any]) -> bool:
    """Return whether a run within the tolerance lost its grade by the picture check alone.

    Args:
        row: From ``judged``.
    """
    return bool(row["within"] and row["doubts"]) and all(
        any(said in reason for said in CHECK) for reason in row["doubts"]
    )


def pose_errors(
    draw: Draw, film: Film, stamps: np.ndarray, area: float, run: Path, document: dict
) -> dict[str, Any]:
    """Return by how much poses miss the material points in the picture.

    Args:
        draw: What was filmed.
        film: What drew it.
        stamps: Times of the frames [s], (frame,).
        area: Of the mechanism in the picture [px].
        run: The run folder.
        document: The content of its ``fit.json``.
    """
    poses = np.atleast_1d(np.genfromtxt(run / "poses.csv", delimiter=",", names=True))
    seen = poses[poses["seen"] > 0]
    size_px = float(2.0 * np.sqrt(area / np.pi))
    row = {"seen": round(len(seen) / max(len(stamps), 1), 3), "size_px": round(size_px, 1)}
    true = np.array([film.shown(float(stamps[int(frame)])) for frame in seen["frame"]])
    drawn = reported(draw, seen, run, document)
    if not len(seen):
        return {**row, "pose_px": float("nan"), "pose_share": float("nan")}
    width, height = draw.case.size
    inside = np.all((true > -0.5) & (true < np.array([width, height]) - 0.5), axis=2)
    off = np.where(inside, np.linalg.norm(drawn - true, axis=2), np.nan)
    # points that are never in the picture do not count
    shown = inside.any(0)
    each = np.sqrt(np.nanmean(off[:, shown] ** 2, axis=0))
    worst = float(each.max()) if shown.any() else float("nan")
    most = float(np.nanmax(off)) if shown.any() else float("nan")
    return {
        **row,
        "pose_px": round(worst, 3),
        "pose_share": round(worst / size_px, 4),
        "pose_most_px": round(most, 2),
        "points_px": [round(float(value), 3) for value in each],
    }


def reported(draw: Draw, poses: np.ndarray, run: Path, document: dict) -> np.ndarray:
    """Return where a run draws joints and far ends [px], (frame, point, 2).

    Args:
        draw: What was filmed.
        poses: Rows of ``poses.csv``, (frame,).
        run: The run folder.
        document: The content of its ``fit.json``.
    """
    model = mujoco.MjModel.from_xml_path(str(run / "model.xml"))
    data = mujoco.MjData(model)
    values = {row["name"]: row["value"] for row in document["parameters"]}
    identified = {name: values[f"{name}.length"] for name in names(draw)}
    fields = Camera.__dataclass_fields__
    camera = Camera(**{key: value for key, value in document["camera"].items() if key in fields})
    joints = [model.joint(j).name for j in range(model.njnt)]
    places = np.empty((len(poses), len(film_points(draw)), 2))
    for i, pose in enumerate(poses):
        data.qpos[:] = [pose[joint] for joint in joints]
        mujoco.mj_kinematics(model, data)
        x, y, z = material_points(model, data, draw, identified).T
        places[i] = pixels(camera, np.column_stack([x, z, -y]))
    return places


def film_points(draw: Draw) -> list[str]:
    """Return the names of the points that a picture shows.

    Args:
        draw: What was filmed.
    """
    return ["end"] if draw.kind == "ball" else [*names(draw), "end"]


def value_errors(draw: Draw, film: Film, document: dict) -> dict[str, Any]:
    """Return by how much lengths, widths and the camera's turns are off.

    Args:
        draw: What was filmed.
        film: What drew it.
        document: The content of ``fit.json``.
    """
    rows = {row["name"]: (row["value"], row["std"]) for row in document["parameters"]}
    stds = document["camera"]["std"]
    rows |= {name: (document["camera"][name[7:]], std) for name, std in stds.items() if name not in rows}
    errors = {}
    for name, (low, high) in truths(draw, film).items():
        value, std = rows.get(name, (0.0, None))
        if std:
            off = max(low - value, value - high, 0.0)
            # of a length as a share, of an angle in rad
            errors[name] = (off if name.startswith("camera") else off / high, off / std, value, std)
    of_lengths = {name: error for name, error in errors.items() if name.endswith(".length")}
    length = max(of_lengths.values(), default=(float("nan"), float("nan")))
    worst = max(errors, key=lambda name: errors[name][1], default="")
    return {
        "values": {name: [float(f"{number:.5g}") for number in error] for name, error in errors.items()},
        "length_off": round(float(length[0]), 5),
        "length_sigmas": round(float(length[1]), 2),
        "worst": worst,
        "worst_sigmas": round(float(errors[worst][1]), 2) if worst else 0.0,
    }


def truths(draw: Draw, film: Film) -> dict[str, tuple[float, float]]:
    """Return what the values of a run should be, each as an interval, by name.

    Args:
        draw: What was filmed.
        film: What drew it.
    """
    focal, eye = view(draw.case)
    scale = focal / float(np.linalg.norm(eye))
    found: dict[str, tuple[float, float]] = {}
    for name, part in zip(names(draw), draw.case.parts, strict=True):
        found[f"{name}.length"] = (part.length, part.length)
        if part.width * scale > SEEN_WIDTH and draw.kind != "ball":
            found[f"{name}.width"] = (part.width, part.width)
        if part.ball:
            ball = f"{name}.width" if draw.model == "ball" else f"{name}.sphere.width"
            found[ball] = (2 * part.ball, 2 * part.ball)
    if draw.stretch:
        during = film.truth.qpos[film.truth.time >= 0.0, -1] + lengths(draw)["link1"]
        found["link1.length"] = (float(during.min()), float(during.max()))
    if draw.pivot and (draw.kind == "ball" or draw.place != "inside"):
        low, high = found["link1.length"]
        swings = swing_length(film)
        found["link1.length"] = (min(low, swings), max(high, swings))
    turns = zip(("roll", "pitch", "yaw"), np.radians(draw.case.turned), strict=True)
    found |= {f"camera.{turn}": (float(angle), float(angle)) for turn, angle in turns}
    if draw.ellipse:
        del found["camera.yaw"]
    return found


def swing_length(film: Film) -> float:
    """Return how far a ball is from where its thread, prolonged, passes the plumb line of its rest [m].

    About that point it swings where its pivot gives way: its period is that of a pendulum of this length.

    Args:
        film: What drew it.
    """
    times = film.truth.time[film.truth.time >= 0.0]
    ball, pivot = np.empty((2, len(times), 3))
    for i, time in enumerate(times):
        data = film.truth.at(float(time))
        ball[i] = data.geom_xpos[film.truth.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE][0]
        pivot[i] = data.xpos[film.truth.model.body("link1").id]
    thread = ball - pivot
    aside = ball[:, :2] - ball[:, :2].mean(axis=0)
    leans = thread[:, :2] / np.linalg.norm(thread, axis=1, keepdims=True)
    leans = leans - leans.mean(axis=0)
    return float(np.sum(aside * leans) / np.sum(leans**2))
