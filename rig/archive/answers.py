"""Answers of a laboratory's index: what is due, the history of an item, what a wrong piece of equipment affects."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any

from rig.archive.documents import Thing
from rig.archive.forecast import Forecast
from rig.archive.index import HISTORY, Lab
from rig.errors import UsageError

_NAMED = """SELECT key, name, maker, model, serial, asset FROM thing WHERE key = ?1
    UNION SELECT key, name, maker, model, serial, asset FROM thing WHERE serial = ?1 AND serial <> ''
    UNION SELECT key, name, maker, model, serial, asset FROM thing WHERE asset = ?1 AND asset <> ''"""


@dataclass(frozen=True)
class Due:
    """When something is due.

    Attributes:
        thing: item or equipment.
        key: by what it is known.
        role: "item" or "equipment".
        certificate: number of its last one; "" for none.
        dated: of that calibration, ISO; "" for none.
        cycle: date by its certificate or the register; "" if none states one.
        drift: date by drift; its `why` says what is missing.
        simulated: whether the certificate is of a simulated run.
        customer: whose it is; "" for the laboratory's own.
    """

    thing: Thing
    key: str
    role: str
    certificate: str
    dated: str
    cycle: str
    drift: Forecast
    simulated: bool = False
    customer: str = ""

    @property
    def on(self) -> str:
        """The earlier of both dates; "" if neither is known."""
        return min(filter(None, (self.cycle, self.drift.on)), default="")

    @property
    def by(self) -> str:
        """The source of the date, and what is not known, in words."""
        if self.on and self.on == self.cycle:
            return f"its cycle; by drift {self.drift.words}" if self.drift.on else f"its cycle; {self.drift.why}"
        return f"drift: {self.drift.words}" if self.on else f"no cycle is stated; {self.drift.why}"

    @property
    def only_known_until(self) -> bool:
        """Whether `on` is the end of a forecast in which nothing broke, not a day on which something does."""
        return self.drift.at_least and self.on == self.drift.on != self.cycle


@dataclass(frozen=True)
class Affected:
    """A certificate that rests on a piece of equipment.

    Attributes:
        number: of the certificate.
        issued: its date.
        began: first day of the calibration.
        ended: last day of the calibration.
        customer: name.
        items: what was calibrated.
        through: from the asked equipment to this certificate, by keys: more than one for what was calibrated with it.
        replaced_by: number of the certificate that replaced it; "" if it holds.
        path: of its file, in the folder.
        simulated: whether no real instrument was involved.
    """

    number: str
    issued: str
    began: str
    ended: str
    customer: str
    items: tuple[str, ...]
    through: tuple[str, ...]
    replaced_by: str
    path: str
    simulated: bool


@dataclass(frozen=True)
class History:
    """Certificates of an item.

    Attributes:
        thing: the item.
        certificates: rows of number, dates, customer, path, in order of time.
        values: of each certificate.
        due: when it is due.
    """

    thing: Thing
    certificates: tuple[dict[str, Any], ...]
    values: tuple[tuple[dict[str, Any], ...], ...]
    due: Due | None


def due(lab: Lab) -> list[Due]:
    """Everything with a calibration, what is due first at the head; what no date is known of comes last."""
    items = {one.key: one for one in _items(lab)}
    own = {one.key: one for one in _equipment(lab)}
    for key in items.keys() & own.keys():  # a standard of the laboratory that it calibrates itself
        own[key] = replace(own[key], drift=items[key].drift)
    return sorted({**items, **own}.values(), key=lambda one: (one.on or "9999", one.only_known_until, one.key))


def _items(lab: Lab) -> Iterator[Due]:
    query = """SELECT * FROM (
            SELECT item.key, name, maker, model, serial, asset, certificate.number, ended, next_due, simulated,
                customer, forecast, row_number() OVER (PARTITION BY item.key ORDER BY name) AS copy
            FROM item JOIN certificate ON certificate.path = last
                JOIN thing ON thing.path = last AND role = 'item' AND thing.key = item.key) every
        WHERE copy = 1 ORDER BY key"""
    for row in lab.rows(query):
        drift = Forecast(**json.loads(row["forecast"]))
        yield Due(
            _thing(row),
            row["key"],
            "item",
            row["number"],
            row["ended"],
            row["next_due"] or "",
            drift,
            bool(row["simulated"]),
            row["customer"],
        )


def _equipment(lab: Lab) -> Iterator[Due]:
    query = """SELECT * FROM (
            SELECT key, name, maker, model, serial, asset, number, dated, due,
                row_number() OVER (PARTITION BY key ORDER BY coalesce(dated, '') DESC, path) AS copy
            FROM thing WHERE role = 'owned') every
        WHERE copy = 1 ORDER BY key"""
    for row in lab.rows(query):
        why = "no certificates of it are here" if row["number"] else "it has no certificate"
        yield Due(
            _thing(row),
            row["key"],
            "equipment",
            row["number"],
            row["dated"] or "",
            row["due"] or "",
            Forecast(why=why),
        )


def history(lab: Lab, name: str) -> History:
    """Certificates of an item, by its key, serial or asset number. Raises `UsageError` if there is none."""
    rows = [row for row in lab.rows(_NAMED, name) if lab.rows(HISTORY, row["key"])]
    keys = sorted({row["key"] for row in rows})
    if len(keys) != 1:
        raise UsageError(
            f"several items are called {name!r}: {', '.join(keys)}" if keys else f"no certificate is of {name!r}"
        )
    certificates = lab.rows(HISTORY, keys[0])
    values = tuple(tuple(json.loads(row.pop("data"))["values"]) for row in certificates)
    when = next((one for one in _items(lab) if one.key == keys[0]), None)
    return History(_thing(certificates[-1]), tuple(certificates), values, when)


def known(lab: Lab, name: str) -> list[Thing]:
    """Things of that name: key, serial or asset number."""
    return [_thing(row) for row in lab.rows(_NAMED, name)]


def affected(lab: Lab, name: str, since: date | None = None, until: date | None = None) -> list[Affected]:
    """Certificates that rest on a piece of equipment in a time, also through what was calibrated with it.

    Args:
        lab: the index.
        name: key, serial number or asset number of the equipment, or the number of a certificate of it.
        since: first day on which it was wrong; None for ever.
        until: last day; None for now.

    Raises:
        UsageError: nothing is called so.
    """
    first, last = since.isoformat() if since else "", until.isoformat() if until else "9999"
    if not known(lab, name) and not lab.rows("SELECT 1 FROM thing WHERE number = ? LIMIT 1", name):
        raise UsageError(f"nothing is called {name!r} in {lab.folder}: name an asset, serial or certificate number")
    found: dict[str, Affected] = {}
    waiting: list[tuple[str, str, str, tuple[str, ...]]] = [(name, first, last, (name,))]
    seen: set[tuple[str, str]] = set()
    while waiting:
        who, begins, ends, through = waiting.pop(0)
        for row in _using(lab, who, begins, ends):
            items = lab.rows("SELECT * FROM thing WHERE path = ? AND role = 'item' ORDER BY key", row["path"])
            if row["number"] not in found:
                found[row["number"]] = _affected(row, items, through)
            for item in map(_thing, items):
                # What was calibrated with it is wrong from that calibration on, whenever it was used since.
                if (item.key, row["began"]) not in seen and item.key not in through:
                    seen.add((item.key, row["began"]))
                    waiting.append((item.key, row["began"], "9999", (*through, item.key)))
    return sorted(found.values(), key=lambda one: (one.ended, one.number))


def _using(lab: Lab, who: str, first: str, last: str) -> Sequence[dict[str, Any]]:
    """Certificates of calibrations in a time that used what is called so."""
    query = f"""SELECT certificate.*, (SELECT min(later.number) FROM certificate later
            WHERE later.replaces = certificate.number AND later.replaces <> '') AS replaced_by
        FROM certificate WHERE ended >= ?2 AND began <= ?3 AND path IN (
            SELECT path FROM thing WHERE role = 'used' AND number = ?1
            UNION SELECT path FROM thing WHERE role = 'used' AND key IN (SELECT key FROM ({_NAMED}) named)
            UNION SELECT path FROM thing WHERE role = 'used' AND asset IN (
                SELECT asset FROM ({_NAMED}) named WHERE asset <> ''))
        ORDER BY ended, number, path"""
    return lab.rows(query, who, first, last)


def _affected(row: dict[str, Any], items: Sequence[dict[str, Any]], through: tuple[str, ...]) -> Affected:
    return Affected(
        number=row["number"],
        issued=row["issued"],
        began=row["began"],
        ended=row["ended"],
        customer=row["customer"],
        items=tuple(item["key"] for item in items),
        through=through,
        replaced_by=row["replaced_by"] or "",
        path=row["path"],
        simulated=bool(row["simulated"]),
    )


def _thing(row: dict[str, Any]) -> Thing:
    return Thing(*(row[name] for name in ("name", "maker", "model", "serial", "asset")))
