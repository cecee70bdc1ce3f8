"""What determines masses themselves, where the motion alone shows their ratios."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np

from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import MASS_KINDS
from monodyn.mechanism.tree import SLIDE, Directions

MassScale = Literal["torques", "given"]
"""Known torques, or something given that is in proportion to the masses."""
STATES = 24
"""States in which accelerations are compared."""
RATES = 5.0
"""Standard deviation of their rates [rad/s], and of the rates of slides in tenths of it [m/s]."""
HEAVY = (*MASS_KINDS, "com_x", "com_y")
"""Kinds of what may be another with the scale of the masses; sizes are known otherwise, or not at all."""
HIDDEN = 1e-3
"""Share of the most by which accelerations change along a direction that free motions hardly show."""
DIVIDED = 0.05
"""Share of what torques do that is left by a change along such directions which is one by a factor."""


def mass_scale(
    mechanism: Mechanism,
    std: Mapping[str, float],
    estimated: Sequence[str],
    directions: Callable[[], Directions],
    *,
    torque: str,
) -> MassScale | None:
    """Return what determines masses themselves; None where only their ratios are known.

    Args:
        mechanism: The identified mechanism.
        std: Standard deviations of its parameters by name, infinite where the data do not fix one.
        estimated: Names of those that were estimated.
        directions: Returns the derivatives of its tree by these.
        torque: The torque model.

    Returns:
        ``"torques"`` that are known; ``"given"`` where a mass, a friction or the like was.
    """
    told = given_scale(mechanism)
    heavy = [p for p in mechanism.parameters if p.kind in ("mass", "inertia") and p.name in std]
    found = any(0.0 < std[p.name] < abs(p.value) for p in heavy)
    # not of the log, which a run that was read back may not have
    if found and torque == "known":
        return "torques"
    if not found and not any(p.name in told for p in heavy):
        return None
    # what free bodies move together may be known, and a mass among them given, without any scale
    kinds = {p.name: p.kind for p in mechanism.parameters}
    lost = [k for k, name in enumerate(estimated) if np.isinf(std[name]) and kinds[name] in HEAVY]
    return None if lost and _open(mechanism, lost, estimated, directions()) else "given"


def given_scale(mechanism: Mechanism) -> list[str]:
    """Return the names of what the user gave that is in proportion to the masses.

    Args:
        mechanism: The mechanism.
    """
    rows = (p for p in mechanism.parameters if p.name in mechanism.chosen and not p.free)
    # no friction is none at all scales
    return [p.name for p in rows if p.kind in MASS_KINDS and p.value != 0.0]


def various_states(mechanism: Mechanism) -> np.ndarray:
    """Return positions [rad or m], rates [rad/s or m/s] and torques [N m or N] that differ, (3, row, dof).

    Args:
        mechanism: Gives the joints.
    """
    rng, slide = np.random.default_rng(1), mechanism.tree.kind == SLIDE
    states = rng.normal(size=(3, STATES, len(slide)))
    states[0] = np.where(slide, 0.1 * states[0], np.pi * states[0])
    states[1] *= RATES * np.where(slide, 0.1, 1.0)
    return states


def _open(
    mechanism: Mechanism, lost: Sequence[int], estimated: Sequence[str], directions: Directions
) -> bool:
    """Return whether what is lost may change all that torques do by one factor, and no free motion."""
    from monodyn.mechanism.simulate import acceleration_derivatives

    q, v, tau = various_states(mechanism)
    (free, by_free), (pushed, by_pushed) = (
        acceleration_derivatives(mechanism.tree, directions, q, v, torque)
        for torque in (np.zeros_like(tau), tau)
    )
    values = np.abs([mechanism.values[estimated[k]] for k in lost])
    unit = np.where(values > 0.0, values, 1.0)

    def relative(rows: np.ndarray, by: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return accelerations (row,) and derivatives (row, lost) in units of their usual size by joint."""
        size = np.sqrt(np.mean(rows**2, axis=0)) + 1e-12
        return (rows / size).ravel(), (by[:, :, lost] * unit / size[:, None]).reshape(-1, len(lost))

    _, shown = relative(free, by_free)
    does, change = relative(pushed - free, by_pushed - by_free)
    _, seen, along = np.linalg.svd(shown, full_matrices=False)
    change = change @ along[seen <= HIDDEN * seen[0]].T
    # one factor on all masses divides all that torques do by it
    by = np.linalg.lstsq(change, does, rcond=HIDDEN)[0]
    return bool(np.linalg.norm(change @ by - does) < DIVIDED * np.linalg.norm(does))
