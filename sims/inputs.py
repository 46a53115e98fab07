"""The path of a reading from an instrument's input to its answer, with hooks for faults and the tape."""

from __future__ import annotations

from collections.abc import Callable

Tamper = Callable[[str, str, float, float], float]
"""Takes channel, unit, time and reading; returns the reported reading."""

Heard = Callable[[str, str, float, float, float, float], None]
"""Called with channel, unit, begin and end of the window, the converter's reading, and the reported reading."""


class Inputs:
    """The inputs of one instrument.

    Args:
        overload: the instrument's code for a reading outside its range.
        told_open: whether it distinguishes an open voltage input from a voltage.

    Attributes:
        tampers: active changes of readings, in order of their begin.
        heard: called with every reading; None if nobody listens.
        latest: the latest reading by channel.
    """

    def __init__(self, overload: float = 9.9e37, *, told_open: bool = False) -> None:
        self.overload = overload
        self.told_open = told_open
        self.tampers: list[Tamper] = []
        self.heard: Heard | None = None
        self.latest: dict[str, float] = {}

    def given(self, channel: str, unit: str, t0: float, t1: float, value: float) -> float:
        """The reported reading.

        Args:
            channel: its input.
            unit: "V", "degC" or "psi".
            t0: begin of the window, virtual seconds.
            t1: its end.
            value: reading of the converter.
        """
        found = value
        if self.tampers:
            for tamper in tuple(self.tampers):
                value = tamper(channel, unit, t0, value)
        self.latest[channel] = value
        if self.heard is not None:
            self.heard(channel, unit, t0, t1, found, value)
        return value
