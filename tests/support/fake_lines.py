"""Instruments of no twin of this project: loopback sockets whose answers a test gives."""

from __future__ import annotations

import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

S = TypeVar("S", bound=socketserver.BaseServer)


@contextmanager
def serving(server: S) -> Iterator[S]:
    """A server, which answers until the block ends, by whatever: one whose socket is closed under it asks for
    connections for ever, at the cost of a processor.
    """
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@contextmanager
def answering(handler: type[socketserver.BaseRequestHandler], quiet_s: float = 0.06) -> Iterator[int]:
    """The port at which a class answers, each connection in a thread. Lines that are opened meanwhile need `quiet_s` of
    silence, less than a third of a second, since what answers from this machine does not pause.
    """
    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    with serving(server), pytest.MonkeyPatch.context() as patch:
        patch.setattr("rig.drivers.wires.serial_port.QUIET_S", quiet_s)
        yield server.server_address[1]


@contextmanager
def served(
    answer: Callable[[str], bytes | None],
    end: bytes = b"\n",
    later: Callable[[str], bytes | None] = lambda line: None,
    after_s: float = 0.0,
) -> Iterator[str]:
    """Its address while it is served.

    Args:
        answer: gives the bytes that answer a line, None if nothing does.
        end: of lines that it hears.
        later: what follows an answer, so many real seconds after it.
        after_s: see `later`.
    """

    class Lines(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            heard = b""
            while got := self.request.recv(256):
                *lines, heard = (heard + got).split(end)
                for line in lines:
                    if said := answer(line.decode("latin-1")):
                        self.request.sendall(said)
                    if more := later(line.decode("latin-1")):
                        threading.Timer(after_s, self.request.sendall, (more,)).start()

    with answering(Lines, 5.0 * after_s or 0.06) as port:  # a thread may come late
        yield f"socket://127.0.0.1:{port}"
