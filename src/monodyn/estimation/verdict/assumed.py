"""What a fit took from the file because nothing determines it: plain sentences."""

from __future__ import annotations

from collections.abc import Sequence

from monodyn.estimation.wording import listed
from monodyn.mechanism import Parameter


def proportions(assumed: Sequence[Parameter]) -> list[str]:
    """Name the sizes that count in the motion and that neither a picture nor the motion determines.

    Args:
        assumed: Sizes and places that keep about their proportion in the file.

    Returns:
        Sentences.
    """
    if not assumed:
        return []
    names = [p.name for p in assumed]
    if len(names) == 1:
        return [
            f"Neither a picture nor this motion determines {names[0]}: within a factor of 1.6 (one "
            "standard deviation) it is taken in "
            "proportion to the length of its body, as in the file, and the intervals contain that; a "
            "measured value, given with --fix, would make them narrower."
        ]
    return [
        f"Neither a picture nor this motion determines {listed(names, 12)}: within a factor of 1.6 (one "
        "standard deviation) they are "
        "taken in proportion to the length of their body, as in the file, and the intervals contain that; "
        "measured values, given with --fix, would make them narrower."
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
