"""`rig verify`: every break is found and named, and a hostile file can do nothing."""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
from pathlib import Path

import pytest
from command import rig

from proving.crashes.damages import small_finished
from rig.errors import RigError, RunFileError
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    return small_finished("attitude", tmp_path_factory.mktemp("finished"))


@pytest.fixture
def run_file(finished, tmp_path) -> Path:
    path = tmp_path / "a-run.sqlite"
    shutil.copy(finished, path)
    return path


def tamper(path: Path, *statements: str) -> None:
    """Change a run file behind its back; its triggers are put back."""
    db = sqlite3.connect(path)
    db.execute("PRAGMA synchronous = OFF")
    triggers = db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'").fetchall()
    for name, _ in triggers:
        db.execute(f"DROP TRIGGER {name}")
    for statement in statements:
        db.execute(statement)
    for _, sql in triggers:
        with contextlib.suppress(sqlite3.OperationalError):  # what became of its table has none
            db.execute(sql)
    db.commit()
    db.close()


def test_a_whole_file_is_whole_and_its_head_is_printed(run_file):
    done = rig("verify", run_file)
    assert done.returncode == 0
    with RunReader.open(run_file) as reader:
        count, head = reader.head()
    assert f"{count} records, chain unbroken, head {head.hex()}" in done.stdout
    told = json.loads(rig("verify", run_file, "--json", "--head", head.hex()[:16]).stdout)
    assert (told["whole"], told["records"], told["head"], told["findings"]) == (True, count, head.hex(), [])


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("UPDATE record SET status = 'rejected' WHERE seq = 20", "status was 'accepted'"),
        ("UPDATE record SET kind = 'fault' WHERE seq = 20", "kind was 'observation'"),
        ("UPDATE record SET run_index = NULL WHERE seq = 20", "run_index was 10"),
        ("UPDATE record SET body = replace(body, '1', '2') WHERE seq = 20", "elapsed_s, utc_s or body"),
        ("UPDATE record SET previous = x'00' WHERE seq = 20", "its column previous"),
        ("UPDATE record SET hash = x'00' WHERE seq = 20", "its column hash"),
        ("DELETE FROM record WHERE seq BETWEEN 12 AND 14", "records 12 to 14 are missing"),
        ("UPDATE record SET seq = seq + 1000 WHERE seq = (SELECT max(seq) FROM record)", "are missing"),
        ("UPDATE point SET pitch_deg = 12 WHERE run_index = 3", "point 3: pitch_deg is 12.0, the run began with -20.0"),
        ("DELETE FROM point WHERE run_index = 23", "point 23 is missing"),
        ("UPDATE factor SET overtravel = 9", "factor pitch_deg is"),
        ("UPDATE factor SET stays = 2 WHERE position = 1", "factor roll_deg: stays is 2, which is neither 0 nor 1"),
        ("UPDATE factor SET position = 5 WHERE position = 1", "factor roll_deg: position is 5, the run began with 1"),
        ("UPDATE document SET body = body || ' ' WHERE name = 'bench.toml'", "document bench.toml is not the one"),
        ("DELETE FROM document WHERE name = 'world.toml'", "document world.toml is missing"),
        ("INSERT INTO document VALUES ('notes.toml', '')", "document notes.toml was added"),
        ("DROP INDEX one_accepted_observation", "index one_accepted_observation is missing"),
        ("CREATE TRIGGER t AFTER INSERT ON record BEGIN SELECT 1; END", "trigger t was added"),
        ("CREATE VIEW v AS SELECT 1", "view v was added"),
    ],
)
def test_what_was_changed_is_named(run_file, statement, says):
    tamper(run_file, statement)
    done = rig("verify", run_file)
    assert done.returncode == 1
    assert says in done.stdout
    assert "was edited or damaged: " in done.stderr
    assert "rig export" in done.stderr
    with RunReader.open(run_file) as reader, pytest.raises(RunFileError, match="rig verify"):
        reader.verify()


def test_a_dropped_trigger_is_tampering_too(run_file):
    db = sqlite3.connect(run_file)
    db.execute("DROP TRIGGER record_refuses_update")
    db.close()
    assert "trigger record_refuses_update is missing" in rig("verify", run_file).stdout


def test_a_flipped_bit_is_found_to_the_character(run_file):
    db = sqlite3.connect(run_file)
    (body,) = db.execute("SELECT body FROM record WHERE seq = 20").fetchone()
    db.close()
    at = body.index("mean") + 1
    flipped = body[:at] + chr(ord(body[at]) ^ 2) + body[at + 1 :]
    tamper(run_file, f"UPDATE record SET body = '{flipped}' WHERE seq = 20")
    assert f"one bit of body, in character {at + 1}" in rig("verify", run_file).stdout


def test_all_breaks_are_told_and_not_only_the_first(run_file):
    tamper(
        run_file,
        "UPDATE record SET attempt = 9 WHERE seq = 30",
        "DELETE FROM record WHERE seq = 12",
        "UPDATE record SET body = replace(body, '1', '2') WHERE seq = 20",
        "UPDATE point SET roll_deg_side = 0 WHERE run_index = 5",
        "UPDATE document SET body = '' WHERE name = 'world.toml'",
        "DROP INDEX one_accepted_observation",
    )
    done = rig("verify", run_file, "--json")
    told = json.loads(done.stdout)
    assert done.returncode == 1
    found = {(f["where"], f["record"], f["point"], f["column"], f["name"]) for f in told["findings"]}
    assert found == {
        ("record", 13, None, None, None),
        ("record", 20, 10, None, None),
        ("record", 30, 20, "attempt", None),
        ("run list", None, 5, "roll_deg_side", None),
        ("document", None, None, None, "document world.toml"),
        ("schema", None, None, None, "index one_accepted_observation"),
    }, told["findings"]


def test_a_cut_tail_and_a_rewritten_chain_show_against_the_head(run_file):
    with RunReader.open(run_file) as reader:
        _, head = reader.head()
    tamper(run_file, "DELETE FROM record WHERE seq > 30")
    assert rig("verify", run_file).returncode == 0  # nothing in the file itself tells
    done = rig("verify", run_file, "--head", head.hex())
    assert done.returncode == 1
    assert "records were cut off at the end, or the chain was written again" in done.stdout
    with RunReader.open(run_file) as reader:
        earlier = next(own for seq, _, _, own in reader.chained() if seq == 25)
    done = rig("verify", run_file, "--head", earlier.hex())
    assert done.returncode == 0
    assert "head given is that of record 25; 5 record(s) follow" in done.stdout
    assert rig("verify", run_file, "--head", "night").returncode == 2


def test_an_observation_accepted_twice_is_named(run_file):
    db = sqlite3.connect(run_file)
    (body, index) = db.execute("SELECT body, run_index FROM record WHERE seq = 20").fetchone()
    db.close()
    tamper(
        run_file,
        "DROP INDEX one_accepted_observation",
        f"UPDATE record SET run_index = {index}, body = '{body}' WHERE seq = 21",
    )
    assert "several accepted observations: records 20,21" in rig("verify", run_file).stdout


HOSTILE = {
    "view in place of a table": (
        "ALTER TABLE record RENAME TO hidden",
        "CREATE VIEW record AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) "
        "SELECT x AS seq, 0 AS session, 'event' AS kind, 0.0 AS elapsed_s, 0.0 AS utc_s, NULL AS run_index, "
        "NULL AS whole_plot, NULL AS attempt, NULL AS status, '{}' AS body, x'' AS previous, x'' AS hash FROM c",
    ),
    "virtual table in place of a table": ("DROP TABLE record", "CREATE VIRTUAL TABLE record USING fts5(seq, body)"),
    "computed column": (
        "ALTER TABLE document RENAME TO hidden",
        "CREATE TABLE document (name TEXT PRIMARY KEY, body TEXT AS (hex(zeroblob(100000000))))",
    ),
    "index on an expression that takes for ever": ("CREATE INDEX slow ON record (length(hex(zeroblob(1000 + seq))))",),
    "many objects": tuple(f"CREATE TABLE extra_{i} (x)" for i in range(300)),
    "a factor's name that is SQL": ("UPDATE factor SET name = 'x\" REAL); DROP TABLE record; --'",),
    "a schema that is edited": (
        "PRAGMA writable_schema = ON",
        "UPDATE sqlite_master SET sql = 'CREATE TABLE record (seq INTEGER PRIMARY KEY, body TEXT)' "
        "WHERE name = 'record'",
    ),
    "text that is a number": (
        "PRAGMA writable_schema = ON",
        "UPDATE sqlite_master SET sql = replace(sql, 'STRICT', '') WHERE name = 'record'",
    ),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_file_does_nothing_and_is_refused(run_file, what):
    tamper(run_file, *HOSTILE[what])
    for command in ("verify", "status", "export", "resume"):
        more = ("--out", run_file.with_suffix(".csv")) if command == "export" else ()
        done = rig(command, run_file, *more)
        if command in ("verify", "resume", "export"):
            assert done.returncode == 1, (command, done)
        assert "unforeseen" not in done.stderr, (command, done)
        assert "Traceback" not in done.stderr


def test_pages_that_point_to_one_another_do_not_hold_a_reader_up(run_file):
    # A tree of which every branch is the same page has more rows than there are atoms; the file stays small.
    db = sqlite3.connect(run_file)
    (root,) = db.execute("SELECT rootpage FROM sqlite_master WHERE name = 'record'").fetchone()
    db.close()
    data = bytearray(run_file.read_bytes())
    size = int.from_bytes(data[16:18], "big")
    page, pages = data[(root - 1) * size : root * size], len(data) // size
    leaf = next(p for p in range(2, pages + 1) if data[(p - 1) * size] == 13 and p != root)
    below = leaf
    for level in range(6):
        at = root if level == 5 else pages + 1 + level
        cells = [below.to_bytes(4, "big") + bytes([0x81, i % 128]) for i in range(400)]
        page = bytearray(size)
        page[0], page[3:5] = 5, len(cells).to_bytes(2, "big")
        page[8:12] = below.to_bytes(4, "big")
        end = size
        for i, cell in enumerate(cells):
            end -= len(cell)
            page[end : end + len(cell)] = cell
            page[12 + 2 * i : 14 + 2 * i] = end.to_bytes(2, "big")
        page[5:7] = end.to_bytes(2, "big")
        if at > len(data) // size:
            data += page
        else:
            data[(at - 1) * size : at * size] = page
        below = at
    data[28:32] = (len(data) // size).to_bytes(4, "big")
    run_file.write_bytes(bytes(data))
    assert rig("verify", run_file).returncode == 1
    assert rig("status", run_file).returncode == 1


def test_names_with_markup_come_out_as_they_are(run_file):
    tamper(run_file, "INSERT INTO document VALUES ('[red]<b>\x1b[2Jx', '<script>')")
    done = rig("verify", run_file)
    assert "[red]<b>" in done.stdout
    assert "\x1b" not in done.stdout + done.stderr


def test_bodies_that_are_bombs_are_one_message(run_file):
    for body in ("[" * 100_000, '{"a":' * 50_000, "1" * 10_000, '{"points": 1e999}', "null", '"x"', "\\u0000"):
        path = run_file.with_name("bomb.sqlite")
        shutil.copy(run_file, path)
        tamper(path, f"UPDATE record SET body = '{body}' WHERE seq = 1")
        assert not verify_file(path).whole
        assert "unforeseen" not in rig("status", path).stderr
        with pytest.raises(RigError), RunReader.open(path) as reader:
            reader.verify()
