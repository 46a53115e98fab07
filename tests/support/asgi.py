"""An ASGI application asked in this process: no sockets, no client library; a stream is read until a condition."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote, urlsplit

import anyio


@dataclass
class Answer:
    """What came back."""

    status: int = 0
    headers: dict[str, str] = field(default_factory=dict)
    body: bytes = b""

    @property
    def text(self) -> str:
        return self.body.decode()

    def events(self) -> list[tuple[str, str, Any]]:
        """(id, event, data) of a stream of server-sent events."""
        found = []
        for block in self.text.split("\n\n"):
            lines = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line)
            if "event" in lines:
                found.append((lines.get("id", ""), lines["event"], json.loads(lines["data"])))
        return found

    def story(self) -> list[int]:
        """Record numbers of all lines of the story in a stream."""
        return [line["seq"] for _, _, data in self.events() for line in data.get("story", {}).get("lines", [])]


def ask(
    app: Any,
    address: str,
    *,
    method: str = "GET",
    host: str = "127.0.0.1:8321",
    headers: dict[str, str] | None = None,
    body: bytes = b"",
    client: str = "127.0.0.1",
    more: bool = False,
    until: Callable[[Answer], bool] = lambda _: False,
) -> Answer:
    """Ask once; a stream that does not end is left as soon as `until` is true of what has come.

    With `more` the body never ends.
    """
    parts = urlsplit(f"http://x{address}" if address.startswith("/") else address)
    given = {"host": host, **(headers or {})}
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": unquote(parts.path),
        "raw_path": parts.path.encode(),
        "query_string": parts.query.encode(),
        "root_path": "",
        "headers": [(k.encode(), v.encode("latin-1")) for k, v in given.items()],
        "client": (client, 1),
        "server": ("127.0.0.1", 8321),
    }
    answer = Answer()

    async def run() -> None:
        gone = anyio.Event()
        sent = False

        async def receive() -> dict[str, Any]:
            nonlocal sent
            if not sent:
                sent = True
                return {"type": "http.request", "body": body, "more_body": more}
            await gone.wait()
            return {"type": "http.disconnect"}

        async def send(message: Any) -> None:
            if message["type"] == "http.response.start":
                answer.status = message["status"]
                answer.headers = {k.decode(): v.decode("latin-1") for k, v in message["headers"]}
            else:
                answer.body += message.get("body", b"")
                if until(answer):
                    gone.set()
                    await anyio.lowlevel.checkpoint()

        with anyio.fail_after(20):
            await app(scope, receive, send)

    anyio.run(run)
    return answer
