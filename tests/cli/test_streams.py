"""Streams that break, and places that cannot be written."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import os
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable
from pathlib import Path

import pytest

from monodyn import errors
from monodyn.cli import main, show, streams
from monodyn.cli.show import progress_on
from monodyn.errors import SettingsError
from monodyn.results.folder import RunFolder
from monodyn.results.log import RunLog, recorded
from monodyn.results.unforeseen import TRACEBACK
from support import command, refuses


class Closed(io.StringIO):
    """A stream whose other end is in trouble."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    def write(self, text: str) -> int:
        raise OSError(self.number, os.strerror(self.number))


def test_a_lost_error_stream_drops_the_progress_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Closed(errno.EPIPE))
    with streams.safe(), progress_on(sys.stderr, quiet=False) as progress:
        assert progress is not None
        progress("track", 1, 2)
        progress("identify", 1, 2)


@pytest.mark.parametrize("words", [["models"], ["--help"], ["run", "--help"]])
def test_a_reader_that_has_gone_away_is_no_error(monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    monkeypatch.setattr(sys, "stdout", Closed(errno.EPIPE))
    assert main(words) == 0
    monkeypatch.setattr(sys, "stdout", Closed(errno.ENOSPC))
    monkeypatch.setattr(sys, "stderr", err := io.StringIO())
    assert main(words) == 2
    assert err.getvalue() == (
        "monodyn: standard output: cannot print the result (No space left on device); give it another place, "
        "or --quiet.\n"
    )


def test_an_output_that_cannot_be_written_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", Closed(errno.EIO))
    said = "standard output: cannot print the result (Input/output error); give it another place, or --quiet."
    with refuses(SettingsError, said), streams.printing():
        print("a result")


def test_names_that_the_terminal_cannot_show_are_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    with streams.safe(), streams.printing():
        print("µ")
    assert raw.getvalue() == b"?\n"


def test_a_minus_that_the_terminal_cannot_show_stays_one(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    with streams.safe(), streams.printing():
        print("−1.5e−05 ± 0.1 × ∞ – §")
    assert raw.getvalue() == b"-1.5e-05 +- 0.1 x inf - ?\n"


NOISY = """
import os, sys, warnings
from monodyn.cli import main, show
def noisy(**_):
    os.write(2, b"libpng error: broken\\n")
    warnings.warn("overflow encountered")
    print("ours", file=sys.stderr)
    return 0
show.show_models = noisy
"""


@pytest.mark.parametrize(
    ("ended", "said"),
    [
        ("sys.exit(main())", "ours\n"),
        # a process that is not ours keeps what it had
        ("import io; main(['models'])", "libpng error: broken\nours\n"),
        ("main(); os.write(2, b'after')", "ours\nafter"),
    ],
)
def test_what_libraries_write_on_the_error_stream_is_not_shown(ended: str, said: str) -> None:
    code = f"import warnings\n{NOISY}\n{ended}"
    done = subprocess.run([sys.executable, "-c", code, "models"], capture_output=True, text=True)
    lines = [line for line in done.stderr.splitlines(True) if "warn" not in line and "overflow" not in line]
    assert "".join(lines) == said


def test_warnings_that_were_asked_for_are_shown() -> None:
    code = f"{NOISY}\nsys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", code, "models"], capture_output=True, text=True
    )
    assert "overflow encountered" in done.stderr


# Ctrl-C while the program is loaded

MAIN = "import sys; from monodyn.cli import main; sys.exit(main())"
ENDED = "import os, sys; sys.stdout.flush(); os._exit(0)"
INTERRUPTED = "monodyn: interrupted; nothing was written.\n"


class Thing:
    """Something whose end can be noticed."""


def dropped() -> None:
    """Press Ctrl-C where Python drops it, in a callback, and go on for long."""

    def pressed(_: object) -> None:
        raise KeyboardInterrupt

    thing = Thing()
    watched = weakref.ref(thing, pressed)
    del thing
    assert watched() is None
    for _ in range(200):
        time.sleep(0.1)


def uncompiled() -> None:
    """Press Ctrl-C in a callback without whose work what follows fails, as numba's compiler does."""

    def pressed(_: object) -> None:
        raise KeyboardInterrupt

    thing = Thing()
    watched = weakref.ref(thing, pressed)
    del thing
    raise RuntimeError(f"no compiled object yet for {watched()}")


def unloaded() -> None:
    """Press Ctrl-C while a library is loaded, as the libraries of C report it."""
    raise ImportError("initialization failed") from KeyboardInterrupt()


def missing() -> None:
    """Press Ctrl-C while a package is loaded that need not be there."""
    try:
        unloaded()
    except ImportError:
        raise SettingsError("control: expected the package, got none; install it.") from None


def swallowed() -> None:
    """Press Ctrl-C while a library of C is loaded that reports another error, and not what is behind it."""
    with contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    raise ImportError("failed to import")


def cleared() -> None:
    """Press Ctrl-C where it is cleared, as libraries of C do that look whether something is there; go on."""
    with contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    for _ in range(200):
        time.sleep(0.1)


@pytest.mark.parametrize("stopped", [dropped, uncompiled, unloaded, missing, swallowed, cleared])
def test_ctrl_c_is_one_line_in_whatever_form_it_comes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], stopped: Callable[[], None]
) -> None:
    monkeypatch.setattr(show, "show_models", lambda **_: stopped())
    begun, hook, handler = time.monotonic(), sys.unraisablehook, signal.getsignal(signal.SIGINT)
    assert main(["models"]) == 130
    assert capsys.readouterr().err == INTERRUPTED
    assert time.monotonic() - begun < 10.0
    assert (sys.unraisablehook, signal.getsignal(signal.SIGINT)) == (hook, handler)


def test_what_ctrl_c_still_has_to_do_is_not_disturbed(monkeypatch: pytest.MonkeyPatch) -> None:
    done = []

    def stopped(**_: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            # much longer than it takes until it comes again where it was lost
            time.sleep(6.0 * streams.SOON)
            done.append("cleaned up")

    monkeypatch.setattr(show, "show_models", stopped)
    assert main(["models"]) == 130
    assert done == ["cleaned up"]


def test_a_second_ctrl_c_does_not_wait_for_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    done = []

    def stopped(**_: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            done.append("cleaned up")

    monkeypatch.setattr(show, "show_models", stopped)
    assert (main(["models"]), done) == (130, [])
    # nobody knows any more what was written
    assert capsys.readouterr().err == "monodyn: interrupted; what was written before stays.\n"
    assert errors.signals == []


def test_what_a_signal_stops_is_no_error_of_ours_though_nothing_shows_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A library that is called back may lose what the handler raised, and fail for the want of it."""

    def stopped(**_: object) -> None:
        folder = RunFolder(tmp_path / "run")
        with recorded(folder, RunLog("run", {}, {})):
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGTERM)
            raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(show, "show_models", stopped)
    assert main(["models"]) == 143
    assert (
        capsys.readouterr().err
        == f"monodyn: terminated; what was finished is in '{tmp_path / 'run'}', which --force replaces.\n"
    )
    assert [file.name for file in (tmp_path / "run").iterdir()] == ["run.json"]
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "interrupted"


@pytest.mark.skipif(os.name == "nt", reason="sends SIGTERM")
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129)])
def test_sigterm_is_as_ctrl_c(
    name: str, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """So is a terminal that is closed."""
    number = getattr(signal, name)

    def stopped(**_: object) -> None:
        folder = RunFolder(tmp_path / "run")
        with recorded(folder, RunLog("run", {}, {})):
            folder.write_text("poses.csv", "frame")
            signal.raise_signal(number)

    monkeypatch.setattr(show, "show_models", stopped)
    assert main(["models"]) == code
    assert capsys.readouterr().err == (
        f"monodyn: terminated; what was finished is in '{tmp_path / 'run'}', which --force replaces.\n"
    )
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["poses.csv", "run.json"]
    assert json.loads((tmp_path / "run" / "run.json").read_text())["status"] == "interrupted"
    assert signal.getsignal(number) == signal.SIG_DFL


def test_another_error_in_a_callback_is_reported_as_ever() -> None:
    with streams.never_lost(), pytest.MonkeyPatch.context() as patch:
        seen: list[object] = []
        patch.setattr(sys, "unraisablehook", seen.append)
        with streams.never_lost():
            thing = Thing()
            watched = weakref.ref(thing, lambda _: 1 / 0)
            del thing
            assert watched() is None
    assert [one.exc_type for one in seen] == [ZeroDivisionError]


def test_ctrl_c_in_a_text_that_is_run_ends_with_the_exit_code(tmp_path: Path) -> None:
    """As in the making of dataclasses, of which an import makes many."""
    (tmp_path / "started.py").write_text(
        "import monodyn.cli.options, monodyn.names, monodyn.typed\nfrom monodyn import cli\n"
        "def stopped(words, own): exec('raise KeyboardInterrupt')\n"
        "cli._dispatch = stopped\nraise SystemExit(cli.main())",
        encoding="utf-8",
    )
    words = [sys.executable, "-m", "started", "models"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, INTERRUPTED)


def test_ctrl_c_before_anything_is_loaded() -> None:
    code = (
        "import sys\nclass Stop:\n    def find_spec(self, name, *_):\n"
        "        if name == 'monodyn.cli.streams': raise KeyboardInterrupt\n"
        f"sys.meta_path.insert(0, Stop())\n{MAIN}"
    )
    done = subprocess.run([sys.executable, "-c", code, "models"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, INTERRUPTED)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="sends SIGINT")
@pytest.mark.parametrize("delay", [0.02 * k for k in range(30)])
def test_ctrl_c_at_any_time_of_the_first_second(delay: float) -> None:
    # what Python does before our first line, and after our last one, is not ours: from its first import on
    code = (
        "import sys\nclass First:\n    def find_spec(self, name, *_):\n"
        "        if name == 'monodyn.cli.streams': print(flush=True)\n"
        "sys.meta_path.insert(0, First())\n"
        f"from monodyn.cli import main; code = main(); print('end', code); {ENDED}"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, "models"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (out.splitlines()[-1], err) in (("end 130", INTERRUPTED), ("end 0", ""))


def broken(*_: object, **__: object) -> int:
    raise ZeroDivisionError("by nothing\nat all")


SENT = (
    "monodyn: an error of Monodyn itself (ZeroDivisionError: by nothing at all); please report it to its "
    "makers with '{}', which has the details.\n"
)


def test_an_error_that_nobody_foresaw_ends_with_70_and_names_its_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever holds the folder writes it there, wherever its name came from; words of the command do not."""

    def run(**_: object) -> int:
        with recorded(RunFolder(tmp_path / "run"), RunLog("run", {}, {})):
            return broken()

    monkeypatch.setattr(show, "show_models", run)
    monkeypatch.setattr(sys, "argv", ["/usr/bin/monodyn", "models"])
    done, file = command("models"), tmp_path / "run" / TRACEBACK
    assert (done.code, done.err) == (70, SENT.format(file))
    text = file.read_text(encoding="utf-8")
    assert text.splitlines()[1] == "monodyn models"
    assert "Traceback (most recent call last):" in text
    assert text.endswith("ZeroDivisionError: by nothing\nat all\n")


def test_without_a_folder_the_traceback_goes_to_a_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    monkeypatch.setattr("monodyn.cli._dispatch", broken)
    monkeypatch.setattr("tempfile.mkdtemp", lambda prefix: str(tmp_path))
    done = command("run", "a.mp4", "--out", mine)
    assert (done.code, done.err) == (70, SENT.format(tmp_path / TRACEBACK))
    assert list(mine.iterdir()) == []


def test_where_no_disk_takes_the_traceback_the_terminal_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("monodyn.cli._dispatch", broken)
    monkeypatch.setattr("tempfile.mkdtemp", lambda prefix: str(tmp_path / "nowhere"))
    done = command("models")
    assert done.code == 70
    assert done.err.endswith(
        "ZeroDivisionError: by nothing\nat all\n\n"
        "monodyn: an error of Monodyn itself (ZeroDivisionError: by nothing at all); please report it to its "
        "makers with the lines above.\n"
    )


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (FileNotFoundError(errno.ENOENT, "No such file", "clip"), 2,
         "'clip': expected a place the system can use, got 'No such file'; give another."),
        (OSError(errno.ENOSPC, "No space left on device"), 2,
         "the system: expected room for another file, got 'No space left on device'; free some, and try "
         "again."),
        (OSError(errno.EMFILE, "Too many open files", "clip"), 2,
         "the system: expected room for another file, got 'Too many open files' at 'clip'; free some, and "
         "try again."),
        (ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"), 70,
         "an error of Monodyn itself (ConnectionResetError: "),
        (BrokenPipeError(), 70, "an error of Monodyn itself (BrokenPipeError: )"),
    ],
)  # fmt: skip
def test_only_what_the_system_says_of_a_file_or_of_its_limits_is_foreseen(
    error: OSError, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: object, **__: object) -> int:
        raise error

    monkeypatch.setattr("monodyn.cli._dispatch", failing)
    monkeypatch.setattr("tempfile.mkdtemp", lambda prefix: str(tmp_path))
    done = command("models")
    assert done.code == code
    assert done.err.startswith(f"monodyn: {said}")
    assert done.err.count("\n") == 1


def test_a_signal_that_comes_as_all_ends_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the first moment it still is an interruption, after that it comes too late; none is sent again."""
    before, ends, usual = signal.getsignal(signal.SIGINT), list[streams._Presses](), streams._Presses.end

    def end(presses: streams._Presses) -> None:
        ends.append(presses)
        if len(ends) == 1:
            os.kill(os.getpid(), signal.SIGTERM)
        presses.over = True
        os.kill(os.getpid(), signal.SIGTERM)
        usual(presses)

    monkeypatch.setattr(streams._Presses, "end", end)
    with pytest.raises(KeyboardInterrupt), streams.never_lost() as came:
        pass
    assert len(ends) == 2
    assert came == [signal.SIGTERM]
    assert not ends[0]._thread.is_alive()
    assert signal.getsignal(signal.SIGINT) is before
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    time.sleep(2 * streams.SOON)
