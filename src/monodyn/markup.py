"""What a prompt and a notebook show of an object: one line, and HTML with tables.

A notebook brings its own fonts and colours: only the sides on which words and numbers stand are said here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

MOST_NAMES = 4
"""Names that a line lists; of more it says how many they are."""


def brief(names: Sequence[str], what: str) -> str:
    """Return a few names, or how many there are of many.

    Args:
        names: The names.
        what: What they are names of, in the plural.
    """
    return f"{len(names)} {what}" if len(names) > MOST_NAMES else ", ".join(names) or f"no {what}"


def counted(count: int, what: str) -> str:
    """Return a number of things in words.

    Args:
        count: How many.
        what: One of them; several have an s at the end.
    """
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def stretch(times: Sequence[float]) -> str:
    """Return from when to when a record goes.

    Args:
        times: Time stamps [s], increasing.
    """
    return f"{times[0]:.2f} to {times[-1]:.2f} s" if len(times) else "no time"


def card(line: str, *parts: str) -> str:
    """Return an object as HTML.

    Args:
        line: The one line that a prompt shows, within <>.
        parts: What stands below, HTML.
    """
    return f"<div><p><b>{escape(line.removeprefix('<').removesuffix('>'))}</b></p>{''.join(parts)}</div>"


def sentences(texts: Iterable[str]) -> str:
    """Return sentences as HTML, each a paragraph.

    Args:
        texts: The sentences.
    """
    return "".join(f"<p>{escape(text)}</p>" for text in texts)


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, words: Sequence[str] = ()) -> str:
    """Return a table as HTML.

    Args:
        columns: Headings; the first column has words, the others numbers, which stand to the right.
        rows: Cells of each row.
        words: Headings of further columns with words.
    """
    sides = ["left" if i == 0 or name in words else "right" for i, name in enumerate(columns)]

    def row(tag: str, cells: Sequence[str]) -> str:
        parts = [
            f'<{tag} style="text-align:{side}">{escape(cell)}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        ]
        return f"<tr>{''.join(parts)}</tr>"

    body = "".join(row("td", cells) for cells in rows)
    return f"<table><thead>{row('th', columns)}</thead><tbody>{body}</tbody></table>"
