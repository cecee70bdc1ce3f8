"""Measure how well what was hidden is filled: in clips with known truth, and in records that are pushed.

Run: ``MONODYN_DATA=<folder> python benchmarks/gaps.py [--only GROUP ...] [--records N] [--gate]``.
``clips``: clips go through the whole pipeline, one that shows the wall alone in two stretches, one in which a
post hides the second link. ``pushed``: double pendulums that are pushed at random, as if the model lacked
something, of which stretches are hidden, both joints or one alone.
"""

from __future__ import annotations

import csv
import json
import math
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from intervals import NOISE, RATE, SUBSTEPS, drawn_pendulum
from monodyn.results.fill import fill
from monodyn.results.gaps import filled
from monodyn.settings import RunSettings
from monodyn.types import Poses

BLANK = (*range(60, 76), *range(120, 151))
"""Frames that show the wall alone."""
FITTED = ((None, "all but the last quarter fitted"), ((0, 100), "frames 0:100 fitted"))
"""Fitted frames of that clip, and what they are called."""
NOISY = 1.5
"""Noise of the wall's pictures [grey levels]."""
AS_SEEN, POST, WITHIN, SQUARE = 2.0, 1.0, 90.0, 1.5
"""Error in gaps over that of seen frames, at most; behind the post, at most [deg]; share within 95 % bands,
at least [%]; mean square of error over deviation, at most."""
FRAMES, GAPS = 120, ((20, 30), (45, 60), (80, 88), (100, 110))
"""Of a record that is pushed, and what is hidden of it."""
WEAKEST, STRONGEST = 1e-3, 0.3
"""Density of the random accelerations [rad^2/s^3]."""
SEED = 11_000


@dataclass(frozen=True)
class Hidden:
    """Hidden positions of one joint and what was filled in.

    Attributes:
        error: Filled less true position [deg], (frame,).
        std: Standard deviation that is stated [deg], (frame,).
        seen: Error of the fitted frames in which the joint was seen [deg], (frame,).
    """

    error: np.ndarray
    std: np.ndarray
    seen: np.ndarray


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``, 2 without the clips.
    """
    parser = command_line(__doc__, ("clips", "pushed"))
    parser.add_argument("--records", type=int, default=50, metavar="N", help="records that are pushed")
    options = parser.parse_args()
    wanted, figures = options.only or ["clips", "pushed"], []
    if "clips" in wanted:
        folder = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
        if not folder.is_dir():
            print(
                "MONODYN_DATA: expected the folder that holds rendered/; set the variable.", file=sys.stderr
            )
            return 2
        figures += clips(folder)
    if "pushed" in wanted:
        figures += pushed(options.records)
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def gaps(records: int) -> list[Figure]:
    """Return all figures: those of the clips where ``MONODYN_DATA`` names a folder with them.

    Args:
        records: How many records are pushed.
    """
    folder = Path(os.environ.get("MONODYN_DATA") or "missing") / "rendered"
    return [*(clips(folder) if folder.is_dir() else []), *pushed(records)]


def clips(folder: Path) -> list[Figure]:
    """Fill what is hidden in clips.

    Args:
        folder: Holds ``double_a`` and ``double_occluded``: clip, model and truth.

    Returns:
        Figures.
    """
    figures = []
    with tempfile.TemporaryDirectory() as home:
        blanked = Path(home) / "blanked.mp4"
        blank(folder / "double_a.mp4", blanked, BLANK)
        for frames, called in FITTED:
            found = filled_in(blanked, folder / "double_a", Path(home) / "run", frames)
            case = f"double_a blanked, {called}"
            for joint, hidden in found.items():
                seen = _rms(hidden.seen)
                most = AS_SEEN * seen
                figures += [
                    Figure(case, f"{joint}: error of seen frames", seen, "deg"),
                    Figure(case, f"{joint}: error in the gaps", _rms(hidden.error), "deg", most),
                ]
            figures += _bands(case, list(found.values()))
        found = filled_in(
            folder / "double_occluded.mp4", folder / "double_occluded", Path(home) / "run", None
        )
        for joint, hidden in found.items():
            if len(hidden.error):
                worst = float(np.abs(hidden.error).max())
                figures.append(Figure("double_occluded", f"{joint}: largest error", worst, "deg", POST))
        figures += _bands("double_occluded", list(found.values()))
    return figures


def blank(clip: Path, to: Path, rows: Sequence[int]) -> None:
    """Write a clip again in which some frames show the wall alone: the median of the others, with noise.

    Args:
        clip: The clip.
        to: The clip to write.
        rows: Frames that are blanked.
    """
    import av

    rng = np.random.default_rng(SEED)
    with av.open(str(clip)) as container:
        stream = container.streams.video[0]
        rate, size = stream.average_rate, (stream.width, stream.height)
        pictures = [frame.to_ndarray(format="yuv420p") for frame in container.decode(stream)]
    wall = np.median(pictures[::10], axis=0)
    with av.open(str(to), "w") as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "18", "threads": "1"})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        for row, picture in enumerate(pictures):
            if row in rows:
                noisy = wall + rng.normal(scale=NOISY, size=wall.shape)
                picture = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="yuv420p")))
        container.mux(stream.encode())


def filled_in(clip: Path, given: Path, out: Path, frames: tuple[int, int] | None) -> dict[str, Hidden]:
    """Run the pipeline on a clip and compare its tables with the truth.

    Args:
        clip: The clip.
        given: Model and truth, less their suffixes.
        out: The run folder.
        frames: First fitted frame and the one after the last; None for the default.

    Returns:
        What was hidden, by joint.
    """
    say(f"gaps: {clip.name}")
    done = monodyn.run(clip, given.with_suffix(".xml"), out, RunSettings(fit_frames=frames), force=True)
    truth = np.degrees(json.loads(given.with_suffix(".json").read_text())["q"])
    poses, states = _columns(out / "poses.csv"), _columns(out / "states.csv")
    first, stop = done.document["fit_frames"]
    frame, found = states["frame"].astype(int), {}
    for dof, joint in enumerate(done.poses.joints):
        error = np.degrees(states[joint]) - truth[frame, dof]
        # a gap may hide a turn
        error -= 360.0 * np.round(error / 360.0)
        seen = poses.get(f"{joint}_seen", poses["seen"]) > 0.0
        fitted = seen & (frame >= first) & (frame < stop)
        std = np.degrees(states[f"{joint}_std"])
        found[joint] = Hidden(error[~seen], std[~seen], error[fitted])
    return found


def pushed(records: int) -> list[Figure]:
    """Fill what is hidden of double pendulums that are pushed at random.

    Args:
        records: How many there are.

    Returns:
        Figures.
    """
    found, rolled = [], []
    for seed in range(records):
        one = pushed_record(np.random.default_rng(SEED + seed))
        if one is not None:
            found.append(one[0])
            rolled.append(one[1])
        if seed % 10 == 9:
            say(f"gaps: {seed + 1} of {records}")
    better = _rms(np.concatenate([one.error for one in rolled])) / _rms(
        np.concatenate([one.error for one in found])
    )
    count = sum(len(one.error) for one in found)
    return [
        Figure("pushed", "records that are identified", len(found), ""),
        Figure("pushed", "hidden positions, in the middle of gaps", count, ""),
        Figure("pushed", "error of the roll-out over that of the filled ones", better, ""),
        *_bands("pushed", found, square=True),
        Figure("pushed", "within the 95 % band, of the roll-out", _within(rolled), "%"),
    ]


def pushed_record(rng: np.random.Generator) -> tuple[Hidden, Hidden] | None:
    """Draw a double pendulum, push it, hide stretches of it, identify it and fill them.

    Args:
        rng: Where everything comes from.

    Returns:
        The middles of the gaps as they were filled, and by the roll-out; None where nothing was identified.
    """
    _, text = drawn_pendulum(rng)
    body = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-np.pi / 2.0, 1.0, 2)
    density = math.exp(rng.uniform(math.log(WEAKEST), math.log(STRONGEST)))
    position = np.zeros((FRAMES, 2))
    for row in range(FRAMES):
        position[row] = data.qpos
        for _ in range(SUBSTEPS):
            data.qvel[:] += math.sqrt(density * body.opt.timestep) * rng.normal(size=2)
            mujoco.mj_step(body, data)
    seen, middles = np.ones((FRAMES, 2), dtype=bool), np.zeros((FRAMES, 2), dtype=bool)
    for first, after in GAPS:
        joint = (slice(None), 0, 1)[int(rng.integers(3))]
        seen[first:after, joint] = False
        middles[(first + after) // 2, joint] = True
    measured = np.where(seen, position + rng.normal(scale=NOISE, size=(FRAMES, 2)), np.nan)
    frame, covariance = np.arange(FRAMES), np.tile(NOISE**2 * np.eye(2), (FRAMES, 1, 1))
    poses = Poses(
        ("joint1", "joint2"), frame, frame / RATE, measured, covariance, seen.all(axis=1), joint_seen=seen
    )
    fit = monodyn.identify(poses, monodyn.load("double"))
    if not fit.ok:
        return None
    both = []
    for motion in (filled(fit, poses), fill(fit, poses.time)):
        error = np.degrees(motion.position - position)
        both.append(Hidden(error[middles], np.degrees(motion.std)[middles], error[seen]))
    return both[0], both[1]


def _bands(case: str, found: Sequence[Hidden], *, square: bool = False) -> list[Figure]:
    """Return how well bands hold; of errors that are independent their mean square, too."""
    figures = [Figure(case, "within the 95 % band", _within(found), "%", WITHIN, least=True)]
    if square:
        error, std = (np.concatenate([getattr(one, name) for one in found]) for name in ("error", "std"))
        figures.append(
            Figure(case, "mean square of error over deviation", _rms(error / std) ** 2, "", SQUARE)
        )
    return figures


def _within(found: Sequence[Hidden]) -> float:
    """Return the share of errors within their 95 % band [%]."""
    error, std = (np.concatenate([getattr(one, name) for one in found]) for name in ("error", "std"))
    return 100.0 * float(np.mean(np.abs(error) <= 1.96 * std))


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2))) if len(error) else math.nan


def _columns(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table by name; an empty cell is NaN."""
    with path.open(newline="", encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


if __name__ == "__main__":
    raise SystemExit(main())
