"""Names of the control ranges of Druck PACE instruments: "15.00psia", "3.50barg", "1600HPAG".

A name consists of the full scale, its unit, and the reference of pressures (K0472, :INST:CAT:ALL?).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

_REFERENCES = {"A": "absolute", "G": "gauge", "D": "differential"}


def full_scale_psi(name: str, pascals: Mapping[str, float]) -> float | None:
    """Full scale of a range, psi; None if the name does not contain it.

    Args:
        name: as the instrument gives it; upper and lower case are equivalent.
        pascals: the known units, in pascals.
    """
    found = _parts(name, pascals)
    return None if found is None else float(found[0]) * pascals[found[1]] / pascals["PSI"]


def reference_of(name: str, pascals: Mapping[str, float]) -> str:
    """Reference of its pressures: "absolute", "gauge", "differential", or "" if the name does not contain it."""
    found = _parts(name, pascals)
    letter = name.strip()[-1:].upper() if found is None else found[2]
    return _REFERENCES.get(letter, "")


def _parts(name: str, pascals: Mapping[str, float]) -> tuple[str, str, str] | None:
    """Number, unit, letter; the last letter may belong to the unit, as in mmHg and Pa."""
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Z0-9]+?)\s*", name.upper())
    if match is None:
        return None
    number, rest = match.groups()
    if rest[:-1] in pascals and rest[-1] in _REFERENCES:
        return number, rest[:-1], rest[-1]
    return (number, rest, "") if rest in pascals else None
