"""Units of a register: factors of differences, so that an uncertainty in mK holds for a column in degC.

From the SI brochure, ninth edition, and NIST SP 811, appendix B.8.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

from rig.procedures.column_names import spelled
from rig.units.of_instruments import scale

_FAMILIES: tuple[Mapping[str, float], ...] = (
    {
        "deg": 1.0,
        "arcmin": 1 / 60,
        "arcsec": 1 / 3600,
        "mdeg": 1e-3,
        "rad": 180 / pi,
        "mrad": 0.18 / pi,
        "urad": 1.8e-4 / pi,
    },
    {"K": 1.0, "degC": 1.0, "mK": 1e-3, "mdegC": 1e-3, "degF": 5 / 9},
    {
        "Pa": 1.0,
        "hPa": 1e2,
        "kPa": 1e3,
        "MPa": 1e6,
        "mbar": 1e2,
        "bar": 1e5,
        "psi": 6894.757293168,
        "psia": 6894.757293168,
        "psig": 6894.757293168,
        "mpsi": 6.894757293168,
        "mmHg": 133.322387415,
        "Torr": 101325 / 760,
        "atm": 101325.0,
    },
    {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "kgf": 9.80665},
    {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "lb": 0.45359237},
    {"m/s2": 1.0, "mGal": 1e-5, "uGal": 1e-8, "um/s2": 1e-6, "gn": 9.80665},
    {"m": 1.0, "mm": 1e-3, "um": 1e-6, "cm": 1e-2, "km": 1e3, "in": 0.0254, "ft": 0.3048},
    {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
)
NOT_CELSIUS = ("K", "mK", "mdegC", "degF")
"""Units of temperatures whose values are none in degC."""
_RELATIVE = {"1": 1.0, "%": 1e-2, "ppm": 1e-6}


def relative(unit: str) -> float | None:
    """The value of a relative unit: 0.01 of "%"; None of any other."""
    return _RELATIVE.get(unit)


def factor(of: str, to: str) -> float | None:
    """Number of units `to` in a difference of one `of`; None if they do not convert."""
    of, to = spelled(of), spelled(to)
    for family in _FAMILIES:
        if of in family and to in family:
            return family[of] / family[to]
    return scale(of, to)
