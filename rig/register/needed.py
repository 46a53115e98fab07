"""Facts of a register that a certificate needs: laboratory, items, customer, errors."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from rig.bench.config import SensorConfig
from rig.register.equipment_file import Register, SensorItem

_OF_LABORATORY = {"name": "the name of the laboratory", "address": "its address"}
_OF_ITEM = {
    "maker": "the maker of {}",
    "model": "the model of {}",
    "serial": "the serial number of {}",
    "condition": "the condition of {} as received",
}
_OF_CUSTOMER = {"customer": "the customer", "customer_address": "the customer's address"}
NO_ERROR = "{}: the register states no error of what reads or sets it; add what its certificate says"


def item_of(register: Register, name: str, sensor: SensorConfig | None) -> tuple[str, SensorItem | None]:
    """Key in the register, and what it knows of a sensor: by its name on the bench, or by its asset number."""
    for key in (name, sensor.asset if sensor else ""):
        if key and key in register.sensors:
            return key, register.sensors[key]
    return name, None


def needed(register: Register, sensors: Mapping[str, SensorConfig | None], where: str) -> Iterator[str]:
    """Fields that a certificate needs and the register does not have, one sentence each.

    Args:
        register: the register.
        sensors: the calibrated ones, by name on the bench.
        where: name of the register's file, for messages.
    """
    for key, words in _OF_LABORATORY.items():
        if not getattr(register.laboratory, key).strip():
            yield f"{words} is missing: add laboratory.{key} in {where}"
    bearers: dict[tuple[str, str, str], str] = {}
    known: list[SensorItem] = []
    for name, sensor in sensors.items():
        entry, one = item_of(register, name, sensor)
        if one is None:
            yield f"sensor {name} is missing: add [sensors.{name}] in {where}"
            continue
        known.append(one)
        same = bearers.setdefault((one.maker, one.model, one.serial), name) if one.serial else name
        if same != name:
            yield (f"{same} and {name} have one serial number, {one.serial}: correct sensors.{entry}.serial in {where}")
        for key, words in _OF_ITEM.items():
            if not getattr(one, key).strip():
                yield f"{words.format(name)} is missing: add sensors.{entry}.{key} in {where}"
    for key, words in _OF_CUSTOMER.items():
        if not any(getattr(one, key).strip() for one in known):
            yield f"{words} is missing: add sensors.*.{key} in {where}"


def stopping(
    unstated: Collection[str], outputs: Collection[str], factors: Collection[str], lacking: Sequence[str] = ()
) -> Iterator[str]:
    """Columns without a stated error that stop a certificate, one sentence each: outputs, and factors in a model.

    Sentences on what is `lacking` that name the column, such as one on a quantity that is misspelled, follow it.
    """
    for column in unstated:
        if column in outputs or column in factors:
            yield ". ".join([NO_ERROR.format(column), *(one for one in lacking if column in one)])
