"""One entry of a world file's [[faults]], checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isnan
from typing import Any

from sims.faults.kinds import KINDS, Kind, Option
from sims.physics.fields import WorldError, known_keys

_WHEN = ("at_s", "exchange", "probability")
_KEYS = ("kind", "on", *_WHEN, "times", "for_s")


@dataclass(frozen=True)
class Fault:
    """What goes wrong, where and when. Exactly one of `at_s`, `exchange` and `probability` says when.

    Attributes:
        kind: one of `KINDS`.
        on: the instrument's name on the bench; "" for the bench as a whole.
        at_s: world time.
        exchange: the nth message from host to instrument in this session, from 1.
        probability: of every exchange.
        times: how many exchanges, frames or readings are affected from then on.
        for_s: how long, 0 for the kind's own; of what is counted, everything within this time, if not 0.
        options: the kind's own; those not given have their defaults when a world is made of it.

    """

    kind: str
    on: str
    at_s: float | None = None
    exchange: int | None = None
    probability: float = 0.0
    times: int = 1
    for_s: float = 0.0
    options: Mapping[str, float | str] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """The entry as a world file has it, without what is the default."""
        kind = KINDS[self.kind]
        given = {"kind": self.kind, "on": self.on, "at_s": self.at_s, "exchange": self.exchange}
        found = {key: value for key, value in given.items() if value not in ("", None)}
        if self.probability:
            found["probability"] = self.probability
        if self.times != 1:
            found["times"] = self.times
        if self.for_s not in (0.0, kind.lasts_s):
            found["for_s"] = self.for_s
        return found | {key: v for key, v in self.options.items() if v != kind.options[key].default}

    def number(self, key: str) -> float:
        """A numeric option."""
        return float(self.options[key])

    def word(self, key: str) -> str:
        """An option that is a word."""
        return str(self.options[key])

    def __str__(self) -> str:
        """The entry in one line, for timelines."""
        when = (
            f"at {self.at_s:g} s"
            if self.at_s is not None
            else f"at exchange {self.exchange}"
            if self.exchange is not None
            else f"with probability {self.probability:g}"
        )
        rest = ", ".join(f"{k} {v}" for k, v in self.table().items() if k not in ("kind", "on", *_WHEN))
        return f"{self.kind}{f' on {self.on}' if self.on else ''} {when}{f' ({rest})' if rest else ''}"


def read_faults(values: object, drivers: Mapping[str, str], wires: Mapping[str, str]) -> tuple[Fault, ...]:
    """Check a world file's [[faults]].

    Args:
        values: the array of tables; None if there is none.
        drivers: driver by instrument.
        wires: kind of wire ("serial", "modbus", "can") by instrument.

    Raises:
        WorldError: naming the entry and the key, what is wrong with it and what would be right.

    """
    if values is None:
        return ()
    if isinstance(values, str | Mapping) or not isinstance(values, Sequence):
        raise WorldError("faults must be given as tables, each under [[faults]]")
    return tuple(_read(item, f"faults[{n}]", drivers, wires) for n, item in enumerate(values, start=1))


def _read(item: object, where: str, drivers: Mapping[str, str], wires: Mapping[str, str]) -> Fault:
    if isinstance(item, Fault):
        item = item.table()
    if not isinstance(item, Mapping):
        raise WorldError(f"{where} must be a table, [[faults]] (it is {item!r})")
    name = item.get("kind")
    if name is None:
        raise WorldError(f"{where}.kind is missing (kinds: {', '.join(KINDS)})")
    if not isinstance(name, str) or name not in KINDS:
        known_keys({str(name): None}, KINDS, f"{where}.kind", "kinds")
        raise WorldError(f"{where}.kind must be a word (it is {name!r})")
    kind = KINDS[name]
    known_keys(item, (*_KEYS, *kind.options), where, f"keys of {name}")
    on = _instrument(item, where, name, kind, drivers, wires)
    when = [key for key in _WHEN if key in item]
    if len(when) != 1:
        said = f"; it says {' and '.join(when)}" if when else ""
        raise WorldError(f"{where} ({name}) must say when, by exactly one of {', '.join(_WHEN)}{said}")
    if kind.of_bench and when != ["at_s"]:
        raise WorldError(f"{where}.{when[0]}: {name} happens at a time, at_s; no instrument's exchanges bring it about")
    for key, goes in (("times", bool(kind.counts)), ("for_s", bool(kind.counts) or kind.lasts_s > 0.0)):
        if key in item and not goes:
            raise WorldError(f"{where}.{key}: {name} {'is not counted' if key == 'times' else 'does not last'}")
    return Fault(
        name,
        on,
        at_s=_number(item["at_s"], f"{where}.at_s", 0.0) if "at_s" in item else None,
        exchange=_whole(item["exchange"], f"{where}.exchange") if "exchange" in item else None,
        probability=_number(item.get("probability", 0.0), f"{where}.probability", 0.0, 1.0),
        times=_whole(item.get("times", 1), f"{where}.times"),
        for_s=_number(item.get("for_s", kind.lasts_s), f"{where}.for_s", 0.0),
        options={key: _option(item.get(key, o.default), f"{where}.{key}", o) for key, o in kind.options.items()},
    )


def _instrument(
    item: Mapping[str, Any],
    where: str,
    name: str,
    kind: Kind,
    drivers: Mapping[str, str],
    wires: Mapping[str, str],
) -> str:
    on = item.get("on", "")
    if kind.of_bench:
        if on:
            raise WorldError(f"{where}.on: {name} happens to the bench as a whole; leave `on` out")
        return ""
    if not isinstance(on, str) or on not in drivers:
        known = ", ".join(drivers)
        raise WorldError(f"{where}.on must be an instrument of the bench ({known}); it is {on!r}")
    if not kind.hits(drivers[on], wires[on]):
        raise WorldError(
            f"{where}.kind: {name} cannot happen to {on}, a {drivers[on]} on {wires[on]}; it may hit {kind.whom()}"
        )
    return on


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
