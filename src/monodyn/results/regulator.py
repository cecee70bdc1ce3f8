"""An identified mechanism and a position in, gains that hold it there out, tried on what it may be in truth.

The linear-quadratic regulator of the identified mechanism is designed once; whether it also holds the others
that the data allow is asked of draws of the covariance, and of another scale of the masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monodyn.arrays import Frozen, frozen
from monodyn.choices import MOST_DRAWN, check_whole
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.extras import extra
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import SLIDE
from monodyn.names import quoted
from monodyn.results.draws import Response, drawn
from monodyn.results.linear import (
    Linearization,
    State,
    by_joint,
    inertia,
    linearize,
    motors,
    needed,
    state_matrices,
    without_dry_friction,
)
from monodyn.typed import check_types

NEAR = 0.1
"""An equilibrium is looked for so near to the position that was asked for [rad or m]."""
HELD = 1e-9
"""Largest torque of a joint without a motor in an equilibrium, as a share of the usual ones."""
POSES = 200
"""Poses among which the largest torque that weight asks of a motor is looked for."""
RATE, FASTEST = 200.0, 1e5
"""How often a controller measures, and sets its torques, which stay in between [Hz]."""
STEERED = 1e-9
"""A pole, in discrete time, nearer to the circle of one than that is none that a motor moves."""
FALLEN = 2.0
"""How many times as far from the equilibrium a mechanism may be at the next measurement without torque."""
UNWEIGHTED = 10.0
"""Acceleration that stands for gravity where there is no weight to hold [rad/s^2 or m/s^2]."""
SCALES = np.geomspace(1e-2, 1e2, 401)
"""Factors on all masses that are tried."""


class Allowed(NamedTuple):
    """What weighs as much as one another in the cost (Bryson's rule).

    Attributes:
        angle: Of a hinge, from where it is to be [rad].
        length: Of a slide [m].
        rate: Rates, as a multiple of the former [1/s].
        effort: Torque of each motor as a share of its usual one: the most that weight ever asks of a hinge,
            what a slide carries.
    """

    angle: float = 0.1
    length: float = 0.1
    rate: float = 30.0
    effort: float = 0.5


class Stability(NamedTuple):
    """Whether gains hold what the mechanism may be in truth.

    Attributes:
        draws: How many mechanisms were drawn from the covariance of the parameters; 0 where it has none.
        stable: How many of them are stable.
        worst: Largest real part of a pole of any of them [1/s]; that of the identified one without draws.
        lightest: Least factor on all masses with which the identified one stays stable.
        heaviest: Largest one.
    """

    draws: int
    stable: int
    worst: float
    lightest: float
    heaviest: float


@dataclass(frozen=True, eq=False)
class Regulator(Frozen):
    """Gains that hold a mechanism in an equilibrium: torque = held torque - gain (q - position, v).

    The torques stay from one measurement to the next.

    Attributes:
        joints: Names of the joints.
        linear: The linear system that it was designed for.
        gain: Torque by positions, then rates [SI], (motor, 2 dof).
        cost: Cost still to come by positions, then rates, of the regulated system, (2 dof, 2 dof).
        state_weight: Weight of positions, then rates, (2 dof, 2 dof).
        torque_weight: Weight of the torques, (motor, motor).
        effort: Usual torque of each motor [N m or N], (motor,).
        turns: True for a hinge that may turn all around, for which whole turns do not count, bool (dof,).
        rate: Measurements a second [Hz].
        poles: Poles of the regulated system, as those of one in continuous time [1/s], complex (2 dof,).
        stability: Whether it holds what the mechanism may be in truth.
    """

    joints: tuple[str, ...]
    linear: Linearization
    gain: np.ndarray
    cost: np.ndarray
    state_weight: np.ndarray
    torque_weight: np.ndarray
    effort: np.ndarray
    turns: np.ndarray
    rate: float
    poles: np.ndarray
    stability: Stability

    def __post_init__(self) -> None:
        for name in ("gain", "cost", "state_weight", "torque_weight"):
            object.__setattr__(
                self,
                name,
                frozen(f"Regulator.{name}", getattr(self, name), (None, None), error=SettingsError),
            )

    @property
    def actuated(self) -> tuple[str, ...]:
        """Joints with a motor."""
        return self.linear.actuated

    @property
    def position(self) -> np.ndarray:
        """The equilibrium [rad or m], (dof,)."""
        return self.linear.position

    @property
    def falls(self) -> float:
        """How many times as far from the equilibrium it is one measurement later without torque."""
        fastest = float(np.max(np.real(np.linalg.eigvals(self.linear.system.A))))
        return float(np.exp(min(max(fastest, 0.0) / self.rate, 99.0)))

    def torque_at(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the torques of the motors [N m or N], (motor,).

        Args:
            time: Time since the controller began [s]; it does not matter here.
            q: Joint positions [rad or m], (dof,).
            v: Joint rates [rad/s or m/s], (dof,).
        """
        return self.linear.torque - self.gain @ np.concatenate((off(q, self.position, self.turns), v))


def lqr(
    fit: Fit,
    at: State,
    *,
    actuated: Sequence[str],
    allowed: Allowed | None = None,
    rate: float = RATE,
    draws: int = 50,
    seed: int = 0,
) -> Regulator:
    """Design the linear-quadratic regulator of an identified mechanism in an equilibrium.

    The gains minimise the integral of sum (x_i / allowed_i)^2 + sum (u_j / allowed_j)^2 for torques that stay
    from one measurement to the next. Where masses are known up to a factor only, torques are in its units, as
    ``linear.notes`` say.

    Args:
        fit: The identified mechanism.
        at: Joint positions of the equilibrium [rad or m]; the one next to them is taken, within ``NEAR``.
        actuated: Joints with a motor.
        allowed: What weighs as much as one another; None takes the defaults.
        rate: Measurements, and torques, a second [Hz].
        draws: Mechanisms that are drawn from the covariance of the parameters, for all of which the gains
            should do; at most 100.
        seed: Of the draws.

    Returns:
        The regulator.

    Raises:
        SettingsError: There is no equilibrium there, or the motors cannot hold it; from deeper down: nothing
            was identified, a joint is not there, or the package ``control`` is missing.

    Example:
        ``monodyn.lqr(fit, {"joint1": np.pi / 2}, actuated=["slide"]).gain``
    """
    fit.start_of(0, "lqr")
    mechanism, allowed = fit.mechanism, allowed or Allowed()
    weights = allowed._asdict()
    check_types("lqr", weights, Allowed)
    for name, value in (*weights.items(), ("rate", rate)):
        if not 1.0 / FASTEST <= value <= FASTEST:
            raise SettingsError(
                f"lqr: expected a number from {1.0 / FASTEST:g} to {FASTEST:g} for {name}, got {value:g}; "
                "change it."
            )
    check_whole("draws", draws, MOST_DRAWN)
    rows = motors(mechanism, actuated)
    position = equilibrium(mechanism, by_joint(mechanism, "at", at), rows)
    linear = linearize(fit, position, actuated=actuated)
    a, b = linear.system.A, linear.system.B
    usual = efforts(mechanism, rows)
    within = np.where(mechanism.tree.kind == SLIDE, allowed.length, allowed.angle)
    q_weight = np.diag(np.concatenate((within, allowed.rate * within)) ** -2.0)
    r_weight = np.diag((allowed.effort * usual) ** -2.0)
    gain, cost = _solved(*sampled(a, b, rate), q_weight / rate, r_weight / rate, actuated)
    poles = _poles(a, b, gain, rate)
    joints = tuple(joint.name for joint in mechanism.joints)
    stability = _stability(fit, linear, rows, gain, rate, draws, seed)
    return Regulator(
        joints, linear, gain, cost, q_weight, r_weight, usual, turning(mechanism), rate, poles, stability
    )


def off(q: np.ndarray, wanted: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return how far positions are from where they are to be, without whole turns [rad or m], (dof,).

    Args:
        q: Joint positions [rad or m], (dof,).
        wanted: Where they are to be [rad or m], (dof,).
        turns: True for hinges that may turn all around, bool (dof,).
    """
    away = q - wanted
    return np.where(turns, np.remainder(away + np.pi, 2.0 * np.pi) - np.pi, away)


def turning(mechanism: Mechanism) -> np.ndarray:
    """Return True for the hinges that may turn all around, bool (dof,).

    Args:
        mechanism: Gives the joints.
    """
    return np.array([j.kind == "hinge" and np.isinf(j.lower) and np.isinf(j.upper) for j in mechanism.joints])


def equilibrium(mechanism: Mechanism, near: np.ndarray, rows: Sequence[int]) -> np.ndarray:
    """Return the next position that motors hold at rest [rad or m], (dof,).

    Newton steps of least length on the torques that the joints without a motor would need.

    Args:
        mechanism: The mechanism.
        near: Joint positions [rad or m], (dof,).
        rows: Dofs with a motor.

    Raises:
        SettingsError: There is none within ``NEAR`` of each joint.
    """
    tree, q = without_dry_friction(mechanism.tree), near.copy()
    free = [row for row in range(len(near)) if row not in rows]
    usual = efforts(mechanism, free)
    step = 1e-6
    for _ in range(20):
        lacking = needed(tree, q)[free] / usual
        if not np.any(np.abs(lacking) > HELD):
            break
        slopes = np.column_stack(
            [(needed(tree, q + e)[free] - needed(tree, q - e)[free]) / usual for e in step * np.eye(len(q))]
        ) / (2.0 * step)
        q = q - np.linalg.lstsq(slopes, lacking, rcond=1e-6)[0]
        if not np.all(np.abs(q - near) <= NEAR):
            break
    if np.all(np.abs(q - near) <= NEAR) and np.all(np.abs(needed(tree, q)[free]) <= 1e3 * HELD * usual):
        return q
    torque = needed(tree, near)
    worst = max(free, key=lambda row: abs(torque[row]) / usual[free.index(row)])
    joint = mechanism.joints[worst]
    where = ", ".join(f"{j.name}={x:.4g}" for j, x in zip(mechanism.joints, near, strict=True))
    raise SettingsError(
        f"lqr: expected a position that the motors can hold at rest, but at {where} joint '{joint.name}', "
        f"which has none, would need {torque[worst]:.3g} {'N m' if joint.kind == 'hinge' else 'N'}; give one "
        "where the joints without a motor need no torque."
    )


def efforts(mechanism: Mechanism, rows: Sequence[int]) -> np.ndarray:
    """Return a torque that is usual at each of some joints [N m or N], (motor,).

    At a hinge it is the largest that weight asks for in any pose, at a slide the weight that it carries.

    Args:
        mechanism: The mechanism.
        rows: The joints.
    """
    tree = without_dry_friction(mechanism.tree)
    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (POSES, len(mechanism.joints)))
    poses[:, tree.kind == SLIDE] = 0.0
    most = np.max(np.abs([needed(tree, pose) for pose in poses]), axis=0)
    carried = np.diag(inertia(tree, np.zeros(len(mechanism.joints))))
    weight = float(np.hypot(*tree.gravity)) or UNWEIGHTED
    usual = np.where(tree.kind == SLIDE, carried * weight, most)
    return np.where(usual > 1e-9 * carried, usual, carried * UNWEIGHTED)[list(rows)]


def sampled(a: np.ndarray, b: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the system from one measurement to the next, the torques held in between.

    Args:
        a: A of the system in continuous time, (2 dof, 2 dof).
        b: B, (2 dof, motor).
        rate: Measurements a second [Hz].

    Returns:
        Both matrices in discrete time, (2 dof, 2 dof) and (2 dof, motor).

    Source:
        C. F. Van Loan, Computing integrals involving the matrix exponential, 1978.
    """
    from scipy.linalg import expm

    n, m = b.shape
    whole = expm(np.block([[a, b], [np.zeros((m, n + m))]]) / rate)
    return whole[:n, :n], whole[:n, n:]


def _solved(
    a: np.ndarray, b: np.ndarray, q_weight: np.ndarray, r_weight: np.ndarray, actuated: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return gain and cost of a system in discrete time."""
    try:
        gain, cost, poles = extra("control", "control", "control").dlqr(
            a, b, q_weight, r_weight, method="scipy"
        )
    except (np.linalg.LinAlgError, ValueError):
        poles = np.array([np.inf])
    if not np.all(np.abs(poles) < 1.0 - STEERED):
        raise SettingsError(
            f"lqr: expected motors that can steer every joint there, got {quoted(actuated)}; add one, or "
            "choose another position."
        )
    return np.asarray(gain), np.asarray(cost)


def _poles(a: np.ndarray, b: np.ndarray, gain: np.ndarray, rate: float) -> np.ndarray:
    """Return the poles of the regulated system as of continuous time [1/s], complex (2 dof,)."""
    ahead, pushed = sampled(a, b, rate)
    found = np.linalg.eigvals(ahead - pushed @ gain).astype(np.complex128)
    return rate * np.log(np.where(found == 0.0, np.finfo(float).tiny, found))


def _stability(
    fit: Fit, linear: Linearization, rows: Sequence[int], gain: np.ndarray, rate: float, draws: int, seed: int
) -> Stability:
    """Return whether the gains hold draws of the mechanism, and it with other masses."""
    q, v = linear.position, linear.velocity
    tau = np.zeros(len(q))
    tau[list(rows)] = linear.torque

    def slowest(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.max(np.real(_poles(a, b, gain, rate))))

    real = []
    for mechanism in drawn(fit, draws, seed=seed, response=Response(q, rows[0])):
        a, b, _ = state_matrices(without_dry_friction(mechanism.tree), q, v, tau, rows)
        real.append(slowest(a, b))
    a, b = linear.system.A, linear.system.B
    # k times the masses take k times the torque: the same torque does a k-th
    held = np.array([slowest(a, b / k) < 0.0 for k in SCALES])
    middle = len(SCALES) // 2
    low = middle - int(np.argmin(np.append(held[middle::-1], False))) + 1
    high = middle + int(np.argmin(np.append(held[middle:], False))) - 1
    return Stability(
        len(real), sum(x < 0.0 for x in real), max(real, default=slowest(a, b)),
        float(SCALES[max(low, 0)]), float(SCALES[min(high, len(SCALES) - 1)]),
    )  # fmt: skip
