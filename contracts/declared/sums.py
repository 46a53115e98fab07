"""Frames of lines, and their checksums: sums, exclusive or, cyclic redundancy checks, over all of a frame or a part."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import xor
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from rig.contracts.declared.exchanges import Strict, Texts
from rig.contracts.declared.forms import Form

_HOLE = re.compile(r"\{checksum(?::0([1-9][0-9]?))?\}")
"""The checksum in a frame; `{checksum:03}` has at least three digits."""


class _Cyclic(NamedTuple):
    """Parameters of a cyclic redundancy check, as catalogues have them."""

    width: int
    polynomial: int
    init: int
    reflect: bool
    xorout: int


NAMED: Mapping[str, _Cyclic] = {
    "crc8": _Cyclic(8, 0x07, 0x00, False, 0x00),
    "crc8 maxim": _Cyclic(8, 0x31, 0x00, True, 0x00),
    "crc16 modbus": _Cyclic(16, 0x8005, 0xFFFF, True, 0x0000),
    "crc16 arc": _Cyclic(16, 0x8005, 0x0000, True, 0x0000),
    "crc16 ccitt": _Cyclic(16, 0x1021, 0xFFFF, False, 0x0000),
    "crc16 xmodem": _Cyclic(16, 0x1021, 0x0000, False, 0x0000),
    "crc32": _Cyclic(32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF),
}
"""Checks by the names that manuals use; the result of each for `123456789` is in the catalogues."""

Kind = Literal[
    "sum",
    "negative sum",
    "xor",
    "crc",
    "crc8",
    "crc8 maxim",
    "crc16 modbus",
    "crc16 arc",
    "crc16 ccitt",
    "crc16 xmodem",
    "crc32",
]
Shown = Literal["hex", "lower hex", "decimal", "binary", "binary, low byte first"]


class Checksum(Strict):
    """A checksum. A text alone is its kind, over all characters before it, in hexadecimal digits."""

    kind: Kind = Field(description="which; crc: by its polynomial")
    over: Texts = Field(
        (), description="part of request and reply that it is made of, or one for each; left out: all before it"
    )
    as_: Shown = Field("hex", alias="as", description="how it is written; binary: as bytes")
    width: Literal[8, 16, 32] | None = Field(None, description="its bits; left out: 8, or those of a named crc")
    polynomial: int = Field(0, ge=0, le=0xFFFFFFFF, description="of a crc, without its highest bit: 0x1021")
    init: int = Field(0, ge=0, le=0xFFFFFFFF, description="begin of a crc, a sum or an exclusive or")
    reflect: bool = Field(False, description="of a crc: the lowest bit of each byte comes first, and of the result")
    xorout: int = Field(0, ge=0, le=0xFFFFFFFF, description="the result is exclusive-ored with this")
    modulo: int = Field(0, ge=0, le=0xFFFFFFFF, description="then the remainder by this is taken; 0: none")
    never: tuple[Annotated[int, Field(ge=0, le=254)], ...] = Field(
        (),
        description="bytes that it does not have, since they end a line; each is increased by one: [0, 13]",
    )
    plus: int = Field(0, ge=0, le=255, description="then this is added: 32 makes a printable character")

    @model_validator(mode="before")
    @classmethod
    def _short(cls, given: Any) -> Any:
        return {"kind": given} if isinstance(given, str) else given

    @property
    def binary(self) -> bool:
        """Whether it is written as bytes."""
        return self.as_.startswith("binary")

    @property
    def bits(self) -> int:
        """Its width."""
        return self.width or (NAMED[self.kind].width if self.kind in NAMED else 8)

    def of(self, data: bytes) -> int:
        """The checksum of some bytes."""
        most = (1 << self.bits) - 1
        match self.kind:
            case "sum":
                found = self.init + sum(data)
            case "negative sum":
                found = -(self.init + sum(data))
            case "xor":
                found = reduce(xor, data, self.init)
            case _:
                own = _Cyclic(self.bits, self.polynomial, self.init, self.reflect, 0)
                found = _crc(data, NAMED.get(self.kind, own))
        found = (found & most) ^ self.xorout
        return ((found % self.modulo if self.modulo else found) + self.plus) & most

    def shown(self, number: int) -> str:
        """A checksum as it is written; bytes as characters of Latin-1."""
        if self.binary:
            order: Literal["big", "little"] = "big" if self.as_ == "binary" else "little"
            data = number.to_bytes(self.bits // 8, order)
            return bytes(byte + (byte in self.never) for byte in data).decode("latin-1")
        if self.as_ == "decimal":
            return str(number)
        digits = f"{number:0{self.bits // 4}X}"
        return digits.lower() if self.as_ == "lower hex" else digits

    def pattern(self, digits: int) -> str:
        """Pattern of how it is written, with so many digits at least."""
        if self.binary:
            return f".{{{self.bits // 8}}}"
        if self.as_ == "decimal":
            return f"[0-9]{{{digits or 1},{max(digits, 1) if digits else 10}}}"
        return f"[0-9A-Fa-f]{{{max(digits, self.bits // 4)}}}"


def _crc(data: bytes, by: _Cyclic) -> int:
    """Bit by bit, the highest first: frames are short."""
    highest, most, register = 1 << by.width - 1, (1 << by.width) - 1, by.init
    for byte in data:
        register ^= (_reflected(byte, 8) if by.reflect else byte) << by.width - 8
        for _ in range(8):
            register = (register << 1 ^ (by.polynomial if register & highest else 0)) & most
    return (_reflected(register, by.width) if by.reflect else register) ^ by.xorout


def _reflected(number: int, bits: int) -> int:
    return int(f"{number:0{bits}b}"[::-1], 2)


class Frame:
    """A frame around a line.

    Args:
        template: `{line}`, parameters and `{checksum}` in it.
        checksum: its checksum, None if it has none.
        known: parameters by name.

    Raises:
        ValueError: the part that the checksum is made of is not in the frame.

    Example:
        >>> frame = Frame("#{line}{checksum}", Checksum(kind="xor"), {})
        >>> frame.write("ID"), frame.read("#ID2E"), frame.read("#ID2F")
        ('#ID2E', ('ID', ''), ('ID', '2E'))
    """

    def __init__(self, template: str, checksum: Checksum | None, known: Mapping[str, str | float]) -> None:
        hole = _HOLE.search(template)
        self._sum = checksum if hole is not None else None
        self._digits = int(hole[1] or 0) if hole is not None else 0
        over = template[: hole.start()] if hole is not None else template
        if self._sum is not None and self._sum.over:
            over = next((part for part in self._sum.over if part in template and not _HOLE.search(part)), "")
            if not over:
                raise ValueError(f"over = {' or '.join(map(repr, self._sum.over))} is no part of {template!r}")
        before, _, after = template.partition(over)
        self._whole = Form(_HOLE.sub("{checksum}", template)).filled(known)
        self._over = Form(over).filled(known)
        pieces = [self._pattern(piece, known) for piece in (before, over, after)]
        self._read = re.compile("{}(?P<part_>{}){}".format(*pieces), re.ASCII | re.DOTALL)

    def _pattern(self, piece: str, known: Mapping[str, str | float]) -> str:
        hole = _HOLE.search(piece)
        if hole is None or self._sum is None:
            return Form(piece).filled(known).pattern()
        before, after = (Form(part).filled(known).pattern() for part in (piece[: hole.start()], piece[hole.end() :]))
        return f"{before}(?P<checksum>{self._sum.pattern(self._digits)}){after}"

    def write(self, line: str) -> str:
        """A line in its frame."""
        fields: dict[str, float | str] = {"line": line}
        if self._sum is not None:
            number = self._sum.of(self._over.write(fields).encode("latin-1"))
            fields["checksum"] = self._sum.shown(number).zfill(0 if self._sum.binary else self._digits)
        return self._whole.write(fields)

    def read(self, text: str) -> tuple[str, str] | None:
        """The line in a frame, and the right checksum if it has another one; None if the frame is another one."""
        found = self._read.fullmatch(text)
        if found is None:
            return None
        line = found["line"].strip()
        if self._sum is None:
            return line, ""
        right = self._sum.shown(self._sum.of(found["part_"].encode("latin-1")))
        said = found["checksum"]
        same = said == right if self._sum.binary else said.lstrip("0").upper() == right.lstrip("0").upper()
        return line, "" if same else right


class Replies:
    """Frames of answers: the first that fits is taken. One without `{line}` is a whole answer, such as ACK.

    Args:
        templates: as of `Frame`.
        checksum, known: see `Frame`.

    Raises:
        ValueError: see `Frame`.
    """

    def __init__(self, templates: Sequence[str], checksum: Checksum | None, known: Mapping[str, str | float]) -> None:
        self._bare = [Form(text).filled(known).write({}) for text in templates if "{line}" not in text]
        self._frames = [Frame(text, checksum, known) for text in templates if "{line}" in text]

    def write(self, line: str) -> str:
        """An answer in its frame, the first one."""
        return line if line in self._bare else self._frames[0].write(line)

    def read(self, text: str) -> tuple[str, str] | None:
        """See `Frame.read`."""
        if text in self._bare:
            return text, ""
        found = [one for frame in self._frames if (one := frame.read(text)) is not None]
        return next((one for one in found if not one[1]), found[0] if found else None)
