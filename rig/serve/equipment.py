"""Equipment and items of a laboratory, with due dates."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from rig.acts import Places
from rig.archive import Due, Lab
from rig.archive import due as what_is_due
from rig.bench.config import InstrumentConfig, ReferenceConfig, parse_bench, read_text
from rig.errors import RigError
from rig.register import read_register

_LOOKED_S = 300.0
SOON_DAYS = 30


@dataclass
class EquipmentList:
    """The list. May be called from several threads.

    Attributes:
        places: files of the laboratory.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
    """

    places: Places
    stopwatch: Callable[[], float]
    utc: Callable[[], float]

    def __post_init__(self) -> None:
        self._lock = threading.Lock()
        self._rows: tuple[object, list[dict[str, Any]]] = (None, [])

    def rows(self) -> list[dict[str, Any]]:
        """Equipment and items, with due dates; what is due first comes first. Read again after a change only."""
        today = datetime.fromtimestamp(self.utc(), UTC).astimezone().date()
        files = {**self.places.registers(), **self.places.benches()}
        # Certificates of other folders are looked for now and then: folders of runs change all the time.
        issued = (print_of(self.places.folder / "certificates"), int(self.stopwatch() / _LOOKED_S))
        now = (today, *((name, print_of(path)) for name, path in files.items()), *issued)
        with self._lock:
            if self._rows[0] != now:
                self._rows = (now, self._read(today))
            return self._rows[1]

    def _read(self, today: date) -> list[dict[str, Any]]:
        rows: dict[tuple[str, str], dict[str, Any]] = {}
        try:
            certified = self._certified()
        except RigError as error:
            certified = []
            rows["certificates", "problem"] = _row("certificates", "problem", str(error), None, today)
        entries: Mapping[str, InstrumentConfig | ReferenceConfig]
        for file, path in self.places.registers().items():
            try:
                register = read_register(path)
            except RigError as error:
                rows[file, ""] = _row(file, "problem", str(error), None, today)
                continue
            for asset, one in register.equipment.items():
                due = one.certificate.due if one.certificate is not None else None
                rows[asset, "equipment"] = _row(asset, "equipment", words_of(one), due, today)
            for name, item in register.sensors.items():
                if item.serial and item.serial in {one.thing.serial for one in certified}:
                    continue  # its certificates say more
                rows[name, "item"] = _row(name, "item", words_of(item), None, today)
        for file, path in self.places.benches().items():
            try:
                config = parse_bench(read_text(path, "bench"), file)
            except RigError:
                continue
            for kind, entries in (("instrument", config.instruments), ("reference", config.references)):
                of_bench = f"{kind} of {config.name}"
                for name, entry in entries.items():
                    if entry.due is not None and (entry.asset, "equipment") not in rows:
                        rows[name, of_bench] = _row(name, of_bench, "", entry.due, today)
        for thing in certified:
            on = date.fromisoformat(thing.on) if thing.on else None
            about = f"{thing.certificate} of {thing.dated}; due by {thing.by}"
            row = rows[thing.key, "item"] = _row(thing.key, "item", about, on, today)
            row["page"] = thing.key
            if thing.only_known_until:  # nothing broke until then, and nobody knows what follows
                row |= {"due": f"after {thing.on}", "days": "not known", "tone": ""}
        return sorted(rows.values(), key=lambda row: (row["date"] is None, row["date"] or today, row["what"]))

    def _certified(self) -> list[Due]:
        """Items that have certificates here. Raises `RigError` if the index cannot be kept."""
        with Lab.open(self.places.folder, database=self.places.laboratory.database) as lab:
            return [one for one in what_is_due(lab) if one.role == "item"]


def moment(utc_s: object) -> str:
    """A time on this machine's clock, for people; "" for none."""
    if not isinstance(utc_s, int | float) or not utc_s:
        return ""
    return datetime.fromtimestamp(utc_s, UTC).astimezone().strftime("%a %d %b %Y, %H:%M")


def words_of(one: Any) -> str:
    """Maker, model and serial number of an entry of the register."""
    return ", ".join(str(part) for name in ("maker", "model", "serial") if (part := getattr(one, name, "")))


def _row(what: str, kind: str, about: str, due: date | None, today: date) -> dict[str, Any]:
    days = None if due is None else (due - today).days
    tone = "" if days is None else "bad" if days < 0 else "hold" if days <= SOON_DAYS else "good"
    said = "" if days is None else f"{-days} days ago" if days < 0 else "today" if not days else f"in {days} days"
    return {
        "what": what,
        "kind": kind,
        "about": about,
        "date": due,
        "due": str(due or ""),
        "days": said,
        "tone": tone,
        "page": "",
    }


def print_of(path: Path) -> tuple[int, int] | None:
    """Size and time of a file, by which a change is seen; None for one that is empty or not there."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return (stat.st_size, stat.st_mtime_ns) if stat.st_size else None  # reading makes an empty -wal
