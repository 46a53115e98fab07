"""What becomes of a reading between an instrument's input and its answer: where faults and the tape take hold."""

from __future__ import annotations

from collections.abc import Callable

Tamper = Callable[[str, str, float, float], float]
"""Takes channel, unit, the moment and the reading; gives what the instrument will say."""

Heard = Callable[[str, str, float, float, float, float], None]
"""Told channel, unit, begin and end of the window, what the converter found, and the reading given."""


class Inputs:
    """The inputs of one instrument.

    Args:
        overload: what the instrument takes for a reading outside its range.
        told_open: whether it tells an open voltage input from a voltage.

    Attributes:
        tampers: what is wrong with readings now, in the order in which it happened.
        heard: told of every reading; None if nobody listens.
        latest: the latest reading by channel.

    """

    def __init__(self, overload: float = 9.9e37, *, told_open: bool = False) -> None:
        self.overload = overload
        self.told_open = told_open
        self.tampers: list[Tamper] = []
        self.heard: Heard | None = None
        self.latest: dict[str, float] = {}

    def given(self, channel: str, unit: str, t0: float, t1: float, value: float) -> float:
        """The reading that the instrument gives.

        Args:
            channel: its input.
            unit: "V", "degC" or "psi".
            t0: begin of the window, virtual seconds.
            t1: its end.
            value: what the converter found.

        """
        found = value
        for tamper in tuple(self.tampers):
            value = tamper(channel, unit, t0, value)
        self.latest[channel] = value
        if self.heard is not None:
            self.heard(channel, unit, t0, t1, found, value)
        return value
