"""The role of a person at a bench: does what no instrument can do.

A real person answers by `rig done`. A simulated one (`rig.simulated.person`) does it in the simulated bench. A bench of
`rig sim` is told of what a real person says (`ServedBench`).
"""

from __future__ import annotations

import json
import math
import socket
from typing import Any, Protocol

from rig.bench.typed import TypedColumn
from rig.drivers.errors import Unreachable
from rig.errors import BenchFault
from rig.procedures.plan.hand_steps import HandStep

SIMULATED = "simulated person"
_REAL_S = 5.0
"""Seconds, of real time, for a simulated bench to take what it is told."""


class Person(Protocol):
    """Who does steps, settings and readings by hand in a simulated bench."""

    def asked(self, step: HandStep) -> bool:
        """The person reads what to do. Returns whether somebody is there to do it."""
        ...

    def answer(self) -> tuple[str | None, str] | None:
        """Stated value and name, once the step is done; None before. The bench is changed from then on."""
        ...

    def asked_to_set(self, factor: str, value: float) -> bool:
        """The person reads to what a factor has to be set. Returns as `asked`; the answer is then that of `answer`."""
        ...

    def asked_to_read(self, column: TypedColumn) -> bool:
        """The person reads what to read. Returns as `asked`; the answer is then that of `answer`."""
        ...

    def recall_setting(self, factor: str, value: float) -> None:
        """A real person has set a factor of a simulated bench."""
        ...

    def recall(self, change: str, number: float | None) -> None:
        """A step was done in an earlier session: the bench is still changed."""
        ...

    def done(self, change: str, number: float | None) -> None:
        """A real person has done a step at a simulated bench."""
        ...


class ServedBench:
    """A bench of `rig sim`, which follows what real people say they have done; see `Person`.

    Args:
        address: where it is told, HOST:PORT.

    """

    def __init__(self, address: str) -> None:
        self._address = address
        self._read: str | None = None
        self._new: bool | None = None  # whether nothing had been changed when the session began

    def asked(self, step: HandStep) -> bool:
        """Nobody simulated comes."""
        return False

    def asked_to_set(self, factor: str, value: float) -> bool:
        """Nobody simulated comes."""
        return False

    def asked_to_read(self, column: TypedColumn) -> bool:
        """The person reads what to read. No real person can see a simulated dial, so the bench reads it, if its world's
        person comes. Raises `Unreachable`.
        """
        self._read = None
        found = self._tell({"reader": column.reader, "channel": column.channel})
        if math.isfinite(found):
            self._read = column.seen(found)
        return self._read is not None

    def answer(self) -> tuple[str | None, str] | None:
        """The reading; None for everything else: a real person answers."""
        return None if self._read is None else (self._read, SIMULATED)

    def recall_setting(self, factor: str, value: float) -> None:
        """A real person has set a factor of a simulated bench. Raises `Unreachable`."""
        self._tell({"factor": factor, "value": value})

    def recall(self, change: str, number: float | None) -> None:
        """A step was done in an earlier session: the bench is still changed. A bench that was not started anew is
        changed already. Raises `BenchFault`.
        """
        try:
            if self._new is None:
                self._new = self._tell({}) == 0
            if self._new:
                self.done(change, number)
        except Unreachable as error:  # before the session has begun
            raise BenchFault(str(error)) from error

    def done(self, change: str, number: float | None) -> None:
        """A real person has done a step at a simulated bench. Raises `Unreachable`."""
        self._tell({"change": change, "number": number})

    def _tell(self, what: dict[str, Any]) -> float:
        """Tell the bench; returns its answer: the number of its changes, or a reading. Raises `Unreachable`."""
        host, _, port = self._address.rpartition(":")
        try:
            with socket.create_connection((host, int(port)), _REAL_S) as line, line.makefile("rwb") as file:
                file.write(json.dumps(what).encode() + b"\n")
                file.flush()
                return float(file.readline(40))
        except (OSError, ValueError) as error:
            raise Unreachable(
                f"the simulated bench does not take at {self._address} what a person has done ({error}): is rig sim "
                f"still running? LIVE.toml is written anew when it starts: rig resume RUN --bench LIVE.toml"
            ) from error
