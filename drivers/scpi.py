"""Common parts of drivers of SCPI instruments: the error queue, comparing settings, options, the mark of `prepare`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from rig.drivers.errors import DriverError, InstrumentError
from rig.drivers.numbers import decimal
from rig.drivers.wires.line import Line

_READBACK = 1e-6  # relative: answers are printed with eight decimals

PREPARED = 52
"""An event enable mask (query, execution and command errors) that means: prepared, and not switched off since.

The mask has no other use. Instruments clear it at power-on, and reading it changes nothing. So the evidence remains if
a session ends before it has used it (unlike the power-on bit of *ESR?).
"""


def one_of(*allowed: str | float) -> Callable[[Any], Any]:
    """A validator: the number, or text, must be one of a few."""

    def check(value: Any) -> Any:
        if value not in allowed:
            raise ValueError(f"must be one of {', '.join(a if isinstance(a, str) else f'{a:g}' for a in allowed)}")
        return value

    return check


Interface = Literal["rs232", "gpib"]
"""Interface of the instrument itself, whatever carries the text to it."""

INTERFACE = "rs232, also behind a serial server, or gpib"


def forget_errors(raise_errors: Callable[[], None], line: Line) -> None:
    """Empty an error queue of errors that are nobody's; an answer that makes no sense is left for later."""
    for _ in range(2):
        try:
            raise_errors()
        except InstrumentError:
            continue
        except DriverError:
            line.drain()
        return


def agrees(answer: str, wanted: float | str) -> bool:
    """Whether an answer is a text, or a number within the rounding of its last digits."""
    if isinstance(wanted, str):
        return answer == wanted
    try:
        return math.isclose(decimal(answer), wanted, rel_tol=_READBACK)
    except ValueError:
        return False
