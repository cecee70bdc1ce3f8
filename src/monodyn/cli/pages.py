"""Pages of text as wide as the terminal: paragraphs, command lines that can be copied, two columns."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Iterable
from pathlib import Path

WIDEST, LEAST = 100, 24
"""Columns of a page: longer lines are hard to read; a narrower terminal breaks them itself."""
NARROW = 64
"""Columns below which the second column stands under the first, not beside it."""

TOGETHER = "\N{NO-BREAK SPACE}"


def usage() -> str:
    """Return the page of all commands, its lines as long as they are."""
    return (Path(__file__).parent / "help.txt").read_text(encoding="utf-8")


def width() -> int:
    """Return how many columns a page has."""
    return max(LEAST, min(WIDEST, shutil.get_terminal_size().columns))


def paragraph(text: str, first: str = "", others: str | None = None) -> list[str]:
    """Return the lines of a text; no word is broken.

    Args:
        text: The text.
        first: What stands before the first line.
        others: What stands before the others; the same when left out.
    """
    return textwrap.wrap(
        text, width(), initial_indent=first, subsequent_indent=first if others is None else others,
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip


def command_line(text: str, indent: str = "") -> list[str]:
    """Return the lines of a command, with what has a shell read them as one.

    Args:
        text: The command.
        indent: What stands before its lines.
    """
    # an option and its value stay together
    bound = re.sub(r"(--\S+) (?!-)", rf"\1{TOGETHER}", text)
    lines = textwrap.wrap(
        bound, width() - 2, initial_indent=indent, subsequent_indent=f"{indent}    ", break_on_hyphens=False,
        break_long_words=False,
    )  # fmt: skip
    lines = [line.replace(TOGETHER, " ") for line in lines]
    return [*(f"{line} \\" for line in lines[:-1]), *lines[-1:]]


def two_columns(rows: Iterable[tuple[str, str]], at: int = 26) -> list[str]:
    """Return rows of two columns as lines.

    Args:
        rows: A name, and what is said of it.
        at: Where the second column begins.
    """
    lines: list[str] = []
    wide = width() >= NARROW
    for left, right in rows:
        said = paragraph(right, " " * (at if wide else 6))
        if wide and len(left) <= at - 4 and said:
            said[0] = f"  {left:{at - 2}}{said[0].lstrip()}"
        else:
            lines += paragraph(left, "  ", "    ")
        lines += said
    return lines


def fitted(text: str) -> str:
    """Return a page whose lines may be too wide, with paragraphs, commands and two columns that fit.

    Args:
        text: The page; a line that begins with two blanks is a command, or a row of two columns.
    """
    lines: list[str] = []
    for line in text.splitlines():
        row = re.fullmatch(r"  (\S+)(\s+)(\S.*)", line)
        if line.startswith("  monodyn "):
            lines += command_line(line.strip(), "  ")
        elif row:
            lines += two_columns([(row[1], row[3])], 2 + len(row[1]) + len(row[2]))
        else:
            lines += paragraph(line) or [""]
    return "\n".join(lines) + "\n"
