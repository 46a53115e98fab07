"""The door that others reach over a wire: the live page."""

from __future__ import annotations

import contextlib
import logging
import random
import re
import select
import shutil
import socket
import threading
from pathlib import Path

import anyio
import uvicorn

from proving.doors.hostile import Acts, Material, Wrong, damaged
from rig.watch import Access, Shelf, make_app
from rig.watch.server import configuration


class _Errors(logging.Handler):
    """Keeps what a server says went wrong."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.told: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.told.append(self.format(record))


class Page:
    """The live page, served as `rig watch` does, in a thread: with a token or without."""

    def __init__(self, folder: Path, token: str) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        access = Access(token, frozenset({"bench.lab"}))
        seconds = iter(range(10**9))
        shelf = Shelf(folder, None, lambda: float(next(seconds)), lambda: 2e9)
        self.errors = _Errors()
        config = configuration(make_app(shelf, access, anyio.sleep))
        for name in ("uvicorn.error", "asyncio"):
            logger = logging.getLogger(name)
            logger.setLevel(logging.ERROR)
            logger.addHandler(self.errors)
            logger.propagate = False
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, kwargs={"sockets": [self._listening]}, daemon=True)
        self.thread.start()
        while not self.server.started:
            self.thread.join(0.01)

    def close(self) -> None:
        """End the server."""
        self.server.should_exit = True
        self.thread.join()
        self._listening.close()

    def answer(self, request: bytes, moment_s: float = 0.03) -> bytes:
        """What comes back for some bytes, of a stream the beginning. Raises `Wrong`.

        The line is closed on our side only when an answer has come whole, or none comes for `moment_s`: a server stops
        working for somebody who has gone.
        """
        self.errors.told.clear()
        got, closed = b"", False
        with socket.create_connection(("127.0.0.1", self.port)) as line, contextlib.suppress(ConnectionError):
            line.sendall(request)
            while True:
                if not closed and (_whole(got) or not select.select([line], [], [], moment_s)[0]):
                    closed = True
                    line.shutdown(socket.SHUT_WR)
                data = line.recv(65536)
                got += data
                if not data or (b"text/event-stream" in got and b"\n\n" in got.partition(b"\r\n\r\n")[2]):
                    break
        if self.errors.told:
            raise Wrong(self.errors.told[0])
        return got


_LENGTH = re.compile(rb"\r\ncontent-length: (\d+)\r\n", re.IGNORECASE)


def _whole(answer: bytes) -> bool:
    head, end, body = answer.partition(b"\r\n\r\n")
    length = _LENGTH.search(head + b"\r\n")
    return bool(end) and length is not None and len(body) >= int(length[1])


_PATHS = (
    "/", "/run/{}", "/run/{}/state.json", "/run/{}/events", "/static/watch.css", "/static/watch.js", "/favicon.ico",
    "/static/../app.py", "/static/..%2fapp.py", "/run/../../etc/passwd", "/run/%00", "/run/%ff%fe", "//evil.example/",
    "/run/" + "x" * 3000, "/" + "a" * 70000, "/run/%0d%0aSet-Cookie:%20a=b", "/\\evil", "*", "http://evil/", "evil:1",
    "/run/%2e%2e", "/run/<script>", "/%", "/run/{}/", "/RUN/{}", "/run/{}/state.json/x", "/.", "/static/", "/run/",
)  # fmt: skip
_HOSTS = (
    "127.0.0.1", "localhost", "bench.lab", "evil.example", "", "[::1", "[::1]:80", "a:b:c", "\xff", "127.0.0.1:x",
    "::1",
)  # fmt: skip
_QUERIES = (
    "", "?token=secret", "?token=", "?token=%ff", "?token=secret&a=%0d%0ab", "?token=x&token=secret",
    "?" + "a=1&" * 5000,
)  # fmt: skip
_HEADS = (
    "Cookie: rig_watch=secret", "Cookie: rig_watch=\xff", "Cookie: " + "a=b; " * 3000, "Cookie: =;;=",
    "Last-Event-ID: 5", "Last-Event-ID: -1", "Last-Event-ID: \xb2", "Last-Event-ID: " + "9" * 5000,
    "Content-Length: 5", "Content-Length: x", "Content-Length: -1", "Content-Length: " + "9" * 400,
    "Transfer-Encoding: chunked", "Transfer-Encoding: x", "Expect: 100-continue",
    "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Key: x", "Upgrade: h2c", "X: " + "y" * 70000, ": x",
    "no colon", " folded", "Host: other", "Accept: */*", "Range: bytes=0-1", "If-None-Match: *", "\0: x",
    "X-Forwarded-For: 1.1.1.1", "a b: c",
)  # fmt: skip
_METHODS = ("GET", "HEAD", "POST", "OPTIONS", "TRACE", "CONNECT", "get", "PRI", "G\0T", "", "X" * 300)
_ALLOWED = frozenset(
    b"date content-length content-type location set-cookie allow retry-after x-accel-buffering connection upgrade "
    b"content-security-policy x-content-type-options referrer-policy cross-origin-resource-policy transfer-encoding "
    b"cross-origin-opener-policy cache-control".split()
)


def _request(rng: random.Random, name: str) -> bytes:
    usual = rng.random() < 0.7
    method = rng.choice(("GET", "GET", "GET", "HEAD")) if usual else rng.choice(_METHODS)
    host = rng.choice(_HOSTS[:3]) if usual else rng.choice(_HOSTS)
    heads = [f"Host: {host}"] if rng.random() < 0.97 else []
    heads += rng.sample(_HEADS, rng.choice((0, 0, 1, 1, 2, 5)))
    version = rng.choice(("1.1", "1.1", "1.1", "1.0", "2.0", "9", "x"))
    path = rng.choice(_PATHS).replace("{}", rng.choice((name, name, "gone", "whole.sqlite"))) + rng.choice(_QUERIES)
    text = f"{method} {path} HTTP/{version}\r\n" + "".join(f"{head}\r\n" for head in heads) + "\r\n"
    body = rng.choice(("", "", "", "hello", "5\r\nhello\r\n0\r\n\r\n", "ffffffffffffffffff\r\n", "-1\r\n", "\0" * 5000))
    return (text + body).encode("latin-1")


def http(rng: random.Random, material: Material) -> Acts:
    """The live page: what anybody on the network may send."""
    folder = material.folder / "page"
    pages: list[Page] = material.made.get("pages", [])
    if not pages:
        folder.mkdir(exist_ok=True)
        for number, run in enumerate(material.runs):
            shutil.copy(run, folder / f"run{number}.sqlite")
        (folder / "broken.sqlite").write_bytes(b"SQLite format 3\0" + bytes(200))
        pages = material.made["pages"] = [Page(folder, ""), Page(folder, "secret")]
    request = b"".join(_request(rng, f"run{rng.randrange(3)}") for _ in range(rng.choice((1, 1, 1, 1, 2, 5))))
    if rng.random() < 0.3:
        request = damaged(request, rng)
    if rng.random() < 0.02:
        request = rng.choice(
            (b"", b"\x16\x03\x01" + rng.randbytes(200), rng.randbytes(3000), b"\r\n" * 5000, b"GET /\r\n")
        )
    page = rng.choice(pages)

    def asked() -> None:
        _check(page.answer(request))

    yield asked


def _check(answer: bytes) -> None:
    """Raise `Wrong` for an answer that says the program failed, or carries what the request put there."""
    head = answer.partition(b"\r\n\r\n")[0]
    if not head:
        return
    status, *lines = head.split(b"\r\n")
    code = status.split(b" ")[1:2]
    if not status.startswith(b"HTTP/1.1 ") or code in ([b"500"], [b"502"]):
        raise Wrong(f"answered {status[:100]!r}")
    for line in lines:
        if line.partition(b":")[0].lower() not in _ALLOWED or b"\n" in line or b"\0" in line:
            raise Wrong(f"a header of an answer is {line[:100]!r}")
