"""Registers, as an instrument's file has them: numbers of one or two words, bits, scales, words for some numbers."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct

from rig.contracts.declared.exchanges import Ask, Register, Tell
from rig.contracts.declared.instrument import Instrument
from rig.drivers.clock import Clock
from rig.drivers.declared.talk import NOTHING, Answer, Holes, Talk
from rig.drivers.errors import BadReply, InstrumentError, LimitError
from rig.drivers.wires import Wires
from rig.drivers.wires.modbus import float_in_order

_FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}


@dataclass(slots=True)
class _Place:
    """Where a number is, and how it is read; the last one and its meaning: settings are read alike."""

    of: Ask
    number: int
    count: int
    words: Struct
    value: Struct
    bit: bool
    whole: bool
    direct: bool
    last: tuple[float, Answer] | None = None


class ModbusTalk(Talk):
    """An instrument with registers.

    Args:
        table: its file.
        name: the bench's name for it.
        address: Modbus address.
        wires: where to open it.
        clock: bench time.

    Raises:
        Unreachable: the address cannot be opened.
    """

    def __init__(self, table: Instrument, name: str, address: str, wires: Wires, clock: Clock) -> None:
        self.line = wires.modbus(address, name, table.wire.timeout_s)
        super().__init__(table, clock, self.line.where)
        self._big = table.wire.word_order == "big"
        self._places_read: dict[int, _Place] = {}

    def _format(self, one: Register) -> str:
        return _FORMATS[one.type if one.type in _FORMATS else self.table.wire.type]

    def _number(self, register: int | None) -> int:
        return (register or 0) - self.table.wire.first_register

    def _places(self, one: Register) -> float:
        """Power of ten by the register that says how many decimals a number has. Raises `BadReply`."""
        if not isinstance(one.decimals, int):
            return 1.0
        self.paced()
        (said,) = self.line.read(self._number(one.decimals))
        try:
            return 10.0 ** -one.places_of(said)
        except ValueError as error:
            raise BadReply(f"{self.where}: register {error}") from None

    def _place(self, one: Ask) -> _Place:
        """A number's place, which is made at its first use."""
        value, bit = Struct(self._format(one)), one.table in ("coil", "discrete")
        count = 1 if bit else value.size // 2
        whole = not bit and (one.type or self.table.wire.type) not in ("bit", "float32")
        direct = bit or value.format == ">H"
        found = _Place(one, self._number(one.register_), count, Struct(f">{count}H"), value, bit, whole, direct)
        self._places_read[id(one)] = found
        return found

    def _read(self, place: _Place) -> float:
        self.paced()
        words = self.line.read(place.number, place.count, place.of.table)
        if place.direct:
            return float(words[0])
        if place.value.format == ">f":
            what = f"{self.where}, asked {place.of.said!r},"
            return float_in_order(words, what, "word_order in its file", low_first=not self._big)
        return float(place.value.unpack(place.words.pack(*(words if self._big else reversed(words))))[0])

    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """Read a register. Raises `NoReply`, `BadReply`, `InstrumentError`."""
        place = self._places_read.get(id(ask)) or self._place(ask)
        number = self._read(place)
        if place.last is not None and place.last[0] == number:
            return place.last[1]
        finite = math.isfinite(number)
        printed = f"{number:.9g}" if not math.isnan(number) else "NaN"
        meaning = self.meant(ask, printed, number if finite else None) if ask.words or self.table.words else ""
        if math.isinf(number):
            meaning = meaning or "overload"  # IEEE 754 has it for what is beyond a range
        elif not finite and not meaning:  # its checksum is right: no reading repeated would have a number
            raise InstrumentError(f"{self.where}, asked {ask.said!r},", 0, "NaN, no number: has it no sensor there?")
        if place.bit or ask.asks_bit or ask.type == "bit":
            meaning = meaning or ask.of_bit(number)
        value = ask.quantity(number)
        if ask.decimals is not None:
            value *= self._places(ask)
        if place.whole and not ask.asks_bit:
            self.printed[id(ask)] = printed, value
        found = Answer({"value": printed}, value, meaning, printed)
        if ask.decimals is None:
            place.last = number, found
        return found

    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Write a register. Never repeated. Raises `InstrumentError`."""
        value = float(tell.value) if tell.value is not None else float(holes["value"]) / self._places(tell)
        number = self._number(tell.register_)
        self.paced()
        if tell.table == "coil":
            self.line.write(number, [int(value)], table="coil")
        else:
            self.line.write(number, self._words(tell, value))
        self.waits(tell)

    def _words(self, tell: Tell, value: float) -> Sequence[int]:
        form = self._format(tell)
        try:
            data = struct.pack(form, value if form == ">f" else round(value))
        except (struct.error, OverflowError):
            raise LimitError(f"{self.where}: {value:g} does not fit into register {tell.register_}") from None
        words = struct.unpack(f">{len(data) // 2}H", data)
        return words if self._big else words[::-1]

    def close(self) -> None:
        """Release the wire; idempotent."""
        self.line.close()
