"""Units of speed and acceleration of CiA 402 drives, and their conversion from deg/s of the table.

A drive may count speeds in position units per second, in revolutions of a shaft or in degrees. The unit is in 60A9h and
60AAh (CiA 402-2), or in the bench file. If both name it they must agree; if neither does, no speed is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

VELOCITY_UNITS = ("counts/s", "rpm", "rev/s", "deg/s")
ACCELERATION_UNITS = ("counts/s^2", "rpm/s", "rev/s^2", "deg/s^2")
Quantity = Literal["velocity", "acceleration"]

_NAMES = {"velocity": VELOCITY_UNITS, "acceleration": ACCELERATION_UNITS}
_PER_TABLE_DEGREE: dict[str, Callable[[float, float], float]] = {
    "counts": lambda counts, turns: counts,
    "rpm": lambda counts, turns: turns / 6.0,
    "rev": lambda counts, turns: turns / 360.0,
    "deg": lambda counts, turns: turns,
}
"""One degree of the table in this unit, by counts per degree and turns of the shaft per turn of the table."""

# CiA 303-2 codes as in public code and manuals; 57h, a second squared, is from memory [?].
_CODES: dict[Quantity, dict[tuple[int, int], str]] = {
    "velocity": {(0xB5, 0x03): "counts/s", (0xB4, 0x47): "rpm", (0xB4, 0x03): "rev/s", (0x41, 0x03): "deg/s"},
    "acceleration": {
        (0xB5, 0x57): "counts/s^2",
        (0xC0, 0x03): "rpm/s",
        (0xB4, 0x57): "rev/s^2",
        (0x41, 0x57): "deg/s^2",
    },
}
_TEXT = re.compile(r"(?:(?P<factor>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?) )?(?P<name>[a-z]+/?[a-z]*(?:\^2)?)")


@dataclass(frozen=True)
class Unit:
    """One unit of speed or acceleration.

    Attributes:
        factor: multiple of `name`: 0.1 for tenths of a revolution per minute.
        name: one of `VELOCITY_UNITS` or `ACCELERATION_UNITS`.
    """

    factor: float
    name: str

    def __str__(self) -> str:
        return self.name if self.factor == 1.0 else f"{self.factor:g} {self.name}"

    @property
    def of_shaft(self) -> bool:
        """Whether it refers to a shaft, so that the gear between shaft and table matters."""
        return not self.name.startswith("counts")

    def per_degree(self, counts_per_degree: float, turns: float) -> float:
        """Number of these units in 1 deg/s (or 1 deg/s^2) of the table.

        Args:
            counts_per_degree: position units per degree of the table.
            turns: turns of the shaft per turn of the table; unused for counts.
        """
        return _PER_TABLE_DEGREE[self.name.partition("/")[0]](counts_per_degree, turns) / self.factor


def parse_unit(text: str, quantity: Quantity) -> Unit:
    """A unit from its text in the bench file: "rpm", "0.1 rpm". Raises `ValueError`."""
    match = _TEXT.fullmatch(text)
    if match is None or match["name"] not in _NAMES[quantity] or not float(match["factor"] or 1.0) > 0.0:
        known = _NAMES[quantity]
        raise ValueError(
            f"{text!r} is not a unit of {quantity}; known: {', '.join(known)}, or a part of one (0.1 {known[1]})"
        )
    return Unit(float(match["factor"] or 1.0), match["name"])


def told_unit(code: int, quantity: Quantity) -> Unit | None:
    """The unit in 60A9h or 60AAh; None if it is not set, or has an unknown code."""
    exponent, numerator, denominator = (code >> 24) & 0xFF, (code >> 16) & 0xFF, (code >> 8) & 0xFF
    name = _CODES[quantity].get((numerator, denominator))
    if name is None:
        return None
    return Unit(10.0 ** (exponent - 256 if exponent > 127 else exponent), name)
