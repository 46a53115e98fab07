"""Server of the page: with its own socket, one process, and no writes."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import platform
import secrets
import socket
from asyncio import constants
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import anyio
import h11
import uvicorn
from h11 import LocalProtocolError
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from rig.errors import UsageError
from rig.runs.previous import read_previous
from rig.watch.access import Access
from rig.watch.app import make_app
from rig.watch.shelf import Shelf

HEADERS_S = 10.0
"""Real seconds within which a connection must have sent a request that it began, or its first one."""
MOST_OF_ONE = 64
"""Maximum number of connections, and so of pages, from one address."""
_MOST_UNREAD = 1 << 20
"""Bytes of a request's body that are taken and thrown away after its answer, so that the client can read the answer."""


class BoundedProtocol(H11Protocol):
    """HTTP with bounded connections: bounded time to every whole request, bounded number in all and per address.

    If there are too many, the connection that has been without a request for longest is closed: of the same address if
    that has too many, of any address otherwise. The new one is closed only if all of its address have a request under
    way: half-open connections keep nobody out.
    """

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._too_late: asyncio.TimerHandle | None = None
        self._silent_since_s = self.loop.time()
        self._unread = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Give a new connection its time limit; close the one that was silent longest if there are too many."""
        super().connection_made(transport)
        self._begin_time_limit()
        host = self.client[0] if self.client else ""
        every = [c for c in self.connections if isinstance(c, BoundedProtocol)]
        own = [c for c in every if c.client and c.client[0] == host]
        if len(own) > MOST_OF_ONE:
            self._longest_silent(own)._give_up()
        elif (
            self.limit_concurrency is not None
            and len(every) >= self.limit_concurrency
            and (longest := self._longest_silent(every)) is not self
        ):
            longest._give_up()  # otherwise the new one gets the answer that the server is too busy

    def _longest_silent(self, some: list[BoundedProtocol]) -> BoundedProtocol:
        """The connection that has been without a request for longest; this one if all others have one under way."""
        silent = [c for c in some if c is not self and not c._under_way]
        return min(silent, key=lambda c: c._silent_since_s, default=self)

    @property
    def _under_way(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        """Take what has arrived; the rest of a body whose request has its answer is bounded too."""
        self._unread += len(data)
        if self._under_way or self.conn.their_state is not h11.SEND_BODY:
            self._unread = 0
        elif self._unread > _MOST_UNREAD:
            self._give_up()
            return
        super().data_received(data)
        if not self._under_way and self._too_late is None and not self.transport.is_closing():
            self._begin_time_limit()

    def handle_events(self) -> None:
        """Handle what has arrived; there is no time limit for the answer to a whole request."""
        super().handle_events()
        if self._under_way:
            self._asked()

    def on_response_complete(self) -> None:
        """Note since when there is no request under way."""
        self._silent_since_s = self.loop.time()
        super().on_response_complete()

    def send_400_response(self, msg: str) -> None:
        """Answer an invalid request, unless another answer has begun on this connection."""
        under_way = self.cycle
        if under_way is not None and not under_way.response_complete:
            under_way.disconnected = True  # the connection is closed, so the application cannot answer any more
            under_way.message_event.set()
            if under_way.response_started:
                self.transport.close()
                return
        with contextlib.suppress(LocalProtocolError):  # an answer to HEAD has no body
            super().send_400_response(msg)
        self.transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the time limit with the connection."""
        self._asked()
        super().connection_lost(exc)

    def _begin_time_limit(self) -> None:
        self._too_late = self.loop.call_later(HEADERS_S, self._give_up)

    def _asked(self) -> None:
        if self._too_late is not None:
            self._too_late.cancel()
            self._too_late = None

    def _give_up(self) -> None:
        self._asked()
        self.connections.discard(self)  # it is counted no more, although the transport ends a moment later
        self.transport.abort()


def serve(
    where: Path,
    *,
    host: str,
    port: int,
    token: str | None,
    against: Path | None,
    stopwatch: Callable[[], float],
    utc: Callable[[], float],
    announce: Callable[[str], None],
) -> None:
    """Serve the page of a run, or of a folder of runs, until interrupted.

    Args:
        where: the run file or folder.
        host: address to listen on.
        port: 0 for any that is free.
        token: token that a visitor must give; if None, one is generated if `host` can be reached from other machines.
        against: a previous calibration, or an earlier run, to compare observations with.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
        announce: called once with the address to open.

    Raises:
        UsageError: there is no such file or folder, or the port is taken.
    """
    if not where.exists():
        raise UsageError(f"there is no run file or folder {where}")
    reference = None if against is None else read_previous(against)
    shelf = Shelf(where, reference, stopwatch, utc)
    if shelf.only is not None:
        feed = shelf.feed(shelf.only)
        assert feed is not None
        feed.check()
    if token is None and not only_this_machine(host):
        token = secrets.token_urlsafe(18)
    access = Access(token or "", Access().names | {host.lower()})
    listening = listen(host, port)
    with contextlib.closing(listening):
        anywhere = host in ("0.0.0.0", "::")
        shown = platform.node() if anywhere else f"[{host}]" if ":" in host else host
        query = f"/?token={quote(token)}" if token else "/"
        announce(f"http://{shown}:{listening.getsockname()[1]}{query}")
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(configuration(make_app(shelf, access, anyio.sleep))).run(sockets=[listening])


def bound_handshakes() -> None:
    """Give a TLS handshake the same time as a request: asyncio waits for a minute, and counts no connection before."""
    constants.SSL_HANDSHAKE_TIMEOUT = HEADERS_S


def configuration(app: ASGIApp) -> uvicorn.Config:
    """Settings of the server: bounded, without a log of requests."""
    return uvicorn.Config(
        app,
        log_level="critical",  # its messages at the end are of no use
        access_log=False,  # the first address may contain a token
        lifespan="off",
        ws="none",
        http=BoundedProtocol,
        server_header=False,
        proxy_headers=False,
        limit_concurrency=200,
        timeout_keep_alive=20,
        timeout_graceful_shutdown=1,
    )


def only_this_machine(host: str) -> bool:
    """Whether an address can be reached only from this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def listen(host: str, port: int) -> socket.socket:
    """A listening socket. Raises `UsageError` if there cannot be one."""
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"cannot listen on {host} port {port}: {why}; choose another with --port") from error
