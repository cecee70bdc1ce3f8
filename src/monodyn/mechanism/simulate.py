"""The only interface to motion: accelerations, rollouts and derivatives of a mechanism's tree and drive.

Nothing outside of this room calls the kernels behind it, so that another engine can take its place. Such an
engine has to provide what the functions below state: accelerations by joint, energy, a rollout over given
time stamps with a given number of steps between them, and the exact derivatives of that very rollout
(`most_off` is for speed alone). Arrays are checked and made contiguous here, because the kernels do not
check them. A rollout takes equal Runge-Kutta steps between time stamps, divided where dry friction changes
its sign; `simulate` chooses their number from a stated error bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from monodyn.arrays import Frozen, freeze, frozen, increasing, plain
from monodyn.errors import MechanismError
from monodyn.mechanism.drive import KNOTS, UNDRIVEN, Drive
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.substeps import least_substeps
from monodyn.mechanism.tree import Directions, Tree

MOST_SUBSTEPS = 4096
"""Most steps between two time stamps: with more, long chaotic motion does not become more exact."""


@dataclass(frozen=True, eq=False)
class Trajectory(Frozen):
    """Joint positions and rates over time.

    Attributes:
        time: Time stamps [s], (frame,).
        position: Joint positions [rad or m], (frame, dof).
        velocity: Joint rates [rad/s or m/s], (frame, dof).
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray

    def __post_init__(self) -> None:
        shape = (len(self.time), None)
        freeze(self, shape[:1], "time", error=MechanismError)
        freeze(self, shape, "position", "velocity", error=MechanismError)


def simulate(
    mechanism: Mechanism, times: np.ndarray, q0: np.ndarray, v0: np.ndarray, *, tolerance: float = 1e-6
) -> Trajectory:
    """Integrate the motion of a mechanism under gravity, its own friction and springs, and its torques.

    Args:
        mechanism: The mechanism.
        times: Increasing time stamps [s], (frame,); they are also the time of the torques.
        q0: Joint positions at ``times[0]`` [rad or m], (dof,).
        v0: Joint rates there [rad/s or m/s], (dof,).
        tolerance: Largest error of any position from the integration [rad or m].

    Returns:
        Positions and rates at the time stamps.

    Raises:
        MechanismError: From the checks of arrays: a time does not increase, or a start state has another
            length than the joints.

    Example:
        >>> import numpy as np
        >>> from monodyn.mechanism import load
        >>> from monodyn.mechanism.simulate import simulate
        >>> fall = simulate(load("single"), np.linspace(0, 1, 31), np.array([0.5]), np.array([0.0]))
        >>> fall.position.shape
        (31, 1)
    """
    times = np.asarray(times, dtype=np.float64)
    increasing("simulate.times", times, error=MechanismError)
    dofs = len(mechanism.joints)
    q0 = frozen("simulate.q0", q0, (dofs,), error=MechanismError)
    v0 = frozen("simulate.v0", v0, (dofs,), error=MechanismError)
    tree, drive = mechanism.tree, mechanism.drive
    steps, _ = least_substeps(
        lambda substeps: rollout(tree, times, q0, v0, substeps=substeps, drive=drive)[0],
        tolerance,
        MOST_SUBSTEPS,
    )
    return Trajectory(times, *rollout(tree, times, q0, v0, substeps=steps, drive=drive))


def accelerations(tree: Tree, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Solve M(q) a = tau + passive(q, v) - bias(q, v) for the joint accelerations of every row.

    Args:
        tree: The joint tree.
        q: Joint positions [rad or m], (frame, dof).
        v: Joint rates [rad/s or m/s], (frame, dof).
        tau: Joint torques or forces in addition to friction and springs of the tree [N m or N], (frame, dof).

    Returns:
        Joint accelerations [rad/s^2 or m/s^2], (frame, dof).

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    from monodyn.mechanism import planar

    _agree(tree, q, v, tau)
    rows = (plain(row, tree.links.dtype) for row in (q, v, tau))
    return planar.accelerations(tree.parent, tree.kind, tree.links, tree.gravity, *rows)


def acceleration_derivatives(
    tree: Tree, directions: Directions, q: np.ndarray, v: np.ndarray, tau: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve the equation of motion for the accelerations of every row, and differentiate them exactly.

    Args:
        tree: The joint tree.
        directions: What each parameter changes in the tree; what it changes in the drive is not looked at.
        q: Joint positions [rad or m], (row, dof).
        v: Joint rates [rad/s or m/s], (row, dof).
        tau: Joint torques or forces in addition to friction and springs of the tree [N m or N], (row, dof).

    Returns:
        Joint accelerations [rad/s^2 or m/s^2], (row, dof), and their derivatives, (row, dof, param + 3 dof):
        by the parameters, then by ``q``, ``v`` and ``tau``.

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    from monodyn.mechanism import slopes

    _agree(tree, q, v, tau)
    rows = (plain(row, np.float64) for row in (q, v, tau))
    return slopes.acceleration_tangents(
        tree.parent, tree.kind, tree.links, plain(directions.links, np.float64), tree.gravity,
        plain(directions.gravity, np.float64), *rows,
    )  # fmt: skip


def energy(tree: Tree, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Sum kinetic energy, height energy (zero at the first joint) and spring energy.

    Args:
        tree: The joint tree.
        q: Joint positions [rad or m], (frame, dof).
        v: Joint rates [rad/s or m/s], (frame, dof).

    Returns:
        Energy [J], (frame,).

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    from monodyn.mechanism import planar

    _agree(tree, q, v)
    rows = (plain(row, tree.links.dtype) for row in (q, v))
    return planar.energy(tree.parent, tree.kind, tree.links, tree.gravity, *rows)


def rollout(
    tree: Tree,
    times: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
    *,
    substeps: int,
    drive: Drive | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the motion over ``times`` with classical Runge-Kutta steps of order four.

    Args:
        tree: The joint tree; complex for a complex step.
        times: Time stamps [s], (frame,); they need not be uniform and may run backwards. The drive uses
            them too.
        q0: Joint positions at ``times[0]`` [rad or m], (dof,).
        v0: Joint rates there [rad/s or m/s], (dof,).
        substeps: Equal steps between two stamps.
        drive: Torques over time in addition to friction and springs, or None.

    Returns:
        Joint positions and rates, each (frame, dof).

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    _agree(tree, q0, v0)
    whole, start = np.array([0, len(times)]), np.concatenate((q0, v0))[None]
    return rollouts(tree, times, whole, start, substeps=substeps, drive=drive)


def rollouts(
    tree: Tree,
    times: np.ndarray,
    first: np.ndarray,
    states: np.ndarray,
    *,
    substeps: int,
    drive: Drive | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate the motion of one mechanism from many states, each over its own part of ``times``.

    Args:
        tree: The joint tree; complex for a complex step.
        times: Time stamps of all runs end to end [s], (frame,).
        first: First frame of each run and one past the last, (piece + 1,).
        states: Joint positions, then rates at the first frame of each run, (piece, 2 dof).
        substeps: Equal steps between two stamps.
        drive: Torques over time in addition to friction and springs, or None.

    Returns:
        Joint positions and rates, each (frame, dof).

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    from monodyn.mechanism import planar

    drive = drive or UNDRIVEN(len(tree.parent))
    _agree(tree, states[:, ::2], drive.table.T)
    t = np.result_type(tree.links, drive.table)
    return planar.rollouts(
        tree.parent, tree.kind, plain(tree.links, t), plain(tree.gravity, t), plain(times, np.float64),
        plain(first, np.int64), int(substeps), plain(states, t), drive.mode, drive.times,
        plain(drive.table, t),
    )  # fmt: skip


def rollout_derivatives(
    tree: Tree,
    directions: Directions,
    times: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
    *,
    substeps: int,
    drive: Drive | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Integrate the motion together with its exact derivatives along directions.

    Args:
        tree: The joint tree.
        directions: What each parameter changes in the tree and in the drive.
        times: Time stamps [s], (frame,); they need not be uniform and may run backwards. The drive uses
            them too.
        q0: Joint positions at ``times[0]`` [rad or m], (dof,).
        v0: Joint rates there [rad/s or m/s], (dof,).
        substeps: Equal steps between two stamps.
        drive: Torques over time in addition to friction and springs, or None.

    Returns:
        Positions and rates, each (frame, dof), and their derivatives, each (frame, dof, param + 2 dof): by
        the parameters, then by ``q0``, then by ``v0``.

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    _agree(tree, q0, v0)
    whole, start = np.array([0, len(times)]), np.concatenate((q0, v0))[None]
    return rollouts_derivatives(tree, directions, times, whole, start, substeps=substeps, drive=drive)


def rollouts_derivatives(
    tree: Tree,
    directions: Directions,
    times: np.ndarray,
    first: np.ndarray,
    states: np.ndarray,
    *,
    substeps: int,
    drive: Drive | None = None,
    most_off: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Integrate as ``rollouts`` does, together with the derivatives along directions.

    Args:
        tree: The joint tree.
        directions: What each parameter changes in the tree and in the drive.
        times: Time stamps of all runs end to end [s], (frame,).
        first: First frame of each run and one past the last, (piece + 1,).
        states: Joint positions, then rates at the first frame of each run, (piece, 2 dof).
        substeps: Equal steps between two stamps.
        drive: Torques over time in addition to friction and springs, or None.
        most_off: Above 0 the derivatives may be those of ``variational``; at 0 they are of this very rollout.

    Returns:
        Positions and rates, each (frame, dof), and their derivatives, each (frame, dof, param + 2 dof): by
        the parameters, then by the positions and by the rates that the frame's run starts with.

    Raises:
        MechanismError: From ``_agree``: an array is not of the tree's joints.
    """
    drive = drive or UNDRIVEN(len(tree.parent))
    _agree(tree, states[:, ::2], drive.table.T, directions.entry.T)
    f8, i8 = np.float64, np.int64
    times, first, states = plain(times, f8), plain(first, i8), plain(states, f8)
    if most_off > 0.0:
        from monodyn.mechanism import variational

        found = variational.derivatives(tree, directions, times, first, substeps, states, drive, most_off)
        if found is not None:
            return found
    from monodyn.mechanism import tangents

    order, live = _carried(tree, directions, times, first, drive)
    lagging = np.zeros(drive.table.shape) if drive.lagging is None else drive.lagging
    # known torques have a table, but no entry of it is a parameter
    entry = directions.entry if directions.entry.size else np.full(drive.table.shape, -1)
    return tangents.rollout_tangents(
        tree.parent, tree.kind, tree.links, plain(directions.links, f8), tree.gravity,
        plain(directions.gravity, f8), times, first, int(substeps), states, drive.mode, drive.times,
        drive.table, plain(lagging, f8), plain(entry, i8), plain(directions.load, f8),
        plain(directions.clock, f8), plain(directions.lag, f8), order, live,
    )  # fmt: skip


def _carried(
    tree: Tree, directions: Directions, times: np.ndarray, first: np.ndarray, drive: Drive
) -> tuple[np.ndarray, np.ndarray]:
    """Return the order in which directions begin to act along each run, int64 (run, param + 2 dof), and how
    many of them act by each frame, int64 (frame,): the kernel carries no others along."""
    params, runs = directions.links.shape[2], len(first) - 1
    acting = np.ones(params + 2 * len(tree.parent), dtype=bool)
    acting[:params] = directions.acting
    if drive.mode != KNOTS or not np.any(directions.entry >= 0):
        return np.tile(np.argsort(~acting, kind="stable"), (runs, 1)), np.full(len(times), np.sum(acting))
    # a torque at a knot costs time only from where it begins to act
    begin = np.tile(np.where(acting, 0, len(times)), (runs, 1))
    live = np.empty(len(times), dtype=np.int64)
    for k, (a, b) in enumerate(pairwise(first.tolist())):
        begins = _begins(drive.times, times[a:b], directions.entry, params)
        begin[k, :params] = np.where(directions.always, 0, begins)
        live[a:b] = np.searchsorted(np.sort(begin[k]), np.arange(b - a), side="right")
    return np.argsort(begin, axis=1, kind="stable"), live


def transitions(
    tree: Tree, times: np.ndarray, motion: np.ndarray, *, substeps: int, drive: Drive | None = None
) -> np.ndarray:
    """Differentiate the state at each time stamp of a motion by the state at the one before.

    Args:
        tree: The joint tree.
        times: Time stamps [s], (frame,).
        motion: Joint positions, then rates there [rad or m, rad/s or m/s], (frame, 2 dof).
        substeps: Equal steps between two stamps.
        drive: Torques over time in addition to friction and springs, or None.

    Returns:
        Derivatives, (frame, 2 dof, 2 dof); the first is the identity.

    Raises:
        MechanismError: There is not one state a time; or from ``_agree``: an array is not of the tree's
            joints.
    """
    drive = drive or UNDRIVEN(len(tree.parent))
    if len(motion) != len(times):
        raise MechanismError(
            f"transitions: expected a state at each of {len(times)} times, got {len(motion)}; give one each."
        )
    none = np.zeros(0)
    entry = np.full(drive.table.shape, -1)
    nothing = Directions(np.zeros((*tree.links.shape, 0)), np.zeros((2, 0)), entry, none, none, none)
    found = np.empty((*motion.shape, motion.shape[1]))
    found[:1] = np.eye(motion.shape[1])
    # every interval is a run of its own, of two frames
    pairs = np.column_stack((times[:-1], times[1:])).ravel()
    first = np.arange(0, len(pairs) + 1, 2)
    _, _, dq, dv = rollouts_derivatives(
        tree, nothing, pairs, first, motion[:-1], substeps=substeps, drive=drive
    )
    found[1:] = np.concatenate((dq[1::2], dv[1::2]), axis=1)
    return found


def _begins(stamps: np.ndarray, times: np.ndarray, entry: np.ndarray, params: int) -> np.ndarray:
    """Return the interval of ``times`` (1 ends at frame 1) in which each parameter first acts by its knots.

    Args:
        stamps: Knots [s], (knot,).
        times: Time stamps [s], (frame,).
        entry: Parameter of each joint's value at each knot, -1 where none, (dof, knot).
        params: Number of parameters.

    Returns:
        int64 (param,); the number of frames for a parameter that acts by no knot.
    """
    # A knot's torque is a hat between the knots next to it; at the ends it is half a hat.
    early = np.concatenate((stamps[:1], stamps[:-1]))
    late = np.concatenate((stamps[1:], stamps[-1:]))
    # the first interval that does not end before the hat begins; backwards in time it is the other way round
    side, begin, end = (1.0, early, late) if times[-1] >= times[0] else (-1.0, -late, -early)
    at = np.searchsorted(side * times[1:], begin)
    first = np.where(side * times[at] <= end, at + 1, len(times))
    begins = np.full(params, len(times))
    joints, knots = np.nonzero(entry >= 0)
    np.minimum.at(begins, entry[joints, knots], first[knots])
    return begins


def _agree(tree: Tree, *joints: np.ndarray) -> None:
    """Raise unless the last axis of each array is that of the tree's joints: the kernels do not check."""
    dofs = len(tree.parent)
    for array in joints:
        if np.shape(array)[-1:] != (dofs,):
            raise MechanismError(
                f"simulate: expected arrays of the tree's {dofs} joints, got one of shape {np.shape(array)}; "
                "give one value a joint."
            )
