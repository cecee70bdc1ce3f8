"""An identified mechanism in, the poses from which it can be let go out, and how long its motion counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.parts import Start
from monodyn.mechanism.simulate import energy, rollout_derivatives
from monodyn.mechanism.tree import HINGE, STIFFNESS, Directions
from monodyn.optimize import DirectSettings, powell

AMPLITUDES = (30.0, 60.0, 90.0, 135.0)
"""Angles from hanging at rest from which hinges are let go [deg]."""
HAND = float(np.radians(3.0))
"""What a hand is off when it lets go [rad]; of slides in metres as well."""
PARTED = 1.0
"""Motions that are so far from one another are two motions, of which each tells other things [rad or m]."""
FIRST = 0.1
"""First step from a position toward less energy [rad or m]."""
COARSE = 4
"""Integration steps between stamps with which motions that part are looked for."""


@dataclass(frozen=True, eq=False)
class Release:
    """A pose at rest from which a mechanism is let go.

    Attributes:
        position: Joint positions [rad or m], (dof,).
        away: How far joints are lifted from where they hang [rad or m], zero for those that hang by
            themselves, (dof,).
        held: True for joints that have to be held there, the others hang by themselves, bool (dof,).
    """

    position: np.ndarray
    away: np.ndarray
    held: np.ndarray

    @property
    def amplitude(self) -> float:
        """How far a joint is lifted at most [rad or m]."""
        return float(np.max(np.abs(self.away)))


def releases(fit: Fit) -> list[Release]:
    """Return the poses from which motions are tried: one joint lifted, what is behind it hanging, or all
    hinges held, straight or bent.

    Args:
        fit: The identified mechanism.
    """
    tree, joints, hanging = fit.mechanism.tree, fit.mechanism.joints, hanging_at_rest(fit)
    is_hinge = tree.kind == HINGE
    # of a slide on a spring the largest amplitude is the one that was seen
    far = np.where(is_hinge, np.radians(max(AMPLITUDES)), np.abs(fit.starts[0].position - hanging))
    lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
    found = []
    for way, loose, held in _ways(fit):
        for amplitude in AMPLITUDES:
            for sign in (1.0, -1.0):
                away = sign * way * far * amplitude / max(AMPLITUDES)
                # a hinge behind one that is lifted turns back as far before it hangs
                begin = hanging + away - np.where(loose, away.sum(), 0.0)
                position = _hanging(fit, begin, loose)
                position = np.where(is_hinge, np.radians(np.round(np.degrees(position))) + 0.0, position)
                if away.any() and np.all((lower <= position) & (position <= upper)):
                    # the other side tells about the same
                    found.append(Release(position, away, held))
                    break
    return found


def until_parted(fit: Fit, start: Start, times: np.ndarray) -> np.ndarray:
    """Find how long motions let go nearby stay together, and within the joints' limits.

    Args:
        fit: The identified mechanism.
        start: Where it is let go.
        times: Time stamps from there on [s], (frame,).

    Returns:
        The first of the times, (sample,).
    """
    tree, joints, dofs = fit.mechanism.tree, fit.mechanism.joints, len(start.position)
    none, drive = np.zeros(0), fit.mechanism.drive
    nothing = Directions(
        np.zeros((*tree.links.shape, 0)), np.zeros((2, 0)), np.full(drive.table.shape, -1), none, none, none
    )
    clock = times * fit.mechanism.values["time_scale"]
    q, _, dq, _ = rollout_derivatives(
        tree, nothing, clock, start.position, start.velocity, substeps=COARSE, drive=drive
    )
    off = HAND * np.linalg.norm(dq[:, :, :dofs], axis=2)
    lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
    apart = ~(off <= PARTED) | (q < lower - 1e-9) | (q > upper + 1e-9)
    gone = apart.any(axis=1)
    return times[: int(np.argmax(gone))] if gone.any() else times


def hanging_at_rest(fit: Fit) -> np.ndarray:
    """Return the positions in which the mechanism hangs at rest [rad or m], (dof,): the least of its energy.

    What nothing pulls, a slide without a spring, stays where the record begins.

    Args:
        fit: The identified mechanism.
    """
    tree, begin = fit.mechanism.tree, fit.starts[0].position
    pulled = (tree.kind == HINGE) | (tree.links[:, STIFFNESS] > 0.0)
    # a joint that begins exactly upright would stay there
    rest = _hanging(fit, np.where(pulled, begin + 0.1, begin), pulled)
    free = [joint.kind == "hinge" and np.isinf(joint.upper - joint.lower) for joint in fit.mechanism.joints]
    return np.where(free, np.remainder(rest + np.pi, 2.0 * np.pi) - np.pi, rest)


def _ways(fit: Fit) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return which joints are lifted, as shares of an amplitude, which ones then come to hang by themselves
    elsewhere, and which ones have to be held."""
    tree = fit.mechanism.tree
    is_hinge, springs = tree.kind == HINGE, (tree.kind != HINGE) & (tree.links[:, STIFFNESS] > 0.0)
    count, none = len(is_hinge), np.zeros(len(is_hinge), dtype=bool)
    ways = []
    for i in np.flatnonzero(is_hinge | springs):
        behind = none.copy()
        for k in range(int(i) + 1, count):
            behind[k] = is_hinge[i] and is_hinge[k] and (tree.parent[k] == i or behind[tree.parent[k]])
        # a link that is lifted leans on those before it, which have to be held where they hang
        before, at = none.copy(), int(i)
        while at >= 0:
            before[at] = is_hinge[at] or at == i
            at = int(tree.parent[at])
        ways.append((np.eye(count)[i], behind, before))
    hinges = np.flatnonzero(is_hinge)
    if len(hinges) > 1:
        # straight on from the first hinge is a way of its own, and so are all bent one way, and to and fro
        bent = is_hinge.astype(float)
        fro = np.where(np.cumsum(bent) % 2 == 1, bent, -bent)
        ways += [(way, none, is_hinge) for way in (np.eye(count)[hinges[0]], bent, fro)]
    return ways


def _hanging(fit: Fit, begin: np.ndarray, loose: np.ndarray) -> np.ndarray:
    """Return the positions of least energy next to others, of which those of loose joints may change."""
    tree, rest, still = fit.mechanism.tree, begin.copy(), np.zeros((1, len(begin)))
    if not loose.any():
        return rest

    def height(q: np.ndarray) -> float:
        rest[loose] = q
        return float(energy(tree, rest[None], still)[0])

    first = begin[loose]
    unit = max(abs(height(first + 1.0) - height(first)), abs(height(first - 1.0) - height(first)), 1e-9)
    rest[loose] = powell(lambda q: height(q) / unit, first, FIRST, settings=DirectSettings(tolerance=1e-5)).x
    return rest
