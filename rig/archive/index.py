"""The index of a laboratory's folder: an SQLite file that is made of the files in it, and may be removed at any time.

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

import apsw

from rig.archive.documents import Issued, Kept, Thing, may_be_kept, read_kept
from rig.archive.forecast import forecast
from rig.drivers.clock import RealClock
from rig.errors import RigError, UsageError

NAME = ".rig-lab.sqlite"
"""Name of the index in the folder of the laboratory."""
_VERSION = 2
_BUSY_MS = 60_000
_JUST_NOW_S = 2.0
"""Age of a change below which a folder is read again: dates of change are coarse."""
_LEFT_OUT = (".git", ".venv", "__pycache__", "node_modules")
_SCHEMA = """
CREATE TABLE folder (path TEXT PRIMARY KEY, changed INT, seen REAL) STRICT, WITHOUT ROWID;
CREATE TABLE file (path TEXT PRIMARY KEY, folder TEXT, changed INT, size INT, edited INT, problem TEXT)
    STRICT, WITHOUT ROWID;
CREATE INDEX file_of_folder ON file (folder);
CREATE INDEX file_edited ON file (folder) WHERE edited = 1;
CREATE INDEX file_problem ON file (path) WHERE problem <> '';
CREATE TABLE certificate (path TEXT PRIMARY KEY, number TEXT, issued TEXT, began TEXT, ended TEXT, next_due TEXT,
    simulated INT, replaces TEXT, customer TEXT) STRICT, WITHOUT ROWID;
CREATE INDEX certificate_number ON certificate (number);
CREATE INDEX certificate_replaces ON certificate (replaces);
CREATE INDEX certificate_simulated ON certificate (path) WHERE simulated = 1;
CREATE TABLE thing (path TEXT, role TEXT, key TEXT, name TEXT, maker TEXT, model TEXT, serial TEXT, asset TEXT,
    number TEXT, dated TEXT, due TEXT, data TEXT) STRICT;
CREATE INDEX thing_path ON thing (path);
CREATE INDEX thing_key ON thing (key, role);
CREATE INDEX thing_number ON thing (number, role);
CREATE INDEX thing_asset ON thing (asset, role);
CREATE INDEX thing_alike ON thing (asset, key) WHERE asset <> '' AND serial <> '';
CREATE INDEX thing_serial ON thing (serial);
CREATE TABLE item (key TEXT PRIMARY KEY, last TEXT, forecast TEXT) STRICT, WITHOUT ROWID;
"""


@dataclass
class Lab:
    """The index of a folder.

    Attributes:
        folder: of the laboratory, with everything below it.
        db: the index.
    """

    folder: Path
    db: apsw.Connection

    @classmethod
    @contextlib.contextmanager
    def open(cls, folder: Path, *, rebuild: bool = False) -> Iterator[Lab]:
        """The index of a folder, up to date with its files.

        Args:
            folder: of the laboratory.
            rebuild: read every file again.

        Raises:
            UsageError: there is no such folder, or the index cannot be written.
        """
        if not folder.is_dir():
            raise UsageError(f"there is no folder {folder}")
        path = folder / NAME
        try:
            lab = cls(folder, _connected(path))
        except apsw.Error as error:
            raise UsageError(f"{path}: the index cannot be used ({error}); it is made of files: remove it") from error
        try:
            lab._refresh(rebuild=rebuild)
            yield lab
        except apsw.Error as error:
            raise UsageError(f"{path}: the index cannot be written ({error}); it may be removed") from error
        finally:
            lab.db.close()

    def rows(self, query: str, *given: Any) -> list[dict[str, Any]]:
        """Rows of a query, by column."""
        cursor = self.db.execute(query, given)
        found: list[dict[str, Any]] = []
        names: tuple[str, ...] = ()
        for row in cursor:
            names = names or tuple(name for name, *_ in cursor.get_description())  # known with the first row alone
            found.append(dict(zip(names, row, strict=True)))
        return found

    def problems(self) -> list[str]:
        """Files that cannot be used, and contradictions between files, a sentence each."""
        found = [f"{row['path']}: {row['problem']}" for row in self.rows("SELECT * FROM file WHERE problem <> ''")]
        twice = "SELECT number, group_concat(path, ', ') paths FROM certificate GROUP BY number HAVING count(*) > 1"
        found += [f"certificate {row['number']} is there several times: {row['paths']}" for row in self.rows(twice)]
        alike = """SELECT asset, group_concat(DISTINCT key) keys FROM thing WHERE asset <> '' AND serial <> ''
            GROUP BY asset HAVING count(DISTINCT key) > 1"""
        found += [f"asset {row['asset']} is several things: {row['keys']}" for row in self.rows(alike)]
        rows = self.rows(f"SELECT DISTINCT key FROM ({_ITEMS} AND simulated = 1) own WHERE {_REAL}")
        found += [f"{row['key']}: its simulated certificates are no part of its history" for row in rows]
        return found

    def _refresh(self, *, rebuild: bool) -> None:
        """Read what changed, in one transaction: a kill leaves the index as it was, and another process waits."""
        self.db.execute("BEGIN IMMEDIATE")
        try:
            if rebuild:
                for table in ("folder", "file", "certificate", "thing", "item"):
                    self.db.execute(f"DELETE FROM {table}")
            stale: set[str] = set()
            now = RealClock().utc()
            known = {row["path"]: row for row in self.rows("SELECT * FROM folder")}
            for folder, changed in _folders(self.folder):
                row = known.pop(folder, None)
                settled = row is not None and row["changed"] == changed and row["seen"] - changed / 1e9 > _JUST_NOW_S
                stale |= self._look_into(folder, settled=settled)
                if not settled:
                    self.db.execute("INSERT OR REPLACE INTO folder VALUES (?, ?, ?)", (folder, changed, now))
            for folder in known:
                for row in self.rows("SELECT path FROM file WHERE folder = ?", folder):
                    stale |= self._forget(row["path"])
                self.db.execute("DELETE FROM folder WHERE path = ?", (folder,))
            for key in stale:
                self._item(key)
            self.db.execute("COMMIT")
        except BaseException:
            self.db.execute("ROLLBACK")
            raise

    def _look_into(self, folder: str, *, settled: bool) -> set[str]:
        """Read what changed in a folder; of a settled one only registers can have. Returns keys of changed items."""
        rows = self.rows("SELECT * FROM file WHERE folder = ?", folder) if not settled else self._registers(folder)
        known = {row["path"]: row for row in rows}
        stale: set[str] = set()
        for path in _files(self.folder, folder, known if settled else None):
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
            self.db.execute(f"DELETE FROM {table} WHERE path = ?", (path,))
        return keys

    def _take(self, folder: str, path: str, found: os.stat_result) -> set[str]:
        """Keep what a file says; returns keys of its items."""
        problem, kept = "", Kept()
        try:
            kept = read_kept(self.folder / path)
        except (RigError, OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            problem = str(error).splitlines()[0] if str(error) else type(error).__name__
        row = (path, folder, found.st_mtime_ns, found.st_size, int(path.endswith(".toml")), problem)
        self.db.execute("INSERT INTO file VALUES (?, ?, ?, ?, ?, ?)", row)
        for own in kept.owned:
            self._thing(path, "owned", own.thing, own.certificate, own.date, own.due)
        return set() if kept.issued is None else self._certificate(path, kept.issued)

    def _certificate(self, path: str, one: Issued) -> set[str]:
        dates = [None if day is None else day.isoformat() for day in (one.issued, one.began, one.ended, one.next_due)]
        row = (path, one.number, *dates, int(one.simulated), one.replaces, one.customer)
        self.db.execute("INSERT INTO certificate VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
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
        self.db.execute(
            "INSERT INTO thing VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", (path, role, *row, *days, data)
        )

    def _item(self, key: str) -> None:
        """Keep the last certificate of an item, and its forecast."""
        self.db.execute("DELETE FROM item WHERE key = ?", (key,))
        rows = self.rows(HISTORY, key)
        if rows:
            told = forecast([(row["dated"], json.loads(row["data"])) for row in rows])
            self.db.execute("INSERT INTO item VALUES (?, ?, ?)", (key, rows[-1]["path"], json.dumps(asdict(told))))


_ITEMS = """SELECT thing.*, certificate.* FROM thing JOIN certificate USING (path) WHERE role = 'item'"""
_REAL = f"""EXISTS (SELECT 1 FROM ({_ITEMS} AND simulated = 0) other WHERE other.key = own.key)"""
HISTORY = f"""SELECT * FROM ({_ITEMS} AND key = ?) own
    WHERE number NOT IN (SELECT replaces FROM certificate) AND (simulated = 0 OR NOT {_REAL})
    GROUP BY number ORDER BY ended, issued, number"""
"""Certificates of an item that hold, in order of time; one of several copies; simulated ones where all are."""


def _connected(path: Path) -> apsw.Connection:
    db = apsw.Connection(str(path))
    db.set_busy_timeout(_BUSY_MS)
    db.pragma("journal_mode", "truncate")  # a journal that comes and goes would change the date of the folder
    db.execute("BEGIN IMMEDIATE")
    try:
        if db.pragma("user_version") != _VERSION:
            for (name,) in db.execute("SELECT name FROM sqlite_schema WHERE type = 'table'").fetchall():
                db.execute(f'DROP TABLE "{name}"')
            db.execute(_SCHEMA)
            db.pragma("user_version", _VERSION)
    finally:
        db.execute("COMMIT")
    return db


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
