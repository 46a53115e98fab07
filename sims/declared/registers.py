"""Twin of a declared instrument with registers: those of its file, and no others."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from math import inf, isnan
from typing import Any

from rig.contracts.declared.exchanges import Ask, Check, Register, Tell
from rig.sims.declared.behaviour import OVERLOAD, Behaviour, Refused, places_of
from rig.sims.wires.modbus_slave import ILLEGAL_ADDRESS, ILLEGAL_VALUE
from rig.sims.wires.modbus_slave import Refused as Exception_
from rig.sims.world import World

_FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}


class _Table:
    """One of the tables of registers; see `rig.sims.wires.modbus_slave.Registers`.

    Args:
        twin: the instrument.
        name: which table.
    """

    identity = b"SIMULATED"

    def __init__(self, twin: RegistersTwin, name: str) -> None:
        self._twin, self._name = twin, name

    def read(self, address: int, count: int) -> Sequence[int]:
        """Words from an address on, of whole numbers. Raises `rig.sims.wires.modbus_slave.Refused`."""
        words: list[int] = []
        while len(words) < count:
            words += self._twin.words(self._name, address + len(words))
        if len(words) != count:
            raise Exception_(ILLEGAL_ADDRESS)
        return words

    def write(self, address: int, words: Sequence[int]) -> None:
        """Set the number at an address. Raises `rig.sims.wires.modbus_slave.Refused`."""
        self._twin.written(self._name, address, list(words))


class RegistersTwin(Behaviour):
    """The twin; see `rig.sims.twin.ModbusTwin`."""

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        first = self.table.wire.first_register
        self._asks: dict[tuple[str, int], tuple[str, Ask]] = {}
        self._tells: dict[tuple[str, int], list[tuple[str, Tell]]] = {}
        self._places: dict[int, int] = {}
        self._kept: dict[tuple[str, int], float] = {}
        for place, ask in self.table.asks():
            key = ask.table, (ask.register_ or 0) - first
            if key not in self._asks or self._asks[key][0] == "identity":
                self._asks[key] = (place, ask)
            self._places |= {ask.decimals - first: places_of(ask)[0]} if isinstance(ask.decimals, int) else {}
        for place, tell in self.table.tells():
            self._tells.setdefault((tell.table, (tell.register_ or 0) - first), []).append((place, tell))
            self._places |= {tell.decimals - first: places_of(tell)[0]} if isinstance(tell.decimals, int) else {}
        self._big = self.table.wire.word_order == "big"
        self.registers = _Table(self, "holding")
        for attribute, table in (("inputs_table", "input"), ("coils", "coil"), ("discretes", "discrete")):
            setattr(self.registers, attribute, _Table(self, table))
        super().__init__(name, options, world, plant, serial)

    def switch_on(self) -> None:
        """State at power-on: what was written is lost."""
        super().switch_on()
        self._kept.clear()

    def _form(self, one: Register) -> str:
        return _FORMATS[one.type if one.type in _FORMATS else self.table.wire.type]

    def words(self, table: str, address: int) -> list[int]:
        """The words of the number that begins at an address. Raises `rig.sims.wires.modbus_slave.Refused`."""
        if table == "holding" and address in self._places and (table, address) not in self._asks:
            return [self._places[address]]
        if (table, address) in self._asks:
            place, ask = self._asks[table, address]
            number = self._shown(place, ask)
            one: Register = ask
        elif (table, address) in self._tells:
            one, number = self._tells[table, address][0][1], self._kept.get((table, address), 0.0)
        else:
            raise Exception_(ILLEGAL_ADDRESS)
        if table in ("coil", "discrete"):
            return [int(bool(number))]
        form = self._form(one)
        try:
            data = struct.pack(form, number if form == ">f" else round(number))
        except (struct.error, OverflowError):
            data = struct.pack(form, inf) if form == ">f" else b"\x7f" + b"\xff" * (struct.calcsize(form) - 1)
        words = struct.unpack(f">{len(data) // 2}H", data)
        return list(words if self._big else words[::-1])

    def _shown(self, place: str, ask: Ask) -> float:
        """The number of a register: of a setting what was written, otherwise what the instrument says."""
        key = "coil" if ask.table == "discrete" else ask.table, (ask.register_ or 0) - self.table.wire.first_register
        if place.startswith(("check", "mark")) and key in self._tells:
            right = ask.is_ if isinstance(ask, Check) and not isinstance(ask.is_, str) else None
            other = 0.0 if right is None else 1.0 - right if key[0] == "coil" else right + 1.0
            return self._kept.get(key, other)
        said = self.answers(place, ask, {})
        words = {meaning: word for word, meaning in reversed({**self.table.words, **ask.words}.items())}
        if ask.asks_bit or ask.table in ("coil", "discrete") or ask.type == "bit":
            return ask.with_bit(said.meaning)
        if said.meaning in words and (isnan(said.value) or place.endswith(("output", "settled", "fetch"))):
            return float(words[said.meaning])
        if said.meaning == "overload" and "overload" in words:
            return float(words[said.meaning])
        if isnan(said.value):
            return float(self._kept.get(key, 0.0))
        return ask.shown(said.value) * 10.0 ** places_of(ask)[1] if abs(said.value) < OVERLOAD / 2 else inf

    def written(self, table: str, address: int, words: list[int]) -> None:
        """Write the number at an address. Raises `rig.sims.wires.modbus_slave.Refused`."""
        known = self._tells.get((table, address))
        if not known:
            raise Exception_(ILLEGAL_ADDRESS)
        form = self._form(known[0][1])
        if table == "coil":
            number = float(words[0])
        elif len(words) * 2 != struct.calcsize(form):
            raise Exception_(ILLEGAL_ADDRESS)
        else:
            ordered = words if self._big else words[::-1]
            number = float(struct.unpack(form, struct.pack(f">{len(words)}H", *ordered))[0])
        for place, tell in known:
            if tell.value is None:
                self._do(place, tell, {"value": number / 10.0 ** places_of(tell)[1]})
                break
            if tell.value == number:
                self._do(place, tell, {})
        else:
            if all(tell.value != number for _, tell in known):
                raise Exception_(ILLEGAL_VALUE)
        self._kept[table, address] = number

    def _do(self, place: str, tell: Tell, holes: Mapping[str, float | str]) -> None:
        try:
            self.does(place, tell, holes)
        except Refused:
            raise Exception_(ILLEGAL_VALUE) from None
