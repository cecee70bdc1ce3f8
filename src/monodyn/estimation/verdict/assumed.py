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
    it, its, value = _number(assumed)
    return [
        f"Neither a picture nor this motion determines {_listed(assumed)}: within a factor of 1.6 (one "
        f"standard deviation) {it} taken in proportion to the length of {its} body, as in the file, and the "
        f"intervals contain that; {value}, given with --fix, would make them narrower."
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
    it, its, value = _number(assumed)
    return [
        "No picture shows a thickness along the line of sight, and the motion hardly determines "
        f"{_listed(assumed)}: within a factor of 2 {it} taken in proportion to the main geom of {its} body, "
        f"as in the file; the lengths depend on it, so give {value} with --fix."
    ]


def _listed(assumed: Sequence[Parameter]) -> str:
    return listed([p.name for p in assumed], 12)


def _number(assumed: Sequence[Parameter]) -> tuple[str, str, str]:
    """Return the words of a sentence that depend on whether it is about one or several."""
    if len(assumed) == 1:
        return "it is", "its", "a measured value"
    return "they are", "their", "measured values"
