"""Electronic data sheets (CiA 306) as read by a simulated node."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from configparser import RawConfigParser
from dataclasses import dataclass, replace
from functools import lru_cache

_PACKING = {0x0002: "<b", 0x0003: "<h", 0x0004: "<i", 0x0005: "<B", 0x0006: "<H", 0x0007: "<I"}
_VISIBLE_STRING = 0x0009
_DRIVE = 0x00020192  # device type: a servo drive after profile 402
_SECTION = re.compile(r"([0-9A-Fa-f]{4})(?:sub([0-9A-Fa-f]+))?")

Key = tuple[int, int]
"""Index and subindex."""


@dataclass(frozen=True)
class EdsObject:
    """One object of the dictionary.

    Attributes:
        name: its name.
        data_type: CiA 301's number for its type.
        access: "ro", "wo", "rw" or "const".
        default: value at power-on, 0 or "" if none is given.
        low, high: range of numbers, None if none is given.

    """

    name: str
    data_type: int
    access: str
    default: int | str
    low: int | None
    high: int | None

    @property
    def size(self) -> int | None:
        """Bytes of a number, None for a string."""
        packing = _PACKING.get(self.data_type)
        return struct.calcsize(packing) if packing else None

    def pack(self, value: int | str) -> bytes:
        """A value as bytes on the wire."""
        return value.encode("ascii") if isinstance(value, str) else struct.pack(_PACKING[self.data_type], value)

    def unpack(self, data: bytes) -> int:
        """A number from bytes on the wire; `data` has the right size."""
        (value,) = struct.unpack(_PACKING[self.data_type], data)
        return int(value)


@lru_cache(maxsize=4)
def _sections(text: str) -> RawConfigParser:
    """The sections of a data sheet. Every node of every bench reads its own, of which there are few."""
    parser = RawConfigParser(inline_comment_prefixes=(";",))
    parser.read_string(text)
    return parser


def read_eds(text: str, node: int) -> Mapping[Key, EdsObject]:
    """All objects that hold a value, by index and subindex; `node` stands for $NODEID."""
    parser = _sections(text)
    found: dict[Key, EdsObject] = {}
    for section in parser.sections():
        match = _SECTION.fullmatch(section)
        if match is None or "datatype" not in parser[section]:
            continue
        entry = parser[section]
        data_type = int(entry["datatype"], 0)
        found[int(match[1], 16), int(match[2] or "0", 16)] = EdsObject(
            entry["parametername"],
            data_type,
            entry["accesstype"].lower(),
            entry.get("defaultvalue", "") if data_type == _VISIBLE_STRING else _number(entry.get("defaultvalue"), node),
            _limit(entry.get("lowlimit"), node),
            _limit(entry.get("highlimit"), node),
        )
    return found


def identified(objects: Mapping[Key, EdsObject], text: str) -> Mapping[Key, EdsObject]:
    """The objects, with those that a drive answers and many data sheets omit: profile, vendor and product."""
    parser = _sections(text)
    device = parser["DeviceInfo"] if parser.has_section("DeviceInfo") else {}
    own = {(0x1000, 0): _DRIVE}
    for subindex, name in ((1, "vendornumber"), (2, "productnumber"), (3, "revisionnumber")):
        own[0x1018, subindex] = _number(device.get(name), 0)
    return {key: replace(o, default=own[key]) if key in own and not o.default else o for key, o in objects.items()}


def _limit(text: str | None, node: int) -> int | None:
    return _number(text, node) if text else None


def _number(text: str | None, node: int) -> int:
    """A sum of numbers; one of them may be $NODEID."""
    return sum(node if part.strip().upper() == "$NODEID" else int(part, 0) for part in (text or "0").split("+"))
