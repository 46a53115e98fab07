"""The schema of a run file, and safe connections to files that may be hostile.

Nothing in a run file is executed. A connection runs in SQLite's defensive mode with an untrusted schema. Reading
connections refuse triggers and views; an authorizer permits only reads. Lengths and depths are limited, and the steps
and content of a statement are limited by the size of the file (`Guarded`). The four tables must be exactly ours before
anything is read from them. So none of them can be a view or a virtual table, or have computed columns. Bodies are JSON;
nothing is ever unpickled.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from operator import length_hint
from typing import Any

import apsw

from rig.procedures.plan.run_list import RunList

Stored = int | float | str | bytes | None
"""What SQLite stores."""
APPLICATION_ID = 0x52494721
"""`RIG!` in ASCII, in the header of the database."""
SCHEMA_VERSION = 2
TABLES = ("document", "factor", "point", "record")
INSERT_RECORD = f"INSERT INTO record VALUES ({', '.join('?' * 12)})"

# Exactly as in every run file of this format, line breaks included: the texts are compared.
_FIXED = {
    "document": "CREATE TABLE document (name TEXT PRIMARY KEY, body TEXT NOT NULL) STRICT",
    "factor": "CREATE TABLE factor (position INTEGER PRIMARY KEY, name TEXT NOT NULL, axis TEXT NOT NULL, "
    """overtravel REAL NOT NULL,
    hard INTEGER NOT NULL, stays INTEGER NOT NULL) STRICT""",
    "record": """CREATE TABLE record (
    seq INTEGER PRIMARY KEY, session INTEGER NOT NULL, kind TEXT NOT NULL, elapsed_s REAL NOT NULL,
    utc_s REAL NOT NULL, run_index INTEGER, whole_plot INTEGER, attempt INTEGER, status TEXT, body TEXT NOT NULL,
    previous BLOB NOT NULL, hash BLOB NOT NULL) STRICT""",
    "one_accepted_observation": "CREATE UNIQUE INDEX one_accepted_observation "
    """ON record (run_index, ifnull(whole_plot, 0))
    WHERE kind = 'observation' AND status = 'accepted'""",
}
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")
_MOST_FACTORS = 100

# Chosen: what a run file needs, with room; a hostile file reaches no more of SQLite than this.
_LIMITS = {
    apsw.SQLITE_LIMIT_LENGTH: 64 << 20,
    apsw.SQLITE_LIMIT_SQL_LENGTH: 1 << 20,
    apsw.SQLITE_LIMIT_COLUMN: 3 + 2 * _MOST_FACTORS,
    apsw.SQLITE_LIMIT_EXPR_DEPTH: 50,
    apsw.SQLITE_LIMIT_COMPOUND_SELECT: 5,
    apsw.SQLITE_LIMIT_VDBE_OP: 250_000,
    apsw.SQLITE_LIMIT_ATTACHED: 0,
    apsw.SQLITE_LIMIT_TRIGGER_DEPTH: 5,
    apsw.SQLITE_LIMIT_WORKER_THREADS: 0,
}
_READS = (apsw.SQLITE_SELECT, apsw.SQLITE_READ)
_PRAGMAS = {
    "quick_check",
    "integrity_check",
    "user_version",
    "application_id",
    "journal_mode",
    "page_count",
    "data_version",
}
_FUNCTIONS = {"count", "ifnull", "typeof", "group_concat", "max", "min", "length"}


def write_run_list(db: apsw.Connection, runs: RunList) -> None:
    """Write every factor and point into the existing tables."""
    db.executemany(
        "INSERT INTO factor VALUES (?, ?, ?, ?, ?, ?)",
        [(i, f.name, f.axis, f.overtravel, int(f.hard), int(f.stays)) for i, f in enumerate(runs.factors)],
    )
    marks = ", ".join("?" * (3 + 2 * len(runs.factors)))
    db.executemany(
        f"INSERT INTO point VALUES ({marks})",
        ((p.index, p.replication, p.whole_plot, *p.setpoints, *p.sides) for p in runs.points),
    )


def statements(factors: Sequence[str]) -> dict[str, str]:
    """SQL statements that create the objects of a run file, by object name, for these factor names.

    Raises:
        ValueError: a factor's name is invalid.

    """
    if len(factors) > _MOST_FACTORS or len(set(factors)) < len(factors):
        raise ValueError(f"{len(factors)} factors, some of one name or too many")
    for name in factors:
        if not _NAME.fullmatch(name):
            raise ValueError(f"{name!r} is no name of a factor")
    columns = "".join(f', "{name}" REAL NOT NULL' for name in factors)
    sides = "".join(f', "{name}_side" INTEGER NOT NULL' for name in factors)
    point = (
        f"CREATE TABLE point (run_index INTEGER PRIMARY KEY, replication INTEGER NOT NULL, whole_plot INTEGER"
        f"{columns}{sides}) STRICT"
    )
    triggers = {
        f"{table}_refuses_{verb.lower()}": f"CREATE TRIGGER {table}_refuses_{verb.lower()} BEFORE {verb} ON {table} "
        f"BEGIN SELECT RAISE(ABORT, 'a run file is append-only'); END"
        for table in TABLES
        for verb in ("UPDATE", "DELETE")
    }
    return {**_FIXED, "point": point, **triggers}


def guard(db: apsw.Connection, *, writes: bool) -> None:
    """Restrict a connection to what a run file needs."""
    db.config(apsw.SQLITE_DBCONFIG_DEFENSIVE, 1)
    db.config(apsw.SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0)
    db.config(apsw.SQLITE_DBCONFIG_ENABLE_VIEW, 0)
    for limit, value in _LIMITS.items():
        db.limit(limit, value)
    if writes:
        return
    db.config(apsw.SQLITE_DBCONFIG_ENABLE_TRIGGER, 0)
    db.authorizer = _only_reads


def _only_reads(action: int, first: str | None, second: str | None, _database: str | None, _within: str | None) -> int:
    if action in _READS:
        return apsw.SQLITE_OK
    if action == apsw.SQLITE_PRAGMA and first in _PRAGMAS and (second is None or second.isdigit()):
        return apsw.SQLITE_OK
    if action == apsw.SQLITE_FUNCTION and second in _FUNCTIONS:
        return apsw.SQLITE_OK
    return apsw.SQLITE_DENY


class Guarded:
    """Runs statements whose steps and content are limited by the size of the file.

    Args:
        db: the connection.
        size: returns the size of the file with its log, bytes; called at the start of every statement.

    """

    _EVERY = 100_000
    """Steps between looks at the limit; chosen."""

    def __init__(self, db: apsw.Connection, size: Callable[[], int]) -> None:
        self._db = db
        self._size = size
        self._steps = self._most_steps = 0
        db.set_progress_handler(self._too_long, self._EVERY)

    def _too_long(self) -> bool:
        self._steps += self._EVERY
        return self._steps > self._most_steps

    def rows(self, statement: str, values: tuple[Stored, ...] = ()) -> Iterator[Any]:
        """The rows of a statement, one after the other.

        Raises:
            apsw.Error: it cannot be run, or exceeds its limit of steps or content.
            UnicodeDecodeError: a text in it is not UTF-8.

        """
        size, content = self._size(), 0
        # Far above what any of our statements needs for a file of this size, and it still ends within seconds.
        self._steps, self._most_steps = 0, 20_000_000 + 20 * size
        most = (64 << 20) + 8 * size
        for row in self._db.execute(statement, values):
            content += sum(map(length_hint, row))  # texts and blobs have a length; numbers and NULL have none
            if content > most:
                raise apsw.TooBigError("it gives more content than a file of its size can hold")
            yield row


def strange_tables(guarded: Guarded) -> str | None:
    """Why the tables of a file are not those of a run file; None if they are."""
    found = {
        (kind, name): sql
        # Limited: a hostile schema may have any number of objects.
        for kind, name, sql in guarded.rows("SELECT type, name, sql FROM sqlite_master LIMIT 10000")
        if name in TABLES
    }
    fixed = [name for name in TABLES if name != "point"]
    for name in fixed:
        if found.get(("table", name)) != _FIXED[name]:
            return f"its table {name} is not the one a run file has"
    names = [str(n) for (n,) in guarded.rows(f"SELECT name FROM factor ORDER BY position LIMIT {_MOST_FACTORS + 1}")]
    try:
        expected = statements(names)["point"]
    except ValueError as error:
        return f"its table factor is not one: {error}"
    return None if found.get(("table", "point")) == expected else "its table point does not go with its factors"


def differences(guarded: Guarded) -> list[tuple[str, str]]:
    """Objects of the schema that differ from their creation: (type and name, difference)."""
    names = [str(n) for (n,) in guarded.rows("SELECT name FROM factor ORDER BY position")]
    expected = statements(names)
    found = {
        name: (kind, sql)
        for kind, name, sql in guarded.rows("SELECT type, name, sql FROM sqlite_master LIMIT 10000")
        if not (kind == "index" and sql is None)  # created by SQLite for a PRIMARY KEY
    }
    says = []
    for name, sql in expected.items():
        what = f"{sql.removeprefix('CREATE ').removeprefix('UNIQUE ').split(' ', 1)[0].lower()} {name}"
        if name not in found:
            says.append((what, "is missing: it was dropped"))
        elif found[name][1] != sql:
            says.append((what, f"was replaced by another: {str(found[name][1])[:200]}"))
    for name, (kind, sql) in found.items():
        if name not in expected:
            says.append((f"{kind} {name}", f"was added: {str(sql)[:200]}"))
    return says
