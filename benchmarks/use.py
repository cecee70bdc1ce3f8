"""Print how well what is said about the use of a simulator holds: predictions, controllers.

Run: ``python benchmarks/use.py [--only GROUP ...] [--records N] [--json FILE] [--gate]``.
``horizon``: MuJoCo moves double pendulums, wildly and hardly damped, and measures the beginning; what is said
of the rest is compared with when the prediction in truth leaves the tolerance. ``control``: what is designed
on identified mechanisms, on the true ones (``controlled.py``; a part needs ``MONODYN_DATA``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

import monodyn
from controlled import controls
from figures import Figure, command_line, finish, say, table
from intervals import NOISE, RATE, SUBSTEPS, drawn_pendulum
from monodyn.choices import Tolerance
from monodyn.results.horizon import FARTHEST, horizon
from monodyn.types import Poses

FRAMES = (40, 90)
"""Frames that are measured: at least, and below."""
SLIPPERY = 0.1
"""Share of the damping that is left."""
TOLERANCES = (2.0, 5.0)
"""Tolerances, in turn [deg]."""
AT_MOST, MEDIAN = 90.0, 0.5
"""Share of records whose horizon is no longer than the true one [%], and the median of it over that."""
SEED = 7000


@dataclass(frozen=True)
class Said:
    """How long a prediction holds, as was said and in truth.

    Attributes:
        seconds: As was said [s].
        true: In truth [s].
    """

    seconds: float
    true: float


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, ("horizon", "control"))
    parser.add_argument("--records", type=int, default=100, metavar="N", help="records of each group")
    options = parser.parse_args()
    groups: dict[str, Callable[[], list[Figure]]] = {
        "horizon": lambda: horizons(options.records),
        "control": controls,
    }
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
    seconds, true = np.array([(one.seconds, one.true) for one in found]).reshape(-1, 2).T
    # what holds to the end of what is looked at says nothing of either
    ended = true < FARTHEST
    at_most = 100.0 * float(np.mean(seconds <= true))
    share = float(np.median((seconds / np.maximum(true, 1.0 / RATE))[ended]))
    return [
        Figure("horizon", "records", len(found), ""),
        Figure("horizon", "that leave the tolerance in a minute", int(ended.sum()), ""),
        Figure("horizon", "true, median", float(np.median(true[ended])), "s"),
        Figure("horizon", "at most the true one", at_most, "%", AT_MOST, least=True),
        Figure("horizon", "share of the true one, median", share, "", MEDIAN, least=True),
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
    angle = float(np.radians(tolerance))
    ahead = np.arange(1, len(position) - frames + 1) / RATE
    future = monodyn.predict(fit, times=poses.time[-1] + ahead)
    off = np.any(~(np.abs(future.position - position[frames:]) <= angle), axis=1)
    row = int(np.argmax(off))
    true = FARTHEST if not off.any() else float(ahead[row - 1]) if row else 0.0
    return Said(min(horizon(fit, Tolerance(angle)).seconds, FARTHEST), true)


if __name__ == "__main__":
    raise SystemExit(main())
