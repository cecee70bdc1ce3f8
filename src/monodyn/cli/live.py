"""``monodyn live``: what goes where while a stream goes on, and what is printed of it at the end."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from monodyn.errors import MonodynError, SettingsError

if TYPE_CHECKING:
    from monodyn.cli.options import LiveOptions
    from monodyn.live.lines import Lines
    from monodyn.live.meter import Meter
    from monodyn.live.server import Address
    from monodyn.live.sources import Source
    from monodyn.live.step import Step
    from monodyn.live.stream import Session
    from monodyn.live.terminal import PlainLines, Terminal
    from monodyn.live.view import View

STANDARD = "-"
"""What stands for a standard stream in place of a file."""


class Output(Protocol):
    """What takes every frame."""

    def add(self, step: Step) -> None:
        """Take the newest frame."""


def follow(options: LiveOptions) -> int:
    """Follow a stream until it ends, or Ctrl-C; return the exit code.

    Args:
        options: What the user wants.

    Raises:
        MonodynError: an option, the mechanism, the source or a place for results cannot be used.
    """
    settings, live = options.settings(), options.live_settings()
    if options.ndjson == STANDARD and options.json:
        raise SettingsError(
            "ndjson: expected a file next to --json, got the standard output, which that takes; name a file, "
            "or leave one of them out."
        )
    address = _address(options)
    from monodyn.checks import drawn_mechanism
    from monodyn.live.ended import ended
    from monodyn.live.meter import Meter
    from monodyn.live.sources import open_source
    from monodyn.live.stream import Session
    from monodyn.results.folder import RunFolder

    mechanism, meter = drawn_mechanism(options.model, settings), Meter()
    with contextlib.ExitStack() as stack:
        view = stack.enter_context(_served(options, address, meter))
        source = open_source(options.source, live, rate=settings.rate)
        folder = None
        if options.out is not None:
            folder = RunFolder(options.out, force=options.force, inputs=[options.source, settings.background])
        lines = stack.enter_context(_lines(options, source))
        screen = stack.enter_context(_screen(options, source, meter))
        outputs = [output for output in (meter, view, lines, screen) if output is not None]
        with Session(source, mechanism, live, settings) as session:
            last, notes = _followed(session, outputs, screen)
    if lines is not None and lines.lost:
        notes.append(f"The reader of the lines was too slow: {lines.lost} of them were left out.")
    found = ended(session, last, folder, notes)
    if found is None:
        _nothing(last, notes, options)
        return 1
    # lines alone are on the standard output where it was asked for them
    if options.ndjson == STANDARD:
        print(f"monodyn: {found.document['grade']}. {found.document['status']}", file=sys.stderr)
        return 0 if last.fit is not None and last.fit.ok else 1
    return options.show(found)


def _followed(
    session: Session, outputs: list[Any], screen: Terminal | PlainLines | None
) -> tuple[Step, list[str]]:
    """Hand every frame to all that show it; return the last one, and notes."""
    from monodyn.cli.streams import first_press

    def stop() -> None:
        session.stop()
        if screen is not None:
            screen.stopping = True

    last, notes = None, []
    with first_press(stop):
        try:
            for last in session.steps():
                for output in outputs:
                    output.add(last)
        except MonodynError as error:
            # a camera that vanishes ends the stream, and what it has shown is kept
            if last is None:
                raise
            notes.append(f"The stream ended: {error}")
    if last is None:
        raise KeyboardInterrupt
    return last, notes


def _nothing(last: Step, notes: list[str], options: LiveOptions) -> None:
    """Say that nothing was identified, and why."""
    from monodyn.live.document import step_document

    said = f"nothing was identified in {last.time:.1f} s. {last.said}"
    print(f"monodyn: {' '.join([said, *notes])}", file=sys.stderr)
    if options.json:
        from monodyn.cli.streams import printing

        with printing():
            print(json.dumps(step_document(last), indent=2, allow_nan=False))


def _address(options: LiveOptions) -> Address | None:
    """Return where the page is to be served; None where nowhere."""
    if options.view is None:
        return None
    from monodyn.live.server import address_of

    return address_of(options.view)


@contextlib.contextmanager
def _served(options: LiveOptions, address: Address | None, meter: Meter) -> Iterator[View | None]:
    """Serve the page while the block runs."""
    if address is None:
        yield None
        return
    from monodyn.live.server import Server
    from monodyn.live.view import View

    view = View(options.name, options.live_settings().ahead, meter, address.hosts)
    server = Server(view, address)
    if not options.quiet:
        print(f"view: {address.url}", file=sys.stderr, flush=True)
    try:
        yield view
    finally:
        view.close()
        server.close()


@contextlib.contextmanager
def _lines(options: LiveOptions, source: Source) -> Iterator[Lines | None]:
    """Write lines while the block runs."""
    if options.ndjson is None:
        yield None
        return
    from monodyn.live.lines import Lines

    name = options.ndjson
    if name == STANDARD:
        stream: Any = sys.stdout
    else:
        if Path(name).exists() and not Path(name).is_char_device() and not Path(name).is_fifo():
            _spare(Path(name), options)
        try:
            stream = open(name, "w", encoding="ascii")  # noqa: SIM115 (closed by ``Lines``)
        except OSError as error:
            raise SettingsError(
                f"ndjson '{name}': cannot be written ({error.strerror or error}); name another file."
            ) from None
    lines = Lines(stream, live=source.live, owned=name != STANDARD)
    try:
        yield lines
    finally:
        lines.close()
    if lines.error is not None:
        raise SettingsError(
            f"ndjson '{name}': cannot be written any more ({lines.error}); the lines before that are there."
        )


def _spare(path: Path, options: LiveOptions) -> None:
    """Refuse to write over a file that is not ours to replace."""
    if path.is_dir() or not options.force:
        got = "a folder" if path.is_dir() else "one that is there"
        raise SettingsError(
            f"ndjson '{path}': expected the name of a new file, got {got}; give another, or --force to "
            "replace a file."
        )
    if Path(options.source).exists() and path.samefile(options.source):
        raise SettingsError(f"ndjson '{path}': expected another file than the source; give another.")


@contextlib.contextmanager
def _screen(options: LiveOptions, source: Source, meter: Meter) -> Iterator[Terminal | PlainLines | None]:
    """Show what is known on the error stream while the block runs."""
    # lines of JSON on the same terminal would be drawn over
    mixed = options.ndjson == STANDARD and sys.stdout.isatty()
    if options.quiet or mixed:
        yield None
        return
    from monodyn.live.terminal import PlainLines, Terminal

    if sys.stderr.isatty():
        from rich.console import Console

        ahead = options.live_settings().ahead
        with Terminal(Console(file=sys.stderr, stderr=True), source.name, ahead, meter) as screen:
            yield screen
    else:
        with PlainLines(sys.stderr, source.name, meter) as screen:
            yield screen
