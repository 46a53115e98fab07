"""Declaration and reading of world-file tables: dataclass fields with their permitted values.

A world file is checked completely before the simulation starts. An unknown key, a number out of range or a value of a
wrong type is a `WorldError` with its place and permitted values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, replace
from datetime import UTC, date, datetime
from difflib import get_close_matches
from math import inf, isfinite
from typing import Any, Protocol, TypeVar

BySensor = float | Mapping[str, float]
"""One number for all sensors, or numbers by sensor name."""

Table = TypeVar("Table")
_KIND = "world file"


class WorldError(ValueError):
    """A world file has an unknown key or an impossible value."""


class Kind(Protocol):
    """Permitted values of one key."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> Any:
        """The checked value. `where` is the key's place in the file, `axes` the axis by sensor name, "" for a pressure
        transducer.
        """
        ...


@dataclass(frozen=True)
class Number:
    """A number from `low` to `high`, both included."""

    low: float = -inf
    high: float = inf

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> float:
        """The checked value."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise WorldError(f"{where} must be a number (it is {value!r})")
        if not self.low <= value <= self.high:
            raise WorldError(f"{where} = {value:g} is outside {self.low:g} to {self.high:g}")
        return float(value)


@dataclass(frozen=True)
class Whole:
    """A whole number, zero or more."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> int:
        """The checked value."""
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise WorldError(f"{where} must be a whole number, zero or more (it is {value!r})")
        return value


@dataclass(frozen=True)
class NumberBySensor:
    """A number, or a table of numbers by the names of the bench's transducers, or otherwise of its attitude sensors."""

    transducers: bool

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> BySensor:
        """The checked value."""
        number = Number()
        if not isinstance(value, Mapping):
            return number.read(value, where, axes)
        concerned = [name for name, axis in axes.items() if (not axis) == self.transducers]
        what = "pressure transducers" if self.transducers else "attitude sensors"
        known_keys(value, concerned, where, f"{what} on this bench")
        return {name: number.read(item, f"{where}.{name}", axes) for name, item in value.items()}


@dataclass(frozen=True)
class Word:
    """One of several words."""

    words: tuple[str, ...]

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> str:
        """The checked value."""
        if value not in self.words:
            raise WorldError(f"{where} must be one of {', '.join(self.words)} (it is {value!r})")
        return str(value)


@dataclass(frozen=True)
class Switch:
    """true or false."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> bool:
        """The checked value."""
        if not isinstance(value, bool):
            raise WorldError(f"{where} must be true or false (it is {value!r})")
        return value


@dataclass(frozen=True)
class Moment:
    """A date and time, UTC unless it has an offset; kept as seconds since 1970-01-01."""

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> float:
        """The checked value."""
        if isinstance(value, str):
            try:
                value = datetime.fromisoformat(value)
            except ValueError:
                raise WorldError(
                    f"{where} must be a date and time like 2026-01-15T18:00:00Z (it is {value!r})"
                ) from None
        if isinstance(value, date) and not isinstance(value, datetime):
            value = datetime(value.year, value.month, value.day, tzinfo=UTC)
        if not isinstance(value, datetime):
            raise WorldError(f"{where} must be a date and time like 2026-01-15T18:00:00Z (it is {value!r})")
        return (value if value.tzinfo else value.replace(tzinfo=UTC)).timestamp()


@dataclass(frozen=True)
class Several:
    """An array of tables, `[[NAME]]`."""

    table: type

    def read(self, value: object, where: str, axes: Mapping[str, str]) -> tuple[Any, ...]:
        """The checked value."""
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise WorldError(f"{where} must be given as tables, each under [[{where}]]")
        return tuple(
            read_table(self.table(), item, f"{where}[{index}]", axes) for index, item in enumerate(value, start=1)
        )


def accepts(kind: Kind) -> Mapping[str, Kind]:
    """Metadata of a dataclass field that is a key of a world file."""
    return {_KIND: kind}


def kind_of(declared: Field[Any]) -> Any:
    """Permitted values of a dataclass field (a `Kind`); None if it is an inner table."""
    return declared.metadata.get(_KIND)


def quantity(default: float, low: float = -inf, high: float = inf) -> Any:
    """A dataclass field that is a number within a range."""
    return field(default=default, metadata=accepts(Number(low, high)))


def known_keys(given: Mapping[str, object], known: Collection[str], where: str, what: str = "known") -> None:
    """Refuse keys that are not among the known ones; the message has both."""
    for name in given:
        if name not in known:
            near = get_close_matches(name, list(known), n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            place = f"{where}.{name}" if where else name
            raise WorldError(f"{place} is not known{hint} ({what}: {', '.join(known) or 'none'})")


def read_table(base: Table, values: object, where: str, axes: Mapping[str, str]) -> Table:
    """A copy of the dataclass `base` with the values of `values`.

    A field with a declaration is a key; a field without one is an inner table, itself a dataclass.

    Raises:
        WorldError: with the key, its defect and permitted values.
    """
    if not isinstance(values, Mapping):
        raise WorldError(f"{where} must be a table, [{where}] (it is {values!r})")
    kinds = {f.name: kind_of(f) for f in fields(base)}  # type: ignore[arg-type]  # a dataclass
    known_keys(values, kinds, where)
    checked = {}
    for name, value in values.items():
        place = f"{where}.{name}" if where else name
        kind = kinds[name]
        inner = getattr(base, name)
        checked[name] = kind.read(value, place, axes) if kind else read_table(inner, value, place, axes)
    return replace(base, **checked)  # type: ignore[type-var]  # a dataclass
