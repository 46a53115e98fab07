"""Bridges: instruments that a driver of another library, or a control system, reaches.

A bridge reads and writes attributes. Everything else is that of a declared instrument (`rig.drivers.declared`), whose
questions are attributes: readings, settings that are read back, when it has settled, its safe state. Drivers of
libraries run in a process of their own, so that one that hangs, prints or crashes does so there.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol


class Value(NamedTuple):
    """The value of an attribute.

    Attributes:
        text: a number with all its digits, a word, or several numbers with commas.
        unit: its unit; "" if the library does not say it.
        stamp: when it was measured, by its own clock; None if the library does not say it.
    """

    text: str
    unit: str = ""
    stamp: float | None = None


class Bridge(Protocol):
    """Reads and writes attributes. All methods raise `DriverError`, at the latest after `timeout_s` bench seconds.

    Attributes:
        measures_when_asked: whether a question for a value with a stamp has it measured; otherwise it is measured by
            itself from time to time.
    """

    @property
    def measures_when_asked(self) -> bool:
        """See the class."""
        ...

    def identity(self, timeout_s: float) -> tuple[str, str, str, str]:
        """Maker, model, serial number and firmware, "" for what it does not say."""
        ...

    def read(self, path: str, timeout_s: float) -> Value:
        """The value of an attribute, or of a call such as `measure()`."""
        ...

    def write(self, path: str, text: str, timeout_s: float) -> None:
        """Set an attribute to a number or a word. Never repeated."""
        ...

    def call(self, path: str, timeout_s: float) -> None:
        """Carry out a call such as `shutdown()`. Never repeated."""
        ...

    def close(self) -> None:
        """Release it; idempotent. It opens again at its next use."""
        ...
