"""The page of a stream, asked for by clients that we did not write: ``http.client``, ``urllib``, sockets."""

from __future__ import annotations

import errno
import http.client
import json
import socket
import sys
import threading
import time
import urllib.request
from contextlib import contextmanager

import cv2
import numpy as np
import pytest

from lives import followed, picture, scene, watched
from monodyn.errors import SettingsError
from monodyn.live import server as server_module
from monodyn.live import view as view_module
from monodyn.live.meter import Meter
from monodyn.live.picture import WIDEST, drawn_over, jpeg_of
from monodyn.live.server import LOOPBACK, Address, Server, address_of
from monodyn.live.view import View
from support import refuses

pytest.importorskip("waitress")


@contextmanager
def served(*steps):
    """Serve some frames; give the view and its port."""
    meter = Meter()
    view = View("clip <b>1</b>.mp4", 1.0, meter, Address(LOOPBACK, 0).hosts)
    server = Server(view, Address(LOOPBACK, 0))
    for step in steps:
        meter.add(step)
        view.add(step)
    try:
        yield view, server.port
    finally:
        view.close()
        server.close()


def asked(port, path, method="GET", **headers):
    """Ask for a path; return status, headers, body."""
    connection = http.client.HTTPConnection(LOOPBACK, port, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), body


def pictures(stream, count):
    """Yield the pictures of a film, read by its own lengths."""
    for _ in range(count):
        while not (line := stream.readline()).lower().startswith(b"content-length:"):
            assert line, "the film has ended"
        length = int(line.split(b":")[1])
        assert stream.readline() == b"\r\n"
        data = stream.read(length)
        yield cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def film(port):
    return urllib.request.urlopen(f"http://{LOOPBACK}:{port}/film", timeout=10)


def test_the_page_and_what_belongs_to_it():
    with served(watched()) as (_, port):
        for path, kind in (("/", "text/html"), ("/page.js", "text/javascript"), ("/page.css", "text/css")):
            status, headers, body = asked(port, path)
            assert (status, headers["Content-Type"]) == (200, f"{kind}; charset=utf-8")
            assert body
            assert headers["X-Content-Type-Options"] == "nosniff"
            assert headers["Content-Security-Policy"].startswith("default-src 'self'")
            # nothing from elsewhere, nothing in line
            assert b"://" not in body
        html = asked(port, "/")[2].decode()
        assert "<script>" not in html
        assert "innerHTML" not in asked(port, "/page.js")[2].decode()


def test_the_state_is_the_step_in_numbers():
    with served(watched(3), followed(45)) as (_, port):
        status, headers, body = asked(port, "/state")
        state = json.loads(body)
        assert (status, headers["Content-Type"]) == (200, "application/json")
        assert state["name"] == "clip <b>1</b>.mp4"
        assert state["step"]["frame"] == 45
        assert state["units"] == {"joint1": "rad"}
        assert state["pose_latency"] == [4.2e-3, 4.2e-3]
        assert state["hardly_known"] == []
    with served() as (_, port):
        assert json.loads(asked(port, "/state")[2])["step"] is None
        assert asked(port, "/picture")[0] == 503


def test_nothing_else_is_served_and_nothing_is_taken():
    with served(watched()) as (_, port):
        for path in (
            "/no",
            "/page.html",
            "/../pyproject.toml",
            "/%2e%2e/page.py",
            "//etc/passwd",
            "/page.css/",
        ):
            assert asked(port, path)[0] == 404, path
        for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS"):
            status, headers, _ = asked(port, "/state", method)
            assert (status, headers["Allow"]) == (405, "GET"), method


def test_a_name_that_points_here_is_refused():
    """DNS rebinding: the browser thinks that it talks to the attacker's site, and says so in Host."""
    with served(watched()) as (_, port):
        for host in (
            "evil.example",
            f"evil.example:{port}",
            "127.0.0.1.evil.example",
            "",
            "[::1].evil",
            "x[::1]:80",
        ):
            assert asked(port, "/state", Host=host)[0] == 403, host
        for host in (f"localhost:{port}", f"127.0.0.1:{port}", "LOCALHOST", f"[::1]:{port}", "[::1]"):
            assert asked(port, "/state", Host=host)[0] == 200, host
    assert Address("0.0.0.0", 80).hosts is None
    assert Address("192.168.1.5", 80).hosts is None
    assert Address("127.1.2.3", 80).hosts is not None


def test_a_film_shows_the_newest_frame_and_repeats_it_while_there_is_none(monkeypatch):
    monkeypatch.setattr(view_module, "REPEATED", 0.1)
    with served(watched(0)) as (view, port), film(port) as stream:
        assert stream.headers["Content-Type"] == "multipart/x-mixed-replace; boundary=frame"
        for shown in pictures(stream, 2):
            assert shown.shape == (240, 320, 3)
        dark = picture(1)
        dark.luma[:] = 16
        view.add(watched(1, frame=dark))
        assert list(pictures(stream, 3))[-1].mean() < 20


@pytest.mark.slow
def test_nothing_is_drawn_while_nobody_watches_and_one_picture_for_all_who_do(monkeypatch):
    drawn = []
    monkeypatch.setattr(view_module, "jpeg_of", lambda step: drawn.append(step.index) or jpeg_of(step))
    monkeypatch.setattr(view_module, "REPEATED", 0.05)
    with served(*map(watched, range(20))) as (view, port):
        asked(port, "/state")
        assert drawn == []
        with film(port) as one, film(port) as other:
            list(pictures(one, 2))
            list(pictures(other, 2))
            assert drawn == [19]
            began = time.monotonic()
            for k in range(20, 220):
                view.add(watched(k))
                time.sleep(0.005)
            seconds = time.monotonic() - began
        # fifteen a second for both together, and not two hundred
        assert 5 < len(drawn) <= 15 * seconds + 3


def test_a_client_that_vanishes_and_one_that_never_reads_hinder_nobody(monkeypatch):
    monkeypatch.setattr(view_module, "REPEATED", 0.05)
    monkeypatch.setattr(view_module, "FASTEST", 200.0)
    rng = np.random.default_rng(0)
    noise = picture(0, 640, 480)
    noise.luma[:] = rng.integers(0, 255, noise.luma.shape, dtype=np.uint8)
    with served(watched(0, frame=noise)) as (view, port):
        gone, idle = (socket.create_connection((LOOPBACK, port)) for _ in range(2))
        for client in (gone, idle):
            client.sendall(f"GET /film HTTP/1.1\r\nHost: {LOOPBACK}\r\n\r\n".encode())
        gone.recv(100)
        gone.close()
        # large pictures fill what the idle client does not read: the server has to wait for it
        with film(port) as stream:
            for k, _ in enumerate(pictures(stream, 40)):
                # as a camera goes on: this must never wait
                began = time.monotonic()
                view.add(watched(k, frame=noise))
                assert time.monotonic() - began < 1.0
            assert asked(port, "/state")[0] == 200
        deadline = time.monotonic() + 10.0
        while view._watchers > 1 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert view._watchers == 1
        idle.close()
        while view._watchers and time.monotonic() < deadline:
            time.sleep(0.02)
        assert view._watchers == 0


@pytest.mark.slow
def test_a_slow_client_gets_no_old_pictures(monkeypatch):
    monkeypatch.setattr(view_module, "FASTEST", 500.0)
    monkeypatch.setattr(view_module, "REPEATED", 0.01)
    rng = np.random.default_rng(0)
    with served() as (view, port):
        base = rng.integers(0, 40, (480, 640), dtype=np.uint8)

        def of(k):
            frame = picture(k, 640, 480, colour=False)
            frame.luma[:] = base + np.uint8(k)
            return watched(k, frame=frame)

        view.add(of(0))
        with film(port) as stream:
            next(pictures(stream, 1))
            for k in range(1, 200):
                view.add(of(k))
                time.sleep(0.003)
            # what the kernel and the server hold between them is a few megabytes at most: some ten pictures
            seen = [shown.mean() for shown in pictures(stream, 60)]
        assert seen[-1] == pytest.approx(jpeg_mean(of(199)), abs=2.0)


def jpeg_mean(step):
    return cv2.imdecode(np.frombuffer(jpeg_of(step), np.uint8), cv2.IMREAD_COLOR).mean()


def test_more_than_a_few_do_not_watch_at_the_same_time(monkeypatch):
    monkeypatch.setattr(view_module, "MOST_WATCHERS", 1)
    monkeypatch.setattr(view_module, "REPEATED", 0.05)
    with served(watched()) as (view, port):
        with film(port) as stream:
            list(pictures(stream, 1))
            assert asked(port, "/film")[0] == 503
            assert asked(port, "/state")[0] == 200
        deadline = time.monotonic() + 10.0
        while view._watchers and time.monotonic() < deadline:
            time.sleep(0.02)
        with film(port) as stream:
            assert len(list(pictures(stream, 1))) == 1


def test_at_its_end_no_thread_is_left_and_the_port_is_free(monkeypatch):
    before = threading.active_count()
    with served(followed()) as (_, port):
        stream = film(port)
        idle = socket.create_connection((LOOPBACK, port))
        idle.sendall(f"GET /film HTTP/1.1\r\nHost: {LOOPBACK}\r\n\r\n".encode())
        next(pictures(stream, 1))
    deadline = time.monotonic() + 5.0
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before
    stream.close()
    idle.close()
    Server(lambda *_: [], Address(LOOPBACK, port)).close()


def test_addresses_in_words():
    assert address_of("8000") == (LOOPBACK, 8000)
    assert address_of("localhost:80") == ("localhost", 80)
    assert address_of("[::1]:8000") == ("::1", 8000)
    assert address_of("0.0.0.0:9") == ("0.0.0.0", 9)
    assert address_of("0.0.0.0:9").url == "http://127.0.0.1:9/"
    assert address_of("[::1]:8000").url == "http://[::1]:8000/"
    for text in ("", "x", "0", "65536", ":80", "a b:80", "80:", "::1:80", "http://x:80", "-1", "8000/x"):
        with refuses(
            SettingsError,
            f"view: expected PORT or HOST:PORT with a port from 1 to 65535, got '{text}'; e.g. 8000.",
        ):
            address_of(text)


def test_an_address_that_cannot_be_used_is_refused_in_one_line(monkeypatch):
    with socket.socket() as taken:
        taken.bind((LOOPBACK, 0))
        taken.listen()
        port = taken.getsockname()[1]
        with refuses(SettingsError, f"view: expected a free port, port {port} is in use; give another one."):
            Server(None, Address(LOOPBACK, port))
    with refuses(SettingsError, "view '192.0.2.1': expected an address of this machine, got another one."):
        Server(None, Address("192.0.2.1", 8000))

    def fails(error):
        def listening(address):
            raise error

        monkeypatch.setattr(server_module, "_listening", listening)

    fails(socket.gaierror(-2, "Name or service not known"))
    with refuses(
        SettingsError, "view 'no.such': expected an address of this machine, got a name that is not known."
    ):
        Server(None, Address("no.such", 8000))
    fails(OSError(errno.EACCES, "Permission denied"))
    with refuses(SettingsError, "view: expected a port that you may use, got 80; give one from 1024 on."):
        Server(None, Address(LOOPBACK, 80))
    fails(OSError(errno.EMFILE, "Too many open files"))
    with refuses(SettingsError, "view '127.0.0.1:80': cannot be served (Too many open files); give another."):
        Server(None, Address(LOOPBACK, 80))


def test_without_waitress_one_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "waitress", None)
    with refuses(
        SettingsError,
        "view: expected the package 'waitress', which is not installed; install it with pip install "
        "'monodyn[live]'.",
    ):
        Server(None, Address(LOOPBACK, 0))


def test_the_picture_has_the_pose_in_colour_and_faintly_where_it_will_be():
    step = followed()
    plain = drawn_over(watched(45, frame=step.frame))
    both, alone = drawn_over(step), drawn_over(followed(estimate=None))
    height = step.frame.luma.shape[0]
    found, ahead = np.abs(np.stack([alone, both]).astype(int) - plain)[:, :height] > 8
    assert 50 < found.sum() < ahead.sum()
    # what is predicted is changed by less than what was found
    added = ahead & ~found
    assert added.sum() > 50
    strongest = [np.abs(both.astype(int) - plain)[:height][where].max() for where in (added, found)]
    assert strongest[0] < 0.7 * strongest[1]
    # of a mechanism that is refused nothing is predicted
    from monodyn.estimation.fit import Doubt

    refused = step.fit.doubted([Doubt("refused", "It is another mechanism.")])
    assert not np.any(drawn_over(followed(fit=refused)) != drawn_over(followed(base=refused, estimate=None)))


def test_large_pictures_are_made_smaller_and_odd_ones_are_shown_whole():
    for width, height, size in ((2560, 1441, (720, WIDEST)), (321, 241, (241, 321))):
        step = followed(frame=picture(45, width, height), scene=scene(followed().fit, width, height))
        shown = cv2.imdecode(np.frombuffer(jpeg_of(step), np.uint8), cv2.IMREAD_COLOR)
        assert shown.shape == (*size, 3)
    grey = cv2.imdecode(np.frombuffer(jpeg_of(watched(frame=picture(0, colour=False))), np.uint8), -1)
    assert np.ptp(grey.reshape(-1, 3).astype(int), axis=1).max() <= 2
