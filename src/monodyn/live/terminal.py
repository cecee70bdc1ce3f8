"""What is known of a stream on a terminal, drawn anew a few times a second; plain lines elsewhere."""

from __future__ import annotations

import math
import threading
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

from monodyn.live.document import hardly_known, shown_pose
from monodyn.live.meter import Meter, Pace, Spread
from monodyn.live.step import Step
from monodyn.numbers import number, shown_in
from monodyn.results.findings import listed_rows

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.table import Table

    from monodyn.estimation.fit import Estimate, Fit

REDRAWS = 5.0
"""Redraws a second."""
EVERY = 1.0
"""Seconds between two plain lines."""
MOST_COLUMNS = 1000
"""Columns in which a table has all the room that it wants."""
MOST_DECIMALS = 7
"""Decimals of a number, at most; a smaller one is written with its power of ten."""
NARROW_UNIT = 5
"""Columns of a unit, at most, where it is narrow."""
BAR = 10
"""Columns of the bar of an interval: full at 100 % of the value, empty at 0.1 %."""
STYLES = {"trusted": "bold green", "approximate": "bold yellow", "refused": "bold red"}
"""How the verdict is shown."""
PHASES = {"searching": "looking for the mechanism"}
"""What is done with the frames, where the word alone does not say it."""


class Shown(NamedTuple):
    """What is on the terminal.

    Attributes:
        name: Name of the source.
        ahead: How far ahead the motion is predicted [s].
        step: What is known at the newest frame; None before one.
        pace: How fast the stream goes.
        stopping: True once it is being ended.
    """

    name: str
    ahead: float
    step: Step | None
    pace: Pace
    stopping: bool = False


class Terminal:
    """Shows the newest frame on a terminal.

    Args:
        console: The terminal.
        name: Name of the source.
        ahead: How far ahead the motion is predicted [s].
        meter: How fast the stream goes.

    Attributes:
        stopping: Set once the stream is being ended.
    """

    def __init__(self, console: Console, name: str, ahead: float, meter: Meter) -> None:
        from rich.live import Live

        self.stopping = False
        self._name, self._ahead, self._meter = name, ahead, meter
        self._console, self._step = console, None
        # drawn on a thread of its own, whatever the rate of the frames; lines of JSON on the other stream
        # are not to be drawn into it
        self._view = Live(
            console=console, refresh_per_second=REDRAWS, transient=True, redirect_stdout=False,
            redirect_stderr=False, get_renderable=self._drawn,
        )  # fmt: skip

    def __enter__(self) -> Terminal:
        self._view.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._view.stop()

    def add(self, step: Step) -> None:
        """Take the newest frame.

        Args:
            step: What is known at it.
        """
        self._step: Step | None = step

    def _drawn(self) -> RenderableType:
        width, height = self._console.size
        shown = Shown(self._name, self._ahead, self._step, self._meter.pace, self.stopping)
        return drawn(shown, width, height)


class PlainLines:
    """Writes a line a second, and what there is to say when it changes.

    Args:
        stream: Where to.
        name: Name of the source.
        meter: How fast the stream goes.

    Attributes:
        stopping: Set once the stream is being ended.
    """

    def __init__(self, stream: TextIO, name: str, meter: Meter) -> None:
        self.stopping = False
        self._stream, self._name, self._meter = stream, name, meter
        self._said, self._next = "", -math.inf
        self._step: Step | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._write, name="plain lines", daemon=True)

    def __enter__(self) -> PlainLines:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closed.set()
        self._thread.join()
        self._print()

    def add(self, step: Step) -> None:
        """Take the newest frame.

        Args:
            step: What is known at it.
        """
        self._step = step

    def _write(self) -> None:
        while not self._closed.wait(EVERY):
            self._print()

    def _print(self) -> None:
        step, self._step = self._step, None
        if step is None:
            return
        if step.said and step.said != self._said:
            print(f"{self._name}: {step.said}", file=self._stream, flush=True)
        self._said = step.said
        print(plain_line(step, self._meter.pace), file=self._stream, flush=True)


def plain_line(step: Step, pace: Pace) -> str:
    """Return what is known at a frame in one line.

    Args:
        step: What is known.
        pace: How fast the stream goes.
    """
    parts = [
        f"{step.time:.1f} s",
        PHASES.get(step.phase, step.phase),
        *_speed(pace),
        f"{step.skipped} skipped",
    ]
    fit = step.fit
    if fit is not None:
        kinds = {p.name: p.kind for p in fit.mechanism.parameters}
        lengths = [row for row in listed_rows(fit) if kinds[row.name] == "length"]
        parts += [f"{row.name} {_value(row)} {row.unit}" for row in lengths]
        parts.append(str(step.verdict))
    return ", ".join(parts)


def drawn(shown: Shown, width: int, height: int) -> RenderableType:
    """Return what is on a terminal.

    Args:
        shown: What to show.
        width: Columns of the terminal.
        height: Its rows.
    """
    from rich.console import Group
    from rich.text import Text

    step, pace = shown.step, shown.pace
    phase = "opening" if step is None else PHASES.get(step.phase, step.phase)
    title = Text(overflow="ellipsis", no_wrap=True)
    title.append(shown.name, style="bold")
    title.append(f"  {'stopping' if shown.stopping else phase}")
    rows: list[RenderableType] = [title]
    if step is not None:
        facts = [f"{step.time:.2f} s", *_speed(pace), f"{step.skipped} skipped"]
        rows.append(_wrapped(facts, width))
        rows += _verdict(step)
        # the last row of a terminal stays free for its cursor
        used = 1 + sum(len(text.wrap(_plain(width), width)) for text in rows if isinstance(text, Text))
        rows += _tables(step, shown.ahead, width, max(height - used - 2 * shown.stopping, 6))
    if shown.stopping:
        rows.append(
            Text("What has been found is being kept; Ctrl-C again stops at once, without it.", "bold")
        )
    return Group(*rows)


def _plain(width: int) -> Console:
    """Return a console by whose width texts are measured."""
    from rich.console import Console

    return Console(width=width)


def _speed(pace: Pace) -> list[str]:
    """Return how fast the stream goes, in words; latencies as the median and the 99th percentile."""
    parts = [] if pace.rate is None else [f"{pace.rate:.1f} frames/s"]
    parts += [] if pace.pose is None else [f"pose {_latency(pace.pose)}"]
    return parts + ([] if pace.fit is None else [f"fit {_latency(pace.fit)}"])


def _latency(spread: Spread) -> str:
    """Return the median and the 99th percentile, with one unit where it is the same."""
    (low, unit), (high, other) = map(_seconds, spread)
    return f"{low}/{high} {other}" if unit == other else f"{low} {unit}/{high} {other}"


def _seconds(seconds: float) -> tuple[str, str]:
    return (f"{1e3 * seconds:.3g}", "ms") if seconds < 0.9995 else (f"{seconds:.3g}", "s")


def _wrapped(facts: list[str], width: int) -> Any:
    """Return facts side by side, in as many lines as they take, none of them cut."""
    from rich.text import Text

    lines = [""]
    for fact in facts:
        longer = f"{lines[-1]}   {fact}" if lines[-1] else fact
        if len(longer) > width and lines[-1]:
            lines.append(fact)
        else:
            lines[-1] = longer
    return Text("\n".join(lines), style="dim")


def _verdict(step: Step) -> list[RenderableType]:
    """Return the verdict with its sentence, and whether the motion was enough."""
    from rich.text import Text

    fit, said = step.fit, step.said
    if fit is None:
        return [Text(said)] if said else []
    grade = step.verdict or fit.grade
    text = Text(f"{grade.capitalize()}. ", STYLES[grade])
    # the status of an approximate fit says so itself
    text.append(said.removeprefix("Approximate. "), style="")
    wide = hardly_known(fit)
    enough = Text("Enough motion? ")
    if not wide:
        enough.append("yes", style="bold green")
    else:
        name, share = wide[0]
        enough.append("not yet", style="bold yellow")
        how = f"± {_percent(share)} %" if math.isfinite(share) else "is not determined"
        # of a refused fit the intervals mean nothing
        enough.append(f": {name} {how}" if fit.ok or not math.isfinite(share) else "")
    return [text, enough]


def _tables(step: Step, ahead: float, width: int, height: int) -> list[RenderableType]:
    """Return joints and parameters, next to or below each other, in so many rows, as the width allows."""
    from rich.table import Table
    from rich.text import Text

    fit, measure = step.fit, _plain(MOST_COLUMNS)
    if shown_pose(step) is None:
        return []

    def fits(table: Table) -> bool:
        return measure.measure(table).maximum <= width

    joints = _joints(step, ahead, whole=True)
    joints = joints if fits(joints) else _joints(step, ahead, whole=False)
    if fit is None:
        return [Text(), joints]
    # a blank line and a head each
    below = max(height - 4 - joints.row_count, 2)
    both = Table.grid(padding=(0, 4))
    both.add_row(joints, _parameters(fit, height - 2, bars=True))
    if fits(both):
        return [Text(), both]
    parameters = _parameters(fit, below, bars=True)
    parameters = parameters if fits(parameters) else _parameters(fit, below, bars=False)
    return [Text(), joints, Text(), parameters]


def _joints(step: Step, ahead: float, *, whole: bool) -> Table:
    """Return the table of the pose, with what predictions were off by; with standard deviations if whole."""
    pose, fit = shown_pose(step), step.fit
    assert pose is not None
    mechanism = fit.mechanism if fit is not None else step.scene.mechanism if step.scene is not None else None
    units = {} if mechanism is None else {joint.name: shown_in(joint) for joint in mechanism.joints}
    off = f"off after {ahead:g} s" if whole else f"off, {ahead:g} s"
    table = _table("joint", "position", *(["std"] if whole else []), off, "unit", wide=whole)
    for dof, joint in enumerate(pose.joints):
        scale, unit = units.get(joint, (1.0, ""))
        seen = bool(pose.measured[0, dof])
        std = math.sqrt(max(float(pose.covariance[0, dof, dof]), 0.0)) * scale
        error = float(step.error[dof]) * scale if len(step.error) else math.nan
        cells = [f"{float(pose.position[0, dof]) * scale:.2f}".replace("-", "−") if seen else "not seen"]
        cells += [f"{std:.2g}" if seen and math.isfinite(std) else "–"] if whole else []
        table.add_row(joint, *cells, f"{error:.2g}" if math.isfinite(error) else "–", unit)
    return table


def _parameters(fit: Fit, most: int, *, bars: bool) -> Table:
    """Return the table of the parameters with their 95 % intervals, in at most so many rows."""
    table = _table("parameter", "95 % interval", "unit", *(["%", ""] if bars else []), wide=bars)
    rows = listed_rows(fit)
    # what gives way where it is narrow: units, then names, and no number
    table.columns[1].min_width = max((len(_value(row)) for row in rows), default=0)
    table.columns[2].max_width = None if bars else NARROW_UNIT
    # what is known before what is not
    rows = [row for row in rows if math.isfinite(row.std)] + [row for row in rows if math.isinf(row.std)]
    left = len(rows) - most
    for row in rows if left <= 0 else rows[: most - 1]:
        share = _share(row)
        bar = [] if not bars else ["", ""] if share is None else [_percent(share), _bar(share)]
        table.add_row(row.name, _value(row), row.unit, *bar)
    if left > 0:
        table.add_row(f"and {left + 1} more")
    return table


def _table(*columns: str, wide: bool) -> Table:
    """Return an empty table; names, units and bars stand to the left."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0) if wide else (0, 1, 0, 0))
    for column in columns:
        left = column in ("joint", "parameter", "unit", "")
        table.add_column(
            Text(column, style="dim"), justify="left" if left else "right", no_wrap=True, overflow="ellipsis"
        )
    return table


def _half(row: Estimate) -> float:
    """Return half the width of an interval; infinite where an end is open."""
    return 0.5 * (row.upper - row.lower)


def _share(row: Estimate) -> float | None:
    """Return half the width of an interval as a share of the value; None where there is none, and of an
    angle, which may be about zero."""
    half = _half(row)
    known = row.value and row.unit != "rad" and math.isfinite(half) and math.isfinite(row.std)
    return half / abs(row.value) if known else None


def _value(row: Estimate) -> str:
    """Return a parameter with half its 95 % interval."""
    if not math.isfinite(row.std):
        return "not determined"
    half = _half(row)
    if not 0.0 < half < math.inf:
        return f"{number(row.value, row.std or None)} ± {'0' if half == 0.0 else '?'}"
    # two digits of the interval, and the value down to there
    decimals = 1 - math.floor(math.log10(half))
    if not 0 <= decimals <= MOST_DECIMALS:
        return f"{number(row.value, half)} ± {half:.2g}"
    return f"{row.value:.{decimals}f} ± {half:.{decimals}f}".replace("-", "−")


def _percent(share: float) -> str:
    """Return a share in percent with two digits."""
    percent = 100.0 * share
    return f"{percent:.2g}" if percent < 99.5 else f"{percent:.0f}" if percent < 1000.0 else "> 999"


def _bar(share: float) -> str:
    """Return a bar as long as an interval is wide, by its logarithm."""
    decades = math.log10(max(share, 1e-3) / 1e-3)
    return "━" * max(round(BAR * min(decades / 3.0, 1.0)), 0)
