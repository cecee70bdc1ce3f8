"""What a fit does not know, why, and which one further measurement would determine it: plain sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monodyn.estimation.fit import Estimate
from monodyn.estimation.parts import Premise
from monodyn.estimation.shooting.unknowns import CENTRE_KINDS
from monodyn.estimation.wording import listed
from monodyn.mechanism import Mechanism
from monodyn.mechanism.dimensions import MASS_KINDS

LENGTH_KINDS = ("length", "width", "tail", "tip", "extent", "along", "across", "gravity", "time_scale")
"""Kinds that are known together or not at all: sizes, and what makes time out of them."""


def open_parameters(
    mechanism: Mechanism,
    parameters: Sequence[Estimate],
    without_effect: Sequence[str],
    assumed: Sequence[str] = (),
    in_ratio: Sequence[str] = (),
) -> list[str]:
    """Name the parameters that the data leave open, and what would fix them.

    Args:
        mechanism: Gives the kinds of the parameters.
        parameters: The estimates.
        without_effect: Names of those on which nothing depends.
        assumed: Names of sizes that are about in the file's proportion, of which another sentence speaks.
        in_ratio: Names of those that are known against an inertia, so that only the scale of masses is open.

    Returns:
        Sentences.
    """
    kinds = {p.name: p.kind for p in mechanism.parameters}
    # open: no interval at all; weak: an interval that reaches a factor of e either way
    lost = [p.name for p in parameters if p.free and not np.isfinite(p.std) and p.name not in without_effect]
    weak = [p.name for p in parameters if p.free and np.isfinite(p.std) and not p.identifiable]
    lost, weak = ([name for name in names if name not in assumed] for names in (lost, weak))
    # a centre of mass is open only where inertias act together, as those of free bodies do
    regrouped = any(kinds[name] == "com_x" for name in lost)
    masses = [name for name in lost if kinds[name] in MASS_KINDS]
    centres = [name for name in lost if kinds[name] in CENTRE_KINDS]
    lengths = [name for name in lost if kinds[name] in LENGTH_KINDS]
    advice = []
    if regrouped:
        advice.append(
            "Planar motion fixes how the inertias of free bodies act together (see the combinations), not "
            f"{listed([*masses, *centres], 20)} one by one; measured masses and centres of mass, given with "
            "--fix, would fix the rest."
        )
    elif masses:
        advice.append(
            Premise(
                f"The motion fixes {listed(masses, 12)} only in ratios (see the combinations); one of them, "
                "measured and given with --fix, fixes the mass scale."
            )
        )
    if lengths:
        advice.append(_open_lengths(lengths))
    if without_effect:
        verb, it = ("does", "it") if len(without_effect) == 1 else ("do", "them")
        advice.append(
            f"{listed(without_effect, 12)} {verb} not change the motion, which cannot determine {it}."
        )
    scaled = [name for name in weak if name in in_ratio]
    if scaled:
        advice.append(
            f"The data show {listed(scaled)} against the inertias (see the combinations), and hardly by "
            "itself: no longer record would, but a measured mass, density or thickness, given with --fix."
        )
    weak = [name for name in weak if name not in scaled]
    if weak:
        advice.append(
            f"The data hardly fix {listed(weak)}: the error is as large as the value; a longer record or a "
            "livelier motion would help."
        )
    return advice


def _open_lengths(names: Sequence[str]) -> str:
    """Report that the data leave the scale of lengths open, and what would fix it."""
    them = listed(names, 12)
    # one of length, gravity and clock follows from the other two: which measurement helps depends on which
    # are open
    sizes = [name for name in names if name not in ("gravity", "time_scale")]
    if "time_scale" not in names:
        return (
            f"The data do not fix {them} one by one; a measured length, or known values of gravity and of "
            "the time scale, given with --fix, would fix them."
        )
    rate = "the true frame rate (--rate for a clip, or --fix time_scale=VALUE)"
    if not sizes:
        return f"The data do not fix {them} one by one; {rate} or the value of gravity would fix the rest."
    known = f"A measured length, given with --fix, or {rate} would fix them."
    if "gravity" in names:
        known = f"Two of these would fix them: a measured length, the value of gravity, {rate}."
    return (
        f"The data do not fix {them} one by one: lengths are only known up to the time scale (see the "
        f"combinations). {known}"
    )


def without_use(names: Sequence[str]) -> list[str]:
    """Name the given values on which nothing depends, as thicknesses of bodies whose file states the mass.

    Args:
        names: Names of the parameters.

    Returns:
        Sentences; none without names.
    """
    if not names:
        return []
    verb = "was" if len(names) == 1 else "were"
    return [
        f"{listed(names, 12)} {verb} given, but the motion of this mechanism does not depend on "
        f"{'it' if len(names) == 1 else 'them'}: its file states masses; give those."
    ]


def nothing_seen(parameters: Sequence[Estimate]) -> list[str]:
    """Name the parameters that came out as zero.

    Args:
        parameters: The estimates.

    Returns:
        Sentences; none where there are none.
    """
    zero = [p.name for p in parameters if p.at_bound and p.value == 0]
    return (
        [f"{listed(zero)} came out as zero, the smallest value allowed: too small to be seen."]
        if zero
        else []
    )
