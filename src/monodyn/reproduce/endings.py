"""Where the searches from drawn start values end: how many in which place, by residual and motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monodyn.reproduce.cases import Case

NEAR_RESIDUAL = 0.05
"""Searches end in one place when their residuals differ by less than this share,"""
NEAR_MOTION = 0.02
"""and their motions over the fitted frames by less than this share of the motion, rms."""


@dataclass(frozen=True, eq=False)
class Ending:
    """A place where searches ended.

    Attributes:
        cases: The fits that ended there, the one with the least residual first.
        residual: Its residual over the hinges, rms [rad].
    """

    cases: tuple[Case, ...]
    residual: float


def endings(cases: Sequence[Case], hinges: Sequence[int]) -> list[Ending]:
    """Return fits from different starts, grouped by where they ended, the least residual first.

    Args:
        cases: Fits of the same frames that have a motion.
        hinges: The degrees of freedom that are hinges.
    """
    columns, found = list(hinges), []
    rated = [(_size(case.residual, columns), case) for case in cases if case.motion is not None]
    for residual, case in sorted(rated, key=lambda pair: pair[0]):
        for group in found:
            if residual <= (1.0 + NEAR_RESIDUAL) * group[0][0] and _alike(case, group[0][1], columns):
                group.append((residual, case))
                break
        else:
            found.append([(residual, case)])
    return [Ending(tuple(case for _, case in group), group[0][0]) for group in found]


def _size(error: np.ndarray | None, columns: list[int]) -> float:
    return np.inf if error is None else float(np.sqrt(np.mean(error[columns] ** 2)))


def _alike(one: Case, other: Case, columns: list[int]) -> bool:
    """Return whether two fits move alike over the fitted frames."""
    assert one.motion is not None
    assert other.motion is not None
    a, b = (case.motion.position[: case.plan.frames, columns] for case in (one, other) if case.motion)
    return bool(np.sqrt(np.mean((a - b) ** 2)) < NEAR_MOTION * max(float(np.std(b)), 1e-12))
