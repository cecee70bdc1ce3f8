"""What was made of a run as one self-contained page: what was asked, what came of it, figures, links.

A prediction and a controller have one each; it looks as the report of the run does, to which it leads back.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from monodyn.estimation.fit import Fit
from monodyn.results.page import plotting_script, template


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        title: Its heading.
        head: Headings of the columns.
        rows: Cells by row.
        note: A sentence below it.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


@dataclass(frozen=True)
class Sequel:
    """What a page says.

    Attributes:
        title: Its heading.
        subtitle: One line below it.
        grade: That of the fit, or ``refused`` where what was asked came to nothing; the colour of the status.
        status: What came of it, a sentence.
        notes: What one should know about it, in sentences.
        facts: Few numbers, each with a label.
        asked: What was asked, by name.
        plots: Data of the figures, as in `curves`.
        legend: Colours of the figures, each with what is drawn in it.
        tables: Tables between what was asked and the figures.
    """

    title: str
    subtitle: str
    grade: str
    status: str
    notes: Sequence[str]
    facts: Sequence[tuple[str, str]]
    asked: Sequence[tuple[str, str]]
    plots: Sequence[dict[str, Any]]
    legend: Sequence[tuple[str, str]]
    tables: Sequence[Table] = ()


def sequel_text(page: Sequel, files: Sequence[str], run: Path, out: Path) -> str:
    """Return a page as HTML text.

    Args:
        page: What it says.
        files: Names of the files that stand next to it.
        run: The run folder, whose report is linked to where there is one.
        out: The folder of the page.
    """
    from markupsafe import Markup

    return template("monodyn.results", "sequel.html.j2").render(
        page=page, files=files, report=_link(run / "report.html", out), plotly=Markup(plotting_script())
    )


def notes_of(fit: Fit, notes: Sequence[str]) -> list[str]:
    """Return the notes of a page, after what is left of a fit that is no more than approximate.

    Args:
        fit: The fit.
        notes: What one should know besides.
    """
    return [*([fit.status] if fit.grade == "approximate" else []), *notes]


def _link(file: Path, folder: Path) -> str:
    """Return how a page in a folder refers to a file; empty where there is none."""
    if not file.is_file():
        return ""
    try:
        return quote(Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix())
    # on another drive there is no relative way
    except ValueError:
        return file.resolve().as_uri()
