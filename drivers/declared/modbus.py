"""Registers, as an instrument's file has them: numbers of one or two words, bits, scales, words for some numbers."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from rig.contracts.declared.exchanges import Ask, Register, Tell
from rig.contracts.declared.instrument import Instrument
from rig.drivers.clock import Clock
from rig.drivers.declared.talk import NOTHING, Answer, Holes, Talk
from rig.drivers.errors import BadReply, InstrumentError, LimitError
from rig.drivers.wires import Wires

_FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}
_WHOLE = ("int16", "uint16", "int32", "uint32")


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

    def _read(self, one: Register) -> float:
        self.paced()
        number = self._number(one.register_)
        if one.table in ("coil", "discrete"):
            return float(self.line.read(number, table=one.table)[0])
        form = self._format(one)
        words = self.line.read(number, struct.calcsize(form) // 2, table=one.table)
        (value,) = struct.unpack(form, struct.pack(f">{len(words)}H", *(words if self._big else reversed(words))))
        return float(value)

    def once(self, ask: Ask, holes: Holes = NOTHING, timeout_s: float | None = None, *, repeat: bool = True) -> Answer:
        """Read a register. Raises `NoReply`, `BadReply`, `InstrumentError`."""
        number = self._read(ask)
        finite = math.isfinite(number)
        printed = f"{number:.9g}" if not math.isnan(number) else "NaN"
        meaning = self.meant(ask, printed, number if finite else None)
        if math.isinf(number):
            meaning = meaning or "overload"  # IEEE 754 has it for what is beyond a range
        elif not finite and not meaning:  # its checksum is right: no reading repeated would have a number
            raise InstrumentError(f"{self.where}, asked {ask.said!r},", 0, "NaN, no number: has it no sensor there?")
        if ask.bit is not None or ask.type == "bit" or ask.table in ("coil", "discrete"):
            meaning = meaning or ("on" if int(number) >> (ask.bit or 0) & 1 else "off")
        value = ask.quantity(number) * self._places(ask)
        if (ask.type or self.table.wire.type) in _WHOLE and ask.table in ("holding", "input") and ask.bit is None:
            self.printed[id(ask)] = printed, value
        return Answer({"value": printed}, value, meaning, printed)

    def tell(self, tell: Tell, holes: Holes = NOTHING, *, checked: bool = True) -> None:
        """Write a register. Never repeated. Raises `InstrumentError`."""
        value = tell.value if tell.value is not None else float(holes["value"]) / self._places(tell)
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
