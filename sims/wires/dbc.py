"""CAN messages of a simulated node, from a DBC file.

Supported parts of the format: messages with identifiers of 11 and 29 bits, signals in both byte orders, floating-point
ones, one multiplexor, names of values, cycle times. Source: Vector, DBC file format documentation 1.0.5.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

_MESSAGE = re.compile(r"^BO_ (\d+) (\w+) *: *(\d+) ")
_SIGNAL = re.compile(
    r"^\s*SG_ (\w+) *(M|m\d+M?)? *: *(\d+)\|(\d+)@([01])([+-]) *"
    r"\(([^,]+),([^)]+)\) *\[([^|]+)\|([^\]]+)\] *\"([^\"]*)\""
)
_VALUES = re.compile(r"^VAL_ (\d+) (\w+) (.*);")
_NAMED = re.compile(r"(-?\d+) \"([^\"]*)\"")
_FLOAT = re.compile(r"^SIG_VALTYPE_ (\d+) (\w+) *:? *([12]) *;")
_CYCLE = re.compile(r"^BA_ \"GenMsgCycleTime\" BO_ (\d+) (\d+)")


@dataclass(frozen=True)
class DbcSignal:
    """One number in a frame.

    Attributes:
        begin: its lowest bit, counted from the first byte's lowest; of Motorola order its highest.
        bits: its number of bits.
        signed: two's complement.
        factor, offset: value = raw * factor + offset.
        low, high: range of the value.
        unit: unit of the value.
        group: value of the multiplexor for which it is present, None if it always is.
        multiplexor: whether it selects the group of the others.
        motorola: whether its high byte comes first.
        names: names of its values.
        is_float: whether its bits are a floating-point number.
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
    motorola: bool = False
    names: dict[int, str] = field(default_factory=dict)
    is_float: bool = False

    @property
    def span(self) -> tuple[float, float]:
        """Smallest and largest value: its range, or, without one, what its bits can be."""
        if self.low < self.high:
            return self.low, self.high
        if self.is_float:
            return -3.4e38, 3.4e38
        most = (1 << self.bits - self.signed) - 1
        ends = [raw * self.factor + self.offset for raw in (-most - 1 if self.signed else 0, most)]
        return min(ends), max(ends)

    def raw(self, value: float) -> int:
        """The bits of a value; a value outside the range is clipped."""
        low, high = self.span
        number = (min(max(value, low), high) - self.offset) / self.factor
        if self.is_float:
            return int.from_bytes(struct.pack(">f" if self.bits == 32 else ">d", number), "big")
        return round(number) & ((1 << self.bits) - 1)

    def put(self, frame: int, raw: int, length: int) -> int:
        """A frame of `length` bytes, one number with the first byte lowest, with these bits in it."""
        if not self.motorola:
            return frame | raw << self.begin
        for n in range(self.bits):  # from the highest
            frame |= (raw >> (self.bits - 1 - n) & 1) << self._place(n)
        return frame

    def value(self, frame: int) -> float:
        """The value in a frame; the bytes are one number with the first byte lowest."""
        counts = frame >> self.begin & ((1 << self.bits) - 1)
        if self.motorola:
            counts = sum((frame >> self._place(n) & 1) << (self.bits - 1 - n) for n in range(self.bits))
        if self.is_float:
            form = ">f" if self.bits == 32 else ">d"
            return float(struct.unpack(form, counts.to_bytes(self.bits // 8, "big"))[0]) * self.factor + self.offset
        if self.signed and counts >> (self.bits - 1):
            counts -= 1 << self.bits
        return counts * self.factor + self.offset

    def _place(self, n: int) -> int:
        """Place of its n-th bit from the highest: to the right within a byte, then on in the next one."""
        at = 8 * (self.begin // 8) + 7 - self.begin % 8 + n
        return 8 * (at // 8) + 7 - at % 8


@dataclass(frozen=True)
class DbcMessage:
    """One kind of frame.

    Attributes:
        can_id: identifier, with the highest bit set if it has 29 bits.
        length: bytes.
        signals: by name.
        cycle_s: seconds from one to the next; 0 if the file does not say.
    """

    can_id: int
    length: int
    signals: dict[str, DbcSignal]
    cycle_s: float = 0.0

    def pack(self, values: Mapping[str, float]) -> bytes:
        """The frame with these values; missing values are zero."""
        frame = 0
        for name, value in values.items():
            signal = self.signals[name]
            frame = signal.put(frame, signal.raw(value), self.length)
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
    """All messages by name."""
    messages: dict[str, DbcMessage] = {}
    current: DbcMessage | None = None
    for line in text.splitlines():
        if match := _MESSAGE.match(line):
            current = messages[match[2]] = DbcMessage(int(match[1]), int(match[3]), {})
        elif current and (match := _SIGNAL.match(line)):
            current.signals[match[1]] = _signal(match)
        elif match := _VALUES.match(line) or _FLOAT.match(line) or _CYCLE.match(line):
            for name, message in messages.items():
                if message.can_id == int(match[1]):
                    messages[name] = _with(message, match)
    return messages


def _with(message: DbcMessage, match: re.Match[str]) -> DbcMessage:
    """A message with what a later line says of it or of its signal."""
    if match.re is _CYCLE:
        return replace(message, cycle_s=int(match[2]) / 1000.0)
    signal = message.signals[match[2]]
    if match.re is _FLOAT:
        signal = replace(signal, is_float=True)
    else:
        signal = replace(signal, names={int(number): name for number, name in _NAMED.findall(match[3])})
    return replace(message, signals={**message.signals, match[2]: signal})


def _signal(match: re.Match[str]) -> DbcSignal:
    role = match[2] or ""
    factor, offset, low, high = (float(match[i]) for i in range(7, 11))
    group = int(role[1:].rstrip("M")) if role.startswith("m") else None
    return DbcSignal(
        int(match[3]),
        int(match[4]),
        match[6] == "-",
        factor,
        offset,
        low,
        high,
        match[11],
        group,
        role == "M",
        match[5] == "0",
    )
