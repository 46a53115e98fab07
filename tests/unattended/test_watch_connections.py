"""Connections of the pages' servers: half-open ones and endless bodies keep nobody out."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import patch

import pytest
import uvicorn

from rig.watch import server as module
from rig.watch.server import configuration, listen

ASK = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
HALF = b"GET / HTTP/1.1\r\nX-Slow: "
Connect = Callable[[], socket.socket]


async def refuse(_scope: Any, _receive: Any, send: Any) -> None:
    """Answer 401 at once, and read no body."""
    await send({"type": "http.response.start", "status": 401, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"no"})


@pytest.fixture
def connect() -> Iterator[Connect]:
    """Connects to a server that takes 20 connections."""
    settings = configuration(refuse)
    settings.limit_concurrency = 20
    server, listening = uvicorn.Server(settings), listen("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    with contextlib.ExitStack() as opened:
        opened.enter_context(listening)

        def connected() -> socket.socket:
            return opened.enter_context(socket.create_connection(listening.getsockname(), timeout=5))

        thread.start()
        yield connected
        server.should_exit = True
        thread.join(10)


def answered(one: socket.socket, asked: bytes = ASK) -> bytes:
    one.sendall(asked)
    found = b""
    while not found.endswith(b"\r\n\r\nno") and (part := one.recv(4096)):
        found += part
    return found.partition(b"\r\n")[0]


def ends_after(one: socket.socket, begun: bytes) -> None:
    """Send what begins a request, after which the time limit is over at once."""
    with patch.object(module, "HEADERS_S", 0.0), contextlib.suppress(ConnectionResetError):
        one.sendall(begun)
        assert one.recv(1) == b""


def test_a_further_request_has_a_time_limit_too(connect: Connect):
    one = connect()
    assert answered(one) == b"HTTP/1.1 401 Unauthorized"
    ends_after(one, HALF)


@pytest.mark.parametrize("most", [64, 10])
def test_half_a_further_request_keeps_nobody_out(most: int, connect: Connect):
    """Neither by the number of one address nor by the number of all."""
    with patch.object(module, "MOST_OF_ONE", most):
        for _ in range(30):
            one = connect()
            assert answered(one) == b"HTTP/1.1 401 Unauthorized"
            one.sendall(HALF)
        assert answered(connect()) == b"HTTP/1.1 401 Unauthorized"


POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n"


def test_a_body_that_nobody_reads_ends(connect: Connect):
    one = connect()
    assert answered(one, POST % 10**11) == b"HTTP/1.1 401 Unauthorized"
    with pytest.raises((ConnectionResetError, BrokenPipeError)):
        one.sendall(b"a" * 65536 * 1000)
    assert answered(connect()) == b"HTTP/1.1 401 Unauthorized"


def test_a_short_body_that_nobody_reads_costs_no_connection(connect: Connect):
    one = connect()
    assert answered(one, POST % 60000) == b"HTTP/1.1 401 Unauthorized"
    one.sendall(b"a" * 60000)
    assert answered(one) == b"HTTP/1.1 401 Unauthorized"


def test_a_body_that_trickles_after_the_answer_has_a_time_limit(connect: Connect):
    one = connect()
    assert answered(one, POST % 1000) == b"HTTP/1.1 401 Unauthorized"
    ends_after(one, b"a")
