"""Quantities of columns, by their names and units: a cause has the name that the field gives it."""

from __future__ import annotations

import re
from typing import Literal

from rig.procedures.general.effects.scene import is_temperature

Quantity = Literal["temperature", "load", "current", "resistance"]

_NUMBER = re.compile(r"\d+")
_PATTERNS = {
    "load": re.compile(r"(^|_)(force|load|weight|mass|torque)s?(_|$)|_([kM]?N|k?g|k?Nm|lbf|psi[ag]?|bar|[kM]?Pa)$"),
    "current": re.compile(r"(^|_)current(_|$)|_[unm]?A$"),
    "resistance": re.compile(r"(^|_)(resistance|r_source|r_load)(_|$)|_[kM]?[oO]hms?$"),
}


def is_quantity(name: str, quantity: Quantity) -> bool:
    """Whether a column is such a quantity, by its name."""
    return is_temperature(name) if quantity == "temperature" else bool(_PATTERNS[quantity].search(name))


def are_neighbours(name: str, other: str) -> bool:
    """Whether two columns have the same name but for a number: outputs of sensors beside each other."""
    return name != other and _NUMBER.sub("#", name) == _NUMBER.sub("#", other)
