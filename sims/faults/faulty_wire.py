"""Effects of faults on messages between the host and one instrument.

A message is a line of text, a Modbus frame, or a CAN frame preceded by its identifier. An exchange is one message from
host to instrument. A wire keeps the order of messages, so a late message delays all later ones.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf

from rig.sims.fault import Fault
from rig.sims.world import World

Deliver = Callable[[bytes], None]
Note = Callable[[Fault, str], None]

_EXCEPTION_S = 0.010  # a refusal is answered at once
_FRAMES = ("lost-frame", "repeated-frame")
_DOWN = ("unplugged", "bus-off")


@dataclass
class _Armed:
    """An active fault.

    Attributes:
        left: number of exchanges or frames still to be affected.
        until: world time of its end.
        skip: number of frames to pass before.
    """

    fault: Fault
    left: float
    until: float
    skip: int


class FaultyWire:
    """One instrument's wire.

    Args:
        world: virtual time.
        medium: "serial", "modbus" or "can".
        note: called with a sentence about each event.
        others: the latest reply of another instrument on a wire of this kind; b"" if there is none.

    Attributes:
        begins: called with the number of every exchange before its message is sent; None if nobody needs it.
        exchanges: number of messages from the host so far.
        connection: a number that changes when the connection is lost: a holder of an earlier number has a dead
            connection.
        latest: the latest reply.
    """

    def __init__(self, world: World, medium: str, note: Note, others: Callable[[], bytes]) -> None:
        self.begins: Callable[[int], None] | None = None
        self.exchanges = 0
        self.connection = 0
        self.latest = b""
        self._world = world
        self._medium = medium
        self._note = note
        self._others = others
        self._armed: list[_Armed] = []
        self._due: list[Fault] = []
        self._held_until = 0.0
        self._down_until = {"unplugged": -inf, "bus-off": -inf, "deaf": -inf}
        self._dead_until = -inf  # the latest of these
        self._struck = False  # whether anything has ever happened to it
        self._request = b""

    @property
    def unplugged(self) -> bool:
        """Whether it cannot be opened."""
        return self._world.now() < self._down_until["unplugged"]

    @property
    def off(self) -> bool:
        """Whether its CAN controller is bus-off."""
        return self._world.now() < self._down_until["bus-off"]

    def strike(self, fault: Fault, until: float) -> None:
        """Start a fault; `until` is the end of one with a duration."""
        self._struck = True
        if fault.kind in _DOWN:
            self._down(fault.kind, until)
            self._note(fault, f"{fault.kind} until {until:.3f} s")
            if fault.kind == "unplugged":
                self.connection += 1
            return
        counted = fault.for_s == 0.0
        skip = int(fault.options.get("skip", 0.0))
        self._armed.append(_Armed(fault, fault.times if counted else inf, inf if counted else until, skip))

    def deafen(self, until: float) -> None:
        """The instrument is off: it neither receives nor answers, and a network connection to it is lost."""
        self._down("deaf", until)
        if self._medium == "modbus":
            self.connection += 1

    def to_twin(self, message: bytes, forward: Deliver, deliver: Deliver) -> None:
        """A message from the host.

        Args:
            message: what the host sends.
            forward: passes on a message to the instrument.
            deliver: passes on a reply to the host, for answers of the wire itself.
        """
        self.exchanges += 1
        if self.begins is not None:
            self.begins(self.exchanges)
        self._request = message
        if not self._struck:  # nearly always
            forward(message)
            return
        if self._medium != "serial":
            self._due.clear()  # with these kinds every message is answered
        if self._world.now() < self._dead_until:
            return
        for armed in self._current():
            if armed.fault.kind not in _FRAMES:
                armed.left -= 1
                self._due.append(armed.fault)
        for fault in self._due:
            if fault.kind == "no-reply" and fault.options["lost"] == "request":
                self._due.remove(fault)
                self._note(fault, f"request {_shown(message)} lost")
                return
            if fault.kind == "modbus-exception":
                self._due.remove(fault)
                self._note(fault, f"request {_shown(message)} refused with exception {fault.number('code'):g}")
                self._world.call_in(_EXCEPTION_S, partial(deliver, _refusal(message, int(fault.number("code")))))
                return
        forward(message)

    def to_host(self, message: bytes, deliver: Deliver) -> None:
        """A message from the instrument; `deliver` passes on the resulting messages."""
        before, self.latest = self.latest, message
        if not self._struck:  # nearly always
            deliver(message)
            return
        if self._world.now() < self._dead_until:
            return
        late = 0.0
        for armed in self._current():
            if armed.fault.kind in _FRAMES:
                if armed.skip:
                    armed.skip -= 1
                    continue
                armed.left -= 1
                self._note(armed.fault, f"frame {_shown(message)}")
                if armed.fault.kind == "lost-frame":
                    return
                self._send(message, deliver, 0.0)
        due, self._due = self._due, []
        for fault in due:
            match fault.kind:
                case "no-reply":
                    self._note(fault, f"reply {_shown(message)} lost")
                    if self._medium == "can":
                        self._due = due  # all replies to this exchange are lost
                    return
                case "late-reply":
                    late = fault.number("delay_s")
                    self._note(fault, f"reply {_shown(message)} is {late:g} s late")
                case "duplicated" if fault.options["what"] == "reply":
                    self._note(fault, f"reply {_shown(message)} comes twice")
                    message += message
                case kind:
                    changed = self._changed(fault, message, before)
                    self._note(fault, f"{kind}: {_shown(message)} arrives as {_shown(changed)}")
                    message = changed
        self._send(message, deliver, late)

    def _changed(self, fault: Fault, message: bytes, before: bytes) -> bytes:
        match fault.kind:
            case "garbled":
                return _garbled(message, self._medium)
            case "truncated":
                return _cut(message, fault.word("lost"), self._medium)
            case "duplicated":
                middle = len(message) // 2
                return message[: middle + 1] + message[middle:]
            case "wrong-unit":
                return message[:6] + bytes((int(fault.number("unit")),)) + message[7:]
            case "wrong-reply" if fault.options["of"] == "another":
                other = self._others()
                if self._medium == "modbus" and other:  # a gateway that has confused its requests
                    return self._request[:4] + other[4:6] + self._request[6:7] + other[7:]
                return other or before or message
            case "wrong-reply":
                return before or message
        return message

    def _send(self, message: bytes, deliver: Deliver, late: float) -> None:
        now = self._world.now()
        at = max(now + late, self._held_until)
        if at <= now:
            deliver(message)
            return
        self._held_until = at
        connection = self.connection
        self._world.call_in(at - now, lambda: deliver(message) if connection == self.connection else None)

    def _current(self) -> list[_Armed]:
        if not self._armed:
            return self._armed
        now = self._world.now()
        self._armed = [a for a in self._armed if a.left > 0 and now < a.until]
        return self._armed

    def _down(self, how: str, until: float) -> None:
        self._struck = True
        self._down_until[how] = max(until, self._down_until[how])
        self._dead_until = max(until, self._dead_until)


def _garbled(message: bytes, medium: str) -> bytes:
    """Every third byte with its top bit inverted; for a Modbus frame the protocol identifier, always 0."""
    if medium == "modbus":
        return message[:2] + b"\x40\x00" + message[4:]
    return bytes(b ^ 0x80 if n % 3 == 0 else b for n, b in enumerate(message))


def _cut(message: bytes, lost: str, medium: str) -> bytes:
    """Without its last third, its first two bytes, or two in the middle; without its tail a text has no end mark
    either.
    """
    middle = len(message.strip()) // 2
    match lost:
        case "head":
            return message[2:] if len(message.strip()) > 2 or medium != "serial" else message[1:]
        case "middle":
            return message[: middle - 1] + message[middle + 1 :]
    return message[: 2 * len(message) // 3] if len(message) > 4 else message[:1]


def _refusal(request: bytes, code: int) -> bytes:
    """A Modbus exception to a request, both with their MBAP headers."""
    return struct.pack(">4sHBBB", request[:4], 3, request[6], request[7] | 0x80, code)


def _shown(message: bytes) -> str:
    text = message.strip()
    readable = all(32 <= b < 127 for b in text)
    return repr(text[:60].decode("ascii")) if readable else message[:30].hex()
