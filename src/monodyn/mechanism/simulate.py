"""Motion of a mechanism from a start state, with a step chosen from a stated error bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monodyn.arrays import frozen, increasing
from monodyn.errors import MechanismError
from monodyn.mechanism.model import Mechanism

MOST_SUBSTEPS = 4096


@dataclass(frozen=True, eq=False)
class States:
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
        set_ = object.__setattr__
        set_(self, "time", frozen("States.time", self.time, shape[:1], error=MechanismError))
        set_(self, "position", frozen("States.position", self.position, shape, error=MechanismError))
        set_(self, "velocity", frozen("States.velocity", self.velocity, shape, error=MechanismError))


def simulate(
    mechanism: Mechanism, times: np.ndarray, q0: np.ndarray, v0: np.ndarray, *, tolerance: float = 1e-6
) -> States:
    """Integrate the motion of a mechanism under gravity, its own friction and springs, and its torques.

    Args:
        mechanism: The mechanism.
        times: Increasing time stamps [s], (frame,); torques over time go by them.
        q0: Joint positions at ``times[0]`` [rad or m], (dof,).
        v0: Joint rates there [rad/s or m/s], (dof,).
        tolerance: Largest error of any position from the integration [rad or m].

    Returns:
        Positions and rates at the time stamps.

    Raises:
        MechanismError: A time does not increase, or a start state has another length than the joints.

    Example:
        >>> import numpy as np
        >>> from monodyn.mechanism import load
        >>> from monodyn.mechanism.simulate import simulate
        >>> fall = simulate(load("single"), np.linspace(0, 1, 31), np.array([0.5]), np.array([0.0]))
        >>> fall.position.shape
        (31, 1)
    """
    from monodyn.mechanism.dynamics import rollout

    times = np.asarray(times, dtype=np.float64)
    increasing("simulate.times", times, error=MechanismError)
    dofs = len(mechanism.joints)
    q0 = frozen("simulate.q0", q0, (dofs,), error=MechanismError)
    v0 = frozen("simulate.v0", v0, (dofs,), error=MechanismError)
    steps = choose_substeps(mechanism, times, q0, v0, tolerance=tolerance)
    tree = mechanism.tree
    arrays = (tree.parent, tree.kind, tree.links, tree.gravity, times)
    return States(times, *rollout(*arrays, steps, q0, v0, mechanism.drive))


def choose_substeps(
    mechanism: Mechanism,
    times: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
    *,
    tolerance: float = 1e-6,
    most: int = MOST_SUBSTEPS,
) -> int:
    """Return the least power of two of substeps whose error stays below a bound over the whole motion.

    Args:
        mechanism: The mechanism.
        times: Time stamps [s], (frame,).
        q0: Joint positions at ``times[0]`` [rad or m], (dof,).
        v0: Joint rates there [rad/s or m/s], (dof,).
        tolerance: Largest error of any position [rad or m].
        most: Where to stop doubling; returned too if the bound is out of reach, as in long chaotic motion.

    Returns:
        Steps between two time stamps.
    """
    from monodyn.mechanism.dynamics import rollout

    tree = mechanism.tree
    arrays = (tree.parent, tree.kind, tree.links, tree.gravity, times)
    return least_substeps(lambda steps: rollout(*arrays, steps, q0, v0, mechanism.drive)[0], tolerance, most)[
        0
    ]


def least_substeps(positions: Callable[[int], np.ndarray], tolerance: float, most: int) -> tuple[int, float]:
    """Double the integration steps until the motion stays within a bound of its error.

    Args:
        positions: Gives the motion integrated with a number of steps between two time stamps [rad or m].
        tolerance: Largest error of any position [rad or m].
        most: Where to stop doubling; returned too if the bound is out of reach, as in long chaotic motion.

    Returns:
        Steps between two time stamps, the least power of two that keeps the bound; and the largest error with
        them [rad or m], infinite where the motion is not finite or there is nothing to compare with.

    Source: step doubling: halving the step of an order-4 method divides its error by 16, so the error of the
        longer step is 16/15 of the difference of the two results, that of the shorter 1/15.
    """
    steps, change = 1, np.inf
    coarse = positions(1)
    while steps < most:
        fine = positions(2 * steps)
        with np.errstate(invalid="ignore", over="ignore"):
            change = float(np.max(np.abs(fine - coarse), initial=0.0))
        if 16 / 15 * change <= tolerance:
            return steps, 16 / 15 * change
        steps, coarse = 2 * steps, fine
    return steps, change / 15 if np.isfinite(change) else np.inf
