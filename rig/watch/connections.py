"""Connections to the page: a connection without a request is closed after a time."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from h11 import LocalProtocolError
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADERS_S = 10.0
"""Real seconds within which a new connection must have sent a request."""
MOST_OF_ONE = 64
"""Maximum number of connections, and so of pages, from one address."""


class BoundedProtocol(H11Protocol):
    """HTTP with bounded connections: bounded time to the first whole request, bounded number per address.

    If an address has too many, its connection that has been without a request for longest is closed. The new one is
    closed only if all have sent a request: half-open connections keep nobody out.
    """

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._too_late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """See `asyncio.Protocol`."""
        super().connection_made(transport)
        self._too_late = asyncio.get_running_loop().call_later(HEADERS_S, self._give_up)
        host = self.client[0] if self.client else ""
        own = [c for c in self.connections if isinstance(c, BoundedProtocol) and c.client and c.client[0] == host]
        if len(own) > MOST_OF_ONE:
            silent = [c for c in own if c is not self and c._too_late is not None]
            # The earliest deadline is that of the connection that has been silent for longest.
            first = min(silent, key=lambda c: c._too_late.when() if c._too_late else 0.0, default=self)
            first._give_up()

    def handle_events(self) -> None:
        """See `H11Protocol`; there is no time limit for the answer to a whole request."""
        super().handle_events()
        if self.cycle is not None:
            self._asked()

    def send_400_response(self, msg: str) -> None:
        """See `H11Protocol`: the answer to an invalid request, unless another answer has begun on this connection."""
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
        """See `asyncio.Protocol`."""
        self._asked()
        super().connection_lost(exc)

    def _asked(self) -> None:
        if self._too_late is not None:
            self._too_late.cancel()
            self._too_late = None

    def _give_up(self) -> None:
        self._asked()
        self.transport.abort()
