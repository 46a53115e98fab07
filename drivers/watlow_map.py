"""Register maps: a Modbus device's registers and codes as data; reading and writing registers by name."""

from __future__ import annotations

import math
import struct
import tomllib
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Literal, Self

from pydantic import BaseModel, Field, model_validator

from rig.drivers.errors import BadReply
from rig.drivers.kept import not_kept
from rig.drivers.wires.modbus import ModbusLine, float_of_words, in_other_order, words_of_float

_READBACK = 1e-5  # relative; a setpoint is stored in single precision
_WORDS = {"uint16": 1, "int32": 2, "float32": 2}


class RegisterEntry(BaseModel, extra="forbid", frozen=True):
    """One register of the map.

    Attributes:
        address: relative address.
        type: "uint16", "int32", "float32" or "text:N".
        access: "r" or "rw".
        stride: distance to the register of the next loop, alarm or module.
        codes: name of the table of its codes.
    """

    address: int = Field(ge=0, le=65535)
    type: str = Field(pattern=r"^(uint16|int32|float32|text:\d+)$")
    access: Literal["r", "rw"]
    stride: int = 0
    codes: str = ""

    @cached_property
    def words(self) -> int:
        """Number of its words."""
        kind, _, length = self.type.partition(":")
        return int(length) if length else _WORDS[kind]


class RegisterMap(BaseModel, extra="forbid", frozen=True):
    """A device's registers and codes; for a cascade, those of `cascade` replace others of the same name."""

    maker: str
    model: str
    word_order: Literal["low-first", "high-first"]
    registers: Mapping[str, RegisterEntry]
    cascade: Mapping[str, RegisterEntry] = Field(default_factory=dict)
    codes: Mapping[str, Mapping[str, int]]

    @model_validator(mode="after")
    def _told(self) -> Self:
        for name, entry in (*self.registers.items(), *self.cascade.items()):
            if entry.codes and entry.codes not in self.codes:
                raise ValueError(f"{name} has the codes of {entry.codes}, which are missing")
        return self


@lru_cache(maxsize=8)
def map_of(text: str) -> RegisterMap:
    """Read a register map from its TOML text."""
    return RegisterMap.model_validate(tomllib.loads(text))


class MappedDevice:
    """A device whose registers are read and written by name.

    Args:
        line: the device.
        registers: its map.
        loop: number of its loop.
        cascade: whether that loop is a cascade.
    """

    def __init__(self, line: ModbusLine, registers: RegisterMap, loop: int, *, cascade: bool) -> None:
        self._line = line
        self._map = registers
        self._loop = loop
        self._entries = {**registers.registers, **(registers.cascade if cascade else {})}
        self._low_first = registers.word_order == "low-first"
        self._kept: dict[str, float | str] = {}
        self._names = {of: {code: known for known, code in codes.items()} for of, codes in registers.codes.items()}

    def _address(self, name: str, number: int = 0) -> int:
        """Address of a register; `number` selects the alarm or module, the loop is this driver's own."""
        entry = self._entries[name]
        return entry.address + ((number or self._loop) - 1) * entry.stride

    def _words(self, name: str, number: int = 0) -> list[int]:
        return self._line.read(self._address(name, number), self._entries[name].words)

    def _text(self, name: str) -> str:
        return "".join(chr(word) for word in self._words(name) if word).strip()  # one character in each register

    def _integer(self, name: str) -> int:
        words = self._words(name)
        high, low = words[::-1] if self._low_first else words
        value: int = struct.unpack(">i", struct.pack(">HH", high, low))[0]
        return value

    def _code(self, name: str, number: int = 0) -> str:
        """Name of a code; an unknown code is kept as its number."""
        codes = self._entries[name].codes
        (word,) = self._words(name, number)
        return self._names[codes].get(word, f"code {word}")

    def _set_code(self, name: str, value: str) -> None:
        code = self._map.codes[self._entries[name].codes][value]
        self._line.write(self._address(name), [code])
        found = self._code(name)
        if found != value:
            raise BadReply(f"{self._line.where}: {name} was set to {value} and reads back {found}")
        self._kept[name] = value

    def _float(self, name: str, number: int = 0) -> float:
        """A number as it stands on the wire, which may be NaN. Raises `BadReply` if its words are swapped."""
        words = self._words(name, number)
        value, other = (
            float_of_words(words, low_first=self._low_first),
            in_other_order(words, low_first=self._low_first),
        )
        if other is not None:
            raise BadReply(
                f"{self._line.where}: {name} reads {value:.3g}, and {other:.6g} with its two words in the other order; "
                f"the word order of the controller or gateway may be swapped: set it to "
                f"{'low' if self._low_first else 'high'} word first, or change word_order of the register map; "
                f"nothing was set"
            )
        return value

    def _number(self, name: str, number: int = 0) -> float:
        value = self._float(name, number)
        if not math.isfinite(value):
            raise BadReply(f"{self._line.where}: {name} reads {value}; look at the controller's sensor")
        return value

    def _set_number(self, name: str, value: float) -> None:
        self._line.write(self._address(name), words_of_float(value, low_first=self._low_first))
        found = self._number(name)
        if not _same(found, value):
            raise BadReply(f"{self._line.where}: {name} was set to {value:g} and reads back {found:g}")
        self._kept[name] = value

    def _shown(self, name: str, value: float | str) -> str:
        """A register's value for a person."""
        return value if isinstance(value, str) else f"{value:.6g}"

    def _not_kept(self) -> list[str]:
        """Settings that are not as this driver set them, as sentences."""

        def ask(name: str) -> float | str:
            return self._code(name) if self._entries[name].codes else self._float(name)

        changed = not_kept(self._kept, ask, _same)
        return [f"{n} reads {self._shown(n, found)}, not {self._shown(n, wanted)}" for n, wanted, found in changed]


def _same(found: float | str, wanted: float | str) -> bool:
    """Whether a code or a number reads back as it was set."""
    if isinstance(found, str) or isinstance(wanted, str):
        return found == wanted
    return math.isclose(found, wanted, rel_tol=_READBACK, abs_tol=1e-4)
