"""CAN identifiers as numbers and as bytes, as both sides of a wire write them."""

from __future__ import annotations

EXTENDED = 1 << 31
"""Added to an identifier of 29 bits, as in DBC files."""
REMOTE = 1 << 30
"""Added to the identifier of a remote frame, which asks for a message; its data say how long that is, no more."""


def packed(can_id: int, data: bytes) -> bytes:
    """Identifier and data: two bytes of identifier; four if it has 29 bits (highest bit) or is remote (the next)."""
    return can_id.to_bytes(4 if can_id & (EXTENDED | REMOTE) else 2, "big") + data


def unpacked(message: bytes) -> tuple[int, bytes]:
    """The contrary of `packed`."""
    size = 4 if message[0] & 0xC0 else 2
    return int.from_bytes(message[:size], "big"), message[size:]


def shown_id(can_id: int) -> str:
    """An identifier as it is shown, `1A0h`; one of 29 bits has eight digits."""
    return f"{can_id & ~(EXTENDED | REMOTE):0{8 if can_id & EXTENDED else 3}X}h"


def shown(message: bytes) -> str:
    """A packed frame as programs for CAN print it: `1A0#0102`."""
    can_id, data = unpacked(message)
    return f"{shown_id(can_id)[:-1]}#{f'R{len(data)}' if can_id & REMOTE else data.hex().upper()}"
