"""Units of the columns of standard models: factor and offset to the model's own."""

from __future__ import annotations

from collections.abc import Mapping

from fitter.errors import FitError

_FACTORS: Mapping[str, Mapping[str, float]] = {
    "ohm": {"ohm": 1.0, "mohm": 1e-3, "kohm": 1e3},
    "mV": {"mV": 1.0, "V": 1e3, "uV": 1e-3},
    "Pa": {"Pa": 1.0, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "bar": 1e5, "MPa": 1e6},
}
_SIGNS = {
    "°C": "degC",
    "℃": "degC",
    "C": "degC",
    "Ω": "ohm",
    "Ohm": "ohm",
    "ohms": "ohm",
    "µV": "uV",
    "μV": "uV",
}
_TEMPERATURES = {"degC": (1.0, 0.0), "K": (1.0, -273.15), "degF": (5.0 / 9.0, -160.0 / 9.0)}


def to_model(unit: str, wanted: str, column: str) -> tuple[float, float]:
    """Factor and offset from a column's unit to the model's.

    Args:
        unit: of the column; "" if it is not known, which is taken for the model's.
        wanted: the model's; "" for any.
        column: its name, for the message.

    Raises:
        FitError: the unit is of another quantity.
    """
    plain = _SIGNS.get(unit.strip(" []()"), unit.strip(" []()"))
    if not plain or not wanted or plain == wanted:
        return 1.0, 0.0
    known = _TEMPERATURES if wanted == "degC" else {one: (f, 0.0) for one, f in _FACTORS.get(wanted, {}).items()}
    if plain not in known:
        told = ", ".join(known) or wanted
        raise FitError(f"{column} is in {plain}, and this model needs {wanted}; it can convert from {told}")
    return known[plain]
