"""Checksums of lines of text, as hexadecimal digits."""

from __future__ import annotations

from functools import reduce
from operator import xor


def checksum(kind: str, text: str) -> str:
    """Checksum of all characters of a text: "sum", "negative sum" (two's complement) or "xor"."""
    data = text.encode("ascii")
    match kind:
        case "sum":
            return f"{sum(data) & 0xFF:02X}"
        case "negative sum":
            return f"{-sum(data) & 0xFF:02X}"
    return f"{reduce(xor, data, 0):02X}"
