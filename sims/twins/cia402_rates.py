"""Units of speed and acceleration of a simulated CiA 402 drive.

Source: CiA 402-2, objects 60A9h and 60AAh; their codes are CiA 303-2's (B5h increments, B4h revolutions, 41h degrees,
C0h revolutions per minute, 03h seconds, 47h minutes, 57h seconds squared).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from rig.sims.wires.eds import EdsObject, Key

_VELOCITY, _ACCELERATION = (0x60A9, 0), (0x60AA, 0)


def rates(
    options: Mapping[str, object], objects: Mapping[Key, EdsObject], counts_per_degree: float
) -> tuple[float, float]:
    """Units on the wire per 1 deg/s and 1 deg/s^2 of the table.

    Args:
        options: those of the bench file; uses `velocity_unit`, `acceleration_unit` and `turns_per_table_turn`.
        objects: objects of the data sheet; counts if neither names a unit.
        counts_per_degree: encoder resolution.
    """
    turns = float(str(options.get("turns_per_table_turn") or 0.0)) or _turns(objects, counts_per_degree)
    per = {"increments": counts_per_degree, "revolutions": turns / 360.0, "degrees": turns, "rpm": turns / 6.0}
    found = []
    for name, key in (("velocity_unit", _VELOCITY), ("acceleration_unit", _ACCELERATION)):
        text = options.get(name)
        factor, thing = _named(str(text)) if text else _coded(objects.get(key))
        found.append(per[thing] / factor)
    return found[0], found[1]


def _named(text: str) -> tuple[float, str]:
    match = re.match(r"(?:([\d.e+-]+) )?(counts|rpm|rev|deg)", text)
    assert match is not None, text
    names = {"counts": "increments", "rpm": "rpm", "rev": "revolutions", "deg": "degrees"}
    return float(match[1] or 1.0), names[match[2]]


def _coded(told: EdsObject | None) -> tuple[float, str]:
    code = int(told.default) if told is not None and isinstance(told.default, int) else 0
    prefix, thing, time = code >> 24 & 0xFF, code >> 16 & 0xFF, code >> 8 & 0xFF
    names = {0xB5: "increments", 0xB4: "rpm" if time == 0x47 else "revolutions", 0x41: "degrees", 0xC0: "rpm"}
    return 10.0 ** (prefix if prefix < 128 else prefix - 256), names.get(thing, "increments")


def _turns(objects: Mapping[Key, EdsObject], counts_per_degree: float) -> float:
    """By feed constant (6092h) or encoder resolution (608Fh) if the data sheet sets them; 1 otherwise."""
    for index in (0x6092, 0x608F):
        over, under = objects.get((index, 1)), objects.get((index, 2))
        if over and under and int(over.default) > int(under.default) > 0:
            return 360.0 * counts_per_degree * int(under.default) / int(over.default)
    return 1.0
