"""CAN messages of a simulated node, from a DBC file.

Supported parts of the format: messages, signals with the low byte first (Intel order), one multiplexor, names of
values. Source: Vector, DBC file format documentation 1.0.5.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

_MESSAGE = re.compile(r"^BO_ (\d+) (\w+) *: *(\d+) ")
_SIGNAL = re.compile(
    r"^ *SG_ (\w+) *(M|m\d+)? *: *(\d+)\|(\d+)@([01])([+-]) *\(([^,]+),([^)]+)\) *\[([^|]+)\|([^\]]+)\] *\"([^\"]*)\""
)
_VALUES = re.compile(r"^VAL_ (\d+) (\w+) (.*);")
_NAMED = re.compile(r"(\d+) \"([^\"]*)\"")


@dataclass(frozen=True)
class DbcSignal:
    """One number in a frame.

    Attributes:
        begin: its lowest bit, counted from the first byte's lowest.
        bits: its number of bits.
        signed: two's complement.
        factor, offset: value = raw * factor + offset.
        low, high: range of the value.
        unit: unit of the value.
        group: value of the multiplexor for which it is present, None if it always is.
        multiplexor: whether it selects the group of the others.
        names: names of its values.
    """

    begin: int
    bits: int
    signed: bool
    factor: float
    offset: float
    low: float
    high: float
    unit: str
    group: int | None
    multiplexor: bool
    names: dict[int, str] = field(default_factory=dict)

    def raw(self, value: float) -> int:
        """The bits of a value; a value outside the range is clipped."""
        counts = round((min(max(value, self.low), self.high) - self.offset) / self.factor)
        return counts & ((1 << self.bits) - 1)

    def value(self, frame: int) -> float:
        """The value in a frame; the bytes are one number with the first byte lowest."""
        counts = frame >> self.begin & ((1 << self.bits) - 1)
        if self.signed and counts >> (self.bits - 1):
            counts -= 1 << self.bits
        return counts * self.factor + self.offset


@dataclass(frozen=True)
class DbcMessage:
    """One kind of frame: identifier, length in bytes, signals by name."""

    can_id: int
    length: int
    signals: dict[str, DbcSignal]

    def pack(self, values: Mapping[str, float]) -> bytes:
        """The frame with these values; missing values are zero."""
        frame = 0
        for name, value in values.items():
            signal = self.signals[name]
            frame += signal.raw(value) << signal.begin
        return frame.to_bytes(self.length, "little")

    def unpack(self, data: bytes) -> dict[str, float]:
        """All values of a frame, of all groups."""
        frame = int.from_bytes(data[: self.length], "little")
        return {name: signal.value(frame) for name, signal in self.signals.items()}

    def group_of(self, name: str) -> dict[str, float]:
        """The value of the multiplexor for which a signal is present."""
        group = self.signals[name].group
        return {n: float(group) for n, s in self.signals.items() if s.multiplexor} if group is not None else {}


def read_dbc(text: str) -> dict[str, DbcMessage]:
    """All messages by name; raises `ValueError` for a signal with the high byte first."""
    messages: dict[str, DbcMessage] = {}
    current: DbcMessage | None = None
    for line in text.splitlines():
        if match := _MESSAGE.match(line):
            current = messages[match[2]] = DbcMessage(int(match[1]), int(match[3]), {})
        elif current and (match := _SIGNAL.match(line)):
            current.signals[match[1]] = _signal(match)
        elif match := _VALUES.match(line):
            names = {int(number): name for number, name in _NAMED.findall(match[3])}
            for message in messages.values():
                if message.can_id == int(match[1]):
                    message.signals[match[2]].names.update(names)
    return messages


def _signal(match: re.Match[str]) -> DbcSignal:
    if match[5] == "0":
        raise ValueError(f"{match[1]} has its high byte first, which the simulated unit does not know")
    role = match[2] or ""
    factor, offset, low, high = (float(match[i]) for i in range(7, 11))
    group = int(role[1:]) if role.startswith("m") else None
    return DbcSignal(
        int(match[3]), int(match[4]), match[6] == "-", factor, offset, low, high, match[11], group, role == "M"
    )
