"""Print whether what one is told to film next is worth it, on pendulums moved by MuJoCo.

Run: ``python benchmarks/next_motion.py [--only GROUP ...] [--records N] [--json FILE] [--gate]``.
A drawn pendulum (``single``, ``double``) swings a little from near where it hangs, for a second or two, and
is identified; in ``lively`` a double one swings from anywhere, so that one film tells much already. Then the
true one is let go as is advised, but for what a hand is off, filmed as long as is advised, and identified
from both records. The named interval is compared before and after, and with what a motion of the same length
from anywhere would have left of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

import monodyn
from figures import Figure, command_line, finish, say, table
from intervals import NOISE, RATE, SUBSTEPS, drawn_pendulum, inertias, valued
from monodyn.estimation.fit import Estimate, Fit
from monodyn.estimation.parts import Combination
from monodyn.mechanism import Mechanism
from monodyn.results.experiment import HALVED, Advised, next_motion
from monodyn.types import Poses

FRAMES = (30, 60)
"""Frames of the first record: at least, and below."""
NEAR = float(np.radians(20.0))
"""It is let go within that of where it hangs [rad]."""
HAND = float(np.radians(4.0))
"""Standard deviation of what a hand is off when it lets go as advised [rad]."""
ANYWHERE = float(np.radians(135.0))
"""A motion from anywhere is let go within that of where it hangs [rad]."""
REACHED, HOLDING = 80.0, 92.0
"""Share of cases in which the interval is to be halved, and to contain the truth [%]."""
SEED = 9000
DRAWN = {"single": (1, NEAR), "double": (2, NEAR), "lively": (2, ANYWHERE)}
"""Groups: how many links, and how far from hanging it is let go for the first record [rad]."""


@dataclass(frozen=True)
class Followed:
    """What came of an advice.

    Attributes:
        promised: Whether it said that it would halve the interval.
        computed: The share of the interval that it said would be left.
        left: The share that is left; infinite where nothing could be identified, or the quantity is gone.
        anywhere: The share that a motion from anywhere leaves.
        holds: Whether the interval contains the truth; None without one.
    """

    promised: bool
    computed: float
    left: float
    anywhere: float
    holds: bool | None


def main() -> int:
    """Run what was asked for and print the table.

    Returns:
        The exit code: 1 when a target is missed under ``--gate``.
    """
    parser = command_line(__doc__, tuple(DRAWN))
    parser.add_argument("--records", type=int, default=50, metavar="N", help="pendulums of each group")
    options = parser.parse_args()
    figures = advised_motions(options.records, options.only or tuple(DRAWN))
    print(table(figures))
    return finish(figures, to=options.json, gate=options.gate)


def advised_motions(records: int, groups: Sequence[str] = ("single", "double", "lively")) -> list[Figure]:
    """Follow the advice on drawn pendulums.

    Args:
        records: Pendulums of each group.
        groups: Which groups.

    Returns:
        Figures.
    """
    figures, together = [], []
    for group in groups:
        found: list[Followed] = []
        lost, still = 0, 0
        for seed in range(records):
            one = followed(group, np.random.default_rng(SEED + seed))
            lost += one is None
            still += isinstance(one, Advised)
            found += [one] if isinstance(one, Followed) else []
            if seed % 10 == 9:
                say(f"{group}: {seed + 1} of {records}")
        figures += [
            Figure(group, "records without a fit", lost, ""),
            Figure(group, "records of which no motion tells more", still, ""),
            *_figures(group, found),
        ]
        together += found
    return figures + (_figures("together", together, gated=True) if len(groups) > 1 else [])


def _figures(case: str, found: list[Followed], *, gated: bool = False) -> list[Figure]:
    """Return the figures of some cases."""
    left, anywhere = (np.array([getattr(one, name) for one in found]) for name in ("left", "anywhere"))
    computed = np.array([one.computed for one in found])
    holds = [one.holds for one in found if one.holds is not None]
    reached, holding = (REACHED, HOLDING) if gated else (None, None)
    return [
        Figure(case, "motions that were advised", len(found), ""),
        Figure(case, "of them said to halve the interval", 100.0 * _mean([o.promised for o in found]), "%"),
        Figure(case, "halved", 100.0 * _mean(left <= HALVED), "%", reached, least=True),
        Figure(case, "left, median", float(np.median(left)), ""),
        Figure(case, "left over what was computed, median", float(np.median(left / computed)), ""),
        Figure(case, "contain the truth", 100.0 * _mean(holds), "%", holding, least=True),
        Figure(case, "halved by a motion from anywhere", 100.0 * _mean(anywhere <= HALVED), "%"),
        Figure(case, "left by it, median", float(np.median(anywhere)), ""),
    ]


def _mean(facts: object) -> float:
    return float(np.mean(np.asarray(facts, dtype=float)))


def followed(group: str, rng: np.random.Generator) -> Followed | Advised | None:
    """Draw a pendulum, identify it, follow the advice, and identify it again.

    Args:
        group: Its name.
        rng: Where everything comes from.

    Returns:
        What came of it; the advice where it is no motion; None where nothing was identified at first.
    """
    links, near = DRAWN[group]
    known, body = drawn(rng, links=links)
    mechanism, hanging = monodyn.load("single" if links == 1 else "double"), np.zeros(body.nq)
    hanging[0] = -np.pi / 2.0
    first = moved(body, hanging + rng.uniform(-near, near, body.nq), int(rng.integers(*FRAMES)), rng)
    fit = monodyn.identify(first, mechanism)
    advised = next_motion(fit) if fit.ok else None
    if advised is None or advised.release is None:
        return advised
    frames = round(advised.seconds * RATE) + 1
    before = _interval(fit, advised.name)
    assert before is not None
    let_go = advised.release.position + rng.normal(scale=HAND, size=body.nq)
    after = _after(first, moved(body, let_go, frames, rng), mechanism, advised.name)
    other = hanging + rng.uniform(-ANYWHERE, ANYWHERE, body.nq)
    anywhere = _after(first, moved(body, other, frames, rng), mechanism, advised.name)
    wide = before.upper - before.lower

    def share(now: Estimate | Combination | None) -> float:
        return np.inf if now is None else (now.upper - now.lower) / wide

    holds = None if after is None else bool(after.lower <= valued(advised.name, known) <= after.upper)
    return Followed(advised.halves, advised.share, share(after), share(anywhere), holds)


def _after(first: Poses, second: Poses, mechanism: Mechanism, name: str) -> Estimate | Combination | None:
    """Identify from both records, and return what is then known of a quantity."""
    both = monodyn.identify([first, second], mechanism)
    return _interval(both, name) if both.ok else None


def _interval(fit: Fit, name: str) -> Estimate | Combination | None:
    """Return the parameter or the combination of a name, where it has an interval."""
    for one in (*fit.parameters, *fit.combinations):
        if one.name == name and 0.0 < one.std < np.inf:
            return one
    return None


def moved(body: mujoco.MjModel, start: np.ndarray, frames: int, rng: np.random.Generator) -> Poses:
    """Let a pendulum go from rest, and measure it.

    Args:
        body: The pendulum.
        start: Joint positions [rad], (dof,).
        frames: Frames that are measured.
        rng: Where the noise comes from.

    Returns:
        The record.
    """
    data = mujoco.MjData(body)
    data.qpos[:] = start
    position = np.zeros((frames, body.nq))
    for row in range(frames):
        position[row] = data.qpos
        mujoco.mj_step(body, data, SUBSTEPS)
    position += rng.normal(scale=NOISE, size=position.shape)
    frame, names = np.arange(frames), tuple(body.joint(k).name for k in range(body.njnt))
    covariance = np.tile(NOISE**2 * np.eye(body.nq), (frames, 1, 1))
    return Poses(names, frame, frame / RATE, position, covariance, np.ones(frames, dtype=bool))


def drawn(rng: np.random.Generator, *, links: int) -> tuple[dict[str, float], mujoco.MjModel]:
    """Draw a pendulum of one link or two.

    Args:
        rng: Where it comes from.
        links: How many links.

    Returns:
        True values of its parameters and of its regrouped inertias by name [SI], and the pendulum.
    """
    known, text = drawn_pendulum(rng)
    if links == 2:
        body = mujoco.MjModel.from_xml_string(text)
        return known | inertias(body), body
    alone = re.sub(r'<body name="link2".*?</body>', "", text, flags=re.DOTALL)
    body = mujoco.MjModel.from_xml_string(alone)
    # the length of the last link reaches to its end
    known = {name: value for name, value in known.items() if name.endswith(("1.damping", "1.thickness"))}
    centre, half = float(body.geom_pos[0, 0]), float(body.geom_size[0, 0])
    mass, (long, _, wide) = float(body.body_mass[1]), (2.0 * body.geom_size[0]).tolist()
    about = mass * ((long**2 + wide**2) / 12.0 + centre**2)
    known |= {"link1.length": centre + half, "link1.tail": half - centre, "link1.width": wide}
    return known | {"link1.J": about, "link1.mx": mass * centre, "gravity": -float(body.opt.gravity[2])}, body


if __name__ == "__main__":
    raise SystemExit(main())
