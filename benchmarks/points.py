"""Print how exact runs on tracked points are, next to targets: tables made from the truth of filmed clips.

Run: ``MONODYN_DATA=<folder> python benchmarks/points.py [--only NAME ...] [--json FILE] [--gate]``.
The pivot, the joints and the far end of each clip are projected through its (moving) camera, spoiled with
noise, outliers, gaps and a stretch in which two names are exchanged, written as a table of DeepLabCut, and
run with default settings. Next to the measured angles stands what the noise alone makes of them in a single
frame.
"""

from __future__ import annotations

import csv
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import monodyn
from accuracy import differences, rms
from figures import Figure, command_line, finish, say, table
from footage import PREDICTED

CLIPS = ("double_a", "double_drift", "triple")
"""Clips whose truth tables are made of."""
NOISE_PX, OUTLIERS, MISSING = 0.5, 0.03, 0.05
"""Noise of a coordinate [px], share of points that are anywhere in the picture, and of points not found."""
EXCHANGED = (100, 140)
"""Frames in which the first joint after the pivot and the next point have exchanged names."""
FITTED = (0, 80)
"""Frames that are fitted, from the first to before the second."""
ANGLE, LENGTH, AHEAD = 0.3, 1.0, 1.0
"""Targets: angles over the fitted frames [deg], lengths [%], predicted angles [deg]."""
SIDES = 0.006
"""How far each body stands before the one before it [m]."""


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    options = command_line(__doc__, CLIPS).parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
    if not data.is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        for name in options.only or CLIPS:
            began = time.perf_counter()
            figures += measured(data / name, Path(temporary) / name)
            say(f"{name}: {time.perf_counter() - began:.1f} s")
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def measured(clip: Path, out: Path) -> list[Figure]:
    """Run on a table of one clip and compare with the truth.

    Args:
        clip: The clip without its ending.
        out: The run folder; the table is written next to it.

    Returns:
        Its figures.
    """
    truth = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    q = np.array(truth["q"])
    px = projected(truth)
    dofs = q.shape[1]
    names = [*(f"joint{i + 1}" for i in range(dofs)), f"link{dofs}"]
    points = deeplabcut(out.with_suffix(".csv"), names, *spoiled(px))
    settings = monodyn.RunSettings(fit_frames=FITTED, points=points)
    outcome = monodyn.run(clip.with_suffix(".mp4"), clip.with_suffix(".xml"), out, settings, force=True)
    say(f"{clip.name}: {outcome.document['status']}")
    figures = angles(clip.name, outcome.poses, out, q, single_frame(px))
    values = {row["name"]: row["value"] for row in outcome.document["parameters"]}
    for i, link in enumerate(truth["truth"]["links"], start=1):
        error = 100.0 * abs(values[f"link{i}.length"] / link[0] - 1.0)
        figures.append(Figure(clip.name, f"link{i}.length", error, "%", LENGTH))
    ahead = np.genfromtxt(out / "prediction.csv", delimiter=",", names=True)[:PREDICTED]
    for dof in range(dofs):
        frames = ahead["frame"].astype(int)
        error = np.degrees(differences(ahead[f"joint{dof + 1}"], q[frames, dof], turns=True))
        figures.append(Figure(clip.name, f"joint{dof + 1} predicted", rms(error), "deg", AHEAD))
    return figures


def angles(name: str, poses: monodyn.Poses, out: Path, q: np.ndarray, single: np.ndarray) -> list[Figure]:
    """Compare the measured angles, and the motion over the fitted frames, with the truth.

    Args:
        name: Name of the clip.
        poses: The measured angles.
        out: The run folder.
        q: True joint positions [rad], (frame, dof).
        single: What the noise makes of each angle in one frame [deg], (dof,).

    Returns:
        Errors of both, and the share of frames in which a joint is seen.
    """
    states = np.genfromtxt(out / "states.csv", delimiter=",", names=True)
    fitted = states[(states["frame"] >= FITTED[0]) & (states["frame"] < FITTED[1])]
    figures = []
    for dof, joint in enumerate(poses.joints):
        off = differences(fitted[joint], q[fitted["frame"].astype(int), dof], turns=True)
        figures.append(Figure(name, f"{joint} over the fitted frames", rms(np.degrees(off)), "deg", ANGLE))
        shown = poses.measured[:, dof]
        off = differences(poses.position[shown, dof], q[poses.frame[shown], dof], turns=True)
        figures.append(Figure(name, f"{joint} measured", rms(np.degrees(off)), "deg"))
        figures.append(Figure(name, f"{joint} by the noise alone", float(single[dof]), "deg"))
        figures.append(Figure(name, f"{joint} seen", 100.0 * float(np.mean(shown)), "%", least=True))
    return figures


def projected(truth: dict) -> np.ndarray:
    """Return where pivot, joints and far end are in the pictures [px], (frame, point, 2).

    Args:
        truth: The clip's truth.
    """
    camera, q = truth["camera"], np.array(truth["q"])
    width, height = camera["w"], camera["h"]
    focal = 0.5 * height / np.tan(0.5 * np.radians(camera["fovy"]))
    x, y, z = map(float, camera["pos"].split())
    path = np.array(truth.get("path", np.zeros((len(q), 3))))
    at, angle = np.zeros((len(q), 2)), np.zeros(len(q))
    places, heights = [at], [0.0]
    for i, (length, *_) in enumerate(truth["truth"]["links"]):
        angle = angle + q[:, i]
        at = at + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        places.append(at)
        heights.append(SIDES * min(i + 1, len(truth["truth"]["links"]) - 1))
    seen = np.stack(places, axis=1) - (np.array([x, z]) + path[:, None, :2])
    seen = focal * seen * [1.0, -1.0] / (-y - np.array(heights))[:, None]
    c, s = np.cos(path[:, 2:]), np.sin(path[:, 2:])
    turned = np.stack([c * seen[..., 0] - s * seen[..., 1], s * seen[..., 0] + c * seen[..., 1]], axis=2)
    return turned + np.array([width - 1, height - 1]) / 2.0


def spoiled(px: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return points as a network finds them, and how sure it says it is.

    Args:
        px: True places [px], (frame, point, 2).
        seed: Seed of the noise.

    Returns:
        Places [px], (frame, point, 2), NaN where not found, and likelihoods, (frame, point).
    """
    draw = np.random.default_rng(seed)
    found = px + NOISE_PX * draw.normal(size=px.shape)
    wrong = draw.random(px.shape[:2]) < OUTLIERS
    found[wrong] = draw.uniform([0.0, 0.0], px.max(axis=(0, 1)) + 100.0, (int(wrong.sum()), 2))
    likelihood = np.where(wrong, draw.uniform(0.2, 1.0, wrong.shape), draw.uniform(0.8, 1.0, wrong.shape))
    found[draw.random(px.shape[:2]) < MISSING] = np.nan
    stretch = slice(*EXCHANGED)
    found[stretch, [1, 2]] = found[stretch, [2, 1]]
    return found, likelihood


def single_frame(px: np.ndarray) -> np.ndarray:
    """Return what the noise alone makes of each angle in one frame, the pivot known [deg], (dof,).

    Args:
        px: True places [px], (frame, point, 2).
    """
    lengths = np.linalg.norm(np.diff(px, axis=1), axis=2).mean(axis=0)
    # the angle of a link: the noise of its two ends over its length; the first end of the first is known
    spread = np.degrees(NOISE_PX / lengths)
    ends = np.diag(spread) - np.diag(spread[1:], -1)
    turns = np.eye(len(spread)) - np.eye(len(spread), k=-1)
    return np.sqrt(np.sum((turns @ ends) ** 2, axis=1))


def deeplabcut(path: Path, names: list[str], px: np.ndarray, likelihood: np.ndarray) -> Path:
    """Write a table of DeepLabCut.

    Args:
        path: The file.
        names: Names of the points.
        px: Places [px], (frame, point, 2).
        likelihood: Likelihoods, (frame, point).

    Returns:
        The file.
    """
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["scorer", *["DLC_resnet50"] * (3 * len(names))])
        rows.writerow(["bodyparts", *(name for name in names for _ in range(3))])
        rows.writerow(["coords", *("x", "y", "likelihood") * len(names)])
        for frame, (places, sure) in enumerate(zip(px, likelihood, strict=True)):
            cells = np.column_stack([places, sure]).ravel()
            rows.writerow([frame, *("" if np.isnan(value) else repr(float(value)) for value in cells)])
    return path


if __name__ == "__main__":
    raise SystemExit(main())
