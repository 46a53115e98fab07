"""A forger of run files: changes whatever it is told to and makes every hash again, without any code of the project.

What it takes: the format as docs/how_to/verify.md has it, and twenty lines.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_COLUMNS = ("session", "kind", "elapsed_s", "utc_s", "run_index", "whole_plot", "attempt", "status")


@dataclass
class Opened:
    """A run file being forged.

    Attributes:
        records: each with its columns and its body, in order; may be changed, removed, inserted.
        documents: file texts by name.
        points: rows of the run list by column.

    """

    records: list[dict[str, Any]]
    documents: dict[str, str]
    points: list[dict[str, Any]]

    def all(self, kind: str, status: str | None = None) -> Iterator[dict[str, Any]]:
        """Records of a kind, and status if given."""
        return (r for r in self.records if r["kind"] == kind and status in (None, r["status"]))

    def observation(self, index: int) -> dict[str, Any]:
        """The accepted observation of a point."""
        return next(r for r in self.all("observation", "accepted") if r["run_index"] == index)

    def without(self, drop: Callable[[dict[str, Any]], bool]) -> None:
        """Remove records."""
        self.records = [r for r in self.records if not drop(r)]


def forge(path: Path, to: Path, change: Callable[[Opened], object]) -> Path:
    """A changed copy of a run file, every hash of which is right."""
    to.write_bytes(path.read_bytes())
    with closing(sqlite3.connect(to)) as db:
        db.execute("PRAGMA synchronous = OFF")
        triggers = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _ in triggers:
            db.execute(f"DROP TRIGGER {name}")
        rows = db.execute(f"SELECT {', '.join(_COLUMNS)}, body FROM record ORDER BY seq").fetchall()
        records = [dict(zip(_COLUMNS, row, strict=False)) | {"body": json.loads(row[-1])} for row in rows]
        cursor = db.execute("SELECT * FROM point ORDER BY run_index")
        names = [column[0] for column in cursor.description]
        points = [dict(zip(names, row, strict=True)) for row in cursor]
        opened = Opened(records, dict(db.execute("SELECT name, body FROM document").fetchall()), points)
        change(opened)
        _write(db, opened)
        for _, sql in triggers:
            db.execute(sql)
        db.commit()
    return to


def _write(db: sqlite3.Connection, forged: Opened) -> None:
    for table in ("record", "document", "point"):
        db.execute(f"DELETE FROM {table}")
    db.executemany("INSERT INTO document VALUES (?, ?)", forged.documents.items())
    for point in forged.points:
        db.execute(f"INSERT INTO point VALUES ({', '.join('?' * len(point))})", list(point.values()))
    genesis = forged.records[0]["body"]
    genesis["documents"] = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in forged.documents.items()}
    genesis["run_list"] = _run_list(db, forged.points, genesis["seed"])
    previous = bytes(32)
    for seq, record in enumerate(forged.records, 1):
        if record["kind"] == "end":
            record["body"] |= {"records": seq - 1, "head": previous.hex()}
        columns = [record[name] for name in _COLUMNS]
        body = json.dumps(record["body"], separators=(",", ":"))
        text = json.dumps([seq, *columns, body], separators=(",", ":"))
        own = hashlib.sha256(previous + text.encode()).digest()
        db.execute(f"INSERT INTO record VALUES ({', '.join('?' * 12)})", [seq, *columns, body, previous, own])
        previous = own


def _run_list(db: sqlite3.Connection, points: list[dict[str, Any]], seed: int) -> str:
    rows = db.execute("SELECT name, axis, overtravel, hard, stays FROM factor ORDER BY position").fetchall()
    factors = [[name, axis, beyond, bool(hard), bool(stays)] for name, axis, beyond, hard, stays in rows]
    digest = hashlib.sha256(json.dumps({"factors": factors, "seed": seed}, sort_keys=True).encode())
    for p in points:
        values, sides = [p[f[0]] for f in factors], [p[f"{f[0]}_side"] for f in factors]
        digest.update(json.dumps([p["run_index"], p["replication"], p["whole_plot"], values, sides]).encode())
    return digest.hexdigest()
