"""Doors that read run files: those of an attacker who knows the code, and what lies beside one."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import random
import sqlite3
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, cast

from proving.doors.hostile import VALUES, Acts, Material, Seeded, check_json, command, damaged, edited, mutated
from rig.procedures.plan.run_list import Factor, rows_sha256
from rig.run_file.chain import GENESIS, Record, encode, link
from rig.verbs.page import story
from rig.watch import Shelf
from rig.watch.feed import RunFeed, encoded

Row = list[Any]

_MORE: tuple[tuple[str, str | None, dict[str, Any]], ...] = (
    ("skip", "later", {"reason": "no reply"}),
    ("skip", "final", {"reason": "no reply"}),
    ("event", "warning", {"message": "x_V drifts", "kind": "drift", "sensor": "x_V"}),
    ("event", "remark", {"instrument": "head", "message": "answered late"}),
    ("event", "rescued", {"to": "/nowhere/copy.sqlite"}),
    ("event", "not-notified", {"channel": "mail", "about": "hold", "why": "no route"}),
    ("hold", None, {"why": "asked for"}),
    ("fault", "abort", {"message": "it smokes"}),
)
"""Records that no run of ours has: put in, so that they are changed too."""


_MOST = 40
"""Records of an image that are taken as they are; of a longer one, a few of each kind."""


def _few(records: list[Row]) -> list[Row]:
    """At most three of each kind of record, of observations six."""
    kept: Counter[tuple[str, str]] = Counter()
    found = []
    for row in records:
        kind = (str(row[2]), "" if row[2] == "identity" else str(row[8]))
        kept[kind] += 1
        if kept[kind] <= (6 if row[2] == "observation" else 3):
            found.append(row)
    return found


@dataclass
class Image:
    """What a run file holds, in lists that can be changed, without the guards of its tables."""

    loose: bytes
    schema: list[tuple[str, str]]
    triggers: list[tuple[str, str, str]]
    documents: list[Row]
    factors: list[Row]
    points: list[Row]
    records: list[Row]
    columns: ClassVar[tuple[str, ...]] = ("document", "factor", "point", "record")

    @classmethod
    def of(cls, path: Path) -> Image:
        """Of a run file."""
        content = bytearray(path.read_bytes())
        content[18] = content[19] = 1
        db = sqlite3.connect(":memory:")
        db.deserialize(bytes(content))
        rows = {t: [list(r) for r in db.execute(f"SELECT * FROM {t} ORDER BY 1").fetchall()] for t in cls.columns}
        schema = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall()
        triggers = db.execute("SELECT name, tbl_name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
        for name, _, _ in triggers:
            db.execute(f"DROP TRIGGER {name}")
        for table in cls.columns:
            db.execute(f"DELETE FROM {table}")
        db.commit()
        db.execute("PRAGMA writable_schema = ON")
        for word in ("STRICT", "NOT NULL"):
            db.execute("UPDATE sqlite_master SET sql = replace(sql, ?, '') WHERE type = 'table'", (word,))
        db.commit()
        if len(rows["record"]) > _MOST:
            rows["record"] = _few(rows["record"])
        loose = db.serialize()
        db.close()
        ending = [row for row in rows["record"] if row[2] == "end"][:1]
        records = rows["record"][: len(rows["record"]) - len(ending)]
        at = max(row[3] for row in records)
        last = records[-1]
        for kind, status, body in _MORE:
            records.append([0, last[1], kind, at, last[4], 1, last[6], 1, status, json.dumps(body), b"", b""])
        return cls(loose, schema, triggers, rows["document"], rows["factor"], rows["point"], records + ending)

    def copy(self) -> Image:
        """One whose rows can be changed."""
        lists: dict[str, Any] = {
            n: [list(row) for row in getattr(self, n)] for n in ("documents", "factors", "points", "records")
        }
        return replace(self, **lists)

    def rechain(self) -> None:
        """Make hashes of documents, run list and records again, as an attacker does who has read the code."""
        previous = GENESIS
        for number, row in enumerate(self.records, 1):
            row[0] = number
            if number == 1 or row[2] == "end":
                with contextlib.suppress(Exception):
                    row[9] = encode(self._true(json.loads(row[9]), number, previous))
            row[10] = previous
            with contextlib.suppress(Exception):
                row[11] = link(previous, number, Record._make(row[1:10]))
            previous = row[11] if isinstance(row[11], bytes) else b""

    def _true(self, body: dict[str, Any], number: int, previous: bytes) -> dict[str, Any]:
        if number == 1:
            if isinstance(body["documents"], dict):
                body["documents"] = {n: hashlib.sha256(text.encode()).hexdigest() for n, text in self.documents}
            with contextlib.suppress(Exception):
                factors = tuple(Factor(n, a, o, bool(h), bool(s)) for _, n, a, o, h, s in self.factors)
                body["run_list"] = rows_sha256(factors, int(body["seed"]), [cast("list[tuple[Any, ...]]", self.points)])
        elif isinstance(body.get("head"), str):
            body |= {"head": previous.hex(), "records": number - 1}
        return body

    def write(self, path: Path, rng: random.Random, *, under_way: bool) -> None:
        """Lay it down as a run file."""
        db = sqlite3.connect(":memory:")
        db.deserialize(self.loose)
        for table in self.columns:
            rows = getattr(self, f"{table}s")
            db.execute("SAVEPOINT filled")
            try:
                db.executemany(f"INSERT INTO {table} VALUES ({','.join('?' * len(rows[0]))})", rows)
            except (sqlite3.Error, UnicodeEncodeError, OverflowError, IndexError):
                db.execute("ROLLBACK TO filled")
                for row in rows:
                    with contextlib.suppress(sqlite3.Error, UnicodeEncodeError, OverflowError):
                        db.execute(f"INSERT INTO {table} VALUES ({','.join('?' * len(row))})", row)
            db.execute("RELEASE filled")
        db.execute("PRAGMA writable_schema = ON")
        for name, sql in self.schema:
            db.execute("UPDATE sqlite_master SET sql = ? WHERE name = ?", (sql, name))
        db.executemany("INSERT INTO sqlite_master VALUES ('trigger', ?, ?, 0, ?)", self.triggers)
        if rng.random() < 0.03:
            of, to = rng.sample(self.columns, 2)
            pages = (
                "UPDATE sqlite_master SET rootpage = (SELECT rootpage FROM sqlite_master WHERE name = ?) WHERE name = ?"
            )
            db.execute(pages, (of, to))
        if rng.random() < 0.02:
            db.execute(
                "DELETE FROM sqlite_master WHERE name = (SELECT name FROM sqlite_master ORDER BY random() LIMIT 1)"
            )
        db.commit()
        content = bytearray(db.serialize())
        db.close()
        db.close()
        if under_way:
            content[18] = content[19] = 2
        path.write_bytes(content)


def _images(material: Material) -> list[Image]:
    if "images" not in material.made:
        material.made["images"] = [Image.of(path) for path in material.runs]
    found: list[Image] = material.made["images"]
    return found


_COLUMN_VALUES = (
    *(None, -1, 0, 1, 2, 7, 2**31, 2**62, 2**63 - 1, -(2**63), 0.5, 1e300, -1e300, float("inf"), float("-inf")),
    *("", "x", "accepted", "rejected", "end", "session", "run", "event", "final", "whole-plot", "whole-plot-lost"),
    *("hole", "safe", "warning", "observation", "identity", b"", b"\xff\xfe", bytes(32), "1", "x" * 5000, "\0", "a\nb"),
    *("=1+1", "../x", "[red]", "pitch_deg", '"', "1e999", 2.5e11, 1e12, True),
)


def _attacked(image: Image, rng: random.Random) -> None:
    """One change of what a run file holds."""
    how = rng.randrange(20)
    records = image.records
    if how < 11 and records:
        kind = rng.choice(sorted({(str(r[2]), str(r[8])) for r in records if r[2] != "observation"} | {("", "")}))
        chosen = [r for r in records if (str(r[2]), str(r[8])) == kind] or [r for r in records if r[2] == "observation"]
        row = rng.choice(chosen or records)
        with contextlib.suppress(ValueError, TypeError):
            body = mutated(json.loads(row[9]), rng)
            row[9] = json.dumps(body, allow_nan=rng.random() < 0.1)
    elif how < 14 and records:
        row = rng.choice(records)
        row[rng.randrange(1, 10)] = rng.choice(_COLUMN_VALUES)
    elif how < 17 and image.documents:
        row = rng.choice(image.documents)
        if rng.random() < 0.9:
            row[1] = edited(str(row[1]), rng)
        else:
            row[rng.randrange(2)] = rng.choice(_COLUMN_VALUES)
    elif how == 17:
        row = rng.choice(rng.choice((image.points, image.factors)) or [[0]])
        row[rng.randrange(len(row))] = rng.choice(_COLUMN_VALUES)
    elif how == 18 and records:
        at = rng.randrange(len(records))
        match rng.randrange(4):
            case 0:
                del records[at]
            case 1:
                records.insert(at, list(rng.choice(records)))
            case 2:
                other = rng.randrange(len(records))
                records[at], records[other] = records[other], records[at]
            case _:
                records[at][9] = rng.choice(
                    ("[" * 5000, "{" * 3, "null", "[]", '"x"', "1", "", '{"a": 1e400}', "NaN", "{}")
                )
    elif image.documents:
        rng.choice((image.documents, image.points, image.factors)).pop()


_COMMANDS = 3
"""So many of the doors that read run files, one input each, are given every changed file."""


def run(rng: Seeded, material: Material) -> Acts:
    """A run file that was changed and hashed again."""
    number, path = rng.number // _COMMANDS, material.path("attacked.sqlite")
    if material.made.get("attacked", (None, b""))[0] != number:
        _forge(random.Random(f"run file {number}"), material, path)
        material.made["attacked"] = (number, path.read_bytes())
    else:
        path.write_bytes(material.made["attacked"][1])
    return _reading(path, material, rng)


def _forge(rng: random.Random, material: Material, path: Path) -> None:
    image = rng.choice(_images(material)).copy()
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        _attacked(image, rng)
    under_way = rng.random() < 0.25
    if under_way:
        image.records = [r for r in image.records if r[2] != "end"]
        if rng.random() < 0.5:
            del image.records[rng.randrange(3, len(image.records)) :]
    image.rechain()
    image.write(path, rng, under_way=under_way)


def _page(path: Path) -> None:
    feed = RunFeed(path, None, lambda: 0.0, lambda: 2e9)
    feed.refresh()
    check_json(encoded({**feed.view(), "story": feed.lines(0)}))


def _shelf(path: Path) -> None:
    for entry in Shelf(path.parent, None, lambda: 0.0, lambda: 2e9).entries():
        assert entry.name


def _reading(path: Path, material: Material, rng: random.Random) -> Acts:
    """One of the doors that read a run file; what takes longer comes less often."""
    out, new = material.folder / "answer.csv", material.folder / "answer.sqlite"
    new.unlink(missing_ok=True)
    chance = rng.random()
    if chance < 0.0004:  # a second or more each
        report = material.folder / "answer.html"
        traces: tuple[tuple[object, ...], ...] = (
            *(("trace", path, "--json"), ("trace", path, "--report", report), ("fit", path, "--report", report)),
            *(
                ("confirm", path, "--list", "--json"),
                ("confirm", material.run, "--by", path),
                ("plan", path, "-b", path),
            ),
        )
        asked = rng.choice(traces)
        yield lambda: command(*asked)
        return
    if chance < 0.008:
        fits: tuple[tuple[object, ...], ...] = (
            *(("fit", path, "--json"), ("fit", path, "--out", material.folder / "answer.json"), ("fit", path)),
            *(
                ("chart", path, material.run, "--json"),
                ("chart", path, f"{path}@2026-02-01"),
                ("doctor", "--run", path),
            ),
        )
        fitted = rng.choice(fits)
        yield lambda: command(*fitted)
        return
    if chance < 0.2:
        act: Callable[[Path], object] = rng.choice((story, _page, _page, _shelf))
        yield lambda: act(path)
        return
    doors: tuple[tuple[object, ...], ...] = (
        *[("verify", path), ("verify", path, "--json"), ("verify", path, "--restore", new)],
        *[("status", path), ("status", path, "--json"), ("status", path, "--check"), ("status", path.parent)],
        *[("export", path, "--out", out, "--all"), ("export", path, "--out", out, "--salvage")] * 2,
        *[("export", path, "--out", out), ("service", path), ("resume", path), ("resume", path), ("stop", path)],
        ("resume", path, "--unless-stopped"),
    )
    chosen = rng.choice(doors)
    yield lambda: command(*chosen)


_SUFFIXES = ("-wal", "-shm", "-journal", ".head", ".live", ".request", ".rescued", ".log", ".lock", ".part")


def beside(rng: random.Random, material: Material) -> Acts:
    """What lies beside a run file: pipes, links, folders, other bytes, other runs' logs, what a controller says."""
    image = rng.choice(_images(material))
    path = material.path("attacked.sqlite")
    if rng.random() < 0.5:
        image = image.copy()
        image.records = [r for r in image.records if r[2] != "end"]
        image.rechain()
        image.write(path, rng, under_way=True)
    else:
        path.write_bytes(rng.choice(material.runs).read_bytes())
    for suffix in rng.sample(_SUFFIXES, 2):
        _put(path.with_suffix(suffix) if suffix.startswith(".") else path.with_name(path.name + suffix), path, rng)
    if rng.random() < 0.2:
        _put(path.with_name("attacked2.sqlite"), path, rng)
    with contextlib.ExitStack() as held:
        if rng.random() < 0.3:  # a controller is at work on it, and says what it likes
            lock = os.open(path, os.O_RDONLY)
            held.callback(os.close, lock)
            fcntl.flock(lock, fcntl.LOCK_EX)
            live = path.with_suffix(".live")
            if not live.exists() and not live.is_symlink():
                live.write_text(json.dumps(mutated(_LIVE, rng)))
            seen = (lambda: _page(path), lambda: _shelf(path), lambda: command("status", path, "--json"))
            yield rng.choice((*seen, lambda: command("status", path), lambda: command("status", path.parent, "--json")))
        else:
            yield from _reading(path, material, rng)


_LIVE = {
    "run_id": "x",
    "simulated": True,
    "session": 1,
    "pid": 1,
    "acknowledged": "",
    "state": "settling",
    "message": "",
    "detail": "x",
    "done": 3,
    "points": 24,
    "elapsed_s": 5.0,
    "remaining_s": 9.0,
    "utc_s": 1.7e9,
    "point": 3,
    "whole_plot": None,
    "whole_plots": 0,
    "settling": {"pitch_deg": {"target": 1.0, "band": 0.1, "outcome": "waiting", "samples": [[1.0, 2.0], [2.0, 3.0]]}},
}


def _put(beside: Path, path: Path, rng: random.Random) -> None:
    match rng.randrange(7):
        case 0:
            os.mkfifo(beside)
        case 1:
            beside.symlink_to(rng.choice(("/dev/zero", "/dev/null", "/nowhere", "/", str(path), beside.name)))
        case 2:
            beside.write_bytes(rng.randbytes(rng.choice((0, 32, 40, 5000, 40000))))
        case 3:
            beside.write_bytes(path.read_bytes())
        case 4:
            beside.mkdir()
        case 5:
            beside.write_text(json.dumps(rng.choice((mutated(_LIVE, rng), rng.choice(VALUES)))))
        case _:
            beside.write_bytes(damaged(_log(path), rng))


def _log(path: Path) -> bytes:
    """A log with the pages of the file itself, as SQLite begins one; its checksums are wrong."""
    page = path.read_bytes()[:4096]
    head = bytes.fromhex("377f0682002de21800001000000000000000000100000002") + bytes(8)
    return head + (bytes.fromhex("0000000100000001000000010000000200000000" + "00000000") + page) * 2
