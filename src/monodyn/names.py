"""Which name was meant, and which there are: the end of a message about one that is not known."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher

MOST = 12
"""Names that are written out where none is near; the rest are counted."""
NEAR, NEAREST = 0.8, 2
"""Likeness from which on a name may have been meant, from 0 to 1; and how many are asked about."""


def known(what: str, names: Sequence[str], given: str) -> str:
    """Write which name may have been meant, or which names there are.

    Args:
        what: What the names are of, in the plural.
        names: All that are known.
        given: The one that is not.

    Returns:
        The end of a sentence with its stop: ``did you mean 'joint1'?`` or ``joints: 'joint1', 'joint2'.``.

    Example:
        >>> known("joints", ["joint1", "joint2"], "elbow")
        "joints: 'joint1', 'joint2'."
    """
    if meant := near(names, given):
        return f"did you mean {' or '.join(map(repr, meant))}?"
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return f"{what}: {', '.join(map(repr, names[:MOST]))}{more}."


def near(names: Sequence[str], given: str) -> list[str]:
    """Return the names that may have been meant, the likeliest first, at most ``NEAREST``.

    Args:
        names: All that are known.
        given: The one that is not.
    """
    likeness = {name: _likeness(name, given) for name in names}
    best = sorted(likeness, key=lambda name: likeness[name], reverse=True)[:NEAREST]
    return [name for name in best if likeness[name] >= NEAR]


def _likeness(name: str, given: str) -> float:
    """Return how alike two names are, from 0 to 1; that they are of the same group says nothing."""
    group, _, own = name.rpartition(".")
    given_group, _, given_own = given.rpartition(".")
    pair = (own, given_own) if group == given_group else (name, given)
    return SequenceMatcher(None, *pair).ratio()
