"""Hostile files at every door: a sentence and a documented exit code, never a traceback, a wait or a full memory."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from pathlib import Path

import pytest
from buses import REGISTER_MAP
from command import rig

from proving.crashes.damages import small_finished
from proving.crashes.runs import PROCEDURES
from proving.doors.hostile import Seeded
from proving.doors.of_pages import Page
from proving.doors.of_runs import Image
from rig.bench.config import parse_bench, parse_procedure, parse_toml, read_text
from rig.errors import ConfigurationError, RigError, RunFileError, UsageError
from rig.examples import example
from rig.files.atomic import check_writable
from rig.fitter.arithmetic_text import FormulaError
from rig.fitter.formula import Formula
from rig.run_file.last_word import read_last_word
from rig.run_file.live import controller_alive
from rig.run_file.read.reader import RunReader
from rig.runs.controller import opened
from rig.runs.plans import plan_of
from rig.sims.faults import read_faults
from rig.sims.physics import WorldError
from rig.simulated.dry_run import twin_class
from rig.tables import read_any_csv, read_gappy_csv, read_table
from rig.unattended.happenings import one_line
from rig.unattended.systemd_unit import ServiceUnit
from rig.verbs.infer import read_calibration
from rig.watch import Shelf
from rig.watch.words import number

BENCH = (example("attitude-lab") / "bench.toml").read_text()
PROCEDURE = PROCEDURES["attitude"]

pytestmark = pytest.mark.timeout(6)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return small_finished("attitude", tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("kind", ["[]", "{}", "3", "[[]]", "1979-05-27"])
def test_a_kind_that_is_no_text(kind):
    with pytest.raises(ConfigurationError, match="is not a kind of procedure"):
        parse_procedure(f"kind = {kind}", "procedure.toml")


@pytest.mark.parametrize("number", ["1" * 5000, "-" + "1" * 5000, "0x" + "f" * 5000, str(2**63)])
def test_integers_that_toml_does_not_have(number):
    with pytest.raises(ConfigurationError, match="whole number"):
        parse_bench(f"a = [{{b = {number}}}]", "bench.toml")


@pytest.mark.parametrize(
    "text", ["a" + ".a" * 20_000 + " = 1", "[a" + ".a" * 20_000 + "]", 'x = {"a"' + ' . "a"' * 20_000 + " = 1}"]
)
def test_keys_nested_20000_deep(text):
    with pytest.raises(ConfigurationError, match="nested too deeply"):
        parse_bench(text, "bench.toml")


def test_words_that_only_look_like_deep_keys_are_read():
    assert parse_toml(f'a = "{"b." * 40}"\nc = {[0.5] * 200}', "x.toml")["c"] == [0.5] * 200


@pytest.mark.parametrize("count", ["1000000000", "10000"])
def test_counts_are_bounded(count):
    roll = 10_000 if count == "10000" else 4
    design = f'[design]\ntype = "D1"\npitch_max_deg = 60\npitch_count = {count}\nroll_count = {roll}\n'
    text = PROCEDURE.partition("[design]")[0] + design
    with pytest.raises(ConfigurationError, match=r"pitch_count|points, more than"):
        parse_procedure(text, "procedure.toml")


@pytest.mark.parametrize("name", ["=1+1", "+x", "-x", "@x", "a\\nb", "a\\u001bb", "a\\u202eb"])
def test_names_are_limited_at_the_door(name):
    plain = "".join(c for c in BENCH.splitlines(keepends=True) if c.startswith("name"))
    with pytest.raises(ConfigurationError, match="a name"):
        parse_bench(BENCH.replace(plain, f'name = "{name}"\n'), "bench.toml")
    with pytest.raises(ConfigurationError, match="a name"):
        parse_bench(BENCH.replace("[sensors.x]", f'[sensors."{name}"]'), "bench.toml")
    named = "\n".join(f'name = "{name}"' if x.startswith("name") else x for x in PROCEDURE.splitlines())
    with pytest.raises(ConfigurationError, match="a name"):
        parse_procedure(named, "procedure.toml")
    assert parse_procedure(named, "a run file", strict=False).name  # what was begun is finished


def test_a_formula_of_2000_operations():
    for text in ("I(" + "x+" * 2000 + "x)", "log(" + "x*" * 2000 + "x)", "x^\u00b2", "x^" + "1" * 5000):
        with pytest.raises(FormulaError):
            Formula.parse(text)
    assert str(Formula.parse("I(" + "x + " * 150 + "x)"))


@pytest.mark.parametrize("cell", ["1_5", "\uff11\uff15"])
def test_numbers_that_only_python_reads(tmp_path, cell):
    path = tmp_path / "t.csv"
    path.write_text(f"pitch_deg,x_V\n{cell},2\n1,2\n", encoding="utf-8")
    with pytest.raises(UsageError, match="is not a number"):
        read_table(path)
    with pytest.raises(UsageError, match="is not a number"):
        read_gappy_csv(path, ["pitch_deg"])
    assert "pitch_deg" in read_any_csv(path, ("x_V",)).text


def test_100000_columns(tmp_path):
    path = tmp_path / "t.csv"
    for cell in ("1", ""):
        path.write_text(",".join(f"c{i}" for i in range(100_000)) + "\n" + ",".join([cell] * 100_000) + "\n")
        with pytest.raises(UsageError, match="100,000 columns"):
            read_table(path)


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
def test_pipes_and_devices_as_any_input(tmp_path, what):
    path = pipe(tmp_path / "pipe") if what == "pipe" else Path(what)
    reads = (read_table, lambda p: read_any_csv(p, ()), read_calibration, RunReader.open, lambda p: read_text(p, "x"))
    for read in reads:
        with pytest.raises(RigError, match="not a regular file"):
            read(path)
    assert not controller_alive(path)


def test_a_pipe_for_the_last_word(tmp_path):
    pipe(tmp_path / "run.head")
    assert read_last_word(tmp_path / "run.sqlite") is None


@pytest.mark.parametrize("suffix", ["-wal", "-shm", "-journal"])
def test_pipes_beside_a_run(whole, tmp_path, suffix):
    path = tmp_path / "run.sqlite"
    shutil.copy(whole, path)
    beside = pipe(path.with_name(path.name + suffix))
    with pytest.raises(RunFileError, match=f"{beside.name} is not a file of .*a named pipe"):
        RunReader.open(path)


def test_a_pipe_in_a_folder_of_runs_keeps_nobody_waiting(whole, tmp_path):
    shutil.copy(whole, tmp_path / "good.sqlite")
    pipe(tmp_path / "pipe.sqlite")
    entries = Shelf(tmp_path, None, lambda: 0.0, lambda: 0.0).entries()
    assert {entry.name for entry in entries} == {"good", "pipe"}


def test_a_path_with_a_newline_makes_no_unit():
    unit = ServiceUnit(Path("/runs/a\nExecStartPre=x/r.sqlite"), "r", "x", system=False, user="u")
    with pytest.raises(UsageError, match="control character"):
        unit.check_paths()


def test_a_dict_for_a_name_in_a_charted_calibration(whole, tmp_path):
    path = tmp_path / "c.json"
    rig("fit", whole, "--out", path)
    content = json.loads(path.read_text())
    content["calibration"]["sensors"][0]["name"] = {"a": 1}
    path.write_text(json.dumps(content))
    done = rig("chart", path, f"{path}@2026-01-01")
    assert (done.returncode, "unforeseen" in done.stderr) == (2, False), done.stderr


def test_a_pipe_to_write_to_keeps_nobody_waiting(tmp_path):
    with pytest.raises(UsageError, match="not a regular file"):
        check_writable(pipe(tmp_path / "answer.csv"))


def test_the_root_folder_is_no_run_file():
    done = rig("verify", "/")
    assert (done.returncode, "unforeseen" in done.stderr) == (2, False), done.stderr


def test_a_register_map_without_what_a_twin_needs():
    text = REGISTER_MAP
    for old, new in (("[codes.alarm_type]", "[codes.other]"), ("[codes.units]", "[codes.other]")):
        lines = (example("pressure-lab") / "bench.toml").read_text().splitlines()
        at = next(n for n, line in enumerate(lines) if '"watlow-f4t"' in line)
        lines.insert(at + 1, f"register_map = {json.dumps(text.replace(old, new))}")
        documents = {"bench.toml": "\n".join(lines), "procedure.toml": PROCEDURES["pressure"]}
        with pytest.raises(ConfigurationError, match="register map"), opened(plan_of(documents, dry=True)):
            pass


def test_a_fault_on_a_table():
    with pytest.raises(WorldError, match="must be an instrument of the bench"):
        read_faults([{"kind": "no-reply", "on": {"a": 1}, "at_s": 5.0}], {"head": twin_class("newport-esp301")})


def test_a_last_word_of_more_records_than_a_file_can_hold(whole, tmp_path):
    path = tmp_path / "run.sqlite"
    shutil.copy(whole, path)
    (tmp_path / "run.head").write_bytes(b"\xff" * 40)
    done = rig("verify", path)
    assert (done.returncode, "unforeseen" in done.stderr) == (1, False), done.stderr
    assert "are missing" in done.stdout + done.stderr


def test_news_of_a_controller_that_are_none(whole, tmp_path):
    path = tmp_path / "run.sqlite"
    image = Image.of(whole)
    image.records = [row for row in image.records[:20] if row[2] != "end"]
    image.rechain()
    image.write(path, Seeded("news", 0), under_way=True)
    (tmp_path / "run.live").write_text(json.dumps({"done": "x", "elapsed_s": 10**400, "state": "settling"}))
    assert number(10**400) is None
    done = rig("resume", path)
    assert "unforeseen" not in done.stderr, done.stderr


def test_a_calibration_with_tables_for_texts(whole, tmp_path):
    path = tmp_path / "c.json"
    rig("fit", whole, "--out", path)
    content = json.loads(path.read_text())
    for name, value in (("run_id", {"a": 1}), ("instruments", {"head": [1]})):
        path.write_text(json.dumps({**content, "data": {**content["data"], name: value}}))
        done = rig("chart", path, f"{path}@2026-01-01")
        assert done.returncode == 2, done.stderr
        assert "is not a calibration file" in done.stderr


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"POST /run/x HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n" + bytes(5000),
        b"HEAD / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nhelloGET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello\0\0\r\n\r\n",
    ],
)
def test_what_follows_a_request_and_is_none(whole, request_bytes):
    page = Page(whole.parent, "")
    try:
        page.answer(request_bytes)  # raises what the server calls an error of its own
        assert b"200 OK" in page.answer(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n", 5.0)
    finally:
        page.close()


def test_a_register_map_nested_too_deeply():
    lines = (example("pressure-lab") / "bench.toml").read_text().splitlines()
    at = next(n for n, line in enumerate(lines) if '"watlow-f4t"' in line)
    lines.insert(at + 1, f'register_map = "a = {"[" * 3000}\\n"')
    with pytest.raises(ConfigurationError, match="nested too deeply"):
        plan_of({"bench.toml": "\n".join(lines), "procedure.toml": PROCEDURES["pressure"]}, dry=True)


@pytest.mark.parametrize("verb", ["hold", "release", "stop"])
def test_requests_to_what_is_no_run_file(tmp_path, verb):
    for path in (pipe(tmp_path / f"{verb}.sqlite"), Path("/"), tmp_path / "gone"):
        done = rig(verb, path)
        assert (done.returncode, "there is no run file" in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize("news", [{"state": "[/] settling"}, {"remaining_s": 10**400}, {"message": "[red]x[/]"}])
def test_what_a_controller_says_is_shown_as_it_is(whole, tmp_path, news):
    path = tmp_path / "run.sqlite"
    shutil.copy(whole, path)
    content = {"state": "settling", "elapsed_s": 5.0, "remaining_s": 3.0, **news}
    (tmp_path / "run.live").write_text(json.dumps(content))
    with path.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        done = rig("status", path)
    assert done.returncode == 0, done.stderr
    assert content["state"] in done.stdout


@pytest.mark.parametrize("hidden", ["\u202e", "\u061c", "\ufeff", "\U000e0041", "\ud800", "\x9b", "\u2028"])
def test_what_servers_say_has_no_characters_that_turn_or_move_text(hidden):
    assert one_line(f"550 {hidden * 3}no") == "550  no"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("part_number =", "part_numb =", "knows no part_number"),
        ("process_value =", "process =", "knows no process_value"),
        ('type = "text:15"', 'type = "int32"', "part_number, which is a text, as a number"),
        ('codes = "mode"', 'codes = "moods"', "codes of moods, which are missing"),
    ],
)
def test_a_register_map_without_what_the_driver_needs(old, new, said):
    lines = (example("pressure-lab") / "bench.toml").read_text().splitlines()
    at = next(n for n, line in enumerate(lines) if '"watlow-f4t"' in line)
    lines.insert(at + 1, f"register_map = {json.dumps(REGISTER_MAP.replace(old, new))}")
    with pytest.raises(ConfigurationError, match=said):
        plan_of({"bench.toml": "\n".join(lines), "procedure.toml": PROCEDURES["pressure"]}, dry=True)
