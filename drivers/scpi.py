"""Common parts of drivers of SCPI instruments: the error queue, comparing settings, options, the mark of `prepare`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from rig.drivers.errors import DriverError, InstrumentError
from rig.drivers.numbers import decimal, whole
from rig.drivers.wires import SerialLine
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


def raise_errors(line: SerialLine, ask: Callable[[], str], most: int, question: str = "SYST:ERR?") -> None:
    """Empty an instrument's error queue.

    Args:
        line: for messages.
        ask: reads and removes the oldest error of the queue: a number, a comma and a quoted text, number 0 for none.
        most: maximum length of the queue.
        question: the query, for messages.

    Raises:
        InstrumentError: the first error, the others in its text.
        BadReply: an answer that is not an error.
    """
    found: list[tuple[int, str]] = []
    while len(found) <= most:
        answer = ask()
        code, _, text = answer.partition(",")
        try:
            number = whole(code)
        except ValueError:
            raise line.bad_reply(question, answer, 'code,"text"') from None
        if number == 0:
            break
        found.append((number, text.strip().strip('"')))
    if found:
        (first, words), *others = found
        raise InstrumentError(line.where, first, words + "".join(f"; then {c} {t}" for c, t in others))


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
