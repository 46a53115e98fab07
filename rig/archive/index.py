"""The index of a laboratory's folder: it is made of the files there, and may be removed at any time.

A folder is read again when its date of change is another than before, and so are registers, which people edit. Files of
certificates are written once and never change; `rebuild` reads them all the same.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rig.archive.documents import Issued, Kept, Thing, may_be_kept, read_kept
from rig.archive.forecast import forecast
from rig.archive.store import TABLES, Store, opened
from rig.drivers.clock import RealClock
from rig.errors import RigError, UsageError
from rig.fitter.steps import steps

_JUST_NOW_S = 2.0
"""Age of a change below which a folder is read again: dates of change are coarse."""
_LEFT_OUT = (".git", ".venv", "__pycache__", "node_modules")


@dataclass
class Lab:
    """The index of a folder.

    Attributes:
        folder: of the laboratory, with everything below it.
        db: where it is kept.
    """

    folder: Path
    db: Store

    @classmethod
    @contextlib.contextmanager
    def open(cls, folder: Path, *, rebuild: bool = False, database: str = "") -> Iterator[Lab]:
        """The index of a folder, up to date with its files.

        Args:
            folder: of the laboratory.
            rebuild: read every file again.
            database: address of the database in which it is kept; "" for a file in the folder.

        Raises:
            UsageError: there is no such folder, or the index cannot be written.
            StorageError: the database cannot be reached.
        """
        if not folder.is_dir():
            raise UsageError(f"there is no folder {folder}")
        with opened(folder, database) as store:
            lab = cls(folder, store)
            lab._refresh(rebuild=rebuild)
            yield lab

    def rows(self, query: str, *given: Any) -> list[dict[str, Any]]:
        """Rows of a query, by column."""
        return self.db.rows(query, *given)

    def problems(self) -> list[str]:
        """Files that cannot be used, and contradictions between files, a sentence each."""
        found = [f"{row['path']}: {row['problem']}" for row in self.rows("SELECT * FROM file WHERE problem <> ''")]
        twice = """SELECT number, string_agg(path, ', ') AS paths FROM (
                SELECT number, path FROM certificate WHERE number IN (
                    SELECT number FROM certificate GROUP BY number HAVING count(*) > 1) ORDER BY path) every
            GROUP BY number ORDER BY number"""
        found += [f"certificate {row['number']} is there several times: {row['paths']}" for row in self.rows(twice)]
        alike = """SELECT asset, string_agg(key, ',') AS keys FROM
            (SELECT DISTINCT asset, key FROM thing WHERE asset <> '' AND serial <> '' ORDER BY asset, key) every
            GROUP BY asset HAVING count(*) > 1 ORDER BY asset"""
        found += [f"asset {row['asset']} is several things: {row['keys']}" for row in self.rows(alike)]
        rows = self.rows(f"SELECT DISTINCT key FROM ({_ITEMS} AND simulated = 1) own WHERE {_REAL} ORDER BY key")
        found += [f"{row['key']}: its simulated certificates are no part of its history" for row in rows]
        return found

    def _refresh(self, *, rebuild: bool) -> None:
        """Read what changed, in one transaction: a kill leaves the index as it was, and another process waits."""
        with self.db.changing():
            if rebuild:
                for table in TABLES:
                    self.db.rows(f"DELETE FROM {table}")
            stale: set[str] = set()
            now = RealClock().utc()
            known = {row["path"]: row for row in self.rows("SELECT * FROM folder")}
            for folder, changed in steps(list(_folders(self.folder)), lambda one: one[0] or "."):
                row = known.pop(folder, None)
                settled = row is not None and row["changed"] == changed and row["seen"] - changed / 1e9 > _JUST_NOW_S
                stale |= self._look_into(folder, settled=settled)
                if not settled:
                    self.db.rows("DELETE FROM folder WHERE path = ?", folder)
                    self.db.rows("INSERT INTO folder VALUES (?, ?, ?)", folder, changed, now)
            for folder in known:
                for row in self.rows("SELECT path FROM file WHERE folder = ?", folder):
                    stale |= self._forget(row["path"])
                self.db.rows("DELETE FROM folder WHERE path = ?", folder)
            for key in stale:
                self._item(key)

    def _look_into(self, folder: str, *, settled: bool) -> set[str]:
        """Read what changed in a folder; of a settled one only registers can have. Returns keys of changed items."""
        rows = self.rows("SELECT * FROM file WHERE folder = ?", folder) if not settled else self._registers(folder)
        known = {row["path"]: row for row in rows}
        stale: set[str] = set()
        files = _files(self.folder, folder, known if settled else None)
        for path in steps(files, lambda path: Path(path).name):
            row, found = known.pop(path, None), os.stat(self.folder / path)
            if row is None or (row["changed"], row["size"]) != (found.st_mtime_ns, found.st_size):
                stale |= self._forget(path) | self._take(folder, path, found)
        for path in known:
            stale |= self._forget(path)
        return stale

    def _registers(self, folder: str) -> list[dict[str, Any]]:
        return self.rows("SELECT * FROM file WHERE folder = ? AND edited = 1", folder)

    def _forget(self, path: str) -> set[str]:
        """Remove what a file said; returns keys of its items."""
        keys = {row["key"] for row in self.rows("SELECT key FROM thing WHERE path = ? AND role = 'item'", path)}
        for table in ("file", "certificate", "thing"):
            self.db.rows(f"DELETE FROM {table} WHERE path = ?", path)
        return keys

    def _take(self, folder: str, path: str, found: os.stat_result) -> set[str]:
        """Keep what a file says; returns keys of its items."""
        problem, kept = "", Kept()
        try:
            kept = read_kept(self.folder / path)
        except (RigError, OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        row = (path, folder, found.st_mtime_ns, found.st_size, int(path.endswith(".toml")), problem)
        self.db.rows("INSERT INTO file VALUES (?, ?, ?, ?, ?, ?)", *row)
        for own in kept.owned:
            self._thing(path, "owned", own.thing, own.certificate, own.date, own.due)
        return set() if kept.issued is None else self._certificate(path, kept.issued)

    def _certificate(self, path: str, one: Issued) -> set[str]:
        dates = [None if day is None else day.isoformat() for day in (one.issued, one.began, one.ended, one.next_due)]
        row = (path, one.number, *dates, int(one.simulated), one.replaces, one.customer)
        self.db.rows("INSERT INTO certificate VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", *row)
        for item in one.items:
            values = json.dumps({"adjusted": item.adjusted, "values": [asdict(value) for value in item.values]})
            self._thing(path, "item", item.thing, one.number, one.ended, one.next_due, values)
        for used in one.used:
            self._thing(path, "used", used.thing, used.certificate)
        return {item.thing.key for item in one.items}

    def _thing(self, path: str, role: str, thing: Thing, number: str, *rest: Any) -> None:
        dated, due, data = (*rest, None, None, None)[:3]
        row = (thing.key, thing.name, thing.maker, thing.model, thing.serial, thing.asset, number)
        days = [None if day is None else day.isoformat() for day in (dated, due)]
        self.db.rows("INSERT INTO thing VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", path, role, *row, *days, data)

    def _item(self, key: str) -> None:
        """Keep the last certificate of an item, and its forecast."""
        self.db.rows("DELETE FROM item WHERE key = ?", key)
        rows = self.rows(HISTORY, key)
        if rows:
            told = forecast([(row["dated"], json.loads(row["data"])) for row in rows])
            self.db.rows("INSERT INTO item VALUES (?, ?, ?)", key, rows[-1]["path"], json.dumps(asdict(told)))


_COLUMNS = """key, name, maker, model, serial, asset, path, number, issued, began, ended, next_due, simulated, replaces,
    customer, dated, due, data"""
_ITEMS = """SELECT key, name, maker, model, serial, asset, certificate.*, dated, due, data
    FROM thing JOIN certificate ON certificate.path = thing.path WHERE role = 'item'"""
_REAL = f"""EXISTS (SELECT 1 FROM ({_ITEMS} AND simulated = 0) other WHERE other.key = own.key)"""
HISTORY = f"""SELECT {_COLUMNS} FROM (
        SELECT own.*, row_number() OVER (PARTITION BY number ORDER BY path) AS copy FROM ({_ITEMS} AND key = ?) own
        WHERE number NOT IN (SELECT replaces FROM certificate) AND (simulated = 0 OR NOT {_REAL})) every
    WHERE copy = 1 ORDER BY ended, issued, number"""
"""Certificates of an item that hold, in order of time; one of several copies; simulated ones where all are."""


def _folders(top: Path) -> Iterator[tuple[str, int]]:
    """Every folder below, relative, with its date of change in nanoseconds; links are not followed."""
    waiting = [""]
    while waiting:
        folder = waiting.pop()
        with contextlib.suppress(OSError):  # gone, or not ours to read
            yield folder, os.stat(top / folder).st_mtime_ns
            with os.scandir(top / folder) as found:
                waiting += [
                    os.path.join(folder, one.name)
                    for one in found
                    if one.is_dir(follow_symlinks=False) and one.name not in _LEFT_OUT
                ]


def _files(top: Path, folder: str, known: Any) -> list[str]:
    """Files of a folder that are looked into; only those known where nothing came or went."""
    if known is not None:
        return [path for path in known if (top / path).exists()]
    with os.scandir(top / folder) as found:
        names = [one.name for one in found if one.is_file(follow_symlinks=False) and not one.name.startswith(".")]
    return sorted(path for name in names if may_be_kept(Path(path := os.path.join(folder, name))))
