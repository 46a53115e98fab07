"""Malformed and hostile files through the public readers: one message and a documented exit code, never more.

A bounded, repeatable share; `HYPOTHESIS_PROFILE=long python -m pytest tests/cli/test_fuzz.py` for much more.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_verify import tamper

from proving.crashes.damages import small_finished
from proving.crashes.runs import PROCEDURES
from proving.doors.attack import DOORS, Found, Material, attack
from rig.bench.config import parse_bench, parse_procedure
from rig.errors import ConfigurationError, ExitCode, RigError, RunFileError, UsageError
from rig.examples import example
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.verify.verification import verify_file
from rig.runs.plans import plan_of
from rig.tables import read_any_csv
from rig.tables.csv_files import read_csv
from rig.tables.table_of_run import run_table

LONG = os.environ.get("HYPOTHESIS_PROFILE") == "long"


def share(examples: int) -> settings:
    return settings(
        max_examples=examples * (50 if LONG else 1),
        derandomize=not LONG,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return small_finished("attitude", tmp_path_factory.mktemp("whole"))


@pytest.fixture(autouse=True)
def bounded_memory():
    """No file may make us take half a gigabyte more than we had."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000  # kB


def read_run_file(path: Path) -> None:
    """Everything that reads a run file; what it raises must be meant for people."""
    for read in (_verify, verify_file, _state, run_table, lambda p: run_table(p, salvage=True, everything=True)):
        try:
            read(path)
        except RigError as error:
            assert error.exit_code in (ExitCode.USAGE, ExitCode.FAULT, ExitCode.CONFIGURATION), error
            assert str(error)


def _verify(path: Path) -> None:
    with RunReader.open(path) as reader:
        reader.verify()


def _state(path: Path) -> None:
    with RunReader.open(path) as reader:
        read_state(reader)


def written(tmp_path_factory, content: bytes, suffix: str) -> Path:
    path = tmp_path_factory.getbasetemp() / f"fuzzed{suffix}"
    path.write_bytes(content)
    return path


@share(60)
@given(st.binary(max_size=3000), st.booleans())
def test_bytes_that_are_no_run_file(tmp_path_factory, content, looks_like_one):
    if looks_like_one:
        head = bytearray(100)
        head[:16], head[68:72] = b"SQLite format 3\0", (0x52494721).to_bytes(4, "big")
        head[16:18] = (4096).to_bytes(2, "big")
        content = bytes(head) + content
    read_run_file(written(tmp_path_factory, content, ".sqlite"))


@share(40)
@given(st.integers(0, 2**32), st.integers(1, 40), st.sampled_from(("bits", "runs", "moved", "cut", "grown")))
def test_random_edits_of_a_real_run_file(tmp_path_factory, whole, seed, count, how):
    rng, data = random.Random(seed), bytearray(whole.read_bytes())
    for _ in range(count):
        at, other, length = rng.randrange(len(data)), rng.randrange(len(data)), rng.randrange(1, 3000)
        if how == "bits":
            data[at] ^= 1 << rng.randrange(8)
        elif how == "runs":
            data[at : at + length] = bytes([rng.randrange(256)]) * len(data[at : at + length])
        elif how == "moved":
            data[at : at + length] = data[other : other + length].ljust(length, b"\0")[: len(data[at : at + length])]
    if how == "cut":
        del data[rng.randrange(len(data)) :]
    if how == "grown":
        data += rng.randbytes(5000)
    read_run_file(written(tmp_path_factory, bytes(data), ".sqlite"))


values = st.one_of(
    st.none(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text(max_size=30),
    st.binary(max_size=30),
    st.sampled_from(("[" * 5000, '{"points": 1e400}', '{"documents": []}', "null", "{}", "'", "accepted", "1e999")),
)
places = st.sampled_from(
    [("record", c) for c in ("seq", "session", "kind", "elapsed_s", "utc_s", "run_index", "whole_plot", "attempt")]
    + [("record", c) for c in ("status", "body", "previous", "hash")]
    + [("point", c) for c in ("run_index", "replication", "whole_plot", "pitch_deg", "pitch_deg_side")]
    + [("factor", c) for c in ("position", "name", "axis", "overtravel", "hard", "stays")]
    + [("document", c) for c in ("name", "body")]
)


@share(40)
@given(st.lists(st.tuples(places, values, st.integers(1, 34)), min_size=1, max_size=3))
def test_values_of_any_type_in_any_column(tmp_path_factory, whole, edits):
    path = tmp_path_factory.getbasetemp() / "typed.sqlite"
    shutil.copy(whole, path)
    db = sqlite3.connect(path)
    db.execute("PRAGMA synchronous = OFF")
    for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
        db.execute(f"DROP TRIGGER {name}")
    db.execute("PRAGMA writable_schema = ON")
    schema = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'").fetchall()
    db.execute(
        "UPDATE sqlite_master SET sql = replace(replace(sql, 'STRICT', ''), 'NOT NULL', '') WHERE type = 'table'"
    )
    db.commit()
    db.close()
    db = sqlite3.connect(path)
    for (table, column), value, row in edits:
        try:
            db.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (value, row))
        except (sqlite3.Error, UnicodeEncodeError):
            db.rollback()
    db.execute("PRAGMA writable_schema = ON")
    for name, sql in schema:
        db.execute("UPDATE sqlite_master SET sql = ? WHERE name = ?", (sql, name))
    db.commit()
    db.close()
    read_run_file(path)


@share(120)
@given(
    st.one_of(
        st.binary(max_size=500),
        st.text(alphabet='pitch_deg,roll_x_V"\r\n0123456789.eE+-naif\x00;\t ', max_size=400).map(str.encode),
        st.lists(st.lists(st.one_of(st.floats().map(str), st.text(max_size=8)), max_size=6), max_size=6).map(
            lambda rows: "\n".join(",".join(row) for row in rows).encode("utf-8", "surrogatepass")
        ),
    )
)
def test_tables_that_are_none(tmp_path_factory, content):
    path = written(tmp_path_factory, content, ".csv")
    for read in (read_csv, lambda p: read_any_csv(p, ("x_V",))):
        try:
            table = read(path)
        except UsageError as error:
            assert error.exit_code is ExitCode.USAGE
            assert "\n" not in str(error).replace("\r", "\n") or b"\n" in content or b"\r" in content
        else:
            assert len(table) > 0


TEXTS = {
    "bench": [(example(f"{lab}-lab") / "bench.toml").read_text() for lab in PROCEDURES],
    "procedure": list(PROCEDURES.values()),
    "world": [(example(f"{lab}-lab") / "world.toml").read_text() for lab in PROCEDURES],
}
toml_values = st.sampled_from(
    [
        *("-1", "0", "1e308", "1e-320", "nan", "inf", "-inf", "10" * 200, "99999999999", "1_000_000", "true"),
        *('""', '"x"', '"\\u0000"', '"../../etc"', "[" * 3000, '"' + "x" * 5000 + '"'),
        *("[]", "{}", "{a = 1}", "[[1, 2], [3]]", "1979-05-27"),
    ]
)


def _edited(text: str, edits: list[tuple[int, str, int]]) -> str:
    lines = text.splitlines()
    for place, value, how in edits:
        at = place % len(lines)
        if how == 0 and "=" in lines[at]:
            lines[at] = f"{lines[at].split('=', 1)[0]}= {value}"
        elif how == 1:
            del lines[at]
        elif how == 2:
            lines.insert(at, lines[place // 7 % len(lines)])
        else:
            lines[at] = lines[at].replace("=", value, 1)
        lines = lines or [""]
    return "\n".join(lines)


edits = st.lists(st.tuples(st.integers(0, 10_000), toml_values, st.integers(0, 4)), min_size=1, max_size=4)


@share(150)
@given(st.sampled_from(sorted(TEXTS)), st.integers(0, 1), edits)
def test_configuration_files_edited_at_random(what, which, changes):
    documents = {f"{name}.toml": texts[which] for name, texts in TEXTS.items()}
    documents[f"{what}.toml"] = _edited(documents[f"{what}.toml"], changes)
    try:
        plan = plan_of(documents, dry=True)
        from rig.simulated.dry_run import DryBench  # noqa: PLC0415 - a real run never loads the simulation

        DryBench(plan.bench, plan.truth).close()
    except RigError as error:
        assert error.exit_code in (ExitCode.CONFIGURATION, ExitCode.USAGE), error


@share(100)
@given(st.one_of(st.text(max_size=200), st.text(alphabet="[]{}=\"'\n.,_ab01#-\\", max_size=200)))
def test_text_that_is_no_configuration(text):
    for parse in (parse_bench, parse_procedure):
        with pytest.raises(ConfigurationError):
            parse(text, "file.toml")


def test_a_file_that_verifies_and_makes_no_sense_together_is_one_message(whole, tmp_path):
    path = tmp_path / "rechained.sqlite"
    shutil.copy(whole, path)
    tamper(path, "UPDATE record SET kind = 'end' WHERE seq = 2")
    with RunReader.open(path) as reader, pytest.raises(RunFileError):
        reader.verify()


@pytest.fixture(scope="module")
def material(tmp_path_factory) -> Iterator[Material]:
    made = Material.make(tmp_path_factory.mktemp("material"))
    yield made
    made.close()


FOUND = {
    "calibration": (70229,),
    "contracts": (91, 128, 132),
    "http": (134, 71616),
    "notify": (6,),
    "run": (22353, 22922),
}
"""Seeds that once ended in a traceback."""
SHARE = {
    "toml": 25,
    "csv": 12,
    "formula": 60,
    "calibration": 12,
    "contracts": 5,
    "paths": 6,
    "run": 60,
    "beside": 12,
    "http": 30,
    "notify": 20,
}


@pytest.mark.parametrize("door", sorted(DOORS))
def test_every_door_answers(material, door):
    found = Found()
    for seed in (*FOUND.get(door, ()), *range(1000, 1000 + SHARE[door] * (50 if LONG else 1))):
        attack(door, seed, material, found)
    assert found.inputs >= SHARE[door]
    assert not found.wrong, found.examples
