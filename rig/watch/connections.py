"""Connections to the page: none is held by somebody who never asks anything."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from h11 import LocalProtocolError
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADERS_S = 10.0
"""Real seconds in which a connection that was opened has to have asked for something."""
MOST_OF_ONE = 64
"""Connections from one address: so many pages, and no more."""


class BoundedProtocol(H11Protocol):
    """HTTP whose connections are bounded: by the time to the first whole request, and by number from one address.

    Where an address has too many, that of them goes which has asked nothing for longest, and the new one only if all
    have: half-open connections keep nobody out.
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
            # The earliest deadline is that of the longest silence.
            first = min(silent, key=lambda c: c._too_late.when() if c._too_late else 0.0, default=self)
            first._give_up()

    def handle_events(self) -> None:
        """See `H11Protocol`; a request that has come whole may take its time to be answered."""
        super().handle_events()
        if self.cycle is not None:
            self._asked()

    def send_400_response(self, msg: str) -> None:
        """See `H11Protocol`: said to what is no request, unless an answer to another has begun on this connection."""
        under_way = self.cycle
        if under_way is not None and not under_way.response_complete:
            under_way.disconnected = True  # the application has nobody left to answer
            under_way.message_event.set()
            if under_way.response_started:
                self.transport.close()
                return
        with contextlib.suppress(LocalProtocolError):  # an answer to HEAD has no words
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
