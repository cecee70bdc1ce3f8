"""Print how often intervals and bands hold end to end: from the pixels of made clips to parameters.

Run: ``python benchmarks/clip_intervals.py [--clips N] [--json FILE] [--gate]``. Every clip shows a double
pendulum that is drawn, with its picture, from a seed, by a camera that is turned as far as is assumed of one
of which nothing is known; it is let go from 0.4 rad or more aside, for one that hardly moves hides what is
behind it. States lie exactly on the time stamps. It is located and followed once, and identified under the
gravity that it was made with in five windows, each of which predicts what comes after it. 88 to 99 % are to
hold of intervals, of the fitted poses within the windows and of the bands after them; how many of the tracked
poses do, which a fit does not know, stands beside.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

import monodyn
from cases import BLUE, DARK, RED
from clips import cached
from figures import Figure, command_line, finish, say, table
from intervals import AHEAD, Swing, bands, inertias, intervals
from monodyn.results.curves import BAND
from monodyn.types import Poses
from monodyn.vision.drawing.camera import CAMERA_STD, CAMERA_TURNS
from spec import Case, Part

WINDOW, WINDOWS = 60, 5
"""Frames of a window, and windows of a clip."""
RATE, SECONDS = 30, 12.0
"""Frames a second [Hz], and length of a clip [s]."""
LEAST, MOST = 88.0, 99.0
"""Share that is to hold [%]."""
TURN = 2.0 * np.pi
"""A whole turn [rad]."""
HANGING = -0.5 * np.pi
"""Position of the first joint at rest [rad]."""
SEED = 500


def main() -> int:
    """Run the clips and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, ())
    parser.add_argument("--clips", type=int, default=16, metavar="N", help="clips that are made")
    options = parser.parse_args()
    held: dict[str, list[bool]] = defaultdict(list)
    grades: list[str] = []
    for seed in range(options.clips):
        case = drawn(np.random.default_rng(SEED + seed), seed)
        for name, holds in covered(case, grades):
            held[name].append(holds)
        say(f"{case.name}: {', '.join(grades[-WINDOWS:])}; {counts(held)}")
    figures = [
        Figure("windows", grade, 100.0 * grades.count(grade) / len(grades), "%") for grade in set(grades)
    ]
    for name in sorted(held):
        figures.append(Figure("each", f"{name} ({len(held[name])})", 100.0 * float(np.mean(held[name])), "%"))
    for kind in ("interval", "pose", "band"):
        values = [holds for name, found in held.items() if name.startswith(kind) for holds in found]
        share = 100.0 * float(np.mean(values)) if values else float("nan")
        figures.append(Figure("all", f"{kind}s that hold", share, "%", LEAST, least=True))
        figures.append(Figure("all", f"{kind}s that hold, at most", share, "%", MOST))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def covered(case: Case, grades: list[str]) -> Iterator[tuple[str, bool]]:
    """Follow one clip and identify its windows.

    Args:
        case: The clip.
        grades: Takes the grade of each window.

    Yields:
        Names and whether they hold.
    """
    clip, roll = cached(case), float(np.radians(case.turned[0]))
    scene = monodyn.locate(monodyn.segment(monodyn.read(clip.video)), monodyn.load(clip.model))
    poses = monodyn.track(scene.masks, scene)
    yield from tracked(poses, clip.position[poses.frame], roll)
    known = dict(monodyn.load(clip.truth).values)
    known |= inertias(mujoco.MjModel.from_xml_path(str(clip.truth)))
    known["camera.roll"] = roll
    for k in range(WINDOWS):
        part = poses[k * WINDOW : (k + 1) * WINDOW]
        fit = monodyn.identify(part, scene.mechanism.with_choices(fix={"gravity": known["gravity"]}))
        grades.append(fit.grade)
        if not fit.ok:
            continue
        # whole turns of a hinge are not seen
        last = int(part.frame[-1])
        whole = np.nan_to_num(np.round((part.position[-1] - clip.position[last]) / TURN) * TURN)
        states = monodyn.predict(fit, times=part.time)
        yield from holding(
            "pose", poses.joints, states.position - clip.position[part.frame] - whole, states.std
        )
        later = clip.position[[last + round(ahead * RATE) for ahead in AHEAD]] + whole
        # a torque over time that was found has a true value as well
        torques = {p.name: 0.0 for p in fit.parameters if ".torque." in p.name}
        yield from intervals(fit, known | torques)
        yield from bands(fit, Swing(part, known, later))


def tracked(poses: Poses, true: np.ndarray, roll: float) -> Iterator[tuple[str, bool]]:
    """Say of tracked positions whether they hold, by the noise of each frame and by what is not known of the
    scene that all frames have in common.

    Args:
        poses: The poses.
        true: The positions against gravity [rad], (frame, dof).
        roll: The roll of the camera [rad].

    Yields:
        Names and whether they hold.
    """
    # a picture shows all turned clockwise by the roll
    error = poses.position - true
    error[:, 0] += roll
    variance = np.diagonal(poses.covariance, axis1=1, axis2=2)
    common = 0.0 if poses.shifts is None else np.sum(poses.shifts**2, axis=0)
    error = np.where(poses.measured, (error + 0.5 * TURN) % TURN - 0.5 * TURN, np.nan)
    yield from holding("tracked", poses.joints, error, np.sqrt(variance + common))


def holding(
    what: str, joints: Sequence[str], error: np.ndarray, std: np.ndarray
) -> Iterator[tuple[str, bool]]:
    """Say of positions whether their band contains the truth.

    Args:
        what: What they are.
        joints: The joints.
        error: What they are off by, (frame, dof); NaN where there is none.
        std: Their standard deviations, (frame, dof).

    Yields:
        Names and whether they hold.
    """
    for joint, off, wide in zip(joints, error.T, std.T, strict=True):
        for value in (np.abs(off) <= BAND * wide)[np.isfinite(off)]:
            yield f"{what} of {joint}", bool(value)


def counts(held: dict[str, list[bool]]) -> str:
    """Return the shares so far, as words.

    Args:
        held: What holds, by name.
    """
    words = []
    for kind in ("interval", "pose", "band"):
        values = [holds for name, found in held.items() if name.startswith(kind) for holds in found]
        words.append(f"{100.0 * np.mean(values):.1f} % of {kind}s" if values else f"no {kind}s")
    return ", ".join(words)


def drawn(rng: np.random.Generator, seed: int) -> Case:
    """Draw a double pendulum and its picture.

    Args:
        rng: Where it comes from.
        seed: Of the noise.

    Returns:
        The clip to make.
    """
    parts = []
    for k, colour in enumerate((RED, BLUE) if rng.random() < 0.6 else (DARK, DARK)):
        length, width = float(rng.uniform(0.12, 0.28)), float(rng.uniform(0.02, 0.034))
        ends = rng.uniform(0.3, 1.0, 2) * width
        parts.append(
            Part(
                length,
                width,
                float(rng.uniform(0.004, 0.009)),
                colour,
                parent=k - 1,
                tail=float(ends[0]),
                tip=float(ends[1]),
                damping=float(rng.uniform(3e-4, 1.2e-3)),
            )
        )
    wall = str(rng.choice(["plain", "mottled", "checker", "stripes"]))
    # a mechanism that hardly moves hides the background, and with it what it looks like itself
    aside = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 1.2))
    start = HANGING + aside, float(rng.uniform(-1.0, 1.0))
    turns = [CAMERA_STD[name] for name in CAMERA_TURNS]
    return Case(
        f"drawn_{seed}", tuple(parts), start, rate=RATE, seconds=SECONDS, wall=wall,  # pyright: ignore
        fovy=float(rng.uniform(30.0, 55.0)), noise=float(rng.uniform(1.0, 4.0)),
        crf=int(rng.integers(18, 25)), seed=seed,
        turned=tuple(float(np.degrees(std * rng.normal())) for std in turns),  # pyright: ignore
    )  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
