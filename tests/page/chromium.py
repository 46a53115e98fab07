"""A headless Chromium, driven over its own debugging pipe: no driver program and no library between."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rig.drivers.clock import RealClock

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
MISSING = "No Chromium was found. Install one (Debian, Ubuntu: apt install chromium) or name it: CHROMIUM=PATH"


def find() -> str | None:
    """Where Chromium is; the environment variable CHROMIUM decides."""
    named = os.environ.get("CHROMIUM")
    return named if named else next((path for name in _NAMES if (path := shutil.which(name))), None)


class Page:
    """One tab: open, ask, look."""

    def __init__(self, send: int, receive: int) -> None:
        self._send, self._receive = send, receive
        self._number = 0
        self._rest = b""
        self._session = ""
        self.complaints: list[str] = []

    def call(self, method: str, **parameters: Any) -> Any:
        """A command of the DevTools protocol, and its result."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._send, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def attach(self) -> None:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        """Show the page so wide and high, light or dark."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, address: str) -> None:
        self.call("Page.navigate", url=address)
        self.until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def ask(self, expression: str) -> Any:
        """The value of an expression on the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression: str, seconds: float = 20.0) -> Any:
        """Wait until an expression is true on the page; its value."""
        clock = RealClock()
        end = clock.now() + seconds
        while not (value := self.ask(expression)):
            assert clock.now() < end, f"never came true: {expression}\n{self.ask('document.body.innerText')}"
            clock.sleep(0.1)
        return value

    def picture(self, path: Path) -> None:
        """The whole page as a PNG."""
        high = int(self.ask("document.documentElement.scrollHeight"))
        width = int(self.ask("document.documentElement.clientWidth"))
        clip = {"x": 0, "y": 0, "width": width, "height": high, "scale": 1}
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def key(self, name: str) -> None:
        """Press and release a key."""
        code = {"Tab": 9, "Enter": 13, " ": 32}[name]
        text = {"Enter": "\r", " ": " "}.get(name, "")
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code, text=text)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            more = os.read(self._receive, 1 << 20)
            assert more, "Chromium ended"
            self._rest += more
        one, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(one)
        self._listen(message)
        return message

    def _listen(self, message: dict[str, Any]) -> None:
        parameters = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                self.complaints.append(str(parameters["exceptionDetails"]))
            case "Runtime.consoleAPICalled" if parameters["type"] in ("error", "warning"):
                self.complaints.append(str(parameters["args"]))
            case "Log.entryAdded" if parameters["entry"]["level"] in ("error", "warning"):
                self.complaints.append(str(parameters["entry"]))
            case "Network.requestWillBeSent":
                address = parameters["request"]["url"]
                if not address.startswith(("http://127.0.0.1:", "http://localhost:", "about:", "data:")):
                    self.complaints.append(f"asked for {address}")
            case _:
                pass


@contextmanager
def chromium(folder: Path) -> Iterator[Page]:
    """A Chromium of our own with nothing but an empty profile in `folder`, ended with the block."""
    program = find()
    assert program is not None, MISSING
    to_read, to_send = os.pipe()
    to_receive, to_write = os.pipe()
    high = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 10) for fd in (to_read, to_write)]

    def place() -> None:
        os.dup2(high[0], 3)  # Chromium reads commands from its descriptor 3
        os.dup2(high[1], 4)  # and writes to 4

    options = [
        "--headless", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
        "--hide-scrollbars", f"--user-data-dir={folder}",
    ]  # fmt: skip
    process = subprocess.Popen(
        [program, *options],
        pass_fds=(3, 4),
        preexec_fn=place,  # noqa: PLW1509 - it only moves descriptors
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    for fd in (to_read, to_write, *high):
        os.close(fd)
    page = Page(to_send, to_receive)
    try:
        page.attach()
        yield page
    finally:
        with suppress(OSError, AssertionError):
            page._session = ""
            page.call("Browser.close")
        with suppress(subprocess.TimeoutExpired):
            process.wait(10)
        if process.poll() is None:
            process.kill()
            process.wait()
        os.close(to_send)
        os.close(to_receive)


if __name__ == "__main__":
    if find() is None:
        print(MISSING, file=sys.stderr)
        sys.exit(1)
