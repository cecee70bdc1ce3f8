"""What one should know about a controller, in sentences: its draws, its rate, the turn on which it ends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.estimation.fit import Fit
from monodyn.estimation.wording import percent
from monodyn.results.regulator import FALLEN, Regulator

ENOUGH = 20
"""Draws from which on it says something that all of them are held: up to one in seven may not be."""


def draws_said(held: int, draws: int) -> list[str]:
    """Say what it means for the true mechanism how many draws of it a controller holds.

    Args:
        held: How many of them.
        draws: How many were drawn.

    Returns:
        A sentence; none where enough were drawn, and all are held.

    Source:
        Clopper and Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
        1934: the upper limit of the share that is not held.
    """
    if not draws or held == draws >= ENOUGH:
        return []
    from scipy.special import betaincinv

    lost = draws - held
    most = 1.0 if lost == draws else float(betaincinv(lost + 1, held, 0.95))
    if 2 * held < draws:
        return [
            "The data do not tell the mechanism well enough for this controller: it is not one for the true "
            "mechanism. Film what the report of the run advises, or choose another equilibrium or motor."
        ]
    if lost:
        return [
            f"The true mechanism is one that it does not hold with a chance of up to {percent(most)} (95 % "
            "sure): film what the report of the run advises, or weigh the torques otherwise (--allowed "
            "effort=SHARE)."
        ]
    return [
        f"That all of {draws} are held says little: up to {percent(most)} of those that the data allow may "
        f"not be (95 % sure); {ENOUGH} draws or more say it better."
    ]


def undrawn(fit: Fit, count: int) -> str:
    """Return why no mechanisms were drawn, the beginning of a sentence.

    Args:
        fit: The identified mechanism.
        count: How many were asked for.
    """
    if count == 0:
        return "No mechanisms were drawn"
    if not fit.shared:
        why = "nothing of the mechanism was estimated"
    elif not np.all(np.isfinite(fit.shared_covariance)):
        why = "the fit does not say how well its parameters are known"
    else:
        why = "what the data allow reaches beyond the bounds of the parameters"
    return f"None of the {count} mechanisms were drawn, as {why}"


def seldom(regulator: Regulator) -> list[str]:
    """Return a note where a mechanism falls too far from one measurement to the next; none else.

    Args:
        regulator: What holds it.
    """
    falls = regulator.falls
    if falls < FALLEN:
        return []
    return [
        f"From one measurement to the next, {1.0 / regulator.rate:.3g} s, it falls {falls:.2g} times as far "
        "from the equilibrium as it was, which leaves no room for any error of the model: measure more often "
        "with --rate."
    ]


def turned(joints: Sequence[str], asked: np.ndarray, reached: np.ndarray) -> list[str]:
    """Return a note where a swing ends on another turn than was asked for; none else.

    Args:
        joints: Names of the joints.
        asked: The equilibrium that was asked for [rad or m], (dof,).
        reached: Where the swing ends [rad or m], (dof,).
    """
    ends = [
        f"{name}={there:.6g}"
        for name, there, here in zip(joints, reached, asked, strict=True)
        if abs(there - here) > np.pi
    ]
    if not ends:
        return []
    return [
        "The swing reaches the equilibrium on another turn: counted on from its start, as control.json has "
        f"it, it is at {', '.join(ends)}."
    ]
