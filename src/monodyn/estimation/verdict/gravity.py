"""How well gravity and densities are known where nobody measured them, and with them all that follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from monodyn.choices import is_bundled
from monodyn.estimation.fit import Fit
from monodyn.estimation.shooting.common import without_states
from monodyn.estimation.shooting.problem import Problem
from monodyn.estimation.shooting.shoot import Optimum
from monodyn.estimation.verdict.combinations import combinations
from monodyn.estimation.verdict.intervals import estimates
from monodyn.estimation.verdict.refine import Refined
from monodyn.estimation.verdict.shares import Share, added
from monodyn.estimation.verdict.uncertainty import Knowledge, knowledge_at
from monodyn.mechanism import Mechanism
from monodyn.mechanism.tree import COM_X, COM_Y, HINGE, MASS

GRAVITY_STD = 1.5e-3
"""Standard deviation of gravity where it is taken from a file, as a share of it: it is 9.780 to 9.832 m/s^2
at sea level, less on mountains, and the air carries a part in a thousand of what is light."""
STRING = 3e-4
"""Standard deviation of the mass of a thread that the file does not have: cotton has 0.03 g a metre, a string
of 1 mm 0.6 g [kg/m]."""
REFINED = 3
"""How often what follows from a further unknown is corrected by what it leaves."""
DENSITY_STD = float(np.log(1.6))
"""Standard deviation of the logarithm of a density of which nothing is known: from wood to steel."""


def gravity_share(found: Refined, fit: Fit) -> Share:
    """Return what it adds to the standard deviations that gravity is known no better than that.

    Gravity is taken for a further unknown about the file's value. Lengths follow from it, and masses and
    forces with them; where a length or a slide tells lengths as well, the motion knows gravity better than
    that, and it adds less. A thread that the file does not have acts like more gravity.

    Args:
        found: The optimum, and what is known there.
        fit: Its parameters and combinations, with the deviations that follow from what is known there.
    """
    mechanism = found.problem.mechanism_at(found.optimum.x)
    std = np.hypot(GRAVITY_STD * _taken(mechanism), _thread_share(mechanism))
    held = std > 0.0 and not mechanism.parameter("gravity").free
    return _share(found, fit, "gravity", float(std)) if held else Share({}, {})


def density_shares(found: Refined, fit: Fit) -> list[Share]:
    """Return what it adds to the standard deviations that nobody has stated densities.

    Args:
        found: The optimum, and what is known there.
        fit: As in ``gravity_share``.
    """
    return [_share(found, fit, name, DENSITY_STD) for name in taken_densities(found.problem.mechanism)]


def taken_densities(mechanism: Mechanism) -> list[str]:
    """Name the densities that are those of a bundled mechanism, where no thickness stands for them.

    Args:
        mechanism: The mechanism.
    """
    if not is_bundled(mechanism.source) or mechanism.torque == "free":
        return []
    names = {p.name for p in mechanism.parameters}
    return [
        p.name
        for p in mechanism.parameters
        if p.kind == "density"
        and not p.free
        and p.name not in mechanism.chosen
        and p.name.removesuffix("density") + "thickness" not in names
        and mechanism.parameter(f"{p.owner}.mass").follows
    ]


def _share(found: Refined, fit: Fit, name: str, std: float) -> Share:
    """Return what it adds that a parameter is known no better than by ``std`` of its logarithm."""
    problem, optimum = found.weighted, found.optimum
    larger = problem.of(problem.mechanism.with_choices(free=[name]))
    x = larger.unknowns.carried(optimum.x, problem.unknowns)
    moved = replace(
        optimum,
        trial=optimum.trial.at(x, optimum.trial.states),
        at_bound=np.isin(larger.unknowns.names, np.array(problem.unknowns.names)[optimum.at_bound]),
    )
    known = _with_its_share(found, larger, moved, name, std)
    # of deviations alone, which do not depend on the width of an interval
    return Share(
        added(fit.parameters, estimates(larger, moved, known, 1.0)),
        added(fit.combinations, combinations(larger, x, known, 1.0)),
    )


def _with_its_share(found: Refined, larger: Problem, moved: Optimum, name: str, std: float) -> Knowledge:
    """Return what is known with one further unknown.

    The others follow a change of its logarithm by r, which leaves residuals of squared size s for a unit of
    it; with its variance v = 1 / (1 / std^2 + s) they have the covariance v r r' in addition. (The
    covariance of all together would lose what it adds where a record is exact.)
    """
    problem, at = found.weighted, larger.unknowns.names.index(name)
    _, jacobian = larger.rows(moved.trial)
    others = np.delete(np.arange(jacobian.shape[2]), at)
    unshifted = problem.with_data(replace(problem.data, shifts=None))
    noise = knowledge_at(unshifted, found.optimum.x, jacobian[:, :, others], moved.trial.pieces)
    rows = without_states(jacobian, len(larger.unknowns), moved.trial.pieces)
    own, rest = rows[:, at], np.delete(rows, at, axis=1)
    follows, information = np.zeros(rest.shape[1]), problem.prior.information
    # what the others cannot follow is a small difference of large rows where a record is exact
    for _ in range(REFINED):
        follows -= noise.covariance @ (rest.T @ (own + rest @ follows) + information @ follows)
    left = float(np.sum((own + rest @ follows) ** 2) + follows @ information @ follows)
    variance = 1.0 / (std**-2.0 + left)
    along = np.insert(follows, at, 1.0)
    known = found.known
    covariance = np.insert(np.insert(known.covariance, at, 0.0, axis=0), at, 0.0, axis=1)
    covariance += variance * np.outer(along, along)
    deviations = np.where(np.isinf(np.insert(known.std, at, 0.0)), np.inf, np.sqrt(np.diag(covariance)))
    return Knowledge(
        covariance,
        np.insert(known.open, at, 0.0, axis=0) if known.open.size else np.zeros((len(along), 0)),
        np.insert(known.relative, at, 1.0),
        deviations,
        known.full,
    )


def _thread_share(mechanism: Mechanism) -> float:
    """Return by what share the thread of a ball that is alone in the file speeds up its swing like gravity.

    On a thread of mass m a ball of mass M swings like a point of mass at L (1 + m / 3M) / (1 + m / 2M).
    """
    radius, (mass, x, y) = mechanism.shapes.radius, mechanism.tree.links[0, [MASS, COM_X, COM_Y]]
    away, hangs = float(np.hypot(x, y)), mechanism.tree.kind[0] == HINGE and mechanism.torque != "free"
    balls = len(radius) > 0 and bool(np.all(np.diff(mechanism.shapes.first) == 1)) and away > radius.max()
    return STRING * away / (6.0 * float(mass)) if balls and hangs and len(mechanism.joints) == 1 else 0.0


def _taken(mechanism: Mechanism) -> bool:
    """Return whether gravity is the file's; free torques hold all sizes, whatever it is."""
    gravity = mechanism.parameter("gravity")
    held = not gravity.free and "gravity" not in mechanism.chosen
    return held and gravity.value > 0.0 and mechanism.torque != "free"
