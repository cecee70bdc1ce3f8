"""Print how often intervals and bands hold: double pendulums moved by MuJoCo, with noise of a known size.

Run: ``python benchmarks/intervals.py [--only GROUP ...] [--records N] [--json FILE] [--gate]``.
Every record has lengths, thicknesses and dampings of its own, and proportions of widths and overhangs, and a
gravity, that are drawn as they are assumed. ``40`` and ``120`` are frames; in ``given`` the proportions are
given. Of 95 % intervals 92 to 98 % are to contain the truth, of all that is called identifiable, and so are
bands of predictions; in ``together`` stand all records, each quantity by itself, where there are ``ENOUGH``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from monodyn.estimation.fit import Fit
from monodyn.estimation.shooting.prior import PROPORTION_STD
from monodyn.estimation.shooting.unknowns import assumed_sizes
from monodyn.estimation.verdict.gravity import GRAVITY_STD
from monodyn.results.curves import BAND
from monodyn.types import Poses

RATE, NOISE = 30.0, 3e-3
"""Frames a second [Hz], and the noise of the positions [rad]."""
SUBSTEPS = 50
"""Integration steps from frame to frame."""
AHEAD = (0.5, 1.0, 2.0)
"""Predictions that are judged, after the last frame [s]."""
HALVED = 0.5
"""Sizes and dampings are drawn within this of the file's logarithms."""
LEAST, MOST = 92.0, 98.0
"""Share of intervals that are to hold [%]."""
ENOUGH = 300
"""Intervals of one quantity whose share is known well enough to have a target: within 1.3 %."""
SEED = 2000
DENSITY = 2700.0

MODEL = """
<mujoco>
  <option gravity="0 0 -{gravity}" integrator="RK4" timestep="{step}"/>
  <default>
    <joint type="hinge" axis="0 -1 0"/>
    <geom type="box" density="{density}" contype="0" conaffinity="0"/>
  </default>
  <worldbody>
    <body name="link1">
      <joint name="joint1" damping="{damping1}"/>
      <geom size="{half1} {thick1} {wide1}" pos="{middle1} 0 0"/>
      <body name="link2" pos="{length1} -0.008 0">
        <joint name="joint2" damping="{damping2}"/>
        <geom size="{half2} {thick2} {wide2}" pos="{middle2} 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Swing:
    """A double pendulum that MuJoCo moved.

    Attributes:
        poses: What is measured of it.
        known: True values of its parameters and of its regrouped inertias by name [SI].
        later: True positions at ``AHEAD`` after the last frame [rad], (time, dof).
    """

    poses: Poses
    known: dict[str, float]
    later: np.ndarray


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    # every group has pendulums of its own: of the same ones by-name shares would lean together
    groups = {"40": (SEED, 40, False), "120": (SEED + 1000, 120, False), "given": (SEED + 2000, 120, True)}
    parser = command_line(__doc__, tuple(groups))
    parser.add_argument("--records", type=int, default=200, metavar="N", help="records of each group")
    options = parser.parse_args()
    figures: list[Figure] = []
    together: dict[str, list[bool]] = defaultdict(list)
    for group in options.only or groups:
        held, lost = covered(group, options.records, *groups[group])
        figures += [Figure(group, "records without a fit", lost, ""), *shares(group, held)]
        for name, holds in held.items():
            together[name] += holds
    few = sorted(f"{name} ({len(holds)})" for name, holds in together.items() if len(holds) < ENOUGH)
    if few:
        say(f"together: fewer than {ENOUGH} of {', '.join(few)}")
    figures += shares(
        "together", {n: holds for n, holds in together.items() if len(holds) >= ENOUGH}, each=True
    )
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def covered(
    group: str, records: int, first: int, frames: int, given: bool
) -> tuple[dict[str, list[bool]], int]:
    """Identify records of one group, and count what holds.

    Args:
        group: Its name.
        records: How many there are.
        first: Seed of the first.
        frames: Frames of each.
        given: Whether widths and overhangs are given.

    Returns:
        What holds, by name; how many records had no fit.
    """
    held: dict[str, list[bool]] = defaultdict(list)
    mechanism, lost = monodyn.load("double"), 0
    for seed in range(records):
        swing = swung(np.random.default_rng(first + seed), frames)
        fix = {p.name: swing.known[p.name] for p in assumed_sizes(mechanism)} if given else {}
        fit = monodyn.identify(swing.poses, mechanism.with_choices(fix=fix))
        if fit.ok:
            for name, holds in (*intervals(fit, swing.known), *bands(fit, swing)):
                held[name].append(holds)
        lost += not fit.ok
        if seed % 10 == 9:
            say(f"{group}: {seed + 1} of {records}, {share(held, 'interval'):.1f} % of intervals")
    return held, lost


def shares(group: str, held: Mapping[str, list[bool]], *, each: bool = False) -> list[Figure]:
    """Return shares by name, and by kind of what has one.

    Args:
        group: What they are of.
        held: What holds, by name.
        each: Names have a target; otherwise kinds have.
    """
    figures: list[Figure] = []

    def add(name: str, value: float) -> None:
        figures.append(Figure(group, name, value, "%", LEAST, least=True))
        figures.append(Figure(group, f"{name}, at most", value, "%", MOST))

    for name, holds in sorted(held.items()):
        value, counted = 100.0 * float(np.mean(holds)), f"{name} ({len(holds)})"
        if each:
            add(counted, value)
        else:
            figures.append(Figure(group, counted, value, "%"))
    for kind in () if each else ("interval", "band"):
        add(f"{kind}s that hold", share(held, kind))
    return figures


def share(held: Mapping[str, list[bool]], kind: str) -> float:
    """Return the share of intervals or bands that hold [%]; NaN without any.

    Args:
        held: What holds, by name.
        kind: ``interval`` or ``band``, with which the names begin.
    """
    found = [holds for name, values in held.items() if name.startswith(kind) for holds in values]
    return 100.0 * float(np.mean(found)) if found else float("nan")


def intervals(fit: Fit, known: Mapping[str, float]) -> list[tuple[str, bool]]:
    """Say of each parameter and combination that is determined whether its interval contains the truth.

    Args:
        fit: The fit.
        known: True values by name.

    Returns:
        Names and whether they hold; without dry friction, which has its truth on a bound.
    """
    found = []
    for p in fit.parameters:
        if p.free and p.identifiable and p.name in known:
            found.append((f"interval of {p.name}", bool(p.lower <= known[p.name] <= p.upper)))
    for c in fit.combinations:
        if "friction" not in c.name and c.std > 0.0:
            found.append((f"interval of {c.name}", bool(c.lower <= valued(c.name, known) <= c.upper)))
    return found


def valued(expression: str, known: Mapping[str, float]) -> float:
    """Return the value of a product of powers.

    Args:
        expression: As in `Combination`: factors joined by `` * `` and `` / ``, powers by ``^``.
        known: Values by name.
    """
    value = 1.0
    for i, part in enumerate(expression.split(" / ")):
        for factor in part.split(" * "):
            name, _, power = factor.partition("^")
            above, _, below = power.strip("()").partition("/")
            exponent = float(above or 1.0) / float(below or 1.0)
            value *= known[name] ** (exponent if i == 0 else -exponent)
    return value


def bands(fit: Fit, swing: Swing) -> list[tuple[str, bool]]:
    """Say of each joint at each time ahead whether its band contains the motion.

    Args:
        fit: The fit.
        swing: The motion.

    Returns:
        Names and whether they hold.
    """
    future = monodyn.predict(fit, times=swing.poses.time[-1] + np.array(AHEAD))
    holds = np.abs(future.position - swing.later) <= BAND * future.std
    return [
        (f"band at {ahead:g} s", bool(value))
        for ahead, row in zip(AHEAD, holds, strict=True)
        for value in row
    ]


def swung(rng: np.random.Generator, frames: int) -> Swing:
    """Draw a double pendulum, let it go, and measure it.

    Args:
        rng: Where sizes, start and noise come from.
        frames: Frames that are measured.

    Returns:
        The record and its truth.
    """
    known, text = drawn_pendulum(rng)
    body = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(body)
    data.qpos[:] = rng.uniform(-1.2, 1.2, 2)
    rows = frames + round(max(AHEAD) * RATE)
    position = np.zeros((rows, 2))
    for row in range(rows):
        position[row] = data.qpos
        mujoco.mj_step(body, data, SUBSTEPS)
    measured = position[:frames] + rng.normal(scale=NOISE, size=(frames, 2))
    covariance = np.tile(NOISE**2 * np.eye(2), (frames, 1, 1))
    frame = np.arange(frames)
    poses = Poses(
        ("joint1", "joint2"), frame, frame / RATE, measured, covariance, np.ones(frames, dtype=bool)
    )
    later = position[[frames - 1 + round(ahead * RATE) for ahead in AHEAD]]
    return Swing(poses, known | inertias(body), later)


def drawn_pendulum(rng: np.random.Generator) -> tuple[dict[str, float], str]:
    """Return true values by name, and the MJCF of a double pendulum.

    Args:
        rng: Where they come from.
    """
    file = monodyn.load("double").values
    known: dict[str, float] = {}
    shape: dict[str, float] = {}
    for k, overhangs in (("1", ("tail", "tip")), ("2", ("tail",))):
        factor, thicker, damped = np.exp(rng.uniform(-HALVED, HALVED, 3))
        length = known[f"link{k}.length"] = file[f"link{k}.length"] * factor
        known[f"link{k}.thickness"] = file[f"link{k}.thickness"] * thicker
        known[f"joint{k}.damping"] = file[f"joint{k}.damping"] * damped
        seen = {
            n: file[f"link{k}.{n}"] * factor * np.exp(PROPORTION_STD * rng.normal())
            for n in ("width", *overhangs)
        }
        known |= {f"link{k}.{name}": float(value) for name, value in seen.items()}
        ends = -seen["tail"], length + seen.get("tip", 0.0)
        shape |= {
            f"length{k}": length,
            f"half{k}": 0.5 * (ends[1] - ends[0]),
            f"middle{k}": 0.5 * (ends[1] + ends[0]),
            f"thick{k}": 0.5 * known[f"link{k}.thickness"],
            f"wide{k}": 0.5 * seen["width"],
            f"damping{k}": known[f"joint{k}.damping"],
        }
    gravity = file["gravity"] * (1.0 + GRAVITY_STD * rng.normal())
    return known, MODEL.format(gravity=gravity, step=1.0 / (RATE * SUBSTEPS), density=DENSITY, **shape)


def inertias(body: mujoco.MjModel) -> dict[str, float]:
    """Return what the motion of a double pendulum shows of its masses, by name.

    Args:
        body: The pendulum.

    Returns:
        Inertias about the hinges [kg m^2] and first moments [kg m], what hangs on the end included.
    """
    mass, centre = body.body_mass[1:], body.body_ipos[1:, 0]
    # the axis of the hinge is y; MuJoCo's principal axes may come in another order
    about = []
    for k in (1, 2):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, body.body_iquat[k])
        turn = turn.reshape(3, 3)
        about.append((turn @ np.diag(body.body_inertia[k]) @ turn.T)[1, 1])
    own, length = np.array(about) + mass * centre**2, body.body_pos[2, 0]
    return {
        "link1.J": float(own[0] + mass[1] * length**2),
        "link2.J": float(own[1]),
        "link1.mx": float(mass[0] * centre[0] + mass[1] * length),
        "link2.mx": float(mass[1] * centre[1]),
        "link1.my": 0.0,
        "link2.my": 0.0,
        "gravity": -float(body.opt.gravity[2]),
    }


if __name__ == "__main__":
    raise SystemExit(main())
