"""An identified mechanism and a state in, the linear system about it out, with the covariance of its entries.

The derivatives of the accelerations are exact (``mechanism.simulate``), so that the system is that of the
simulator, and what is not known of the parameters is carried into every entry to first order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from monodyn.arrays import Frozen, frozen
from monodyn.errors import SettingsError
from monodyn.estimation.fit import Fit
from monodyn.estimation.wording import listed
from monodyn.extras import extra
from monodyn.mechanism import Mechanism
from monodyn.mechanism.simulate import acceleration_derivatives
from monodyn.mechanism.tree import FRICTION, Directions, Tree
from monodyn.names import known, quoted
from monodyn.results.restart import FARTHEST

DIFFERENCE = 1e-5
"""Step of the central differences of exact derivatives [rad or m, or a second]: its square is their error."""

State = Mapping[str, float] | Sequence[float] | np.ndarray
"""Values by joint: by name, zero for those that are not named; or one for each in the mechanism's order."""


@dataclass(frozen=True, eq=False)
class Linearization(Frozen):
    """The linear system about a state: d/dt (dq, dv) = A (dq, dv) + B du, in true time.

    Where the state is no equilibrium it drifts: ``acceleration`` is not zero, and belongs to the equation.

    Attributes:
        system: The system, a ``control.StateSpace``, with named states (joint positions, then rates, as
            ``joint1`` and ``joint1_vel``), inputs (``joint1_torque``) and outputs (all states).
        actuated: Joints at which the inputs act.
        position: Joint positions [rad or m], (dof,).
        velocity: Joint rates [rad/s or m/s], (dof,).
        torque: Torques of the inputs there [N m or N], (motor,).
        acceleration: Joint accelerations there [rad/s^2 or m/s^2], (dof,).
        covariance: Covariance of the entries of [A B], row after row, (entry, entry); NaN where that of the
            fit is.
        notes: What the system leaves out, in sentences.
    """

    system: Any
    actuated: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    acceleration: np.ndarray
    covariance: np.ndarray
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "torque", "acceleration"):
            object.__setattr__(
                self, name, frozen(f"Linearization.{name}", getattr(self, name), (None,), error=SettingsError)
            )

    @property
    def std(self) -> np.ndarray:
        """Standard deviation of the entries of [A B], infinite where unknown, (2 dof, 2 dof + motor)."""
        variance = np.diag(self.covariance).reshape(len(self.system.A), -1)
        return np.where(np.isnan(variance), np.inf, np.sqrt(np.maximum(variance, 0.0)))


def linearize(
    fit: Fit,
    q: State,
    v: State | None = None,
    *,
    actuated: Sequence[str] | None = None,
    torque: Sequence[float] | np.ndarray | None = None,
) -> Linearization:
    """Linearise an identified mechanism about a state.

    A = [[0, 1], [da/dq, da/dv]] and B = [[0], [da/dtau]], for the accelerations a(q, v, tau). The covariance
    of their entries is J C J^T with C that of the parameters and J the derivative of the entries by them. Dry
    friction is left out: at rest its slope would be that by which it is smoothed. So are torques over time.

    Args:
        fit: The identified mechanism.
        q: Joint positions [rad or m].
        v: Joint rates [rad/s or m/s]; None is rest.
        actuated: Joints with a motor; None is all of them.
        torque: Torques of the motors there [N m or N], (motor,); None takes those that hold their joints
            against everything else, so that these do not accelerate.

    Returns:
        The system.

    Raises:
        SettingsError: Nothing was identified, a joint is not there, or the package ``control`` is missing.

    Example:
        ``monodyn.linearize(fit, {"joint1": np.pi / 2}, actuated=["slide"]).system.poles()``
    """
    fit.start_of(0, "linearize")
    mechanism = fit.mechanism
    position = by_joint(mechanism, "q", q)
    velocity = by_joint(mechanism, "v", () if v is None else v)
    rows = motors(mechanism, actuated)
    names = tuple(mechanism.joints[row].name for row in rows)
    tree, directions = without_dry_friction(mechanism.tree), fit.directions()
    tau = np.zeros(len(position))
    tau[rows] = holding(tree, position, velocity, rows) if torque is None else _torque(torque, names)
    a, b, acceleration = state_matrices(tree, position, velocity, tau, rows)
    by_param = _entries(tree, directions, position, velocity, tau, rows)
    if fit.mass_scale is None:
        # all of B is known up to one factor: it is told in units of what the first motor does to its joint
        by_b = by_param.reshape(*a.shape[:1], -1, by_param.shape[1])[:, a.shape[1] :]
        row = len(position) + rows[0]
        by_b -= b[:, :, None] * by_b[row, 0] / b[row, 0]
    # a parameter that changes nothing leaves the entries known, though it may be open itself
    moves = np.any(by_param != 0.0, axis=0)
    moved = by_param[:, moves]
    covariance = moved @ fit.shared_covariance[np.ix_(moves, moves)] @ moved.T
    system = _named(mechanism, names, a, b)
    notes = _notes(fit, names[0], 1.0 / b[len(position) + rows[0], 0])
    return Linearization(system, names, position, velocity, tau[rows], acceleration, covariance, notes)


def by_joint(mechanism: Mechanism, where: str, values: State) -> np.ndarray:
    """Return values in the order of the joints, (dof,).

    Args:
        mechanism: Gives the joints.
        where: What they are, for the message.
        values: By name, or one for each joint; none is all zero.

    Raises:
        SettingsError: From deeper down: a joint is not in the mechanism, or their number is another one.
    """
    return by_name([joint.name for joint in mechanism.joints], where, values)


def by_name(names: Sequence[str], where: str, values: State) -> np.ndarray:
    """Return values in the order of the names of joints, (dof,).

    Args:
        names: Names of the joints.
        where: What the values are, for the message.
        values: By name, or one for each joint; none is all zero.

    Raises:
        SettingsError: A joint is not among them, or their number is another one.
    """
    if isinstance(values, Mapping):
        for name in values:
            if name not in names:
                raise SettingsError(
                    f"{where}: joint '{name}' is not in the mechanism; {known('joints', names, name)}"
                )
            if not abs(values[name]) <= FARTHEST:
                raise SettingsError(
                    f"{where}: expected a number within {FARTHEST:g} of 0 for {name}, got {values[name]:g}."
                )
        return np.array([float(values.get(name, 0.0)) for name in names])
    found = np.asarray(values, dtype=float)
    if found.size == 0:
        return np.zeros(len(names))
    if found.shape != (len(names),) or not np.all(np.isfinite(found)):
        raise SettingsError(
            f"{where}: expected a finite value for each of {len(names)} joints, got {found.tolist()}; "
            f"joints: {quoted(names)}."
        )
    return found


def motors(mechanism: Mechanism, actuated: Sequence[str] | None) -> list[int]:
    """Return the dofs at which there is a motor.

    Args:
        mechanism: Gives the joints.
        actuated: Their names; None is all joints.

    Raises:
        SettingsError: There are none, one is named twice, one is not in the mechanism, or they are no list.
    """
    names = [joint.name for joint in mechanism.joints]
    if isinstance(actuated, str):
        raise SettingsError(f"actuated: expected a list of joints, got '{actuated}'; give ['{actuated}'].")
    chosen = names if actuated is None else list(actuated)
    for name in chosen:
        if name not in names:
            raise SettingsError(
                f"actuated: joint '{name}' is not in the mechanism; {known('joints', names, name)}"
            )
    if not chosen or len(set(chosen)) < len(chosen):
        raise SettingsError(
            f"actuated: expected one or more joints, each once, got {quoted(chosen) or 'none'}; joints: "
            f"{quoted(names)}."
        )
    return [names.index(name) for name in chosen]


def without_dry_friction(tree: Tree) -> Tree:
    """Return the tree without dry friction.

    Args:
        tree: The tree.
    """
    links = tree.links.copy()
    links[:, FRICTION] = 0.0
    return Tree(tree.parent, tree.kind, links, tree.gravity)


def holding(tree: Tree, q: np.ndarray, v: np.ndarray, rows: Sequence[int]) -> np.ndarray:
    """Return the torques of motors under which their joints do not accelerate [N m or N], (motor,).

    Args:
        tree: The tree.
        q: Joint positions [rad or m], (dof,).
        v: Joint rates [rad/s or m/s], (dof,).
        rows: Dofs with a motor.
    """
    at, inverse = _response(tree, q, v)
    return -np.linalg.solve(inverse[np.ix_(rows, rows)], at[list(rows)])


def needed(tree: Tree, q: np.ndarray, v: np.ndarray | None = None) -> np.ndarray:
    """Return the torque at every joint that keeps a state from accelerating [N m or N], (dof,).

    Args:
        tree: The tree.
        q: Joint positions [rad or m], (dof,).
        v: Joint rates [rad/s or m/s], (dof,); None is rest.
    """
    at, inverse = _response(tree, q, np.zeros(len(q)) if v is None else v)
    return -np.linalg.solve(inverse, at)


def inertia(tree: Tree, q: np.ndarray) -> np.ndarray:
    """Return the inertia matrix M(q) [SI], (dof, dof).

    Args:
        tree: The tree.
        q: Joint positions [rad or m], (dof,).
    """
    return np.linalg.inv(_response(tree, q, np.zeros(len(q)))[1])


def state_matrices(
    tree: Tree, q: np.ndarray, v: np.ndarray, tau: np.ndarray, rows: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A (2 dof, 2 dof) and B (2 dof, motor) of the linear system, and the accelerations (dof,).

    Args:
        tree: The tree.
        q: Joint positions [rad or m], (dof,).
        v: Joint rates [rad/s or m/s], (dof,).
        tau: Joint torques [N m or N], (dof,).
        rows: Dofs with a motor.
    """
    n = len(q)
    at, slopes = acceleration_derivatives(tree, _nothing(tree), q[None], v[None], tau[None])
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:], a[n:] = np.eye(n), slopes[0, :, : 2 * n]
    b = np.zeros((2 * n, len(rows)))
    b[n:] = slopes[0][:, 2 * n :][:, list(rows)]
    return a, b, at[0]


def _response(tree: Tree, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the accelerations without motors (dof,) and the inverse of the inertia matrix (dof, dof)."""
    n = len(q)
    at, slopes = acceleration_derivatives(tree, _nothing(tree), q[None], v[None], np.zeros((1, n)))
    return at[0], slopes[0, :, 2 * n :]


def _nothing(tree: Tree) -> Directions:
    """Return no directions."""
    none = np.zeros(0)
    entry = np.zeros((len(tree.parent), 0), dtype=np.int64)
    return Directions(np.zeros((*tree.links.shape, 0)), np.zeros((2, 0)), entry, none, none, none)


def _entries(
    tree: Tree, directions: Directions, q: np.ndarray, v: np.ndarray, tau: np.ndarray, rows: Sequence[int]
) -> np.ndarray:
    """Differentiate the entries of [A B], row after row, by the parameters, (entry, param).

    The derivatives of the accelerations by parameters are exact; those of these by the state are their
    central differences, by the torques (in which accelerations are linear) a difference that is exact too.
    """
    n, params = len(q), directions.links.shape[2]
    wide = 2 * n + len(rows)
    moved = np.zeros((2 * wide, 3 * n))
    step = np.concatenate((np.full(2 * n, DIFFERENCE), np.ones(len(rows))))
    columns = [*range(2 * n), *(2 * n + row for row in rows)]
    for k, column in enumerate(columns):
        moved[k, column], moved[wide + k, column] = step[k], -step[k]
    moved += np.concatenate((q, v, tau))
    _, slopes = acceleration_derivatives(tree, directions, *np.split(moved, 3, axis=1))
    change = (slopes[:wide, :, :params] - slopes[wide:, :, :params]) / (2.0 * step[:, None, None])
    found = np.zeros((2 * n, wide, params))
    found[n:] = np.swapaxes(change, 0, 1)
    return found.reshape(-1, params)


def _named(mechanism: Mechanism, names: tuple[str, ...], a: np.ndarray, b: np.ndarray) -> Any:
    """Return the system with its names."""
    joints = [joint.name for joint in mechanism.joints]
    states = [*joints, *(f"{name}_vel" for name in joints)]
    return extra("control", "control", "control").StateSpace(
        a, b, np.eye(len(a)), np.zeros(b.shape), states=states, outputs=states,
        inputs=[f"{name}_torque" for name in names], name=mechanism.name or "mechanism",
    )  # fmt: skip


def _notes(fit: Fit, joint: str, moved: float) -> tuple[str, ...]:
    """Say what the system leaves out, and in which units its torques are: ``moved`` is what a joint moves."""
    mechanism, notes = fit.mechanism, []
    rubbing = np.flatnonzero(mechanism.tree.links[:, FRICTION])
    if len(rubbing):
        said = listed([mechanism.joints[i].name for i in rubbing])
        notes.append(f"Dry friction is left out of the linear system: it acts at {said}.")
    if mechanism.torque != "friction":
        notes.append(
            "Torques over time that were identified are left out, of the linear system as of the closed "
            "loop in MuJoCo."
        )
    if fit.mass_scale is None:
        unit = "kg m^2" if next(j for j in mechanism.joints if j.name == joint).kind == "hinge" else "kg"
        notes.append(
            "Masses are known up to one factor: torques are those of a mechanism in which the motor at "
            f"{joint} moves {moved:.3g} {unit} there; where that is k times as much, every torque is k times "
            "as large."
        )
    return tuple(notes)


def _torque(torque: Sequence[float] | np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    found = np.asarray(torque, dtype=float)
    if found.shape != (len(names),):
        raise SettingsError(
            f"torque: expected one for each of the joints {quoted(names)}, got {found.tolist()}."
        )
    return found
