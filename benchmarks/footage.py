"""Print how exact a default run is on clips as people film them, next to targets.

Run: ``MONODYN_DATA=<folder> python benchmarks/footage.py [--only NAME ...] [--json FILE] [--gate]``.
Every clip goes through ``monodyn.run`` with default settings and the model alone; with the truth is compared
what stands in the run folder. Pictures, tables and reports of the runs are kept with ``--runs FOLDER``.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import monodyn
from accuracy import differences, rms
from figures import Figure, command_line, finish, say, table

PREDICTED = 40
"""Frames after the fitted ones that are predicted."""


@dataclass(frozen=True)
class Asked:
    """What one clip must reach.

    Attributes:
        angle: Error of every joint angle over the seen frames, rms [deg].
        length: Error of every length [%].
        ahead: Error of every predicted joint angle, rms [deg].
        fitted: Frames that are fitted, from the first to before the second.
        width: Error of every width [%].
        pivot: Error of the pivot's place in the picture over the length there [%].
        seen: Least share of the frames that are seen [%].
        release: Most frames between the first fitted one and the release.
        resting: True where the predicted angle at the end of the clip counts; MuJoCo's friction, which gives
            way a little, moves it by half a degree, so that it has no target.
        note: Words that must occur in the notes of the run.
    """

    angle: float
    length: float
    ahead: float
    fitted: tuple[int, int] = (0, 80)
    width: float | None = None
    pivot: float | None = None
    seen: float | None = None
    release: int | None = None
    resting: bool = False
    note: str | None = None


CLIPS = {
    "double_shadow": Asked(0.1, 0.5, 0.5),
    "double_occluded": Asked(0.2, 1.0, 1.0),
    "bob_above": Asked(0.3, 1.5, 0.7, fitted=(0, 120), pivot=1.0),
    "ball_above": Asked(0.3, 1.5, 0.7, fitted=(0, 120), pivot=1.0),
    "double_hand": Asked(0.15, 0.7, 0.5, fitted=(0, 120), release=3),
    "double_repeats": Asked(0.1, 0.7, 0.5, note="repeat"),
    "double_pane": Asked(0.1, 0.5, 0.4, width=4.0),
    "double_ell": Asked(0.1, 0.7, 0.5),
    "double_faint": Asked(0.3, 1.5, 1.5, seen=95.0),
    "single_dry": Asked(0.1, 0.7, 0.4, resting=True),
}
"""The targets by clip."""


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 when the data are missing.
    """
    parser = command_line(__doc__, tuple(CLIPS))
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep the run folders there")
    options = parser.parse_args()
    data = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
    if not data.is_dir():
        print("MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr)
        return 2
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory() as temporary:
        runs = options.runs or Path(temporary)
        runs.mkdir(parents=True, exist_ok=True)
        for name in options.only or CLIPS:
            began = time.perf_counter()
            try:
                figures += filmed(data / name, runs / name)
            except monodyn.MonodynError as error:
                say(f"{name}: {error}")
                figures.append(Figure(name, "run", float("nan"), "", 0.0))
            say(f"{name}: {time.perf_counter() - began:.1f} s")
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def filmed(clip: Path, out: Path) -> list[Figure]:
    """Run one clip and compare its run folder with the truth.

    Args:
        clip: The clip without its ending.
        out: The run folder.

    Returns:
        Its figures.
    """
    asked = CLIPS[clip.name]
    settings = monodyn.RunSettings(fit_frames=asked.fitted)
    outcome = monodyn.run(clip.with_suffix(".mp4"), clip.with_suffix(".xml"), out, settings, force=True)
    say(f"{clip.name}: {outcome.document['status']}")
    truth = json.loads(clip.with_suffix(".json").read_text(encoding="utf-8"))
    figures = tracked(clip.name, asked, outcome.poses, truth)
    figures += sizes(clip.name, asked, outcome.document, truth["truth"]["links"])
    figures += predicted(clip.name, asked, out, truth)
    if asked.pivot is not None:
        figures.append(Figure(clip.name, "pivot", pivot_error(outcome.document, truth), "%", asked.pivot))
    if asked.release is not None:
        away = abs(outcome.document["fit_frames"][0] - float(truth["release"]) / step(truth["times"]))
        figures.append(Figure(clip.name, "first fitted frame to release", away, "frames", asked.release))
    if asked.note is not None:
        said = any(asked.note in note for note in outcome.notes)
        figures.append(Figure(clip.name, f"notes without '{asked.note}'", float(not said), "", 0.0))
    return figures


def tracked(name: str, asked: Asked, poses: monodyn.Poses, truth: dict) -> list[Figure]:
    """Compare the tracked angles with the truth, wherever they are called seen.

    Args:
        name: Name of the clip.
        asked: Its targets.
        poses: What was tracked.
        truth: The clip's truth.

    Returns:
        Share of seen frames, and for each joint the rms and the largest error.
    """
    q = np.array(truth["q"])[poses.frame]
    fresh = np.array(truth.get("fresh", np.ones(len(truth["q"]))), dtype=bool)[poses.frame]
    free = np.asarray(truth["times"])[poses.frame] >= truth.get("release", 0.0)
    seen = poses.seen & free
    share = 100.0 * float(np.mean(poses.seen[fresh & free]))
    figures = [Figure(name, "frames seen", share, "%", asked.seen, least=True)]
    for dof, joint in enumerate(poses.joints):
        error = np.degrees(differences(poses.position[seen, dof], q[seen, dof], turns=True))
        most = float(np.max(np.abs(error), initial=0.0))
        figures.append(Figure(name, f"{joint} over the clip", rms(error), "deg", asked.angle))
        figures.append(Figure(name, f"{joint} at its worst", most, "deg"))
    return figures


def sizes(name: str, asked: Asked, document: dict, links: list[list[float]]) -> list[Figure]:
    """Compare lengths, and widths where they are asked for, with the truth.

    Args:
        name: Name of the clip.
        asked: Its targets.
        document: The content of ``fit.json``.
        links: True length, width and thickness of the links [m], as far as they are known.

    Returns:
        The relative error of each size.
    """
    values = {row["name"]: row["value"] for row in document["parameters"]}
    figures = []
    for kind, column, most in (("length", 0, asked.length), ("width", 1, asked.width)):
        for i, link in enumerate(links, start=1):
            if most is not None:
                error = 100.0 * abs(values[f"link{i}.{kind}"] / link[column] - 1.0)
                figures.append(Figure(name, f"link{i}.{kind}", error, "%", most))
    return figures


def predicted(name: str, asked: Asked, out: Path, truth: dict) -> list[Figure]:
    """Compare the prediction after the fitted frames with the truth, where the picture shows it.

    Args:
        name: Name of the clip.
        asked: Its targets.
        out: The run folder.
        truth: The clip's truth; a picture that repeats the one before shows where the mechanism was.

    Returns:
        The rms error of each joint over the predicted frames, and where asked for that of the last frame.
    """
    file = np.genfromtxt(out / "prediction.csv", delimiter=",", names=True)
    file = file[np.array(truth.get("fresh", np.ones(len(truth["q"]))), dtype=bool)[file["frame"].astype(int)]]
    q = np.array(truth["q"])[file["frame"].astype(int)]
    figures = []
    for dof in range(q.shape[1]):
        error = np.degrees(differences(file[f"joint{dof + 1}"], q[:, dof], turns=True))
        figures.append(Figure(name, f"joint{dof + 1} predicted", rms(error[:PREDICTED]), "deg", asked.ahead))
        if asked.resting:
            last = float(abs(error[-1]))
            figures.append(Figure(name, f"joint{dof + 1} at the end", last, "deg"))
    return figures


def pivot_error(document: dict, truth: dict) -> float:
    """Return how far the located pivot is from the true one, over the mechanism's length [%].

    Both are compared in the picture: the pivot in front of the camera, in lengths of the first link.

    Args:
        document: The content of ``fit.json``.
        truth: The clip's truth.
    """
    camera = document["camera"]
    values = {row["name"]: row["value"] for row in document["parameters"]}
    # the mechanism hangs at the origin; the camera's place is in the identified scale
    found = np.array([-camera["x"], -camera["y"]]) / values["link1.length"]
    x, _, z = map(float, truth["camera"]["pos"].split())
    true = np.array([-x, -z]) / truth["truth"]["links"][0][0]
    return 100.0 * float(np.hypot(*(found - true)))


def step(times: list[float]) -> float:
    """Return the median time between two frames [s].

    Args:
        times: Time stamps [s].
    """
    return float(np.median(np.diff(times)))


if __name__ == "__main__":
    raise SystemExit(main())
