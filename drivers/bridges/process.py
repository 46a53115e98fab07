"""A bridge to a driver of another library, in a process of its own.

The process is `rig.drivers.bridges.worker`. Requests and answers are a JSON object a line. One that does not answer in
time is ended: nothing else ends a library that hangs.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from typing import IO, Any, NoReturn

from rig.contracts.declared.bridges import Bridged
from rig.drivers.bridges import Value
from rig.drivers.clock import Clock
from rig.drivers.errors import InstrumentError, NoReply, Unreachable

_OPENING_S = 60.0  # longest wait for a library to be imported and its driver to be made; chosen
_CLOSING_S = 3.0
_LONGEST = 1 << 20  # characters of an answer; chosen


class LibraryBridge:
    """A driver of another library; see `rig.drivers.bridges.Bridge`. It is opened at its first use.

    Args:
        of: library and class.
        address: the instrument's address, as the library has it.
        arguments: what its class takes besides.
        where: the instrument and its address, for messages.
        clock: bench time.
    """

    measures_when_asked = False

    def __init__(self, of: Bridged, address: str, arguments: Mapping[str, Any], where: str, clock: Clock) -> None:
        self._of, self._address, self._arguments = of, address, dict(arguments)
        self._where, self._clock = where, clock
        self._process: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None

    def identity(self, timeout_s: float) -> tuple[str, str, str, str]:
        """Maker, model, serial number and firmware, "" for what it does not say."""
        maker, model, serial, firmware = map(str, self._asked({"do": "identity"}, "who it is", timeout_s)["identity"])
        return maker or self._of.kind, model or self._of.model, serial, firmware

    def read(self, path: str, timeout_s: float) -> Value:
        """The value of an attribute, or of a call."""
        found = self._asked({"do": "read", "path": path}, path, timeout_s)
        return Value(str(found["text"]), str(found["unit"]), found["stamp"])

    def write(self, path: str, text: str, timeout_s: float) -> None:
        """Set an attribute. Never repeated."""
        self._asked({"do": "write", "path": path, "text": text}, f"{path} = {text}", timeout_s)

    def call(self, path: str, timeout_s: float) -> None:
        """Carry out a call. Never repeated."""
        self._asked({"do": "call", "path": path}, path, timeout_s)

    def close(self) -> None:
        """Release the instrument and end the process; idempotent."""
        if self._process is not None:
            with contextlib.suppress(Exception):
                self._exchange({"do": "close"}, "close", _CLOSING_S)
            self._end()

    def _asked(self, request: Mapping[str, Any], what: str, timeout_s: float) -> dict[str, Any]:
        """The answer to a request; the process begins with the first one."""
        if self._process is None:
            self._begin()
        return self._exchange(request, what, timeout_s)

    def _begin(self) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig.drivers.bridges.worker"],  # nothing is imported from where we stand
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            start_new_session=True,  # a Ctrl-C at the terminal is for us
        )
        opened = {"do": "open", "kind": self._of.kind, "what": self._of.what}
        self._exchange({**opened, "address": self._address, "arguments": self._arguments}, "open", _OPENING_S)

    def _exchange(self, request: Mapping[str, Any], what: str, timeout_s: float) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
            line = self._line(what, timeout_s)
        except OSError:
            line = b""
        try:
            found = json.loads(line)
        except ValueError:
            raise self._died() from None
        if not isinstance(found, dict):
            raise self._died()
        if "wrong" in found:
            self._refuse(found, what)
        return found

    def _line(self, what: str, timeout_s: float) -> bytes:
        """The answer; the process is ended if it takes too long."""
        assert self._process is not None
        assert self._process.stdout is not None
        end, heard, out = self._clock.now() + timeout_s, bytearray(), self._process.stdout.fileno()
        while b"\n" not in heard and len(heard) < _LONGEST:
            left = end - self._clock.now()
            if left <= 0 or not select.select([out], [], [], self._clock.timeout(left))[0]:
                self._end()
                raise NoReply(
                    f"{self._where}: {self._of.kind} did nothing for {timeout_s:g} s, asked for {what!r}; its process "
                    f"was ended. Is the instrument on and connected? Whether a setting was carried out is not known"
                )
            more = os.read(out, 1 << 16)
            if not more:
                break
            heard += more
        return bytes(heard)

    def _refuse(self, found: Mapping[str, Any], what: str) -> NoReturn:
        """Raise what the process says is wrong."""
        said, kind = str(found["wrong"]), found.get("kind")
        if kind == "missing library":
            self._end()
            raise Unreachable(
                f"{self._where}: {self._of.kind} cannot be imported here ({said}); install it beside rig: "
                f"pip install 'calibration-rig[{self._of.kind}]'"
            )
        if kind == "open":
            self._end()
            raise Unreachable(
                f"{self._where} cannot be opened by {self._of.kind}:{self._of.what} ({said}); check power, cable, "
                f"address, and `arguments`"
            )
        if kind == "timeout":
            raise NoReply(
                f"{self._where}: {self._of.kind} got no answer, asked for {what!r} ({said}); is the instrument on?"
            )
        raise InstrumentError(f"{self._where}, asked for {what!r} by {self._of.kind}", 0, said)

    def _died(self) -> Unreachable:
        process, said = self._process, b""
        if process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(1.0)
            if self._said is not None:
                self._said.seek(0)
                said = self._said.read()[-2000:]
        code = None if process is None else process.poll()
        self._end()
        last = said.decode(errors="replace").strip().splitlines()[-1:] or ["it said nothing"]
        return Unreachable(
            f"{self._where}: the process of {self._of.kind} has ended by itself (exit code {code}): {last[0]}"
        )

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout, self._said):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
