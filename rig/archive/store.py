"""Where an index is kept: an SQLite file in the folder, or a PostgreSQL database. Both take the same statements."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

import apsw

from rig.errors import UsageError

NAME = ".rig-lab.sqlite"
"""Name of the index in the folder of the laboratory."""
_VERSION = 2
_BUSY_MS = 60_000
TABLES = ("folder", "file", "certificate", "thing", "item")
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


class Store(Protocol):
    """A place of an index."""

    def rows(self, query: str, *given: Any) -> list[dict[str, Any]]:
        """Rows of a statement, by column; values are at `?`, or at `?1`, `?2`."""

    def changing(self) -> contextlib.AbstractContextManager[None]:
        """For changes that are all made or none, while nobody else changes it."""


class InFile:
    """An index in a file."""

    def __init__(self, path: Path) -> None:
        self._db = apsw.Connection(str(path))
        self._db.set_busy_timeout(_BUSY_MS)
        self._db.pragma("journal_mode", "truncate")  # a journal that comes and goes would change the folder's date
        with self.changing():
            if self._db.pragma("user_version") != _VERSION:
                for row in self.rows("SELECT name FROM sqlite_schema WHERE type = 'table'"):
                    self._db.execute(f'DROP TABLE "{row["name"]}"')
                self._db.execute(_SCHEMA)
                self._db.pragma("user_version", _VERSION)

    def rows(self, query: str, *given: Any) -> list[dict[str, Any]]:
        """See `Store`."""
        cursor = self._db.execute(query, given)
        found: list[dict[str, Any]] = []
        names: tuple[str, ...] = ()
        for row in cursor:
            names = names or tuple(name for name, *_ in cursor.get_description())  # known with the first row alone
            found.append(dict(zip(names, row, strict=True)))
        return found

    @contextlib.contextmanager
    def changing(self) -> Iterator[None]:
        """See `Store`."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise

    def close(self) -> None:
        """Close the file."""
        self._db.close()


class InDatabase:
    """An index in a database, in a schema of its own for each path of a folder."""

    def __init__(self, db: Any, folder: Path) -> None:
        self._db = db
        self._schema = f"rig_lab_{_VERSION}_{sha256(str(folder.resolve()).encode()).hexdigest()[:12]}"
        with self.changing():
            self._db.exec_driver_sql(f"CREATE SCHEMA IF NOT EXISTS {self._schema}")
            if not self.rows("SELECT 1 FROM pg_tables WHERE schemaname = ? LIMIT 1", self._schema):
                for statement in _of_postgresql(_SCHEMA).split(";"):
                    if statement.strip():
                        self._db.exec_driver_sql(statement)

    def rows(self, query: str, *given: Any) -> list[dict[str, Any]]:
        """See `Store`."""
        numbers = iter(range(1, len(given) + 1))
        text = re.sub(r"\?(\d*)", lambda at: f"%(p{at[1] or next(numbers)})s", query)
        done = self._db.exec_driver_sql(text, {f"p{i}": value for i, value in enumerate(given, 1)})
        return [dict(row) for row in done.mappings()] if done.returns_rows else []

    @contextlib.contextmanager
    def changing(self) -> Iterator[None]:
        """See `Store`."""
        if self._db.in_transaction():
            self._db.commit()  # of what was only read
        with self._db.begin():
            self._db.exec_driver_sql("SELECT pg_advisory_xact_lock(hashtext(%(p1)s))", {"p1": self._schema})
            self._db.exec_driver_sql(f"SET search_path TO {self._schema}")
            yield


def _of_postgresql(schema: str) -> str:
    """The same tables there: whole numbers of 64 bits, and texts in the order of their bytes."""
    for theirs, ours in (
        (r"\s+STRICT(, WITHOUT ROWID)?", ""),
        (r"\bINT\b", "BIGINT"),
        (r"\bREAL\b", "DOUBLE PRECISION"),
        (r"\bTEXT\b", 'TEXT COLLATE "C"'),
    ):
        schema = re.sub(theirs, ours, schema)
    return schema


@contextlib.contextmanager
def opened(folder: Path, database: str) -> Iterator[Store]:
    """The index of a folder, in its file or in a database.

    Raises:
        UsageError: the file cannot be used.
        StorageError: the database cannot be reached.
    """
    if database:
        from rig.database import Database  # noqa: PLC0415 - the extra may not be installed

        with Database(database).reached("the index of the laboratory") as db:
            yield InDatabase(db, folder)
        return
    path = folder / NAME
    try:
        store = InFile(path)
    except apsw.Error as error:
        raise UsageError(f"{path}: the index cannot be used ({error}); it is made of files: remove it") from error
    try:
        yield store
    except apsw.Error as error:
        raise UsageError(f"{path}: the index cannot be written ({error}); it may be removed") from error
    finally:
        store.close()
