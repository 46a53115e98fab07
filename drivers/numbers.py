"""Numbers as printed by instruments, for all text protocols: only ASCII digits, sign, point and exponent.

Python's `float` and `int` also accept "nan", "inf", "1_000" and the digits of every script; on a wire these are
corrupted characters. Codes for an overload (9.9E+37) are numbers here; callers know them.
"""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([Ee][+-]?[0-9]{1,3})?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")


def decimal(text: str) -> float:
    """The finite number in a text; spaces around it are ignored. Raises `ValueError`."""
    if _DECIMAL.fullmatch(text.strip(" ")):
        value = float(text)
        if math.isfinite(value):
            return value
    raise ValueError(f"{text!r} is not a number")


def whole(text: str) -> int:
    """The integer in a text; spaces around it are ignored. Raises `ValueError`."""
    if not _WHOLE.fullmatch(text.strip(" ")):
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)
