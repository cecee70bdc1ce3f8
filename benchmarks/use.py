"""Print how well what is said about the use of a simulator holds: predictions, gaps, controllers, files.

Run: ``python benchmarks/use.py [--only GROUP ...] [--records N] [--json FILE] [--gate]``.
``horizon``: MuJoCo moves double pendulums, wildly and hardly damped, and measures the beginning; what is said
of the rest is compared with when the prediction in truth leaves the tolerance. ``rendered``: the same of
clips that are drawn. The others have scripts of their own: ``gaps`` (``gaps.py``),
``control`` (``controlled.py``), ``files`` (``handed_over.py``), ``next`` (``next_motion.py``).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import monodyn
from clips import cached
from controlled import controls
from figures import Figure, command_line, finish, say, table
from gaps import gaps
from handed_over import handed_over
from intervals import NOISE, RATE, SUBSTEPS, drawn_pendulum
from monodyn.choices import Tolerance
from monodyn.results.horizon import FARTHEST, horizon
from monodyn.types import Poses
from monodyn.vision.drawing.camera import CAMERA_STD, CAMERA_TURNS
from next_motion import advised_motions
from spec import Case, Part

FRAMES = (40, 90)
"""Frames that are measured: at least, and below."""
SLIPPERY = 0.1
"""Share of the damping that is left."""
TOLERANCES = (2.0, 5.0)
"""Tolerances, in turn [deg]."""
AT_MOST, MEDIAN = 90.0, 0.5
"""Share of records whose horizon is no longer than the true one [%], and the median of it over that."""
SEED = 7000
CLIPS, FILMED, SECONDS = 20, 60, 8.0
"""Clips that are made, frames of each that are fitted, and how long it is [s]."""


@dataclass(frozen=True)
class Said:
    """How long a prediction holds, as was said and in truth.

    Attributes:
        seconds: As was said [s].
        true: In truth [s]; infinite where it does as far as is known.
    """

    seconds: float
    true: float


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    groups: dict[str, Callable[[], list[Figure]]] = {
        "horizon": lambda: horizons(options.records),
        "rendered": rendered,
        "gaps": lambda: gaps(options.records),
        "control": controls,
        "files": handed_over,
        "next": lambda: advised_motions(options.records // 2),
    }
    parser = command_line(__doc__, tuple(groups))
    parser.add_argument("--records", type=int, default=100, metavar="N", help="records of each group")
    options = parser.parse_args()
    figures = [figure for group in options.only or groups for figure in groups[group]()]
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def horizons(records: int) -> list[Figure]:
    """Compare how long predictions are said to hold with how long they do.

    Args:
        records: How many there are.

    Returns:
        Figures.
    """
    found: list[Said] = []
    for seed in range(records):
        said = lasting(np.random.default_rng(SEED + seed), TOLERANCES[seed % len(TOLERANCES)])
        found += [said] if said is not None else []
        if seed % 10 == 9:
            say(f"horizon: {seed + 1} of {records}")
    return said_figures("horizon", found)


def rendered() -> list[Figure]:
    """Return the same figures of clips of wild double pendulums, from their first frames."""
    found = []
    for number in range(CLIPS):
        clip = cached(wild(number))
        with tempfile.TemporaryDirectory() as folder:
            settings = monodyn.RunSettings(fit_frames=(0, FILMED))
            try:
                fit = monodyn.run(clip.video, clip.model, Path(folder) / "run", settings).fit
            except monodyn.MonodynError as refusal:
                say(f"rendered {number}: {refusal}"[:160])
                continue
        assert fit is not None
        said = f"{fit.grade}"
        if fit.ok:
            tolerance = TOLERANCES[number % len(TOLERANCES)]
            one = held(fit, clip.time[FILMED:], clip.position[FILMED:], tolerance)
            found.append(one)
            said += f", {one.seconds:.2f} s said, {one.true:.2f} s in truth"
        say(f"rendered {number}: {said}")
    return said_figures("rendered", found)


def wild(number: int) -> Case:
    """Return a drawn double pendulum that is let go high up and hardly damped, by a camera that is turned as
    far as is assumed of one of which nothing is known.

    Args:
        number: Which one.
    """
    rng = np.random.default_rng(SEED + number)
    parts = tuple(
        Part(
            length=float(rng.uniform(0.12, 0.3)), width=float(rng.uniform(0.018, 0.035)),
            thickness=float(rng.uniform(0.004, 0.01)), colour=colour, parent=k - 1, tail=0.012, tip=0.012,
            damping=float(10.0 ** rng.uniform(-4.7, -3.7)),
        )
        for k, colour in enumerate(((170, 60, 50), (45, 70, 150)))
    )  # fmt: skip
    start = float(rng.uniform(0.0, 1.3)), float(rng.uniform(-1.5, 1.5))
    roll, pitch, yaw = (float(np.degrees(CAMERA_STD[name] * rng.normal())) for name in CAMERA_TURNS)
    turned = roll, pitch, yaw
    return Case(f"wild_{number}", parts, start, seconds=SECONDS, seed=number, turned=turned)


def said_figures(group: str, found: list[Said]) -> list[Figure]:
    """Return how long predictions were said to hold against how long they do.

    Args:
        group: What they are of.
        found: Each of them.
    """
    seconds, true = np.array([(one.seconds, one.true) for one in found]).reshape(-1, 2).T
    # what holds to the end of what is looked at says nothing of either
    ended = np.isfinite(true)
    at_most = 100.0 * float(np.mean(seconds <= true))
    share = float(np.median((seconds / np.maximum(true, 1.0 / RATE))[ended]))
    return [
        Figure(group, "records", len(found), ""),
        Figure(group, "that leave the tolerance", int(ended.sum()), ""),
        Figure(group, "true, median", float(np.median(true[ended])), "s"),
        Figure(group, "at most the true one", at_most, "%", AT_MOST, least=True),
        Figure(group, "share of the true one, median", share, "", MEDIAN, least=True),
    ]


def lasting(rng: np.random.Generator, tolerance: float) -> Said | None:
    """Draw a double pendulum, identify it from its first frames, and follow its prediction.

    Args:
        rng: Where everything comes from.
        tolerance: How far off a prediction may be [deg].

    Returns:
        How long it holds; None where nothing was identified.
    """
    _, text = drawn_pendulum(rng)
    body = mujoco.MjModel.from_xml_string(text)
    body.dof_damping[:] *= SLIPPERY
    data = mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-np.pi / 2.0, 2.5, 2)
    frames = int(rng.integers(*FRAMES))
    position = np.zeros((frames + round(FARTHEST * RATE), 2))
    for row in range(len(position)):
        position[row] = data.qpos
        mujoco.mj_step(body, data, SUBSTEPS)
    measured = position[:frames] + rng.normal(scale=NOISE, size=(frames, 2))
    frame, covariance = np.arange(frames), np.tile(NOISE**2 * np.eye(2), (frames, 1, 1))
    poses = Poses(
        ("joint1", "joint2"), frame, frame / RATE, measured, covariance, np.ones(frames, dtype=bool)
    )
    fit = monodyn.identify(poses, monodyn.load("double"))
    if not fit.ok:
        return None
    ahead = np.arange(1, len(position) - frames + 1) / RATE
    return held(fit, poses.time[-1] + ahead, position[frames:], tolerance)


def held(fit: monodyn.Fit, times: np.ndarray, position: np.ndarray, tolerance: float) -> Said:
    """Return how long a prediction is said to hold, and how long it does.

    Args:
        fit: The identified mechanism.
        times: Time stamps after the fitted frames [s], (frame,).
        position: True positions there [rad], (frame, dof).
        tolerance: How far off a prediction may be [deg].
    """
    angle, since = float(np.radians(tolerance)), times - fit.time[0][-1]
    future = monodyn.predict(fit, times=times)
    off = np.any(~(np.abs(future.position - position) <= angle), axis=1)
    row = int(np.argmax(off))
    true = np.inf if not off.any() else float(since[row - 1]) if row else 0.0
    return Said(min(horizon(fit, Tolerance(angle)).seconds, FARTHEST), true)


if __name__ == "__main__":
    raise SystemExit(main())
