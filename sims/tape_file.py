"""The tape of a served bench: a file written only by the server's process, one JSON object per line.

It has all bytes on the wires in both directions, all true events, and the times at which the server itself was stalled.
A checker compares the records of a controller in another process with it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Self

from rig.sims.wires.ports import Receive
from rig.sims.world import Pace, World

_STALL_S = 0.05
"""Maximum delay of the server without a note, real seconds."""


class TapeFile:
    """Appends lines to a tape; each is in the file before any consequence of it leaves the server.

    Every line has `t`, world time in seconds, and `what`: "server" (the first of each process: pid, speed, the
    machine's clocks `boot_s` and `utc_s` at world time 0, `epoch_utc` of the world), "asked" and "answered" (`on` which
    wire, `text` with bytes as Latin-1), "reading", "readback" and "change" (fields as in `rig.sims.tape`, a change's
    `what` as `of`), "stalled" (`seconds` of world time until `t` for which the server was stalled).

    Args:
        path: the file; its contents are kept.
        world: virtual time.

    Raises:
        OSError: it cannot be written.
    """

    def __init__(self, path: Path, world: World) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK, 0o644)
        self._world = world
        self._turn_s = 0.0

    def begin(self, pace: Pace, speed: float) -> None:
        """Note world time and the machine's clocks."""
        self._pace, self._speed = pace, speed
        self.add(
            "server",
            pid=os.getpid(),
            speed=speed,
            boot_s=max(time.clock_gettime(time.CLOCK_BOOTTIME) - pace.real_s() for _ in range(9)),
            utc_s=pace.started_utc,
            epoch_utc=pace.epoch_utc,
        )

    def add(self, what: str, t: float | None = None, **fields: object) -> None:
        """Append a line."""
        line = {"t": self._world.now() if t is None else t, "what": what, **fields}
        os.write(self._file, f"{json.dumps(line)}\n".encode())

    def happened(self, thing: NamedTuple) -> None:
        """A reading, readback or change of `rig.sims.tape`."""
        fields = thing._asdict()
        fields["on"] = fields.pop("instrument")
        change = fields.pop("what", None)
        self.add(
            type(thing).__name__.lower(), fields.pop("t_s"), **({} if change is None else {"of": change}), **fields
        )

    def turn(self, waited_s: float) -> None:
        """Note that the server runs again, after a planned wait of this many real seconds."""
        now = self._pace.real_s()
        late = now - self._turn_s - waited_s
        if late > _STALL_S:
            self.add("stalled", seconds=late * self._speed)
        self._turn_s = now

    def wired(self, wire: str, receive: Receive) -> Receive:
        """An instrument's end of a wire, recorded on the tape."""

        def taped(data: bytes, tx: Callable[[bytes], None]) -> None:
            self.asked(wire, data)
            receive(data, self.answering(wire, tx))

        return taped

    def asked(self, wire: str, data: bytes) -> None:
        """Received bytes."""
        if data:
            self.add("asked", on=wire, text=data.decode("latin-1"))

    def answering(self, wire: str, tx: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Output of an instrument's bytes: to the tape, then to the wire."""

        def out(data: bytes) -> None:
            self.add("answered", on=wire, text=data.decode("latin-1"))
            tx(data)

        return out

    def __enter__(self) -> Self:
        """The open tape."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)
