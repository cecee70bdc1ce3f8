"""An optimum in, springs that would act as weight does out: the lengths hold only where there are none."""

from __future__ import annotations

import numpy as np

from monodyn.estimation.shooting.common import without_states
from monodyn.estimation.torque.laws import sprung
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.wording import listed

CONFUSED = 5.0
"""How many times as unsure as it is a length becomes by an unknown spring, where a word is due."""
SMALL = 2.0
"""Range of an angle up to which it is asked [rad]: from the middle to its ends a sine bends by a sixth."""


def like_weight(found: Refined) -> list[str]:
    """Name springs that the motion does not tell from weight, and the lengths that depend on it.

    Where a joint turns by small angles alone weight pulls as a spring does. Each is taken for a further
    unknown that the others follow; what its stiffness leaves of the residuals says how well it is known.

    Args:
        found: The optimum, and what is known there.

    Returns:
        Sentences; none where the motion tells them apart.
    """
    problem, optimum = found.weighted, found.optimum
    lengths = np.flatnonzero(problem.unknowns.of_kind("length") & problem.unknowns.log)
    position = problem.simulated(optimum.trial)
    mechanism, laws = sprung(problem.mechanism, np.mean(position, axis=0))
    springs = {
        joint.name: laws[joint.name][0]
        for joint, angle in zip(mechanism.joints, position.T, strict=True)
        if joint.kind == "hinge" and joint.name in laws and np.ptp(angle) < SMALL
    }
    if not springs or not len(lengths) or problem.mechanism.torque == "free":
        return []
    larger = problem.of(mechanism.with_choices(free=list(springs.values())))
    x = larger.unknowns.carried(optimum.x, problem.unknowns)
    _, jacobian = larger.rows(optimum.trial.at(x, optimum.trial.states))
    rows = without_states(jacobian, len(larger.unknowns), optimum.trial.pieces)
    rest = rows[:, larger.unknowns.index(problem.unknowns.names)]
    said = []
    for joint, name in springs.items():
        own = rows[:, larger.unknowns.names.index(name)]
        follows = -found.known.covariance @ (rest.T @ own)
        left = np.sum((own + rest @ follows) ** 2) + follows @ problem.prior.information @ follows
        with np.errstate(divide="ignore", invalid="ignore"):
            more = np.abs(follows[lengths]) / np.sqrt(max(float(left), 0.0))
        confused = lengths[more > CONFUSED * found.known.std[lengths]]
        if len(confused):
            names = listed([problem.unknowns.names[i] for i in confused])
            said.append(
                f"In a motion as small as this a spring at {joint} would act as weight does: {names} "
                f"{'holds' if len(confused) == 1 else 'hold'} only where there is none. A livelier motion "
                f"tells them apart, with --free {' '.join(laws[joint])}."
            )
    return said
