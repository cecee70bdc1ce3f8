"""Which name was meant, and which there are: the end of a message about one that is not known."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher
from pathlib import Path

MOST, MOST_LETTERS = 12, 160
"""Names that are written out where none is near, and their letters; the rest are counted."""
LONGEST = 60
"""Letters of a name that are written out; the middle of a longer one is left out."""
NEAR, NEAREST = 0.8, 2
"""Likeness from which on a name may have been meant, from 0 to 1; and how many are asked about."""
MOST_ERRORS = 2
"""Letters that were left out, added, exchanged or mistaken, at most, in a name that may have been meant."""
ALIKE = 0.09
"""What is so much less alike than the likeliest was not meant."""
MOST_FILES = 1000
"""Files of a folder that are looked at for one that may have been meant."""


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
    return meant(near(names, given)) or f"{what}: {quoted(names)}."


def meant(names: Sequence[str]) -> str:
    """Ask whether one of a few names was meant; nothing where there is none.

    Args:
        names: The names, the likeliest first.

    Returns:
        The end of a sentence with its stop, or nothing.
    """
    return f"did you mean {' or '.join(repr(name) for name in names)}?" if names else ""


def quoted(names: Sequence[str]) -> str:
    """Return names between quotes with commas between them, as many as are read; the rest are counted.

    Args:
        names: The names.
    """
    said = [repr(short(name)) for name in names[:MOST]]
    while len(said) > 1 and len(", ".join(said)) > MOST_LETTERS:
        said.pop()
    more = f" and {len(names) - len(said)} more" if len(names) > len(said) else ""
    return f"{', '.join(said)}{more}"


def short(name: str, most: int = LONGEST) -> str:
    """Return a name, the middle left out where it is a long one.

    Args:
        name: The name.
        most: Letters that are left.
    """
    begin = most * 2 // 3
    return name if len(name) <= most else f"{name[:begin]}...{name[begin + 3 - most :]}"


def near(names: Sequence[str], given: str, *, grouped: bool = True) -> list[str]:
    """Return the names that may have been meant, the likeliest first, at most ``NEAREST``.

    Args:
        names: All that are known.
        given: The one that is not.
        grouped: False for names whose last dot does not divide a group from what is in it.
    """
    likeness = {name: _likeness(name, given, grouped) for name in names}
    best = sorted(likeness, key=lambda name: likeness[name], reverse=True)[:NEAREST]
    return [name for name in best if likeness[name] >= max(NEAR, likeness[best[0]] - ALIKE)]


def near_files(path: Path, endings: Sequence[str] = ()) -> list[str]:
    """Return the files next to one that does not exist that may have been meant, at most ``NEAREST``.

    Args:
        path: The one that does not exist.
        endings: How their names may end; any where there is none.
    """
    try:
        there = [each.name for each, _ in zip(path.parent.iterdir(), range(MOST_FILES), strict=False)]
    except (OSError, ValueError):
        return []
    names = sorted(name for name in there if not endings or name.endswith(tuple(endings)))
    return [str(path.with_name(name)) for name in near(names, path.name, grouped=False)]


def _likeness(name: str, given: str, grouped: bool) -> float:
    """Return how alike two names are, from 0 to 1; that they are of the same group says nothing."""
    # a name of a thousand letters was not meant to be any of these, and comparing takes their product
    if len(given) > 2 * LONGEST:
        return 0.0
    name, given = name.casefold(), given.casefold()
    group, _, own = name.rpartition(".")
    given_group, _, given_own = given.rpartition(".")
    pair = (own, given_own) if grouped and group == given_group else (name, given)
    # a slip weighs so much that there may be one in three letters, and no more than two
    errors, letters = _errors(*pair), min(map(len, pair))
    few = 1.0 - (1.0 - NEAR) * 3 * errors / letters if errors <= MOST_ERRORS and letters else 0.0
    return max(SequenceMatcher(None, *pair).ratio(), few)


def _errors(one: str, other: str) -> int:
    """Return how many slips make one word of another: letters left out, added, mistaken, or exchanged.

    Source: F. J. Damerau, A technique for computer detection and correction of spelling errors,
    Communications of the ACM 7 (1964), as the optimal string alignment.
    """
    if abs(len(one) - len(other)) > MOST_ERRORS:
        return MOST_ERRORS + 1
    before: list[int] = []
    last = list(range(len(other) + 1))
    for i, letter in enumerate(one, 1):
        row = [i]
        for j, its in enumerate(other, 1):
            row.append(min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != its)))
            if i > 1 and j > 1 and letter == other[j - 2] and its == one[i - 2]:
                row[j] = min(row[j], before[j - 2] + 1)
        before, last = last, row
    return last[-1]
