"""A link more than the model has: a record fitted with one that hangs where the last one ends, unmeasured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from monodyn.estimation.record.samples import ordered, prepare
from monodyn.estimation.record.smooth import smooth
from monodyn.estimation.settings import IdentifySettings
from monodyn.estimation.shooting.accelerations import mismatch_cost, smooth_motion
from monodyn.estimation.shooting.hanging import hanging
from monodyn.estimation.shooting.problem import posed
from monodyn.estimation.shooting.scaling import starts_of_scales
from monodyn.estimation.shooting.search import difference_size
from monodyn.estimation.shooting.shoot import ROUGH, Route
from monodyn.estimation.shooting.starts import FACTORS
from monodyn.estimation.wording import two_digits
from monodyn.mechanism import Mechanism
from monodyn.mechanism.mounted import hung
from monodyn.types import Poses

MOST_ROWS = 400
"""Rows of a record that are fitted, from its beginning: a link more moves all of it."""
COARSE = 1e-4
"""Integration error that the fit may have [rad or m]."""
NOISE_ALONE = 1.5
"""Mean size of residuals up to which they are noise alone, in units of the noise: 0.8 for normal ones."""
UNSEEN = np.pi**2
"""Variance of an angle of which nothing is known [rad^2]."""


@dataclass(frozen=True)
class Further:
    """A record fitted with a link more, or what came of it.

    Attributes:
        last: Name of the body at whose end it hangs.
        rows: Rows of the record that were fitted.
        left: Mean size of what it leaves over of the measured joints, in units of the noise; infinite where
            the record is not followed within its noise.
        length: Its length [m].
        heavier: Its mass over that of the last body.
    """

    last: str
    rows: int
    left: float
    length: float = np.nan
    heavier: float = np.nan

    @property
    def name(self) -> str:
        """What it is, in words."""
        return f"a link more at the end of {self.last}"

    def said(self, times: float) -> str:
        """Name it as what is lacking.

        Args:
            times: How many times as close to the record the motion comes with it.
        """
        return (
            f"With {self.name}, about {1e3 * self.length:.3g} mm long and {self.heavier:.2g} times as heavy "
            f"as {self.last}, the motion comes {two_digits(times)} times as close to the record, to within "
            "its noise: more hangs there than the file has. Take a mechanism with a body and a joint more."
        )


def further_link(
    records: tuple[Poses, ...], mechanism: Mechanism, settings: IdentifySettings
) -> Further | None:
    """Fit a record with a link more at the end of the last one.

    A hidden motion that meets all rows of the others within their noise is hardly there by chance; one that
    only comes closer may stand for anything.

    Args:
        records: The records.
        mechanism: The mechanism, its bodies chosen.
        settings: How it was identified.

    Returns:
        What came of it; None where it cannot be tried: several records, known torques, no end to hang from.
    """
    plain = mechanism.with_torque("friction")
    grown = hung(_of_scale(records, plain)) if len(records) == 1 and not records[0].torques else None
    if grown is None:
        return None
    larger, joint = grown
    record = _with_unseen(ordered(records[0][:MOST_ROWS], plain), joint)
    found = Further(larger.bodies[-2], len(record), np.inf)
    problem = posed(larger, prepare((record,), larger), near=True)
    route = Route(settings.piece, max(settings.error_bound, COARSE), ROUGH)
    optimum = hanging(problem, smooth(record), route)
    # sizes on their bounds are no link
    if optimum is None or np.any(optimum.at_bound & problem.unknowns.log):
        return found
    left = difference_size(problem, optimum, [j.name for j in plain.joints])
    values, own = problem.mechanism_at(optimum.x).values, larger.bodies[-1]
    return replace(
        found,
        left=left if left < NOISE_ALONE else np.inf,
        length=values[f"{own}.length"],
        heavier=values[f"{own}.mass"] / values[f"{found.last}.mass"],
    )


def _of_scale(records: tuple[Poses, ...], mechanism: Mechanism) -> Mechanism:
    """Return the mechanism at the common scale at which it comes closest to the accelerations."""
    problem = posed(mechanism, prepare(records, mechanism))
    motion = smooth_motion(problem, tuple(smooth(ordered(record, mechanism)) for record in records))
    scales = starts_of_scales(problem, FACTORS)
    return problem.mechanism_at(min(scales, key=lambda x: mismatch_cost(problem, x, motion)))


def _with_unseen(record: Poses, joint: str) -> Poses:
    """Return a record with a joint more, the last one, that was never seen."""
    frames, dofs = record.position.shape
    covariance = np.zeros((frames, dofs + 1, dofs + 1))
    covariance[:, :dofs, :dofs], covariance[:, dofs, dofs] = record.covariance, UNSEEN
    return replace(
        record,
        joints=(*record.joints, joint),
        position=np.column_stack([record.position, np.full(frames, np.nan)]),
        covariance=covariance,
        seen=np.zeros(frames, dtype=bool),
        joint_seen=np.column_stack([record.measured, np.zeros(frames, dtype=bool)]),
        shifts=None,
    )
