"""Whether an instrument that told its identity is the one of the register."""

from __future__ import annotations

from typing import Literal

from rig.register.equipment_file import Equipment


def unlike(known: Equipment, model: str, serial: str, *, confirmed: bool) -> Literal["", "model", "serial"]:
    """The key of the register that is another one than the instrument told; "" if none is.

    A maker is not compared: makers are sold, and their instruments keep the old name.

    Args:
        known: its entry in the register.
        model: as it told.
        serial: as it told.
        confirmed: whether that distinguishes it from another one of its model.
    """
    if model and known.model and not _one_model(model, known.model):
        return "model"
    return "serial" if confirmed and serial and known.serial not in ("", serial) else ""


def _one_model(one: str, other: str) -> bool:
    """Whether two texts may name one model: "34401A" and "HP 34401 A"."""
    a, b = ("".join(filter(str.isalnum, text)).upper() for text in (one, other))
    return a in b or b in a
