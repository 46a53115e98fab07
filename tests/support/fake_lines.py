"""An instrument of no twin of this project: a loopback socket whose answers a function of a test gives."""

from __future__ import annotations

import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


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

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Lines) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield f"socket://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
