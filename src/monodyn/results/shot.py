"""Two states and a time in, torques that lead from one to the other out: multiple shooting.

The time is cut into intervals, each begun at a node, a state of its own; torques are linear between knots.
That intervals end where the next begins is what the optimiser (SLSQP of SciPy) has to bring about, with the
exact derivatives of the rollouts.

Source: H. G. Bock and K. J. Plitt, A multiple shooting algorithm for direct solution of optimal control
    problems, 1984; D. Kraft, A software package for sequential quadratic programming, 1988.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.mechanism.drive import KNOTS, Drive
from monodyn.mechanism.simulate import rollout, rollout_derivatives, rollouts_derivatives
from monodyn.mechanism.tree import Directions, Tree

STEP = 0.01
"""Longest step of an integration [s]."""
MOST_ROUNDS = 250
"""Steps of the optimiser, at most."""
PRECISION = 1e-6
"""Change of the cost at which it ends."""
RATES = 5.0
"""Usual rates [1/s], which put positions and rates on one scale."""


@dataclass(frozen=True, eq=False)
class Shot:
    """What is asked for.

    Attributes:
        tree: The mechanism's tree.
        rows: Dofs with a motor.
        start: Positions, then rates at the beginning [rad or m, rad/s or m/s], (2 dof,).
        goal: Those at the end, (2 dof,).
        seconds: The time in between [s].
        limit: Largest torque of each motor [N m or N], (motor,).
        lower: Least positions on the way [rad or m], (dof,).
        upper: Largest ones, (dof,).
        intervals: How many intervals the time is cut into.
        parts: Knots of the torques an interval.
    """

    tree: Tree
    rows: tuple[int, ...]
    start: np.ndarray
    goal: np.ndarray
    seconds: float
    limit: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    intervals: int = 25
    parts: int = 2

    @property
    def knots(self) -> np.ndarray:
        """Times of the knots of the torques [s], (knot,)."""
        return np.linspace(0.0, self.seconds, self.intervals * self.parts + 1)


@dataclass(frozen=True, eq=False)
class Found:
    """Torques that lead from the start to the goal.

    Attributes:
        nodes: States at the ends of the intervals, the first is the start, (knot, 2 dof).
        torque: Torques at the knots [N m or N], (motor, knot).
        gap: Largest difference between where an interval ends and the next begins [rad or m, rad/s or m/s].
        cost: Mean square of the torques as shares of their limits.
    """

    nodes: np.ndarray
    torque: np.ndarray
    gap: float
    cost: float


def shoot(shot: Shot, *, seed: int) -> Found:
    """Look for torques of the least mean square that lead from the start to the goal.

    Args:
        shot: What is asked for.
        seed: Of the guess that the search begins with; 0 is a straight line without torques.

    Returns:
        The torques; ``gap`` says whether they do what they should.
    """
    from scipy.optimize import minimize

    layout = _Layout(shot)
    last: list[tuple[bytes, tuple[np.ndarray, np.ndarray]]] = []

    def gaps(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # the optimiser asks for values and derivatives one after the other
        if not last or last[0][0] != x.tobytes():
            last[:] = [(x.tobytes(), layout.gaps(x))]
        return last[0][1]

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        # the square of a line from a to b has the mean (a^2 + a b + b^2) / 3
        share = x[layout.inner :].reshape(layout.motors, -1)
        a, b = share[:, :-1], share[:, 1:]
        weight, by_share = 1.0 / (3.0 * a.size), np.zeros_like(share)
        by_share[:, :-1] += weight * (2.0 * a + b)
        by_share[:, 1:] += weight * (2.0 * b + a)
        slope = np.concatenate((np.zeros(layout.inner), by_share.ravel()))
        return weight * float(np.sum(a * a + a * b + b * b)), slope

    ends = {"type": "eq", "fun": lambda x: gaps(x)[0], "jac": lambda x: gaps(x)[1]}
    best = minimize(
        cost, layout.guess(seed), jac=True, method="SLSQP", bounds=layout.bounds, constraints=ends,
        options={"maxiter": MOST_ROUNDS, "ftol": PRECISION},
    ).x  # fmt: skip
    nodes, torque = layout.split(best)
    gap = float(np.max(np.abs(gaps(best)[0] * np.tile(layout.unit, shot.intervals))))
    return Found(nodes, torque, gap if np.isfinite(gap) else np.inf, cost(best)[0])


class _Layout:
    """Where nodes and torques stand among the unknowns, all of which are of the size of one."""

    def __init__(self, shot: Shot) -> None:
        self.shot = shot
        dofs, self.motors, self.knots = len(shot.start) // 2, len(shot.rows), len(shot.knots)
        self.unit = np.repeat([1.0, RATES], dofs)
        self.inner = (shot.intervals - 1) * len(shot.start)
        self.substeps = max(1, int(np.ceil(shot.seconds / (self.knots - 1) / STEP)))
        entry = np.full((dofs, self.knots), -1, dtype=np.int64)
        entry[list(shot.rows)] = np.arange(self.motors * self.knots).reshape(self.motors, -1)
        none = np.zeros(self.motors * self.knots)
        links = np.zeros((*shot.tree.links.shape, len(none)))
        self.directions = Directions(links, np.zeros((2, len(none))), entry, none, none, none)
        # each interval is a run: where two meet, the knot is the end of one and the start of the next
        self.rows = np.arange(shot.intervals)[:, None] * shot.parts + np.arange(shot.parts + 1)

    @property
    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Bounds of the unknowns."""
        free = [(None, None)] * (len(self.unit) // 2)
        within = list(zip(self.shot.lower.tolist(), self.shot.upper.tolist(), strict=True))
        node = [(a if np.isfinite(a) else None, b if np.isfinite(b) else None) for a, b in within] + free
        return node * (self.shot.intervals - 1) + [(-1.0, 1.0)] * (self.motors * self.knots)

    def guess(self, seed: int) -> np.ndarray:
        """Return where the search begins, within the bounds.

        Args:
            seed: Of what is added to a straight line; 0 adds nothing.
        """
        shot, rng = self.shot, np.random.default_rng(seed)
        share = np.linspace(0.0, 1.0, shot.intervals + 1)[1:-1, None]
        nodes = shot.start + (shot.goal - shot.start) * share
        torque = np.zeros((self.motors, self.knots))
        if seed:
            nodes = nodes + 0.3 * rng.normal(size=nodes.shape)
            torque = np.clip(0.3 * rng.normal(size=torque.shape), -1.0, 1.0)
        dofs = len(shot.lower)
        nodes[:, :dofs] = np.clip(nodes[:, :dofs], shot.lower, shot.upper)
        return np.concatenate(((nodes / self.unit).ravel(), torque.ravel()))

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes with start and goal, (knot, 2 dof), and torques, (motor, knot).

        Args:
            x: The unknowns, (unknown,).
        """
        nodes = x[: self.inner].reshape(-1, len(self.unit)) * self.unit
        torque = x[self.inner :].reshape(self.motors, self.knots) * self.shot.limit[:, None]
        return np.vstack((self.shot.start, nodes, self.shot.goal)), torque

    def gaps(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much intervals miss the next one, over the units, and the derivatives.

        Args:
            x: The unknowns, (unknown,).

        Returns:
            Gaps (row,) and their derivatives (row, unknown).
        """
        shot, (nodes, torque) = self.shot, self.split(x)
        wide, runs = len(self.unit), shot.intervals
        table = np.zeros((len(shot.lower), self.knots))
        table[list(shot.rows)] = torque
        q, v, dq, dv = rollouts_derivatives(
            shot.tree, self.directions, shot.knots[self.rows.ravel()],
            np.arange(runs + 1) * (shot.parts + 1), nodes[:-1], substeps=self.substeps,
            drive=Drive(KNOTS, shot.knots, table),
        )  # fmt: skip
        last = slice(shot.parts, None, shot.parts + 1)
        ends, by = np.hstack((q[last], v[last])), np.concatenate((dq[last], dv[last]), axis=1)
        by_torque, by_node = np.split(by / self.unit[:, None], [self.motors * self.knots], axis=2)
        slopes = np.zeros((runs, wide, len(x)))
        slopes[:, :, self.inner :] = by_torque * np.repeat(shot.limit, self.knots)
        # start and goal are no unknowns
        for k in range(runs - 1):
            node = slice(k * wide, (k + 1) * wide)
            slopes[k + 1, :, node] = by_node[k + 1] * self.unit
            slopes[k, :, node] = -np.eye(wide)
        return ((ends - nodes[1:]) / self.unit).ravel(), slopes.reshape(-1, len(x))


def along(shot: Shot, found: Found, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow what was found, each interval from its node, so that no error grows over the whole.

    Args:
        shot: What was asked for.
        found: What was found.
        samples: Measurements an interval.

    Returns:
        States at every measurement, the goal at the end, (frame, 2 dof); torques that are held from one to
        the next, those of the middle, (frame - 1, motor); and the derivatives of each next state by the one
        before and by the torques, (frame - 1, 2 dof, 2 dof + motor).
    """
    layout, dofs, motors = _Layout(shot), len(shot.lower), len(shot.rows)
    states, torques, slopes = [], [], []
    entry = np.full((dofs, 2), -1, dtype=np.int64)
    entry[list(shot.rows)] = np.arange(2 * motors).reshape(motors, 2)
    none = np.zeros(2 * motors)
    links = np.zeros((*shot.tree.links.shape, 2 * motors))
    directions = Directions(links, np.zeros((2, 2 * motors)), entry, none, none, none)
    for k in range(shot.intervals):
        ends = shot.knots[k * shot.parts], shot.knots[(k + 1) * shot.parts]
        times = np.linspace(*ends, samples + 1)
        table = np.zeros((dofs, len(shot.knots)))
        table[list(shot.rows)] = found.torque
        q, v = rollout(
            shot.tree, times, *np.split(found.nodes[k], 2), substeps=layout.substeps,
            drive=Drive(KNOTS, shot.knots, table),
        )  # fmt: skip
        middle = 0.5 * (times[1:] + times[:-1])
        held = np.stack([np.interp(middle, shot.knots, row) for row in found.torque], axis=1)
        for i in range(samples):
            step, pushed = times[i : i + 2], np.zeros((dofs, 2))
            pushed[list(shot.rows)] = held[i][:, None]
            _, _, dq, dv = rollout_derivatives(
                shot.tree, directions, step, q[i], v[i], substeps=1, drive=Drive(KNOTS, step, pushed)
            )
            by = np.concatenate((dq[1], dv[1]))
            # a torque that is held has both of its knots
            by_torque = by[:, : 2 * motors].reshape(2 * dofs, motors, 2).sum(axis=2)
            slopes.append(np.hstack((by[:, 2 * motors :], by_torque)))
        states.append(np.hstack((q, v))[:-1])
        torques.append(held)
    return np.vstack((*states, shot.goal)), np.vstack(torques), np.array(slopes)
