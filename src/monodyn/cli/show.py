"""Progress on the error stream, results on the standard output."""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from monodyn.types import Progress

if TYPE_CHECKING:
    from rich.table import Table

    from monodyn.pipeline import Outcome

STYLES = {"trusted": "bold green", "approximate": "bold yellow", "refused": "bold red"}
"""How the status is shown, by grade."""
WIDEST = 10_000
"""Columns of what tables are laid out on."""
USUAL = 80
"""Columns of a terminal that does not say how many it has."""
BESIDE = 48
"""Columns beside a bar: what it is of, how many, how fast and how long still."""
NARROWEST = BESIDE + 8
"""Columns of a terminal below which progress is written in lines, as where there is none."""


@contextmanager
def progress_on(stream: TextIO, *, quiet: bool) -> Iterator[Progress | None]:
    """Yield a bar with frames a second for every step, or plain lines where the stream is no terminal.

    Args:
        stream: Where to.
        quiet: Show nothing and yield None.
    """
    if quiet:
        yield None
    elif width := drawable(stream):
        yield from _bars(stream, width)
    else:
        lines = _ProgressLines(stream)
        try:
            yield lines
            lines.end()
        finally:
            lines.close()


def drawable(stream: TextIO) -> int:
    """Return the columns of a terminal that can be drawn on: 0 where it is too narrow, or is none.

    Args:
        stream: The terminal, or what is none.
    """
    if not stream.isatty():
        return 0
    said, width = os.environ.get("COLUMNS", ""), USUAL
    if said.isdecimal():
        width = int(said)
    else:
        with suppress(OSError, ValueError):
            # a terminal without a size says 0
            width = os.get_terminal_size(stream.fileno()).columns or USUAL
    return width if width >= NARROWEST else 0


def _bars(stream: TextIO, width: int) -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        # it turns while a step takes long
        SpinnerColumn(finished_text=" "),
        TextColumn("{task.description:<12}"),
        BarColumn(bar_width=max(1, min(32, width - BESIDE))),
        MofNCompleteColumn(),
        TextColumn("{task.fields[speed]:>9}"),
        TimeRemainingColumn(compact=True),
    )
    begun: dict[str, tuple[Any, float]] = {}
    with Progress(
        *columns, console=Console(file=stream, stderr=True, width=width), refresh_per_second=8
    ) as bars:

        def progress(step: str, done: int, total: int | None) -> None:
            if step not in begun:
                begun[step] = (bars.add_task(step, total=total, speed=""), time.perf_counter())
            task, start = begun[step]
            speed = _speed(done, time.perf_counter() - start) if done > 1 else ""
            bars.update(task, completed=done, total=total, speed=speed)

        yield progress


def _speed(done: int, seconds: float) -> str:
    """Write how many are done in a second; nothing for steps that take longer than that."""
    rate = done / max(seconds, 1e-6)
    return f"{rate:.0f}/s" if rate >= 1.0 else ""


class _ProgressLines:
    """One line for every step when it ends, and one every ten seconds while it goes on, also where it is not
    heard of for longer."""

    def __init__(self, stream: TextIO, every: float = 10.0) -> None:
        self.stream, self.every = stream, every
        self.step, self.done, self.total = "", 0, None
        self.begun = self.printed = time.perf_counter()
        self._turn, self._closed = threading.Lock(), threading.Event()
        threading.Thread(target=self._watch, name="progress", daemon=True).start()

    def __call__(self, step: str, done: int, total: int | None) -> None:
        with self._turn:
            now = time.perf_counter()
            if step != self.step:
                self._end(now)
                self.step, self.begun, self.printed = step, now, now
            self.done, self.total = done, total
            self._print_if_due(now)

    def end(self) -> None:
        """Print the line of the last step."""
        with self._turn:
            self._end(time.perf_counter())

    def close(self) -> None:
        """Print nothing more."""
        self._closed.set()

    def _watch(self) -> None:
        # a stream that is gone is complained of where something is told
        with suppress(OSError, ValueError):
            while not self._closed.wait(self.every / 4.0):
                with self._turn:
                    self._print_if_due(time.perf_counter())

    def _print_if_due(self, now: float) -> None:
        if self.step and now - self.printed > self.every:
            self._print_line(now)

    def _end(self, now: float) -> None:
        if self.step:
            self._print_line(now)
        self.step = ""

    def _print_line(self, now: float) -> None:
        self.printed = now
        share = f"{self.done}" if self.total is None else f"{self.done} of {self.total}"
        spent = now - self.begun
        parts = [
            f"{self.step}: {share}",
            _speed(self.done, spent),
            f"{spent:.0f} s" if spent > self.every else "",
        ]
        print(", ".join(part for part in parts if part), file=self.stream, flush=True)


def show(outcome: Outcome, *, as_json: bool, quiet: bool) -> int:
    """Print what a command found and return the exit code.

    Args:
        outcome: What was found.
        as_json: As JSON, and nothing else.
        quiet: Print no table.

    Returns:
        0, or 1 when the fit is not to be trusted.
    """
    whole = _print_tracking if outcome.fit is None else _print_fit
    trusted = outcome.fit is None or outcome.fit.ok
    return show_result(
        outcome.document, outcome.folder, None if trusted else str(outcome.document["status"]),
        lambda: whole(outcome), as_json=as_json, quiet=quiet,
    )  # fmt: skip


def show_result(
    document: Mapping[str, Any],
    folder: Path | None,
    refusal: str | None,
    whole: Callable[[], None],
    *,
    as_json: bool,
    quiet: bool,
) -> int:
    """Print a result and return the exit code.

    Args:
        document: The result as JSON has it.
        folder: Where its files are; None where none were written.
        refusal: Why it is not to be relied on; None where it is.
        whole: Prints all of it as text.
        as_json: As JSON, and nothing else.
        quiet: Print nothing but the refusal, on the error stream.

    Returns:
        0, or 1 where there is a refusal.
    """
    from monodyn.cli.streams import printing

    with printing():
        if as_json:
            from monodyn.results.export import jsonable

            # what cannot be encoded is escaped: a replaced character would be lost to the reader
            ascii_only = "utf" not in (getattr(sys.stdout, "encoding", None) or "utf").lower()
            found = jsonable({**document, "out": None if folder is None else str(folder)})
            print(json.dumps(found, indent=2, ensure_ascii=ascii_only, allow_nan=False))
        elif not quiet:
            whole()
        elif refusal is not None:
            print(f"monodyn: {refusal}", file=sys.stderr)
    return 0 if refusal is None else 1


def console() -> Any:
    """Return what writes tables and sentences on the standard output."""
    from rich.console import Console

    class PipeConsole(Console):
        # rich would end the process; a reader that has gone away must reach ``printing`` as an error
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    # no cell of a table is cut, whatever the terminal says of its width: it breaks lines that are too long
    return PipeConsole(highlight=False, soft_wrap=True, width=WIDEST)


def _print_comparison(out: Any, rows: list[dict[str, Any]]) -> None:
    if rows:
        out.print(f"model: {rows[0]['model']}", style="bold", markup=False)
    for row in rows:
        out.print(f"- {row['model']}: {row['said']}", markup=False)


def _print_tracking(outcome: Outcome) -> None:
    from monodyn.checks import tracked_share

    out = console()
    _print_comparison(out, outcome.document["comparison"])
    poses = outcome.poses
    out.print(f"{tracked_share(poses, f'{len(poses)} frames')} ({sum(outcome.seconds.values()):.1f} s).")
    for note in outcome.notes:
        out.print(f"- {note}", markup=False)
    out.print(f"poses: {outcome.folder}/poses.csv", markup=False)


def _print_fit(outcome: Outcome) -> None:
    from monodyn.numbers import known_or
    from monodyn.results.findings import REFUSED, listed_rows

    out = console()
    document, fit = outcome.document, outcome.fit
    _print_comparison(out, document["comparison"])
    if document["tried_torques"]:
        out.print("What acts at the joints, the likeliest first:")
    for row in document["tried_torques"]:
        out.print(f"- {row['kind']}: {row['said']}", markup=False)
    if document["grade"] == "refused" and fit is not None:
        out.print(REFUSED, style=STYLES["refused"], markup=False)
    names = set() if fit is None else {row.name for row in listed_rows(fit)}
    if names:
        out.print(_parameters([row for row in document["parameters"] if row["name"] in names]))
    if document["combinations"]:
        out.print(_combinations(document["combinations"]))
    out.print(_errors(outcome))
    # the status of an approximate fit says so itself
    grade = "" if document["grade"] == "approximate" else f"{document['grade'].capitalize()}. "
    out.print(f"{grade}{document['status']}", style=STYLES[document["grade"]], markup=False)
    if document["horizon"]:
        count = len(document["horizon"])
        # null is beyond all that was looked at
        shortest = min(document["horizon"], key=lambda row: known_or(row["seconds"], math.inf))
        which = f"Of {count} records the shortest: " if count > 1 else ""
        out.print(f"{which}{shortest['said']}", markup=False)
    for sentence in document["advice"]:
        out.print(f"- {sentence}", markup=False)
    if outcome.folder is not None:
        out.print(f"report: {outcome.folder}/report.html", markup=False)


def plain_table(*columns: str, left: int = 1) -> Table:
    """Return an empty table.

    Args:
        columns: Their headings.
        left: How many of them stand to the left; the others hold numbers.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(
            Text(column), justify="left" if i < left or column == "unit" else "right", no_wrap=True
        )
    return table


def _parameters(rows: list[dict[str, Any]]) -> Table:
    from monodyn.numbers import interval, number

    table = plain_table("parameter", "value", "95 % interval", "unit")
    for row in rows:
        std = row["std"]
        within = interval(
            row["lower"], row["upper"], std, free=row["free"], known=row["identifiable"],
            at_bound=row["at_bound"],
        )  # fmt: skip
        table.add_row(row["name"], number(row["value"], std), within, row["unit"])
    return table


def _combinations(rows: list[dict[str, Any]]) -> Table:
    from monodyn.numbers import number, short

    table = plain_table("combination", "value", "standard deviation", "unit")
    for row in rows:
        table.add_row(row["name"], number(row["value"], row["std"]), short(row["std"]), row["unit"])
    return table


def _errors(outcome: Outcome) -> Table:
    from monodyn.numbers import shown_in

    fit, document = outcome.fit, outcome.document
    table = plain_table("joint", "fit rms", "prediction rms", "unit")
    # a joint that was not predicted, or not measured, has no error
    for joint in fit.mechanism.joints if fit is not None else ():
        scale, unit = shown_in(joint)
        # of several records the worst
        ahead = [rms[joint.name] for rms in document["heldout_rms"] if rms.get(joint.name) is not None]
        cells = [document["rms"].get(joint.name), max(ahead, default=None)]
        texts = ["–" if cell is None else f"{cell * scale:.3g}" for cell in cells]
        table.add_row(joint.name, *texts, unit)
    return table


def show_models(*, as_json: bool) -> int:
    """Return the exit code, 0, after printing the bundled mechanisms.

    Args:
        as_json: As JSON.
    """
    from monodyn.cli.streams import printing

    with printing():
        _print_models(as_json)
    return 0


def _print_models(as_json: bool) -> None:
    # what ``load`` says of them, so that neither MuJoCo nor the kernels are needed for a list
    text = (Path(__file__).parent / "models.json").read_text(encoding="utf-8")
    if as_json:
        print(text, end="")
        return
    table = plain_table("model", "joints", "lengths [m]", left=3)
    for row in json.loads(text):
        lengths = ", ".join(f"{value:g}" for value in row["lengths"].values())
        table.add_row(row["name"], ", ".join(row["joints"]), lengths)
    out = console()
    out.print(table)
    out.print(
        "chain:N has N hinges, 1 to 10; shown for 3. Any MJCF or URDF file of a planar mechanism works too."
    )
