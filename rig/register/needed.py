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
_SHORT = {"maker": "maker", "model": "model", "serial": "serial number", "condition": "condition as received"}
NO_ERROR = "{}: the register states no error of what reads or sets {}; add what its certificate says"


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
    lacks: dict[str, list[tuple[str, str]]] = {}
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
        for key in _OF_ITEM:
            if not getattr(one, key).strip():
                lacks.setdefault(key, []).append((name, entry))
    yield from _of_items(lacks, where)
    for key, words in _OF_CUSTOMER.items():
        if not any(getattr(one, key).strip() for one in known):
            yield f"{words} is missing: add sensors.*.{key} in {where}"


def _of_items(lacks: Mapping[str, Sequence[tuple[str, str]]], where: str) -> Iterator[str]:
    """Fields that items lack, each with the items' names and entries; one sentence for what the same ones lack."""
    alike: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for key, of in lacks.items():
        alike.setdefault(tuple(of), []).append(key)
    for of, keys in alike.items():
        if len(of) == 1:
            ((name, entry),) = of
            yield from (f"{_OF_ITEM[k].format(name)} is missing: add sensors.{entry}.{k} in {where}" for k in keys)
            continue
        words, is_ = ", ".join(_SHORT[key] for key in keys), "is" if len(keys) == 1 else "are"
        names, entries = (", ".join(one) for one in zip(*of, strict=True))
        yield f"{words} of {names} {is_} missing: add {', '.join(keys)} to [sensors.NAME] of {entries} in {where}"


def stopping(
    unstated: Collection[str], outputs: Collection[str], factors: Collection[str], lacking: Sequence[str] = ()
) -> Iterator[str]:
    """Columns without a stated error that stop a certificate, outputs, and factors in a model.

    Those of which the same is said share a sentence.

    Sentences on what is `lacking` that name the column, such as one on a quantity that is misspelled, follow it.
    """
    for kind in (outputs, factors):
        alike: dict[tuple[str, ...], list[str]] = {}
        for column in unstated:
            if column in kind and (kind is outputs or column not in outputs):
                alike.setdefault(tuple(one for one in lacking if column in one), []).append(column)
        for more, columns in alike.items():
            yield ". ".join([NO_ERROR.format(", ".join(columns), "it" if len(columns) == 1 else "each"), *more])
