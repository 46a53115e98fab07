"""Numbers as instruments print them, for all text protocols: ASCII digits, sign, point and exponent, nothing else.

Python's own `float` and `int` also take "nan", "inf", "1_000" and the digits of every script, which on a wire are
characters gone wrong. Codes that stand for an overload (9.9E+37) are numbers here; who asks knows them.
"""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([Ee][+-]?[0-9]{1,3})?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")


def decimal(text: str) -> float:
    """The finite number that a text is; spaces around it do not matter. Raises `ValueError`."""
    value = float(text) if _DECIMAL.fullmatch(text.strip(" ")) else math.nan
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is no number")
    return value


def whole(text: str) -> int:
    """The whole number that a text is; spaces around it do not matter. Raises `ValueError`."""
    if not _WHOLE.fullmatch(text.strip(" ")):
        raise ValueError(f"{text!r} is no whole number")
    return int(text)
