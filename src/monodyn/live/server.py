"""A web application served by waitress on a thread of its own, on this machine unless told otherwise."""

from __future__ import annotations

import errno
import logging
import re
import socket
import threading
from typing import Any, NamedTuple

from monodyn.errors import SettingsError
from monodyn.extras import extra

LOOPBACK = "127.0.0.1"
"""Where is served unless another host is named: no other machine gets there."""
THREADS = 10
"""Answers that are made at the same time: films, and room for what is short."""
HELD = 65_536
"""Bytes that wait for a client, about a picture: a slow one gets fewer pictures, and no old ones."""
TICK = 0.5
"""Longest wait for something to do [s]."""
LAST_WAIT = 2
"""How long answers that are being made may take at the end [s]."""


class Address(NamedTuple):
    """Where a page is served.

    Attributes:
        host: Name or number of the machine's own address.
        port: The port.
    """

    host: str
    port: int

    @property
    def hosts(self) -> frozenset[str] | None:
        """What a request may call this machine, on loopback; None where it is reached from others."""
        local = self.host in ("localhost", "::1") or self.host.startswith("127.")
        return frozenset({self.host, f"[{self.host}]", "localhost", LOOPBACK, "[::1]"}) if local else None

    @property
    def url(self) -> str:
        """What to open."""
        host = LOOPBACK if self.host in ("0.0.0.0", "::") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"


def address_of(text: str) -> Address:
    """Return the address that ``PORT`` or ``HOST:PORT`` stands for.

    Args:
        text: What the user wrote.

    Raises:
        SettingsError: it is neither.
    """
    found = re.fullmatch(r"(?:(?:\[([0-9a-fA-F:.]+)\]|([^:\[\]\s/]+)):)?(\d{1,5})", text.strip())
    if not found or not 1 <= int(found[3]) <= 65535:
        raise SettingsError(
            f"view: expected PORT or HOST:PORT with a port from 1 to 65535, got '{text}'; e.g. 8000."
        )
    return Address(found[1] or found[2] or LOOPBACK, int(found[3]))


class Server:
    """Serves a web application until it is closed.

    Args:
        application: The application (WSGI).
        address: Where; port 0 takes any that is free.

    Attributes:
        port: The port.

    Raises:
        SettingsError: waitress is not installed, or the address cannot be used.
    """

    def __init__(self, application: Any, address: Address) -> None:
        wasyncore = extra("view", "waitress.wasyncore", "live")
        create_server = extra("view", "waitress.server", "live").create_server
        self._sockets: dict[int, Any] = {}
        try:
            listening = _listening(address)
        except OSError as error:
            raise SettingsError(_cannot(address, error)) from None
        self.port = int(listening.getsockname()[1])
        # it warns of answers that wait for a thread: more pages than threads are no error
        logging.getLogger("waitress.queue").setLevel(logging.ERROR)
        # its own loop, so that it can be ended; waitress' way to end is to end the program
        self._server: Any = create_server(
            application, map=self._sockets, sockets=[listening], threads=THREADS, ident=None,
            outbuf_high_watermark=HELD, clear_untrusted_proxy_headers=True,
            max_request_body_size=0, max_request_header_size=16_384, connection_limit=64,
        )  # fmt: skip
        self._loop, self._closed = wasyncore, False
        self._thread = threading.Thread(target=self._serve, name="view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it; what waits for a client is dropped."""
        self._closed = True
        self._server.pull_trigger()
        self._thread.join(LAST_WAIT + 2.0 * TICK)

    def _serve(self) -> None:
        while not self._closed:
            self._loop.loop(timeout=TICK, use_poll=True, map=self._sockets, count=1)
        # threads that wait for a client to take what they have are let go
        for channel in list(self._server.active_channels.values()):
            channel.handle_close()
        self._server.task_dispatcher.shutdown(timeout=LAST_WAIT)
        self._server.close()
        self._loop.close_all(self._sockets, ignore_all=True)


def _listening(address: Address) -> socket.socket:
    """Return a socket that is bound to an address; the first that its name stands for."""
    family, kind, protocol, _, place = socket.getaddrinfo(
        address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    bound = socket.socket(family, kind, protocol)
    try:
        # a port that was in use a minute ago is free; one that is in use is not
        if hasattr(socket, "SO_REUSEADDR") and not hasattr(socket, "SO_EXCLUSIVEADDRUSE"):
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(place)
        # two sockets may be bound to a port, and only one can listen
        bound.listen()
    except OSError:
        bound.close()
        raise
    return bound


def _cannot(address: Address, error: OSError) -> str:
    """Say why an address cannot be used."""
    if isinstance(error, socket.gaierror):
        return f"view '{address.host}': expected an address of this machine, got a name that is not known."
    if error.errno == errno.EADDRINUSE:
        return f"view: expected a free port, port {address.port} is in use; give another one."
    if error.errno == errno.EACCES:
        return f"view: expected a port that you may use, got {address.port}; give one from 1024 on."
    if error.errno == errno.EADDRNOTAVAIL:
        return f"view '{address.host}': expected an address of this machine, got another one."
    return (
        f"view '{address.host}:{address.port}': cannot be served ({error.strerror or error}); give another."
    )
