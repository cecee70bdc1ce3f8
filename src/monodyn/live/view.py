"""What is known of a stream as web pages: a page, the pictures that it shows, the numbers below them.

Pictures are drawn while somebody watches, on the threads of the server, each for all who watch at that
moment; only the newest frame is kept. The application is WSGI, and ``server`` has it served.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from monodyn.live.document import hardly_known, step_document
from monodyn.live.meter import Meter, Spread
from monodyn.live.picture import jpeg_of
from monodyn.live.step import Step
from monodyn.mechanism import Mechanism

FASTEST = 15.0
"""Pictures a second, at most."""
REPEATED = 1.0
"""Seconds without a new frame after which the last picture is sent again: so a client that has gone shows."""
MOST_WATCHERS = 6
"""Films that are sent at the same time, at most; each takes a thread of the server."""
BOUNDARY = "frame"
PAGES = {"/": ("page.html", "text/html"), "/page.js": ("page.js", "text/javascript"),
         "/page.css": ("page.css", "text/css")}  # fmt: skip
"""The files of the page by path, and what they are; nothing else in the file system is served."""
SECURE = (
    ("X-Content-Type-Options", "nosniff"),
    ("Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'; base-uri 'none'"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-store"),
)
"""Headers of every answer: no other site shows or reads what is served here, and nothing is kept."""

Begin = Callable[[str, list[tuple[str, str]]], Any]


class View:
    """The newest frame of a stream, and the application that shows it.

    Args:
        name: Name of the source.
        ahead: How far ahead the motion is predicted [s].
        meter: How fast the stream goes.
        hosts: What the ``Host`` of a request may name, without its port: an attacker's name that has been
            pointed at this machine is none of them. None takes every one.
    """

    def __init__(self, name: str, ahead: float, meter: Meter, hosts: frozenset[str] | None = None) -> None:
        self._name, self._ahead, self._meter, self._hosts = name, ahead, meter, hosts
        self._change, self._drawing = threading.Condition(), threading.Lock()
        self._step: Step | None = None
        self._drawn: _Drawn | None = None
        self._watchers, self._closed = 0, False

    def add(self, step: Step) -> None:
        """Take the newest frame.

        Args:
            step: What is known at it.
        """
        with self._change:
            self._step = step
            self._change.notify_all()

    def close(self) -> None:
        """End the films that are being sent."""
        with self._change:
            self._closed = True
            self._change.notify_all()

    def __call__(self, environ: dict[str, Any], begin: Begin) -> Iterable[bytes]:
        """Answer a request (WSGI).

        Args:
            environ: The request.
            begin: Takes status and headers.
        """
        path = environ.get("PATH_INFO", "")
        if self._hosts is not None and _host(environ.get("HTTP_HOST", "")) not in self._hosts:
            return _answer(begin, "403 Forbidden", b"This address is not known here.\n")
        if environ.get("REQUEST_METHOD") != "GET":
            return _answer(begin, "405 Method Not Allowed", b"Only GET.\n", more=[("Allow", "GET")])
        if path in PAGES:
            return _answer(begin, "200 OK", _page(path), kind=f"{PAGES[path][1]}; charset=utf-8")
        if path == "/state":
            return _answer(begin, "200 OK", self.state(), kind="application/json")
        if path == "/picture":
            return self._picture(begin)
        if path == "/film":
            return self._film(begin)
        return _answer(begin, "404 Not Found", b"There is nothing here.\n")

    def state(self) -> bytes:
        """Return what is known at the newest frame as JSON."""
        step, pace = self._step, self._meter.pace
        document: dict[str, Any] = {
            "name": self._name, "ahead": self._ahead, "ended": self._closed, "rate": pace.rate,
            "pose_latency": _latency(pace.pose), "fit_latency": _latency(pace.fit), "units": {},
            "hardly_known": [], "step": None,
        }  # fmt: skip
        if step is not None:
            document["step"] = step_document(step)
            document["units"] = _units(step)
            # infinity is no number of JSON
            wide = () if step.fit is None else hardly_known(step.fit)
            document["hardly_known"] = [name for name, _ in wide]
        return json.dumps(document, allow_nan=False).encode()

    def _picture(self, begin: Begin) -> Iterable[bytes]:
        """Answer with the newest picture."""
        step = self._step
        if step is None:
            return _answer(begin, "503 Service Unavailable", b"There is no frame yet.\n")
        return _answer(begin, "200 OK", self._jpeg(step), kind="image/jpeg")

    def _film(self, begin: Begin) -> Iterable[bytes]:
        """Answer with one picture after the other (motion JPEG)."""
        with self._change:
            full = self._watchers >= MOST_WATCHERS
            self._watchers += not full
        if full:
            return _answer(begin, "503 Service Unavailable", b"Too many watch already; close another page.\n")
        begin("200 OK", [("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}"), *SECURE])
        return _Film(self._parts(), self._left)

    def _left(self) -> None:
        with self._change:
            self._watchers -= 1

    def _parts(self) -> Iterator[bytes]:
        """Yield picture after picture, the newest each time, until the stream ends."""
        shown: Step | None = None
        yield f"--{BOUNDARY}".encode()
        while not self._closed:
            shown, began = self._after(shown), time.monotonic()
            if shown is None:
                continue
            picture = self._jpeg(shown)
            head = f"\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture)}\r\n\r\n"
            # a browser shows a picture once it sees where the next one begins
            yield head.encode() + picture + f"\r\n--{BOUNDARY}".encode()
            time.sleep(max(1.0 / FASTEST - (time.monotonic() - began), 0.0))

    def _after(self, last: Step | None) -> Step | None:
        """Return the newest frame once it is another one, or after a while the same."""
        with self._change:
            self._change.wait_for(lambda: self._closed or self._step is not last, REPEATED)
            return self._step

    def _jpeg(self, step: Step) -> bytes:
        """Return the picture of a frame, or for one of several who watch the one of a moment ago."""
        with self._drawing:
            drawn, now = self._drawn, time.monotonic()
            if drawn is None or (drawn.step is not step and now - drawn.at >= 1.0 / FASTEST):
                drawn = self._drawn = _Drawn(step, now, jpeg_of(step))
            return drawn.picture


class _Drawn(NamedTuple):
    """A picture, of which frame it is, and when it was drawn [s]."""

    step: Step
    at: float
    picture: bytes


class _Film:
    """Parts of an answer; ``close`` is called when it ends, also where its client left before it began."""

    def __init__(self, parts: Iterator[bytes], left: Callable[[], None]) -> None:
        self._parts, self._left = parts, left

    def __iter__(self) -> Iterator[bytes]:
        return self._parts

    def close(self) -> None:
        self._left()


def _answer(
    begin: Begin, status: str, body: bytes, *, kind: str = "text/plain", more: Iterable[tuple[str, str]] = ()
) -> list[bytes]:
    begin(status, [("Content-Type", kind), ("Content-Length", str(len(body))), *more, *SECURE])
    return [body]


@cache
def _page(path: str) -> bytes:
    return files("monodyn.live").joinpath(PAGES[path][0]).read_bytes()


def _host(text: str) -> str:
    """Return the host of a ``Host`` header without its port: ``[::1]:80`` is ``[::1]``."""
    name, colon, port = text.rpartition(":")
    return (
        name if colon and port.isdigit() and (not name or name[-1] == "]" or ":" not in name) else text
    ).lower()


def _latency(spread: Spread | None) -> list[float] | None:
    return None if spread is None else list(spread)


def _units(step: Step) -> dict[str, str]:
    """Return the unit of each joint's position."""
    mechanism: Mechanism | None = None if step.scene is None else step.scene.mechanism
    joints = () if mechanism is None else mechanism.joints
    return {joint.name: "rad" if joint.kind == "hinge" else "m" for joint in joints}
