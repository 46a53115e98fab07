"""Contents of a certificate, and of a register of equipment, that the index keeps."""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rig.files.regular import read_regular_text
from rig.register.read import read_register

MOST_BYTES = 64 << 20
"""Size of a file above which it is no certificate."""


@dataclass(frozen=True)
class Thing:
    """An item under calibration, or a piece of equipment.

    Attributes:
        name: for people: on the bench, or its description.
        maker: manufacturer.
        model: of the manufacturer.
        serial: serial number; "" if not stated.
        asset: the laboratory's number; "" for none.
    """

    name: str
    maker: str = ""
    model: str = ""
    serial: str = ""
    asset: str = ""

    @property
    def key(self) -> str:
        """By what it is known again: maker, model and serial number, or its asset number, or its name."""
        return " ".join(filter(None, (self.maker, self.model, self.serial))) if self.serial else self.asset or self.name


@dataclass(frozen=True)
class Value:
    """A result of an item that has a tolerance.

    Attributes:
        what: label of the result.
        value: unrounded.
        standard: its standard uncertainty.
        lower: smallest value that conforms; -inf for any.
        upper: largest.
        unit: of all; "" for a plain number.
        left: whether it is as left by an adjustment.
    """

    what: str
    value: float
    standard: float
    lower: float
    upper: float
    unit: str
    left: bool


@dataclass(frozen=True)
class Calibrated:
    """An item on a certificate.

    Attributes:
        thing: the item.
        values: of its results with a tolerance, as found and as left where it was adjusted.
        adjusted: whether it was adjusted.
    """

    thing: Thing
    values: tuple[Value, ...]
    adjusted: bool


@dataclass(frozen=True)
class Used:
    """A piece of equipment on a certificate, and the number of its own."""

    thing: Thing
    certificate: str


@dataclass(frozen=True)
class Issued:
    """A certificate.

    Attributes:
        number: its number.
        issued: its date.
        began: first day of the calibration.
        ended: last day of the calibration.
        next_due: date of the next calibration; None if it states none.
        simulated: whether no real instrument was involved.
        replaces: number of the certificate that it amends; "" for none.
        customer: name.
        items: what was calibrated.
        used: with what.
    """

    number: str
    issued: datetime.date
    began: datetime.date
    ended: datetime.date
    next_due: datetime.date | None
    simulated: bool
    replaces: str
    customer: str
    items: tuple[Calibrated, ...]
    used: tuple[Used, ...]


@dataclass(frozen=True)
class Owned:
    """A piece of equipment in a register.

    Attributes:
        thing: the equipment.
        certificate: number; "" if it has none.
        date: of the certificate.
        due: of its next calibration; None if not stated.
    """

    thing: Thing
    certificate: str = ""
    date: datetime.date | None = None
    due: datetime.date | None = None


@dataclass(frozen=True)
class Kept:
    """Contents of a file: a certificate, equipment, or neither."""

    issued: Issued | None = None
    owned: tuple[Owned, ...] = field(default=())


def may_be_kept(path: Path) -> bool:
    """Whether a file is looked into: certificates are JSON, registers TOML."""
    return path.suffix == ".json" or path.name == "equipment.toml"


def read_kept(path: Path) -> Kept:
    """The contents of a file.

    Raises:
        RigError: a register is wrong.
        OSError: it cannot be read.
        ValueError, LookupError, TypeError: it looks like a certificate, and is none.
    """
    if path.suffix == ".toml":
        register = read_register(path)
        return Kept(owned=tuple(_owned(register.equipment)))
    if path.stat().st_size > MOST_BYTES:
        return Kept()
    given = json.loads(read_regular_text(path))
    if not isinstance(given, dict) or not {"number", "items", "evidence", "statements"} <= given.keys():
        return Kept()  # a result of another command
    return Kept(_issued(given))


def _owned(equipment: Mapping[str, Any]) -> Iterator[Owned]:
    for asset, one in equipment.items():
        thing = Thing(one.description, one.maker, one.model, one.serial, asset)
        own = one.certificate
        yield Owned(thing) if own is None else Owned(thing, own.number, own.date, own.due)


def _issued(given: Mapping[str, Any]) -> Issued:
    dates = given["dates"]
    next_due, amends = given.get("next_due"), given.get("amends")
    return Issued(
        number=str(given["number"]),
        issued=datetime.date.fromisoformat(dates["issued"]),
        began=datetime.date.fromisoformat(dates["began"]),
        ended=datetime.date.fromisoformat(dates["ended"]),
        next_due=datetime.date.fromisoformat(next_due) if next_due else None,
        simulated=bool(given["simulated"]),
        replaces=str(amends["number"]) if amends else "",
        customer=str(given["customer"]["name"]),
        items=tuple(_calibrated(one, given) for one in given["items"]),
        used=tuple(Used(_thing(one), str(one["certificate"])) for one in given["equipment"]),
    )


def _thing(given: Mapping[str, Any]) -> Thing:
    return Thing(*(str(given[name]) for name in ("name", "maker", "model", "serial", "asset")))


def _calibrated(item: Mapping[str, Any], given: Mapping[str, Any]) -> Calibrated:
    own = [table for table in given["tables"] if table["sensor"] in ("", item["name"])]
    adjusted = any(table["stage"] == "as left" for table in own)
    results = {(table["stage"], one["label"]): one for table in own for one in table["results"]}
    values = []
    for statement in given["statements"]:
        one = results.get((statement["stage"], statement["what"]))
        limits = statement.get("permitted")
        if statement["sensor"] != item["name"] or one is None or limits is None:
            continue
        low, high = (float("-inf" if i == 0 else "inf") if v is None else float(v) for i, v in enumerate(limits))
        left = statement["stage"] == "as left"
        values.append(
            Value(statement["what"], float(one["estimate"]), float(one["standard"]), low, high, one["unit"], left)
        )
    thing = _thing(item)
    if not (thing.serial or thing.asset):  # names repeat: customers have a sensor "x" each
        thing = replace(thing, name=f"{thing.name} of {given['customer']['name']}")
    return Calibrated(thing, tuple(values), adjusted)
