"""Hostile inputs at every door, from a seed: what ends in anything but an answer or an error meant for people.

The quick tests run a share of it, `python -m benchmarks.fuzz` as much as is asked for.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import resource
import shutil
import signal
import sqlite3
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import typer
from command import rig
from crashes import PROCEDURES
from damages import small_finished

from fitter.effects.own import own_effects
from fitter.formula import Formula, FormulaError
from rig.cli import app, commands  # noqa: F401 - importing it registers the commands
from rig.config import parse_bench, parse_procedure
from rig.errors import RigError
from rig.examples import example
from rig.plans import plan_of
from rig.run_file.chain import GENESIS, Record, encode, link
from rig.run_file.creation import _digest
from rig.run_file.reader import RunReader

HANG_S, MEMORY_KB = 5.0, 1 << 20
_USAGE = next(cls for cls in typer.BadParameter.__mro__ if cls.__name__ == "ClickException")


class Hang(BaseException):
    """An input that took longer than it may."""


@dataclass
class Found:
    """What was tried and found: of each kind of finding how many, and an example with its seed."""

    inputs: int = 0
    tracebacks: int = 0
    hangs: int = 0
    memory: int = 0
    examples: dict[str, str] = field(default_factory=dict)

    @property
    def wrong(self) -> int:
        return self.tracebacks + self.hangs + self.memory


@dataclass(frozen=True)
class Material:
    """What is mutated: a finished run and a calibration of it, and a folder to write to."""

    run: Path
    calibration: dict[str, Any]
    folder: Path

    @classmethod
    def make(cls, folder: Path) -> Material:
        run = small_finished("attitude", folder / "whole")
        rig("fit", run, "--out", folder / "calibration.json")
        return cls(run, json.loads((folder / "calibration.json").read_text()), folder)

    def path(self, name: str) -> Path:
        """A path of which nothing is left from an earlier input."""
        for old in self.folder.glob(f"{Path(name).stem}*"):
            old.unlink()
        return self.folder / name


VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1, 2**63, -(2**63), 10**400, 1e308, 1e-320, float("nan"), float("inf"), 0.5),
    *("", "x", "=1+1", "a\nb", "\0", "../../etc/passwd", "x" * 5000, "1_5", "\ud800", "\u202e", "C(", "2026-01-01"),
    *([], {}, [[]], {"a": 1}, [1, "x", None], [{}] * 3, {"name": {"a": 1}}),
)
TOML_VALUES = (
    *("-1", "0", "1e308", "nan", "-inf", "1" * 5000, "0x" + "f" * 5000, "1000000000", "99999999999", "true", '""'),
    *('"x"', '"\\u0000"', '"a\\nb"', '"=1+1"', "[" * 3000, "[]", "{}", "{a = 1}", "[[1, 2], [3]]", "1979-05-27"),
    *('"spy:///dev/null?file=/tmp/x"', '"socket://[::1"', "a" + ".a" * 2000, '"' + "x" * 5000 + '"', "[1, 1]"),
)


def mutated(value: Any, rng: random.Random) -> Any:
    """A JSON value with one place in it changed."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        if rng.random() < 0.1:
            return {k: v for k, v in value.items() if k != key}
        return {**value, key: mutated(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = rng.randrange(len(value))
        if rng.random() < 0.1:
            return value[:at] + value[at + 1 :]
        return [*value[:at], mutated(value[at], rng), *value[at + 1 :]]
    return rng.choice(VALUES)


def edited(text: str, rng: random.Random, values: tuple[str, ...]) -> str:
    """A text of lines `name = value` with some of them changed."""
    lines = text.splitlines()
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(len(lines))
        how = rng.randrange(5)
        if how < 3 and "=" in lines[at]:
            lines[at] = f"{lines[at].partition('=')[0]}= {rng.choice(values)}"
        elif how == 3:
            lines.insert(at, rng.choice(lines))
        else:
            lines[at] = lines[at].replace(rng.choice("=[]\"'. "), rng.choice(("", "\0", "[[", ".", "\n", '"')), 1)
    return "\n".join(lines)


def _command(*arguments: object) -> None:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        app([str(a) for a in arguments], standalone_mode=False)


def _toml(rng: random.Random, _: Material) -> Iterator[Callable[[], object]]:
    lab = rng.choice(sorted(PROCEDURES))
    documents = {f"{n}.toml": (example(f"{lab}-lab") / f"{n}.toml").read_text() for n in ("bench", "world")}
    documents["procedure.toml"] = rng.choice([PROCEDURES[lab], (example(f"{lab}-lab") / "procedure.toml").read_text()])
    name = rng.choice(sorted(documents))
    documents[name] = edited(documents[name], rng, TOML_VALUES)
    yield lambda: parse_bench(documents["bench.toml"], "bench.toml")
    yield lambda: parse_procedure(documents["procedure.toml"], "procedure.toml")
    yield lambda: plan_of(documents, dry=True)


def _csv(rng: random.Random, material: Material) -> Iterator[Callable[[], object]]:
    names = ["pitch_deg", "roll_deg", "x_V", "y_V", "z_V", "replication", "package_degC"]
    rows = [[repr(rng.gauss(0, 50)) for _ in names] for _ in range(rng.randrange(12))]
    lines = [names, *rows]
    for _ in range(rng.randrange(4)):
        row = rng.choice(lines)
        row[rng.randrange(len(row))] = rng.choice(("", "1_5", "nan", "1e999", '"', "=1+1", "a,b", "\0", "\r", "-", "x"))
    path = material.path("table.csv")
    path.write_text("\n".join(map(",".join, lines)), encoding="utf-8")
    out = material.path("answer.json")
    yield lambda: _command("fit", path, "--out", out)
    yield lambda: _command("fit", path, "--model", "x_V ~ pitch_deg", "--out", out)
    yield lambda: _command("chart", f"{path}@2026-01-01", f"{path}@2026-02-01", "--json")


_WORDS = ("P", "T", "1", "0", "I(", "C(", "log(", "(", ")", ")^2", "^", "*", ":", "+", "-", "/", "~", "1e999", "\u00b2")


def _formula(rng: random.Random, _: Material) -> Iterator[Callable[[], object]]:
    words = [rng.choice(_WORDS) for _ in range(rng.randrange(1, 25))]
    text = "".join(words)
    if rng.random() < 0.2:
        text = rng.choice(("I(", "log(", "(", "")) + rng.choice(("P+", "P*", "-", "(P+T)*", "P:")) * 2000 + "P)"
    table: Mapping[str, Any] = {"P": np.linspace(1, 2, 5), "T": np.array([1.0, 1, 2, 2, 3])}

    def parse() -> None:
        with contextlib.suppress(FormulaError):
            formula = Formula.parse(text)
            str(formula)
            with contextlib.suppress(KeyError, ValueError):
                formula.columns(table)

    effect = json.dumps("".join(rng.choice(("pitch", "+", "**", "sin(", ")", "9", "1e9", "-")) for _ in range(20)))
    fields = dict.fromkeys(("name", "cause", "scope", "stratum", "unit", "separate_by", "usual_size"), '"x"')
    fields |= {"scope": '"sensor"', "stratum": '"between-point"', "columns": f"[{effect}]"}
    written = "[[effect]]\n" + "\n".join(f"{k} = {v}" for k, v in fields.items())

    def effects() -> None:
        with contextlib.suppress(ValueError):
            own_effects(edited(written, rng, TOML_VALUES))

    yield parse
    yield effects


def _calibration(rng: random.Random, material: Material) -> Iterator[Callable[[], object]]:
    content = mutated(material.calibration, rng)
    path = material.path("changed.json")
    path.write_text(json.dumps(content), encoding="utf-8")
    table = material.path("reading.csv")
    table.write_text("x_V,y_V,z_V\n0.1,0.2,0.9\n")
    yield lambda: _command("chart", path, f"{path}@2026-02-01", "--json")
    yield lambda: _command("infer", path, table, "--json")


def rechain(path: Path) -> None:
    """Make hashes of documents, run list and records again, as an attacker does who has read the code."""
    db = sqlite3.connect(path)
    db.execute("PRAGMA synchronous = OFF")
    triggers = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    for name, _ in triggers:
        db.execute(f"DROP TRIGGER {name}")
    rows = db.execute("SELECT * FROM record ORDER BY seq").fetchall()
    previous = GENESIS
    for row in rows:
        record = Record._make(row[1:10])
        with contextlib.suppress(Exception):
            body = record.data
            if row[0] == 1:
                body["documents"] = {n: _digest(t) for n, t in db.execute("SELECT name, body FROM document")}
                db.commit()
                with RunReader.open(path) as reader, contextlib.suppress(Exception):
                    body["run_list"] = reader.run_list_sha256()
            if record.kind == "end" and "head" in body:
                body |= {"head": previous.hex(), "records": row[0] - 1}
            record = record._replace(body=encode(body))
        own = link(previous, row[0], record)
        db.execute(
            "UPDATE record SET body = ?, previous = ?, hash = ? WHERE seq = ?", (record.body, previous, own, row[0])
        )
        previous = own
    for _, sql in triggers:
        db.execute(sql)
    db.commit()
    db.close()


def _attacked(db: sqlite3.Connection, rng: random.Random) -> None:
    """One change of what a run file holds."""
    how = rng.randrange(10)
    if how < 5:
        seq, body = rng.choice(db.execute("SELECT seq, body FROM record").fetchall())
        with contextlib.suppress(ValueError):  # NaN is not JSON
            db.execute("UPDATE record SET body = ? WHERE seq = ?", (encode(mutated(json.loads(body), rng)), seq))
    elif how < 7:
        name, body = rng.choice(db.execute("SELECT name, body FROM document").fetchall())
        db.execute("UPDATE document SET body = ? WHERE name = ?", (edited(body, rng, TOML_VALUES), name))
    elif how == 7:
        column = rng.choice(("run_index", "replication", "whole_plot", "pitch_deg", "pitch_deg_side"))
        db.execute(f"UPDATE point SET {column} = ? WHERE rowid = ?", (rng.choice((-1, 9e9, 2**62, 0.5)), 3))
    elif how == 8:
        column = rng.choice(("kind", "status", "run_index", "attempt", "session", "elapsed_s", "utc_s"))
        value = rng.choice(("end", "session", "accepted", "rejected", "skip", "run", None, -1, 1e300, 2**62))
        db.execute(f"UPDATE record SET {column} = ? WHERE seq = ?", (value, rng.randrange(1, 30)))
    else:
        db.execute("PRAGMA writable_schema = ON")
        of, to = rng.sample(("point", "record", "factor", "document"), 2)
        db.execute(
            "UPDATE sqlite_master SET rootpage = (SELECT rootpage FROM sqlite_master WHERE name = ?) WHERE name = ?",
            (of, to),
        )


def _rechained(rng: random.Random, material: Material) -> Iterator[Callable[[], object]]:
    path = material.path("attacked.sqlite")
    shutil.copy(material.run, path)
    db = sqlite3.connect(path)
    db.execute("PRAGMA synchronous = OFF")
    for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        triggers = db.execute("SELECT sql FROM sqlite_master WHERE name = ?", (name,)).fetchall()
        db.execute(f"DROP TRIGGER {name}")
        db.execute("CREATE TEMP TABLE IF NOT EXISTS kept (sql)")
        db.executemany("INSERT INTO kept VALUES (?)", triggers)
    for _ in range(rng.randrange(1, 3)):
        with contextlib.suppress(sqlite3.Error, UnicodeEncodeError, OverflowError):
            _attacked(db, rng)
    for (sql,) in db.execute("SELECT sql FROM kept").fetchall():
        with contextlib.suppress(sqlite3.Error):
            db.execute(sql)
    with contextlib.suppress(sqlite3.Error):
        db.commit()
    db.close()
    with contextlib.suppress(sqlite3.Error, RigError, UnicodeEncodeError):
        rechain(path)
    return _reading(path, material, rng)


def _reading(path: Path, material: Material, rng: random.Random) -> Iterator[Callable[[], object]]:
    """A few of the commands that read a run file."""
    out = material.path("exported.csv")
    doors: list[tuple[object, ...]] = [
        ("verify", path),
        ("status", path),
        ("status", path, "--json"),
        ("story", path),
        ("export", path, "--out", out, "--all"),
        ("export", path, "--out", out, "--salvage"),
        ("resume", path),
        ("fit", path, "--json"),
        ("service", path),
        ("runs", path.parent),
        ("chart", path, path),
    ]
    for door in rng.sample(doors, 4):
        yield lambda door=door: _command(*door)  # type: ignore[misc]


def _beside(rng: random.Random, material: Material) -> Iterator[Callable[[], object]]:
    path = material.path("attacked.sqlite")
    shutil.copy(material.run, path)
    for suffix in rng.sample(("-wal", "-shm", "-journal", ".head", ".live", ".live.json"), 2):
        beside = path.with_suffix(suffix) if suffix.startswith(".") else path.with_name(path.name + suffix)
        match rng.randrange(4):
            case 0:
                os.mkfifo(beside)
            case 1:
                beside.symlink_to(rng.choice(("/dev/zero", "/dev/null", "/nowhere", "/", str(path))))
            case 2:
                beside.write_bytes(rng.randbytes(rng.choice((0, 32, 40, 5000))))
            case 3:
                beside.write_bytes(path.read_bytes())
    yield from _reading(path, material, rng)


DOORS: Mapping[str, Callable[[random.Random, Material], Iterator[Callable[[], object]]]] = {
    "toml": _toml,
    "csv": _csv,
    "formula": _formula,
    "calibration": _calibration,
    "run": _rechained,
    "beside": _beside,
}


def attack(door: str, seed: int, material: Material, found: Found) -> None:
    """Give a door one input made from a seed, and note what should not be."""

    def too_long(*_: object) -> None:
        raise Hang

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    handler = signal.signal(signal.SIGALRM, too_long)
    found.inputs += 1
    try:
        for act in DOORS[door](random.Random(f"{door} {seed}"), material):
            signal.setitimer(signal.ITIMER_REAL, HANG_S)
            try:
                act()
            except (RigError, _USAGE, OSError, SystemExit, typer.Abort):
                pass
            except Hang:
                found.hangs += 1
                found.examples.setdefault("hang", f"--door {door} --seed {seed}:\n{traceback.format_exc()[-1500:]}")
            except MemoryError:
                found.memory += 1
                found.examples.setdefault("memory", f"--door {door} --seed {seed}")
            except Exception as error:
                found.tracebacks += 1
                last = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}"
                found.examples.setdefault(where, f"--door {door} --seed {seed}:\n{traceback.format_exc()[-1800:]}")
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0)
    finally:
        signal.signal(signal.SIGALRM, handler)
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > MEMORY_KB:
        found.memory += 1
        found.examples.setdefault("memory", f"--door {door} --seed {seed}")
