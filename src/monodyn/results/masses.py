"""What determines masses themselves, where the motion alone shows their ratios."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from monodyn.mechanism.dimensions import MASS_KINDS

if TYPE_CHECKING:
    from monodyn.estimation.fit import Fit

MassScale = Literal["torques", "given"]
"""Known torques, or something given that is in proportion to the masses."""


def mass_scale(fit: Fit) -> MassScale | None:
    """Return what determines masses themselves; None where only their ratios are known.

    Args:
        fit: The fit.

    Returns:
        ``"torques"`` that are known; ``"given"`` where a mass, a friction or the like was.
    """
    kinds = {p.name: p.kind for p in fit.mechanism.parameters}
    told = given_scale(fit)
    heavy = [p for p in fit.parameters if kinds.get(p.name) in ("mass", "inertia")]
    found = any(0.0 < p.std < abs(p.value) for p in heavy)
    # not of the log, which a run that was read back may not have
    if found and fit.torque == "known":
        return "torques"
    return "given" if found or any(p.name in told for p in heavy) else None


def given_scale(fit: Fit) -> list[str]:
    """Return the names of what the user gave that is in proportion to the masses.

    Args:
        fit: The fit.
    """
    mechanism = fit.mechanism
    rows = (p for p in mechanism.parameters if p.name in mechanism.chosen and not p.free)
    # no friction is none at all scales
    return [p.name for p in rows if p.kind in MASS_KINDS and p.value != 0.0]
