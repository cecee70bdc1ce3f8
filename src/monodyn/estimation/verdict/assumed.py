"""What a fit took from the file because nothing determines it: plain sentences."""

from __future__ import annotations

from collections.abc import Sequence

from monodyn.estimation.wording import listed
from monodyn.mechanism import Parameter


def proportions(tied: Sequence[Parameter]) -> list[str]:
    """Name the sizes that count in the motion and were neither measured nor estimated.

    Args:
        tied: Parameters that keep their proportion to a length.

    Returns:
        Sentences.
    """
    names = [p.name for p in tied if p.kind in ("width", "tail", "tip", "extent", "along", "across")]
    if not names:
        return []
    if len(names) == 1:
        return [
            f"Nothing determines {names[0]}; it keeps its proportion to the length of its body, and the "
            "intervals take that for exact. Give a measured value with --fix where its share of the inertia "
            "counts."
        ]
    return [
        f"Nothing determines {listed(names, 12)}; they keep their proportion to the length of their body, "
        "and the intervals take that for exact. Give measured values with --fix where their share of the "
        "inertia counts."
    ]


def thicknesses(assumed: Sequence[Parameter]) -> list[str]:
    """Name the thicknesses that keep about their proportion in the file because the motion does not fix them.

    Args:
        assumed: Parameters of kind thickness.

    Returns:
        Sentences.
    """
    if not assumed:
        return []
    names = [p.name for p in assumed]
    if len(names) == 1:
        return [
            "No picture shows a thickness along the line of sight, and the motion hardly determines "
            f"{names[0]}: within a factor of 2 it is taken in proportion to the main geom of its body, as in "
            "the file; the lengths depend on it, so give a measured value with --fix."
        ]
    return [
        "No picture shows a thickness along the line of sight, and the motion hardly determines "
        f"{listed(names, 12)}: within a factor of 2 they are taken in proportion to the main geom of their "
        "body, as in the file; the lengths depend on it, so give measured values with --fix."
    ]
