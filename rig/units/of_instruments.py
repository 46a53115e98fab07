"""Names of quantities set by instruments, by role, and units of outputs, for bench files and tables."""

from math import prod

HEAD_AXES = ("pitch", "roll")
"""Quantities of a dividing head (`rig.drivers.roles.Head`)."""
HEAD = tuple(f"{axis}_deg" for axis in HEAD_AXES)
PRESSURE = "pressure_psia"
"""Quantity of a pressure controller (`rig.drivers.roles.PressureController`)."""
PRESSURE_UNIT, TEMPERATURE_UNIT = "psia", "degC"
"""Units of the roles that have one of their own."""
ATMOSPHERE_PSIA = 14.7
VOLT = "V"
"""Unit of readers that do not say another one."""

PER_VOLT = {"V": 1.0, "mV": 1e3}
"""Units in which small and large voltages are told to people, per volt."""

PER = "_per_"
"""In place of the slash of a unit in names."""

_PREFIXES = {"p": -12, "n": -9, "u": -6, "m": -3, "": 0, "k": 3, "M": 6, "G": 9}
"""Powers of ten of the prefixes that a unit may have."""
_WHOLE = ("m", "min", "mol", "mmHg", "mHg", "kg", "Pa", "psi", "psia", "psig", "pct", "ppm", "cd", "degC", "deg", "K")
"""Units that begin like a prefix, or that have none."""


_TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Units of time without a prefix, in seconds: a flow in kg_per_h is one in kg_per_min."""


def scale(of: str, to: str) -> float | None:
    """Number of units `to` in one `of`, which differ by a prefix or are of time; None for others."""
    if of == to:
        return 1.0
    if of in _TIMES and to in _TIMES:
        return _TIMES[of] / _TIMES[to]
    parts = of.split(PER), to.split(PER)
    if len(parts[0]) > 1 and len(parts[0]) == len(parts[1]):
        top, *below = (scale(one, other) for one, other in zip(*parts, strict=True))
        known = [one for one in below if one is not None]
        return None if top is None or len(known) < len(below) else top / prod(known)
    if any(unit[-1:].isdigit() or PER in unit for unit in (of, to)):  # mm2 is no thousandth of m2
        return None
    found, wanted = _split(of), _split(to)
    if found[1] != wanted[1]:
        return None
    power = found[0] - wanted[0]
    return 10.0**power if power >= 0 else 1.0 / 10.0**-power


def per_volt(unit: str) -> float | None:
    """Number of these units in a volt; None if it is no unit of voltage."""
    return scale(VOLT, unit)


def _split(unit: str) -> tuple[int, str]:
    """Power of ten of a unit's prefix, and the unit without it."""
    if unit in _WHOLE or len(unit) < 2 or unit[0] not in _PREFIXES:
        return 0, unit
    return _PREFIXES[unit[0]], unit[1:]
