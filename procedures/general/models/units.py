"""Units of the columns of standard models: read from a column's name, and converted to the model's own."""

from __future__ import annotations

import re
from collections.abc import Mapping

from rig.fitter.errors import FitError

_FAMILIES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "degC": {"degC": (1.0, 0.0), "K": (1.0, -273.15), "degF": (5.0 / 9.0, -160.0 / 9.0)},
    "ohm": {"ohm": (1.0, 0.0), "mohm": (1e-3, 0.0), "kohm": (1e3, 0.0)},
    "mV": {"mV": (1.0, 0.0), "V": (1e3, 0.0), "uV": (1e-3, 0.0)},
    "Pa": {
        "Pa": (1.0, 0.0),
        "hPa": (1e2, 0.0),
        "mbar": (1e2, 0.0),
        "kPa": (1e3, 0.0),
        "bar": (1e5, 0.0),
        "MPa": (1e6, 0.0),
    },
}
"""By the model's unit: factor and offset from others to it."""
_SIGNS = {
    "°C": "degC",
    "C": "degC",
    "°F": "degF",
    "\u2126": "ohm",
    "\u03a9": "ohm",
    "Ohm": "ohm",
    "ohms": "ohm",
    "k\u2126": "kohm",
    "k\u03a9": "kohm",
    "m\u03a9": "mohm",
    "\u00b5V": "uV",
    "\u03bcV": "uV",
}
_AT_END = re.compile(r"[(\[]\s*([^()\[\]]+?)\s*[)\]]\s*$|[_ ]([^_ ()\[\]]+)$")


def unit_in(name: str, given: str = "") -> str:
    """The unit of a column by its name, `t_degC` or `Temperature (K)`, or as the file says; "" if none is known."""
    found = _AT_END.search(name)
    text = given.strip(" []()") or ("" if found is None else found[1] or found[2])
    plain = _SIGNS.get(text, text)
    return plain if any(plain in units for units in _FAMILIES.values()) else ""


def to_model(unit: str, wanted: str, column: str) -> tuple[float, float]:
    """Factor and offset from a column's unit to the model's.

    Args:
        unit: from `unit_in`; "" if it is not known, which is taken for the model's.
        wanted: the model's; "" for any.
        column: its name, for the message.

    Raises:
        FitError: the unit is of another quantity.
    """
    if not unit or not wanted:
        return 1.0, 0.0
    known = _FAMILIES[wanted]
    if unit not in known:
        raise FitError(f"{column} is in {unit}, and this model needs {wanted}; it can convert from {', '.join(known)}")
    return known[unit]
