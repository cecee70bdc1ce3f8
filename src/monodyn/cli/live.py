"""``monodyn live``: what goes where while a stream goes on, and what is printed of it at the end."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monodyn.cli import SIGNALLED
from monodyn.errors import SettingsError

if TYPE_CHECKING:
    from monodyn.job import Outcome
    from monodyn.live.lines import Lines
    from monodyn.live.meter import Meter
    from monodyn.live.server import Address
    from monodyn.live.step import Step
    from monodyn.live.stream import Session
    from monodyn.live.view import View
    from monodyn.types import Progress

STANDARD = "-"
"""What stands for a standard stream in place of a file."""


def go_live(options: Any) -> int:
    """Return the exit code after following a stream until it ends, or Ctrl-C, SIGTERM or SIGHUP.

    Args:
        options: What the user wants, as ``options.LiveOptions`` has it.

    Raises:
        SettingsError: an option, or a place for results, cannot be used.
    """
    settings, live = options.settings, options.live
    if options.ndjson == STANDARD and options.json:
        raise SettingsError(
            "ndjson: expected a file next to --json, got the standard output, which that takes; name a file, "
            "or leave one of them out."
        )
    from monodyn.cli.streams import first_press
    from monodyn.live.meter import Meter

    meter = Meter()
    with contextlib.ExitStack() as stack:
        # what cannot be used is refused before anything starts
        view = stack.enter_context(_served(options, live.ahead, meter))
        lines = stack.enter_context(_lines(options))
        watch = stack.enter_context(_Watch(options, live.ahead, meter, view, lines))
        from monodyn.live.run import follow

        came = stack.enter_context(first_press(watch.stop))
        outcome = follow(
            options.source, options.model, options.out, live, settings, shown=watch.shown,
            force=options.force, progress=watch.progress,
        )  # fmt: skip
    code = _printed(options, outcome, watch)
    ended = [number for number in came if number != signal.SIGINT]
    return SIGNALLED + ended[0] if ended else code


class _Watch:
    """What takes every frame while a stream goes on, and then shows how far the results are.

    Args:
        options: What the user wants.
        ahead: How far ahead the motion is predicted [s].
        meter: How fast the stream goes.
        view: The page, or None.
        lines: Lines of JSON, or None.
    """

    def __init__(
        self, options: Any, ahead: float, meter: Meter, view: View | None, lines: Lines | None
    ) -> None:
        self.session: Session | None = None
        self.last: Step | None = None
        self.lines = lines
        self._outputs = [output for output in (meter, view) if output is not None]
        self._screens = contextlib.ExitStack()
        self._quiet, self._progress = options.quiet, None
        self._screen: Any = _screen(options, ahead, meter)

    def __enter__(self) -> _Watch:
        if self._screen is not None:
            self._screens.enter_context(self._screen)
        return self

    def __exit__(self, *_: object) -> None:
        self._screens.close()

    def shown(self, session: Session, step: Step) -> None:
        """Hand a frame to all that show it."""
        self.session, self.last = session, step
        for output in self._outputs:
            output.add(step)
        if self.lines is not None:
            self.lines.add(step, wait=not session.source.live)
        if self._screen is not None:
            self._screen.add(step)

    def stop(self) -> bool:
        """End the stream; before its first frame there is nothing to keep, and False is returned."""
        if self.session is None:
            return False
        self.session.stop()
        if self._screen is not None:
            self._screen.stopping = True
        return True

    def progress(self, step: str, done: int, total: int | None) -> None:
        """Show how far the results are: a bar where the frames were shown before."""
        if self._quiet:
            return
        if self._progress is None:
            from monodyn.cli.show import progress_on

            self._screens.close()
            self._screen = None
            self._progress: Progress | None = self._screens.enter_context(
                progress_on(sys.stderr, quiet=False)
            )
        if self._progress is not None:
            self._progress(step, done, total)


def _printed(options: Any, outcome: Outcome | None, watch: _Watch) -> int:
    """Print what was found, and return the exit code."""
    notes, lost = [], 0 if watch.lines is None else watch.lines.lost
    if lost:
        notes.append(f"The reader of the lines was too slow: {lost} of them were left out.")
    found = outcome or _found(watch)
    if found is None:
        return _nothing(options, watch, notes)
    for note in notes:
        print(f"monodyn: {note}", file=sys.stderr)
    # lines alone are on the standard output where they were asked for there
    if options.ndjson != STANDARD:
        return options.show(found)
    if not options.quiet:
        print(f"monodyn: {found.document['grade']}. {found.document['status']}", file=sys.stderr)
    return 0 if found.fit is not None and found.fit.ok else 1


def _found(watch: _Watch) -> Outcome | None:
    """Return what was found where no folder took it; None where nothing was identified."""
    from monodyn.job import Outcome
    from monodyn.results.findings import Findings, fit_document

    session, last = watch.session, watch.last
    if session is None or last is None or session.found is None:
        return None
    fit = last.fit or session.identifier.fit
    if fit is None:
        return None
    poses = session.identifier.record.whole
    assert poses is not None
    findings = Findings(fit, notes=[*session.source.remarks, *session.notes, *session.found.notes])
    return Outcome(None, fit_document(findings), poses, fit, (), findings.notes)


def _nothing(options: Any, watch: _Watch, notes: list[str]) -> int:
    """Say that nothing was identified, and why; return the exit code."""
    from monodyn.cli.streams import printing
    from monodyn.live.document import step_document

    last = watch.last
    said = "the stream gave no picture." if last is None else f"in {last.time:.1f} s. {last.said}"
    print(f"monodyn: nothing was identified: {' '.join([said, *notes])}", file=sys.stderr)
    if options.json and last is not None:
        with printing():
            print(json.dumps(step_document(last), indent=2, allow_nan=False))
    return 1


@contextlib.contextmanager
def _served(options: Any, ahead: float, meter: Meter) -> Iterator[View | None]:
    """Serve the page while the block runs."""
    if options.view is None:
        yield None
        return
    from monodyn.live.server import Server, address_of

    address: Address = address_of(options.view)
    from monodyn.live.view import View

    view = View(options.name, ahead, meter, address.hosts)
    server = Server(view, address)
    if not options.quiet:
        print(f"view: {address.url}", file=sys.stderr, flush=True)
    try:
        yield view
    finally:
        view.close()
        server.close()


@contextlib.contextmanager
def _lines(options: Any) -> Iterator[Lines | None]:
    """Write lines while the block runs."""
    name = options.ndjson
    if name is None:
        yield None
        return
    from monodyn.live.lines import Lines

    lines = Lines(*(_standard() if name == STANDARD else (_opened(name, options), True)))
    try:
        yield lines
    finally:
        lines.close()
    if lines.error is not None:
        raise SettingsError(
            f"ndjson '{name}': cannot be written ({lines.error}); give it another place. What came before is "
            "there."
        )


def _standard() -> tuple[Any, bool]:
    """Return the standard output, and whether it is ours to close."""
    try:
        sys.stdout.flush()
        # by a number of its own: at the end the program must not wait for what a stalled reader leaves there
        return os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="ascii"), True
    except (OSError, ValueError):
        return sys.stdout, False


def _opened(name: str, options: Any) -> Any:
    """Return a new file for the lines; lines that are there are replaced with ``--force`` alone, and nothing
    else ever is: it may be an input, or the only result of a run."""
    from monodyn.live.lines import is_lines
    from monodyn.results.folder import FILES

    path = Path(name)
    if path.is_dir():
        raise SettingsError(f"ndjson '{path}': expected the name of a file, got a folder; give another.")
    if path.name.lower() in FILES:
        raise SettingsError(
            f"ndjson '{path}': expected a name that no file of a run has, got '{path.name}'; give another."
        )
    try:
        # a pipe or a terminal is there, and is no file to be lost
        if path.is_file():
            if not is_lines(path):
                raise SettingsError(
                    f"ndjson '{path}': expected a new file or lines of a stream, got another file, which "
                    "would be lost; give another name."
                )
            if not options.force:
                raise SettingsError(
                    f"ndjson '{path}': expected the name of a new file, got one that is there; give another, "
                    "or --force to replace it."
                )
        return path.open("w", encoding="ascii")
    except OSError as error:
        raise SettingsError(
            f"ndjson '{path}': cannot be written ({error.strerror or error}); name another file."
        ) from None


def _screen(options: Any, ahead: float, meter: Meter) -> Any:
    """Return what shows on the error stream what is known; None for nothing."""
    # lines of JSON on the same terminal would be drawn over
    if options.quiet or (options.ndjson == STANDARD and sys.stdout.isatty()):
        return None
    from monodyn.cli.show import drawable
    from monodyn.live.terminal import PlainLines, Terminal

    if not drawable(sys.stderr):
        return PlainLines(sys.stderr, options.name, meter)
    from rich.console import Console

    return Terminal(Console(file=sys.stderr, stderr=True), options.name, ahead, meter)
