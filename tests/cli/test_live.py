"""``monodyn live``: its options, where everything goes, how it ends; the stream itself is made up."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import socket
import sys
import threading
import urllib.request
from types import SimpleNamespace

import pytest

from lives import followed, watched
from monodyn.cli.parse import parsed
from monodyn.errors import FitError, SettingsError
from monodyn.estimation.fit import Doubt
from monodyn.live.settings import LiveSettings
from support import command

WORDS = ("live", "clip.mp4", "--model", "double")


class Session:
    """What ``monodyn.live.stream.Session`` shows of a stream."""

    def __init__(self, live=False):
        self.source = SimpleNamespace(live=live, remarks=["A remark."])
        self.identifier = SimpleNamespace(record=SimpleNamespace(whole=followed().pose), fit=None)
        self.notes, self.found, self.stopped = ["A note."], SimpleNamespace(notes=()), False

    def stop(self):
        self.stopped = True


@pytest.fixture
def play(monkeypatch):
    """Have the command follow made-up steps; ``between`` is called before each of them."""

    def playing(*steps, between=lambda k: None, saving=lambda progress: None, error=None):
        calls = []

        def follow(source, model, out, live, settings, *, shown, force, progress):
            calls.append(SimpleNamespace(source=source, model=model, out=out, live=live, settings=settings))
            session = Session()
            for k, step in enumerate(steps):
                between(k)
                if session.stopped:
                    break
                shown(session, step)
            saving(progress)
            if error is not None:
                raise error

        monkeypatch.setattr("monodyn.live.run.follow", follow)
        return calls

    return playing


def test_options_become_the_settings_of_the_stream():
    words = [
        *WORDS[1:], "--pace", "real", "--ahead", "0.5", "--live.size", "640,480", "--live.pixels", "rgb24",
        "--fix", "gravity=9.8", "--track.reach", "5",
    ]  # fmt: skip
    found = parsed("live", words)
    assert found.live == LiveSettings(pace="real", ahead=0.5, size=(640, 480), pixels="rgb24")
    assert found.settings.fix == {"gravity": 9.8}
    assert found.settings.track.reach == 5.0
    assert parsed("live", WORDS[1:]).live == LiveSettings()
    assert parsed("live", ["0", "--model", "x", "--live.pace", "real"]).live.pace == "real"
    for source, name in (("a/b.mp4", "b.mp4"), ("0", "0"), ("-", "-"), ("rtsp://h/x", "rtsp://h/x"),
                         ("a/²", "²"), ("a/٣", "٣")):  # fmt: skip
        assert parsed("live", [source, "--model", "x"]).name == name


def test_what_is_missing_or_cannot_be_used_is_named():
    for words, message in (
        ((), "live: expected SOURCE, --model, got nothing; see monodyn live --help."),
        (("0",), "live: expected --model, got 0; see monodyn live --help."),
        (("0", "--model", "single", "--pace", "slow"),
         "live.pace: expected one of 'fast', 'real', got 'slow'."),
        (("0", "--model", "single", "--live.begin", "0"),
         "live.begin: expected 0.2 to 60 s, got 0; give a number in between."),
        (("0", "--model", "single", "--live.size", "640x480"),
         "live.size: expected W,H with whole numbers of pixels, got '640x480'; e.g. 1280,720."),
        (("0", "--model", "single", "--points", "x.csv"), "live: expected known options, got --points, "
         "x.csv; --points belongs to monodyn run and track; leave it out."),
        (("0", "--model", "single", "--ndjson", "-", "--json"),
         "ndjson: expected a file next to --json, got the standard output, which that takes; name a file, or "
         "leave one of them out."),
    ):  # fmt: skip
        done = command("live", *words)
        assert (done.code, done.out, done.err) == (2, "", f"monodyn: {message}\n")


def test_a_standard_input_that_is_closed_and_a_number_of_no_camera_are_one_line(monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    for words, message in (
        (("-", "--live.size", "64,48"), "source '-': expected raw frames on the standard input, got one "
         "that is closed; send them through a pipe."),
        (("99999999999999999999",), "camera: expected a number from 0 to 99, got a longer one; give "
         "another."),
        (("9" * 5000,), "camera: expected a number from 0 to 99, got a longer one; give another."),
        (("²",), "clip '²': expected a video file or a folder of pictures, found nothing; check the path."),
        (("٣",), "clip '٣': expected a video file or a folder of pictures, found nothing; check the path."),
    ):  # fmt: skip
        done = command("live", *words, "--model", "double", "--quiet")
        assert (done.code, done.out, done.err) == (2, "", f"monodyn: {message}\n")


def test_what_was_found_is_printed_and_the_code_is_that_of_the_verdict(play):
    play(watched(0), followed(45), followed(46))
    done = command(*WORDS)
    assert done.code == 0
    assert "link1.length" in done.out
    assert followed().fit.status in done.out
    assert "- A remark." in done.out
    assert "- A note." in done.out
    assert "clip.mp4: Waiting for motion." not in done.out
    # the plain lines of the end
    assert "1.5 s, following" in done.err
    refused = followed().fit.doubted([Doubt("refused", "It is another mechanism.")])
    play(followed(fit=refused))
    done = command(*WORDS)
    assert done.code == 1
    assert "It is another mechanism." in done.out


def test_json_alone_is_on_the_standard_output_and_nothing_with_quiet(play):
    play(followed())
    done = command(*WORDS, "--json")
    assert json.loads(done.out)["grade"] == followed().fit.grade
    done = command(*WORDS, "--quiet")
    assert (done.code, done.out, done.err) == (0, "", "")


def test_a_stream_that_shows_nothing_has_exit_code_1_and_says_why(play):
    play(watched(30))
    done = command(*WORDS, "--quiet", "--json")
    assert done.code == 1
    assert done.err == "monodyn: nothing was identified: in 1.0 s. Waiting for motion.\n"
    assert json.loads(done.out)["phase"] == "watching"
    play()
    done = command(*WORDS)
    assert (done.code, done.out) == (1, "")
    assert done.err == "monodyn: nothing was identified: the stream gave no picture.\n"
    play(watched(0), error=FitError("x: the mechanism was not found."))
    assert command(*WORDS, "--quiet").code == 1


def test_lines_go_into_a_new_file(play, tmp_path):
    path = tmp_path / "lines.ndjson"
    play(watched(0), followed(45))
    done = command(*WORDS, "--ndjson", path, "--quiet")
    assert (done.code, done.err) == (0, "")
    assert [json.loads(line)["frame"] for line in path.read_text().splitlines()] == [0, 45]
    done = command(*WORDS, "--ndjson", path)
    assert (done.code, done.err) == (
        2,
        f"monodyn: ndjson '{path}': expected the name of a new file, got one that is there; give another, or "
        "--force to replace it.\n",
    )
    assert len(path.read_text().splitlines()) == 2
    assert command(*WORDS, "--ndjson", path, "--force", "--quiet").code == 0
    path.write_text("")
    assert command(*WORDS, "--ndjson", path, "--force", "--quiet").code == 0
    done = command(*WORDS, "--ndjson", tmp_path, "--force")
    assert done.err == (
        f"monodyn: ndjson '{tmp_path}': expected the name of a file, got a folder; give another.\n"
    )
    odd = tmp_path / "no" / "x"
    done = command(*WORDS, "--ndjson", odd)
    assert done.err == (
        f"monodyn: ndjson '{odd}': cannot be written (No such file or directory); name another file.\n"
    )


@pytest.mark.parametrize("name", ["dd.xml", "bb.png", "lc.toml", "clip.mp4.bak", "lines"])
def test_lines_replace_lines_alone(play, tmp_path, name):
    """Whatever else is there may be an input, or the only result of a run, also under another name."""
    calls = play(followed(45))
    there = tmp_path / "there"
    there.write_text('{\n  "schema": 2,\n')
    path = tmp_path / name
    path.symlink_to(there)
    done = command(*WORDS, "--ndjson", path, "--force")
    assert (done.code, done.err) == (
        2,
        f"monodyn: ndjson '{path}': expected a new file or lines of a stream, got another file, which would "
        "be lost; give another name.\n",
    )
    assert there.read_text() == '{\n  "schema": 2,\n'
    assert calls == []


@pytest.mark.parametrize("name", ["fit.json", "poses.csv", "Report.html"])
def test_lines_have_no_name_of_a_file_of_a_run(play, tmp_path, name):
    play(followed(45))
    done = command(*WORDS, "--ndjson", tmp_path / name, "--force", "--out", tmp_path)
    assert (done.code, done.err) == (
        2,
        f"monodyn: ndjson '{tmp_path / name}': expected a name that no file of a run has, got '{name}'; give "
        "another.\n",
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is full")
def test_a_disk_that_is_full_is_said_at_the_end(play):
    play(*[followed()] * 3)
    done = command(*WORDS, "--ndjson", "/dev/full", "--quiet")
    assert done.code == 2
    assert done.err == (
        "monodyn: ndjson '/dev/full': cannot be written ([Errno 28] No space left on device); give it "
        "another place. What came before is there.\n"
    )


def test_lines_alone_are_on_the_standard_output(play):
    play(watched(0), followed(45))
    done = command(*WORDS, "--ndjson", "-")
    rows = [json.loads(line) for line in done.out.splitlines()]
    assert [row["frame"] for row in rows] == [0, 45]
    fit = followed().fit
    assert f"monodyn: {fit.grade}. {fit.status}\n" in done.err


@pytest.mark.parametrize("count", [3, 3000])
def test_a_standard_output_that_is_closed_ends_the_lines_alone(play, monkeypatch, count):
    reading, writing = os.pipe()
    os.close(reading)
    play(*[followed()] * count)
    with os.fdopen(writing, "w") as gone, contextlib.redirect_stderr(io.StringIO()) as said:
        monkeypatch.setattr(sys, "stdout", gone)
        from monodyn.cli import main

        assert main([*WORDS, "--ndjson", "-", "--quiet"]) == 0
    assert said.getvalue() == ""


def test_lines_for_which_there_was_no_time_are_said(play, monkeypatch):
    from monodyn.live.lines import Lines

    play(followed())
    monkeypatch.setattr(Lines, "lost", property(lambda self: 7, lambda self, value: None), raising=False)
    done = command(*WORDS, "--ndjson", "-")
    assert "monodyn: The reader of the lines was too slow: 7 of them were left out.\n" in done.err


def test_the_page_is_there_while_the_stream_goes_on_and_gone_after(play):
    pytest.importorskip("waitress")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    seen = []

    def ask(k):
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/state", timeout=10) as answer:
            seen.append(json.load(answer)["step"])

    before = threading.active_count()
    play(watched(0), followed(45), between=ask, saving=lambda progress: ask(2))
    done = command(*WORDS, "--view", port)
    assert done.err.startswith(f"view: http://127.0.0.1:{port}/\n")
    assert seen[0] is None
    assert [step["frame"] for step in seen[1:]] == [0, 45]
    assert threading.active_count() == before
    with pytest.raises(OSError, match="refused"):
        ask(3)


def test_a_port_that_is_in_use_is_one_line_before_anything_starts(play):
    pytest.importorskip("waitress")
    calls = play(followed())
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = command(*WORDS, "--view", port)
    assert (done.code, done.out) == (2, "")
    assert done.err == f"monodyn: view: expected a free port, port {port} is in use; give another one.\n"
    done = command(*WORDS, "--view", "x:y")
    assert done.err == (
        "monodyn: view: expected PORT or HOST:PORT with a port from 1 to 65535, got 'x:y'; e.g. 8000.\n"
    )
    assert calls == []


def test_the_first_ctrl_c_is_a_normal_end(play):
    def press(k):
        if k == 2:
            signal.raise_signal(signal.SIGINT)

    handler = signal.getsignal(signal.SIGINT)
    play(*[followed(45)] * 10, between=press)
    done = command(*WORDS)
    assert done.code == 0
    assert "link1.length" in done.out
    assert "interrupted" not in done.err
    assert signal.getsignal(signal.SIGINT) == handler


@pytest.mark.skipif(os.name == "nt", reason="sends SIGHUP")
@pytest.mark.parametrize(("name", "code"), [("SIGTERM", 143), ("SIGHUP", 129)])
def test_sigterm_is_a_normal_end_with_an_exit_code_of_its_own(play, name, code):
    """So is a terminal that is closed."""
    number = getattr(signal, name)
    play(*[followed(45)] * 10, between=lambda k: signal.raise_signal(number) if k == 2 else None)
    done = command(*WORDS)
    assert done.code == code
    assert "link1.length" in done.out
    assert signal.getsignal(number) == signal.SIG_DFL


def test_an_error_after_the_first_ctrl_c_is_that_error(play):
    play(*[followed(45)] * 2, between=lambda k: signal.raise_signal(signal.SIGINT) if k else None,
         error=SettingsError("out: the disk is full."))  # fmt: skip
    done = command(*WORDS, "--quiet")
    assert (done.code, done.err) == (2, "monodyn: out: the disk is full.\n")


def test_a_second_ctrl_c_and_one_before_the_first_frame_end_it_at_once(play):
    def saving(progress):
        progress("fit", 1, 2)
        signal.raise_signal(signal.SIGINT)

    play(*[followed(45)] * 2, between=lambda k: signal.raise_signal(signal.SIGINT) if k else None,
         saving=saving)  # fmt: skip
    done = command(*WORDS, "--quiet")
    assert (done.code, done.out) == (130, "")
    assert done.err == "monodyn: interrupted; nothing was written.\n"
    play(followed(45), between=lambda k: signal.raise_signal(signal.SIGINT))
    assert command(*WORDS, "--quiet").code == 130


def test_how_far_the_results_are_is_shown_after_the_stream(play):
    play(followed(45), saving=lambda progress: progress("overlay", 3, 3))
    done = command(*WORDS)
    assert done.err.index("1.5 s, following") < done.err.index("overlay: 3 of 3")
