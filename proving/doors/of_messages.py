"""The door to the servers that messages are sent to: what goes in, and what they answer."""

from __future__ import annotations

import contextlib
import random
import socket
import threading
import unicodedata
from pathlib import Path
from typing import Any

from proving.doors.hostile import TOML_VALUES, VALUES, Acts, Material, Wrong, damaged, edited
from rig.engine.session import Progress
from rig.unattended import Happening, Kind, RunFacts
from rig.unattended.notify import NotifySettings, NotSent, compose, read_settings, sender


class Answering:
    """A server that says the lines of `script`: the first at once, then one for each line it hears (all, for HTTP)."""

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0), backlog=50)
        self.port = self._listening.getsockname()[1]
        self.script: list[bytes] = []
        self.speaks_first = True
        self.heard = b""
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the server."""
        with contextlib.suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                line, _ = self._listening.accept()
                with line, contextlib.suppress(OSError):
                    line.settimeout(2.0)
                    self._talk(line)

    def _talk(self, line: socket.socket) -> None:
        script, self.heard = list(self.script), b""
        with line.makefile("rb") as words:
            if self.speaks_first:
                line.sendall(script.pop(0))
                body = False
                while script and (heard := words.readline(2000)):
                    self.heard += heard
                    if body and heard.strip() != b".":
                        continue
                    body = heard.upper().startswith(b"DATA")
                    line.sendall(script.pop(0))
                return
            length = 0
            while (heard := words.readline(70000)).strip():
                self.heard += heard
                if heard.lower().startswith(b"content-length:"):
                    length = int(heard.split(b":")[1])
            words.read(length)
            for part in script:
                line.sendall(part)


_NAMES = (
    *(v for v in VALUES if isinstance(v, str)),
    "=?utf-8?q?x=0D=0AReply-To=3A_evil=40example.com=0D=0A=0D=0AA_body?=",
    "x\r\nBcc: evil@example.com",
    "\u0394p \u00fc" * 30,
)
_WEB = (
    b"HTTP/1.1 200 OK\r\n", b"HTTP/1.1 500 no\r\n", b"HTTP/1.1 302 x\r\nLocation: file:///etc/passwd\r\n",
    b"HTTP/9 x\r\n", b"HTTP/1.1 200\r\n", b"HTTP/1.1 99999999999999999999 x\r\n", b"HTTP/1.1 429 \xff\xfe\r\n",
    b"\0\0\0\0\r\n", b"ICY 200\r\n", b"HTTP/1.1 100 Continue\r\n\r\n" * 3 + b"HTTP/1.1 204 x\r\n",
    b"HTTP/1.1 401 x\r\nWWW-Authenticate: Basic\r\n", b"\r\n" * 50,
)  # fmt: skip
_WEB_HEADS = (
    b"Content-Length: 5\r\n", b"Content-Length: -5\r\n", b"Content-Length: x\r\n", b"Transfer-Encoding: chunked\r\n",
    b"A: b\r\n" * 300, b"X: " + b"y" * 70000 + b"\r\n", b"no colon\r\n", b"\xff: \xff\r\n", b" folded\r\n", b"\0\r\n",
    b"A:\r\n", b"Content-Encoding: gzip\r\n", b"Set-Cookie: \xff\r\n", b"Connection: close\r\n",
    b"Content-Length: " + b"9" * 5000 + b"\r\n",
)  # fmt: skip
_WEB_BODIES = (
    b"", b"hello", b"5\r\nhello\r\n0\r\n\r\n", b"zz\r\n", b"f" * 400 + b"\r\n", b"-5\r\nx", b"\xff" * 3000,
    b"5;" + b"x" * 70000,
)  # fmt: skip
_MAIL = (
    b"220 here\r\n", b"250 ok\r\n", b"354 go on\r\n", b"221 bye\r\n", b"451 later\r\n", b"550 no\r\n",
    b"250-more\r\n", b"250\r\n", b"999 x\r\n", b"-1 x\r\n", b"\xff\xfe\r\n", b"x" * 10000 + b"\r\n", b"\r\n", b"2",
    b"", b"250-SIZE x\r\n250-STARTTLS\r\n250 AUTH \xff\r\n", b"250 " + b"y" * 3000 + b"\r\n", b"\0\0\0\r\n",
    b"250-a\r\n" * 500 + b"250 b\r\n", b"421 gone\r\n", b"1e3 x\r\n", b"25\xb2 x\r\n",
)  # fmt: skip
_GOOD_MAIL = (
    b"220 here\r\n", b"250 ok\r\n", b"250 ok\r\n", b"250 ok\r\n", b"354 go on\r\n", b"250 taken\r\n", b"221 bye\r\n",
)  # fmt: skip


_CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Characters that make new lines, move a terminal's cursor or turn the order of letters."""


def _message(rng: random.Random) -> Any:
    names = [rng.choice(_NAMES) if rng.random() < 0.3 else "lab" for _ in range(4)]
    path = Path("/runs/" + names[0].replace("\0", "")[:200])
    facts = RunFacts(rng.choice((path, None)), names[1], names[2], names[3], simulated=rng.random() < 0.5)
    told = rng.choice((Kind.HOLD, Kind.FINISH, Kind.ENDED_BY_FAULT, Kind.WARNING, Kind.START, Kind.CRASH, Kind.TEST))
    text = rng.choice(_NAMES) if rng.random() < 0.3 else "held: no reply"
    seconds = rng.choice((0.0, 1.7e9, 1.7e9, -1e9, 2e11))
    news = rng.choice((None, Progress("holding", 12, 30, 7200.0, rng.choice((None, 3600.0, 0.0, 1e9)), text)))
    return compose(Happening(told, "warning", text, seconds, 7.0, {}, rng.random() < 0.2), facts, news)


def notify(rng: random.Random, material: Material) -> Acts:
    """Messages: what goes in (names, texts, `notify.toml`), and what the servers answer."""
    if rng.random() < 0.25:
        path = material.path("notify.toml")
        text = edited(_SETTINGS, rng, TOML_VALUES)
        path.write_bytes(damaged(text.encode(), rng) if rng.random() < 0.2 else text.encode("utf-8", "replace"))
        yield lambda: read_settings(path)
        return
    server: Answering = material.made.get("answering") or material.made.setdefault("answering", Answering())
    message = _message(rng)
    if rng.random() < 0.5:
        values: dict[str, Any] = {
            "kind": "webhook",
            "url": f"http://127.0.0.1:{server.port}/T0/s3cret/%ff",
            "timeout_s": 0.1,
        }
        values |= rng.choice(
            ({}, {"shape": "slack"}, {"shape": "teams"}, {"shape": "ntfy"}, {"body": {"a": ["{message}", 1]}})
        )
        server.speaks_first = False
        heads = b"".join(rng.sample(_WEB_HEADS, rng.choice((0, 1, 1, 3))))
        script = [rng.choice(_WEB) + heads + rng.choice((b"\r\n", b"\r\n", b"")) + rng.choice(_WEB_BODIES)]
    else:
        values = {"kind": "mail", "to": ["a@lab.example"], "sender": "rig@lab.example", "host": "127.0.0.1"}
        values |= {"port": server.port, "security": rng.choice(("none", "none", "none", "starttls")), "timeout_s": 0.1}
        server.speaks_first = True
        script = list(_GOOD_MAIL)
        for _ in range(rng.randrange(3)):
            script[rng.randrange(len(script))] = rng.choice(_MAIL)
        if rng.random() < 0.1:
            script.insert(rng.randrange(len(script)), rng.choice(_MAIL))
    if rng.random() < 0.2:
        script = [damaged(part, rng) for part in script]
    server.script = script
    channel = NotifySettings.model_validate({"channel": [values]}).channel[0]

    def sent() -> None:
        try:
            sender(channel)(message)
        except NotSent as error:
            if "s3cret" in str(error) or any(unicodedata.category(c) in _CONTROLS for c in str(error)):
                raise Wrong(f"a failure is told as {str(error)!r}") from error
        head = server.heard.partition(b"\r\n\r\n")[0].lower()
        if b"\nreply-to" in head or b"\nbcc" in head:
            raise Wrong(f"a message went out with {head[-300:]!r}")

    yield sent


_SETTINGS = """
most_per_hour = 10
repeats_s = 900.0
[[channel]]
kind = "mail"
to = ["a@lab.example"]
sender = "rig@lab.example"
host = "mail.lab.example"
port = 25
security = "none"
on = ["hold", "finish"]
benches = ["lab"]
timeout_s = 5.0
[[channel]]
kind = "webhook"
name = "hook"
url = "https://hooks.lab.example/T0"
shape = "slack"
[channel.body]
a = "{headline}"
[[channel]]
kind = "command"
name = "beep"
argv = ["/usr/bin/true", "{headline}"]
[[channel]]
kind = "apprise"
name = "others"
url_env = "NOWHERE"
"""
