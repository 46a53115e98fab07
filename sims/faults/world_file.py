"""Reading a world file's [[faults]]: every entry is checked against the possible faults of the bench's twins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isnan
from typing import Any

from rig.sims.fault import WHEN, Fault, Kind, Option
from rig.sims.faults.known_kinds import kinds_of, kinds_on
from rig.sims.physics.fields import WorldError, known_keys
from rig.sims.twin import TwinClass

_KEYS = ("kind", "on", *WHEN, "times", "for_s")


def read_faults(values: object, twins: Mapping[str, TwinClass]) -> tuple[Fault, ...]:
    """Check a world file's [[faults]].

    Args:
        values: the array of tables; None if there is none.
        twins: by instrument.

    Raises:
        WorldError: with the entry, the key, its defect and permitted values.
    """
    if values is None:
        return ()
    if isinstance(values, str | Mapping) or not isinstance(values, Sequence):
        raise WorldError("faults must be given as tables, each under [[faults]]")
    known = kinds_on(twins.values())
    return tuple(_read(item, f"faults[{n}]", known, twins) for n, item in enumerate(values, start=1))


def _read(item: object, where: str, known: Mapping[str, Kind], twins: Mapping[str, TwinClass]) -> Fault:
    if isinstance(item, Fault):
        item = item.table()
    if not isinstance(item, Mapping):
        raise WorldError(f"{where} must be a table, [[faults]] (it is {item!r})")
    name = item.get("kind")
    if name is None:
        raise WorldError(f"{where}.kind is missing (kinds: {', '.join(known)})")
    if not isinstance(name, str) or name not in known:
        known_keys({str(name): None}, known, f"{where}.kind", "kinds")
        raise WorldError(f"{where}.kind must be a word (it is {name!r})")
    on, kind = _whom(item, where, known[name], twins)
    known_keys(item, (*_KEYS, *kind.options), where, f"keys of {name}")
    when = [key for key in WHEN if key in item]
    if len(when) != 1:
        said = f"; it says {' and '.join(when)}" if when else ""
        raise WorldError(f"{where} ({name}) must say when, by exactly one of {', '.join(WHEN)}{said}")
    if kind.of_bench and when != ["at_s"]:
        raise WorldError(f"{where}.{when[0]}: {name} happens at a time, at_s; no instrument's exchanges bring it about")
    for key, goes in (("times", bool(kind.counts)), ("for_s", bool(kind.counts) or kind.lasts_s > 0.0)):
        if key in item and not goes:
            raise WorldError(f"{where}.{key}: {name} {'is not counted' if key == 'times' else 'does not last'}")
    return Fault(
        kind,
        on,
        at_s=_number(item["at_s"], f"{where}.at_s", 0.0) if "at_s" in item else None,
        exchange=_whole(item["exchange"], f"{where}.exchange") if "exchange" in item else None,
        probability=_number(item.get("probability", 0.0), f"{where}.probability", 0.0, 1.0),
        times=_whole(item.get("times", 1), f"{where}.times"),
        for_s=_number(item.get("for_s", kind.lasts_s), f"{where}.for_s", 0.0),
        options={key: _option(item.get(key, o.default), f"{where}.{key}", o) for key, o in kind.options.items()},
    )


def _whom(item: Mapping[str, Any], where: str, kind: Kind, twins: Mapping[str, TwinClass]) -> tuple[str, Kind]:
    """The instrument named by an entry, and its version of the kind."""
    on = item.get("on", "")
    if kind.of_bench:
        if on:
            raise WorldError(f"{where}.on: {kind.name} happens to the bench as a whole; leave `on` out")
        return "", kind
    if not isinstance(on, str) or on not in twins:
        raise WorldError(f"{where}.on must be an instrument of the bench ({', '.join(twins)}); it is {on!r}")
    found = kinds_of(twins[on])
    if kind.name not in found:
        others = [name for name, twin in twins.items() if kind.name in kinds_of(twin)]
        whom = f"it may hit {', '.join(others)}" if others else "nothing on this bench can have it"
        raise WorldError(
            f"{where}.kind: {kind.name} cannot happen to {on}; {whom}. What can happen to {on}: {', '.join(found)}"
        )
    return on, found[kind.name]


def _number(value: object, where: str, low: float = -inf, high: float = inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or isnan(value):
        raise WorldError(f"{where} must be a number (it is {value!r})")
    if not low <= value <= high:
        raise WorldError(f"{where} = {value:g} is outside {low:g} to {high:g}")
    return float(value)


def _whole(value: object, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise WorldError(f"{where} must be a whole number from 1 on (it is {value!r})")
    return value


def _option(value: object, where: str, option: Option) -> float | str:
    if isinstance(option.default, str):
        if not isinstance(value, str) or (option.words and value not in option.words):
            allowed = f"one of {', '.join(option.words)}" if option.words else "a word"
            raise WorldError(f"{where} must be {allowed} (it is {value!r})")
        return value
    return _number(value, where, option.low, option.high)
