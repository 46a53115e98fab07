"""Twin of a declared instrument with registers: those of its file, and no others."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf, isclose, isnan
from typing import Any

from rig.contracts.declared.exchanges import Ask, Check, Tell
from rig.sims.declared.behaviour import OVERLOAD, Behaviour, Refused, places_of
from rig.sims.wires.modbus_slave import ILLEGAL_VALUE
from rig.sims.wires.modbus_slave import Refused as Exception_
from rig.sims.wires.register_bank import Bank, Register
from rig.sims.world import World

_BITS = ("coil", "discrete")


class RegistersTwin(Behaviour):
    """The twin; see `rig.sims.twin.ModbusTwin`."""

    def __init__(self, name: str, options: Mapping[str, object], world: World, plant: Any, serial: str) -> None:
        self.table = self.table.chosen(options)  # type: ignore[misc]  # of one instance
        wire = self.table.wire
        self._kept: dict[tuple[str, int], float] = {}
        self._tells: dict[tuple[str, int], list[tuple[str, Tell]]] = {}
        known: dict[tuple[str, int], tuple[str, Ask | Tell]] = {}
        banks = {table: Bank(b"SIMULATED") for table in ("holding", "input", *_BITS)}
        self.registers: Any = banks["holding"]
        for attribute, table in (("inputs_table", "input"), ("coils", "coil"), ("discretes", "discrete")):
            setattr(self.registers, attribute, banks[table])
        every: list[tuple[str, Ask | Tell]] = [*self.table.asks(), *self.table.tells()]
        for place, one in every:
            key = self._key(one)
            if key not in known or known[key][0] == "identity":
                known[key] = place, one
            if isinstance(one, Tell):
                self._tells.setdefault(key, []).append((place, one))
        for key, (place, one) in known.items():
            kind = "bit" if key[0] in _BITS else wire.type if one.type in (None, "bit") else str(one.type)
            put = partial(self._written, key) if key in self._tells else None
            register = Register(kind, wire.word_order == "little", partial(self._now, place, one), put)
            banks[key[0]].add(key[1], register)
        for _, one in every:  # the register of its decimals, unless it is asked for itself
            at = one.decimals - wire.first_register if isinstance(one.decimals, int) else -1
            if at >= 0 and known.get(("holding", at), ("identity",))[0] == "identity":
                code = partial(places_of(one).__getitem__, 0)
                banks["holding"].add(at, Register("uint16", False, code, None))
        super().__init__(name, options, world, plant, serial)

    def _key(self, one: Ask | Tell) -> tuple[str, int]:
        """Table and number of a register."""
        return one.table, (one.register_ or 0) - self.table.wire.first_register

    def switch_on(self) -> None:
        """State at power-on: what was written is lost."""
        super().switch_on()
        self._kept.clear()

    def _now(self, place: str, one: Ask | Tell) -> float:
        number = self._shown(place, one) if isinstance(one, Ask) else self._kept.get(self._key(one), 0.0)
        return float(bool(number)) if one.table in _BITS else number

    def _shown(self, place: str, ask: Ask) -> float:
        """The number of a register: of a setting what was written, otherwise what the instrument says."""
        key = "coil" if ask.table == "discrete" else ask.table, self._key(ask)[1]
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

    def _written(self, key: tuple[str, int], number: float) -> None:
        """Write a number. Raises `rig.sims.wires.modbus_slave.Refused`."""
        for place, tell in self._tells[key]:
            if tell.value is None:
                self._do(place, tell, {"value": number / 10.0 ** places_of(tell)[1]})
                break
            if isclose(float(tell.value), number, rel_tol=1e-6):  # of single precision
                self._do(place, tell, {})
        else:
            if not any(isclose(float(tell.value or 0.0), number, rel_tol=1e-6) for _, tell in self._tells[key]):
                raise Exception_(ILLEGAL_VALUE)
        self._kept[key] = float(number)

    def _do(self, place: str, tell: Tell, holes: Mapping[str, float | str]) -> None:
        try:
            self.does(place, tell, holes)
        except Refused:
            raise Exception_(ILLEGAL_VALUE) from None
