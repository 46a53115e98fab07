"""Registers of a simulated Modbus device: numbers and texts of one or more words, at their addresses."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from rig.sims.wires.modbus_slave import ILLEGAL_ADDRESS, Refused

_STRUCT = {"int16": ">h", "uint16": ">H", "bit": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}

Value = float | int | str
Access = tuple[Callable[[], Value], Callable[[Any], None] | None]
"""Reading and writing of a register."""


class Register:
    """One parameter in one or more words.

    Args:
        kind: "int16", "uint16", "bit", "int32", "uint32", "float32", or "text:N" with N characters.
        low_first: order of the words of a number.
        get: its value now; of a number that does not fit its type, the last of the type is read.
        put: sets it, None if it is read only; raises `Refused`.

    Attributes:
        size: number of its words.
        number: whether it is a number or a code, not a text.
    """

    def __init__(self, kind: str, low_first: bool, get: Callable[[], Value], put: Callable[[Any], None] | None) -> None:
        self.number = kind in _STRUCT
        self._low_first = low_first
        self._get, self._put, self._whole = get, put, kind != "float32"
        self._value = struct.Struct(_STRUCT.get(kind, ""))
        self.size = int(kind.partition(":")[2]) if kind.startswith("text:") else self._value.size // 2
        self._words = struct.Struct(f">{self.size}H")

    def words(self) -> list[int]:
        """Its value as words."""
        value = self._get()
        if isinstance(value, str):
            return [ord(c) for c in value.ljust(self.size, "\0")]
        try:
            data = self._value.pack(round(value) if self._whole else value)
        except (struct.error, OverflowError):
            data = b"\x7f" + b"\xff" * (self._value.size - 1) if self._whole else self._value.pack(inf)
        words = list(self._words.unpack(data))
        return words[::-1] if self._low_first else words

    def set(self, words: Sequence[int]) -> None:
        """Set its value from all of its words."""
        if self._put is None or len(words) != self.size:
            raise Refused(ILLEGAL_ADDRESS)
        ordered = words[::-1] if self._low_first else words
        (value,) = self._value.unpack(self._words.pack(*ordered))
        self._put(value)


class Bank:
    """Registers at their addresses, of one table or one port; see `rig.sims.wires.modbus_slave.Registers`.

    Args:
        identity: the answer of function 17.
        padded: whether a parameter of 16 bits has two addresses, of which the second reads 0.
    """

    def __init__(self, identity: bytes, *, padded: bool = False) -> None:
        self.identity = identity
        self._padded = padded
        self._at: dict[int, tuple[Register, int]] = {}

    def add(self, address: int, register: Register) -> None:
        """Put a register at an address."""
        for offset in range(register.size):
            self._at[address + offset] = (register, offset)

    def read(self, address: int, count: int) -> list[int]:
        """Words from `address` on; every word must belong to a register; numbers are read whole."""
        register, offset = self._find(address)
        if register.size == count and not offset:  # nearly always
            return register.words()
        words: list[int] = []
        single = False
        while len(words) < count:
            at = address + len(words)
            if single and at not in self._at:
                words.append(0)
                single = False
                continue
            register, offset = self._find(at)
            if register.number and (offset or count - len(words) < register.size):
                raise Refused(ILLEGAL_ADDRESS)
            single = self._padded and register.size == 1
            words += register.words()[offset:]
        return words[:count]

    def write(self, address: int, words: Sequence[int]) -> None:
        """Set words from `address` on; registers are written whole."""
        done = 0
        while done < len(words):
            register, offset = self._find(address + done)
            if offset:
                raise Refused(ILLEGAL_ADDRESS)
            register.set(words[done : done + register.size])
            done += register.size

    def _find(self, address: int) -> tuple[Register, int]:
        try:
            return self._at[address]
        except KeyError:
            raise Refused(ILLEGAL_ADDRESS) from None
