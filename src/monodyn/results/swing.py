"""An identified mechanism and its regulator in, a way to swing it up into the equilibrium out.

Torques are planned (``shot``), tracked by a linear-quadratic regulator that varies along the way, and handed
over to the regulator at its end. Of several ways the one is taken that most of the mechanisms go which the
data allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from monodyn.arrays import Frozen, freeze
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import energy
from monodyn.mechanism.tree import SLIDE
from monodyn.names import known
from monodyn.results.closed import closed_loop
from monodyn.results.draws import Response, drawn
from monodyn.results.linear import State, by_joint, motors, state_matrices, without_dry_friction
from monodyn.results.regulator import FALLEN, Regulator, off
from monodyn.results.shot import Shot, along, shoot
from monodyn.types import Progress

PLANNED = 0.8
"""Share of the largest torque that is planned with; the rest is for what goes astray."""
LASTING, LONGEST = (2.0, 3.0, 1.5, 4.0), 100.0
"""Times that are tried, in periods of the slowest swing of the mechanism hanging."""
GUESSES = 3
"""Guesses that each time is begun with."""
WAYS = 3
"""Ways that are found at most, of which the best is taken."""
CLOSED = 1e-3
"""Largest gap of a way that counts as found [rad or m, rad/s or m/s]."""
KNOTS = Shot.intervals * Shot.parts
"""Pieces of the torques of a way."""
HALF = np.pi + 1e-6
"""Half a turn, and what rounding may add to it [rad]."""
SETTLING = 3.0
"""Time after the swing in which a mechanism has to come to rest [s]."""
SLOWEST = 0.5
"""Least frequency that counts as a swing [rad/s]."""


@dataclass(frozen=True, eq=False)
class SwingUp(Frozen):
    """A way from a start into an equilibrium, with the gains that keep to it.

    Attributes:
        regulator: Takes over at its end, and has the equilibrium there: on the turn on which the way ends.
        time: Times of measurements [s], (frame,).
        states: Joint positions, then rates [rad or m, rad/s or m/s], (frame, 2 dof).
        torque: Torques that are held from one measurement to the next [N m or N], (frame - 1, motor).
        gain: Torque by positions, then rates [SI], (frame - 1, motor, 2 dof).
        limit: Largest torque of each motor [N m or N], (motor,).
        draws: Mechanisms drawn from the covariance of the parameters on which it was tried in MuJoCo.
        reached: How many of them it swings up and balances.
    """

    regulator: Regulator
    time: np.ndarray
    states: np.ndarray
    torque: np.ndarray
    gain: np.ndarray
    limit: np.ndarray
    draws: int = 0
    reached: int = 0

    def __post_init__(self) -> None:
        frames = len(self.time)
        freeze(self, (frames,), "time")
        freeze(self, (frames, None), "states")
        freeze(self, (frames - 1, None), "torque")
        freeze(self, (frames - 1, None, None), "gain")

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.regulator.joints

    @property
    def actuated(self) -> tuple[str, ...]:
        """Joints with a motor."""
        return self.regulator.actuated

    @property
    def position(self) -> np.ndarray:
        """The equilibrium, on the turn on which the way ends [rad or m], (dof,)."""
        return self.regulator.position

    @property
    def turns(self) -> np.ndarray:
        """True for a hinge whose whole turns do not count, bool (dof,)."""
        return self.regulator.turns

    @property
    def rate(self) -> float:
        """Measurements a second [Hz]."""
        return self.regulator.rate

    @property
    def seconds(self) -> float:
        """How long it takes [s]."""
        return float(self.time[-1])

    @property
    def start(self) -> np.ndarray:
        """Joint positions at the beginning [rad or m], (dof,)."""
        return self.states[0, : len(self.joints)]

    def torque_at(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques of the motors [N m or N], (motor,), within their limits.

        Args:
            time: Time since the start [s].
            q: Joint positions [rad or m], (dof,).
            v: Joint rates [rad/s or m/s], (dof,).
        """
        row = round(time * self.rate)
        if row >= len(self.torque):
            torque = self.regulator.torque_at(time, q, v)
        else:
            dofs = len(q)
            away = np.concatenate((off(q, self.states[row, :dofs], self.turns), v - self.states[row, dofs:]))
            torque = self.torque[row] - self.gain[row] @ away
        return np.clip(torque, -self.limit, self.limit)


def swing_up(
    fit: Fit,
    regulator: Regulator,
    *,
    start: State | None = None,
    limit: Mapping[str, float] | None = None,
    within: Mapping[str, tuple[float, float]] | None = None,
    seconds: float | None = None,
    draws: int = 10,
    seed: int = 0,
    progress: Progress | None = None,
) -> SwingUp:
    """Plan a way from rest into the equilibrium of a regulator, and the gains that keep to it.

    Args:
        fit: The identified mechanism.
        regulator: Its regulator, from ``lqr``.
        start: Joint positions at rest [rad or m]; None hangs down.
        limit: Largest torque by joint [N m or N], in the units of ``regulator.linear.notes``; without it the
            usual one: the most that weight ever asks of a hinge, the weight that a slide carries.
        within: Least and largest position by joint on the way [rad or m]; else those of the file.
        seconds: How long it takes; None tries multiples of the slowest period of the mechanism hanging.
        draws: Mechanisms drawn from the covariance of the parameters on which each way is tried.
        seed: Of guesses and draws.
        progress: Called with the ways looked for.

    Returns:
        The way.

    Raises:
        SettingsError: No way was found, or a limit is of a joint without a motor or not above 0; from deeper
            down: a joint is not there.

    Example:
        ``monodyn.swing_up(fit, monodyn.lqr(fit, {"joint1": np.pi / 2}, actuated=["joint1"])).torque``
    """
    mechanism = fit.mechanism
    rows = motors(mechanism, regulator.actuated)
    begin = hanging(mechanism, regulator.position) if start is None else by_joint(mechanism, "start", start)
    most = _limits(regulator, limit)
    lower, upper = _ranges(mechanism, within)
    if seconds is not None and not 0.0 < seconds <= LONGEST:
        raise SettingsError(
            f"swing_up: expected a time above 0 and up to {LONGEST:g} s, got {seconds:g}; change it."
        )
    lasting = _lasting(mechanism, begin) if seconds is None else (seconds,)
    others = drawn(fit, draws, seed=seed, response=Response(regulator.position, rows[0]))
    best: SwingUp | None = None
    found = 0
    for tries, period in enumerate(lasting):
        for guess in range(GUESSES):
            if progress is not None:
                progress("swing", tries * GUESSES + guess, len(lasting) * GUESSES)
            way = _way(mechanism, regulator, begin, period, most, (lower, upper), seed + guess)
            if way is None:
                continue
            tried = [_reaches(one, way) for one in (mechanism, *others)]
            way = replace(way, draws=len(others), reached=sum(tried[1:]))
            found += 1
            if tried[0] and (best is None or way.reached > best.reached):
                best = way
            if best is not None and (best.reached == len(others) or found >= WAYS):
                return best
    if best is None:
        raise _no_way(mechanism, regulator, lasting, most, (lower, upper))
    return best


def _no_way(
    mechanism: Mechanism,
    regulator: Regulator,
    lasting: Sequence[float],
    limit: np.ndarray,
    ranges: tuple[np.ndarray, np.ndarray],
) -> SettingsError:
    """Return the complaint that no way up was found, with what it was looked for within."""
    times = ", ".join(
        dict.fromkeys(f"{_each(x, regulator.rate) * KNOTS / regulator.rate:.2g}" for x in lasting)
    )
    said = ", ".join(f"{name}={x:.3g}" for name, x in zip(regulator.actuated, limit, strict=True))
    ways = ", ".join(
        f"{joint.name}={low:g}:{high:g}"
        for joint, low, high in zip(mechanism.joints, *ranges, strict=True)
        if np.isfinite(low) or np.isfinite(high)
    )
    room = f" and the positions {ways}" if ways else ""
    often = "measure more often (--rate) or " if _seldom(regulator, lasting) else ""
    return SettingsError(
        f"swing_up: expected a way up within the torques {said}{room}, but found none in {times} s at "
        f"{regulator.rate:g} measurements a second; {often}give larger limits, more room, or another time."
    )


def hanging(mechanism: Mechanism, near: np.ndarray) -> np.ndarray:
    """Return the positions in which hinges hang down at rest [rad or m], (dof,).

    Args:
        mechanism: The mechanism.
        near: Positions of slides, which stay [rad or m], (dof,).
    """
    from scipy.optimize import minimize

    tree = mechanism.tree
    hinges, position = np.flatnonzero(tree.kind != SLIDE), near.copy()

    def height(angles: np.ndarray) -> float:
        position[hinges] = angles
        return float(energy(tree, position[None], np.zeros((1, len(near))))[0])

    scale = abs(height(near[hinges])) or 1.0
    rng = np.random.default_rng(0)
    starts = [np.zeros(len(hinges)), *rng.uniform(-np.pi, np.pi, (4, len(hinges)))]
    found = [
        minimize(lambda x: height(x) / scale, one, method="BFGS", options={"gtol": 1e-9}) for one in starts
    ]
    lowest = min(result.fun for result in found)
    # of equal ones the first, which is the one nearest to zero
    angles = next(result.x for result in found if result.fun <= lowest + 1e-9)
    position[hinges] = np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi
    return position


def _limits(regulator: Regulator, limit: Mapping[str, float] | None) -> np.ndarray:
    """Return the largest torque of each motor, (motor,)."""
    limit = limit or {}
    for name, value in limit.items():
        if name not in regulator.actuated:
            raise SettingsError(
                f"limit: joint '{name}' has no motor; {known('motors', regulator.actuated, name)}"
            )
        if not value > 0.0:
            raise SettingsError(f"limit: expected a torque above 0, got {name}={value:g}; give a larger one.")
    usual = zip(regulator.actuated, regulator.effort, strict=True)
    return np.array([limit.get(name, float(effort)) for name, effort in usual])


def _ranges(
    mechanism: Mechanism, within: Mapping[str, tuple[float, float]] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return least and largest positions, each (dof,)."""
    lower = np.array([joint.lower for joint in mechanism.joints])
    upper = np.array([joint.upper for joint in mechanism.joints])
    by_joint(mechanism, "within", dict.fromkeys(within or {}, 0.0))
    for row, joint in enumerate(mechanism.joints):
        if within and joint.name in within:
            lower[row], upper[row] = within[joint.name]
            if not lower[row] < upper[row]:
                raise SettingsError(
                    f"within: expected the least position of {joint.name} first, got {lower[row]:g} and "
                    f"{upper[row]:g}; exchange them."
                )
    return lower, upper


def _lasting(mechanism: Mechanism, begin: np.ndarray) -> tuple[float, ...]:
    """Return the times that are tried [s]: multiples of the slowest period of small swings."""
    still = np.zeros(len(begin))
    hung = hanging(mechanism, begin)
    a, _, _ = state_matrices(without_dry_friction(mechanism.tree), hung, still, still, [0])
    turning = np.abs(np.linalg.eigvals(a).imag)
    slowest = float(np.min(turning[turning > SLOWEST], initial=np.inf))
    period = 2.0 * np.pi / slowest if np.isfinite(slowest) else 1.0
    return tuple(multiple * period for multiple in LASTING)


def _each(seconds: float, rate: float) -> int:
    """Return how many measurements there are from knot to knot of a way of about a duration."""
    return max(1, round(seconds * rate / KNOTS))


def _seldom(regulator: Regulator, lasting: Sequence[float]) -> bool:
    """Return whether there are so few measurements that a way may be missing because of it: it falls too far
    in between, or knots, which are at measurements, cannot be as close as they should."""
    return regulator.falls >= FALLEN or min(lasting) * regulator.rate < KNOTS


def _way(
    mechanism: Mechanism,
    regulator: Regulator,
    begin: np.ndarray,
    seconds: float,
    limit: np.ndarray,
    ranges: tuple[np.ndarray, np.ndarray],
    seed: int,
) -> SwingUp | None:
    """Return a way of about a duration; None where none was found."""
    still, goal = np.zeros(len(begin)), regulator.position
    # of a hinge that may turn all around the shorter way; of two equal ones that towards the turn asked for
    away = goal - begin
    whole = 2.0 * np.pi * np.ceil((np.abs(away) - HALF) / (2.0 * np.pi))
    goal = np.where(regulator.turns, goal - np.sign(away) * whole, goal)
    rows, tree = motors(mechanism, regulator.actuated), without_dry_friction(mechanism.tree)
    each = _each(seconds, regulator.rate)
    shot = Shot(
        tree, tuple(rows), np.concatenate((begin, still)), np.concatenate((goal, still)),
        each * KNOTS / regulator.rate, PLANNED * limit, *ranges,
    )  # fmt: skip
    found = shoot(shot, seed=seed)
    if not found.gap < CLOSED:
        return None
    states, torque, slopes = along(shot, found, each * shot.parts)
    gain = _tracking(regulator, slopes)
    # the same equilibrium counted in the turns of the way, so that their difference is none at its end
    regulator = replace(regulator, linear=replace(regulator.linear, position=goal))
    return SwingUp(regulator, np.arange(len(states)) / regulator.rate, states, torque, gain, limit)


def _tracking(regulator: Regulator, slopes: np.ndarray) -> np.ndarray:
    """Return the gains along a way, (frame - 1, motor, 2 dof), by the Riccati recursion from its end."""
    cost, wide = regulator.cost, len(regulator.cost)
    q_weight, r_weight = regulator.state_weight / regulator.rate, regulator.torque_weight / regulator.rate
    gains = np.empty((len(slopes), len(r_weight), wide))
    for i in range(len(slopes) - 1, -1, -1):
        a, b = slopes[i, :, :wide], slopes[i, :, wide:]
        gains[i] = np.linalg.solve(r_weight + b.T @ cost @ b, b.T @ cost @ a)
        cost = q_weight + a.T @ cost @ (a - b @ gains[i])
        cost = 0.5 * (cost + cost.T)
    return gains


def _reaches(mechanism: Mechanism, way: SwingUp) -> bool:
    """Return whether a mechanism is swung up and balanced, in MuJoCo."""
    return closed_loop(mechanism, way, way.start, seconds=way.seconds + SETTLING).balanced
