"""Names of the control ranges of Druck PACE instruments: "15.00psia", "3.50barg", "1600HPAG".

A name consists of the full scale, its unit, and the reference of pressures (K0472, :INST:CAT:ALL?).
"""

from __future__ import annotations

import re
from functools import lru_cache

PASCALS = {
    "PSI": 6894.757293168,
    "BAR": 1e5,
    "MBAR": 100.0,
    "HPA": 100.0,
    "KPA": 1e3,
    "MPA": 1e6,
    "PA": 1.0,
    "TORR": 101325.0 / 760.0,
    "MMHG": 133.322387415,
}
"""Units of readings, in pascals: somebody may change the unit at the front panel."""

_REFERENCES = {"A": "absolute", "G": "gauge", "D": "differential"}


def full_scale_psi(name: str) -> float | None:
    """Full scale of a range, psi; None if the name does not contain it.

    Args:
        name: as the instrument gives it; upper and lower case are equivalent.
    """
    found = _parts(name)
    return None if found is None else float(found[0]) * PASCALS[found[1]] / PASCALS["PSI"]


@lru_cache(maxsize=64)  # every reading asks for it
def reference_of(name: str) -> str:
    """Reference of its pressures: "absolute", "gauge", "differential", or "" if the name does not contain it."""
    found = _parts(name)
    letter = name.strip()[-1:].upper() if found is None else found[2]
    return _REFERENCES.get(letter, "")


def _parts(name: str) -> tuple[str, str, str] | None:
    """Number, unit, letter; the last letter may belong to the unit, as in mmHg and Pa."""
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Z0-9]+?)\s*", name.upper())
    if match is None:
        return None
    number, rest = match.groups()
    if rest[:-1] in PASCALS and rest[-1] in _REFERENCES:
        return number, rest[:-1], rest[-1]
    return (number, rest, "") if rest in PASCALS else None
