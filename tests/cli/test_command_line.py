"""The command line as a person meets it: one clear message, the documented exit code, nothing half-written."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from command import in_its_own_process, rig
from dry import LAB, SHORT, dry, write_short
from few_sensors import with_sensors

from rig.examples import example

BENCH = (LAB / "bench.toml").read_text()


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


@pytest.mark.parametrize(
    ("bench", "procedure", "code", "says"),
    [
        (BENCH.replace("newport-esp301", "newport-esp300"), SHORT, 78, "driver 'newport-esp300' is not known"),
        (BENCH.replace("nplc = 10", "nplc = 11"), SHORT, 78, "instruments.scanner: nplc"),
        (BENCH.replace("nplc = 10", "nlpc = 10"), SHORT, 78, "did you mean nplc?"),
        (BENCH.replace("[-185, 185]", "[-60, 60]"), SHORT, 78, "pitch_deg = -90, outside -60 to 60 (bench limits)"),
        (BENCH.replace("pitch_deg = [", "pich_deg = ["), SHORT, 78, "limits nothing: did you mean pitch_deg"),
        (BENCH, SHORT.replace("setpoint_degC = 23", "setpoint_degC = 50"), 78, "(bench limits of enclosure)"),
        (BENCH + "\n[[[", SHORT, 78, "not valid TOML"),
        (BENCH, SHORT.replace("replications = 2", "replications = 0"), 78, "replications"),
        (
            BENCH.replace('channel = "104"', 'channel = "104"\nplace = "lab"'),
            SHORT + "[model]\ntemperature = true\n",
            78,
            "no temperature in the package is read",
        ),
        (BENCH, "kind = 'tea'", 78, "is not a kind of procedure"),
        (BENCH.replace('channel = "103"', 'channel = "309"'), SHORT, 78, "no channel 309"),
        (BENCH.replace("[sensors.x]", "[sensors.pitch]"), SHORT, 78, "a table has pitch_deg already"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_explained_and_nothing_is_left_behind(tmp_path, bench, procedure, code, says):
    (tmp_path / "bench.toml").write_text(bench)
    write_short(tmp_path, procedure)
    before = files(tmp_path)
    done = rig("run", "short.toml", "--bench", "bench.toml", "--dry", cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert files(tmp_path) == before


def test_a_wrong_world_is_explained(tmp_path):
    write_short(tmp_path)
    (tmp_path / "world.toml").write_text("[effects.isolation_pads]\nx = 1\n")
    done = rig("run", "short.toml", "--bench", LAB / "bench.toml", "--dry", "--world", "world.toml", cwd=tmp_path)
    assert done.returncode == 78
    assert "isolation_pads" in done.stderr
    assert "isolation_pad" in done.stderr
    assert not (tmp_path / "runs").exists()


def test_an_unreachable_instrument_is_named_with_its_address_and_nothing_is_left_behind(tmp_path):
    write_short(tmp_path)
    done = rig("run", "short.toml", "--bench", LAB / "bench.toml", cwd=tmp_path)
    assert done.returncode == 1
    assert "head at /dev/rig/head cannot be opened" in done.stderr
    assert files(tmp_path) == {"short.toml"}


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("run",), 2, "Missing argument"),
        (("run", "none.toml", "--bench", "none.toml"), 78, "bench file none.toml does not exist"),
        (("fit", "none.csv"), 2, "there is no file none.csv"),
        (("trace", "."), 2, "is a folder"),
        (("resume", "none.sqlite"), 2, "there is no run file none.sqlite"),
        (("status", "short.toml"), 2, "is not a run file"),
        (("verify", "short.toml"), 2, "is not a run file"),
        (("export", "short.toml", "--out", "x.csv"), 2, "is not a run file"),
        (("hold", "none.sqlite"), 2, "there is no run file"),
        (("run", "short.toml", "--bench", "short.toml", "--world", "w.toml"), 2, "--world"),
        (("nonsense",), 2, "No such command"),
    ],
)
def test_misuse_is_one_message_and_an_exit_code(tmp_path, arguments, code, says):
    write_short(tmp_path)
    done = rig(*arguments, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert files(tmp_path) == {"short.toml"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run of one sensor: pictures are what takes time."""
    bench, world = with_sensors(LAB, tmp_path_factory.mktemp("bench"), "x")
    return dry(tmp_path_factory.mktemp("finished"), bench=bench, world=world)


def test_what_a_finished_run_answers(finished, tmp_path):
    status = json.loads(rig("status", finished, "--json", cwd=tmp_path).stdout)
    assert status["state"] == "complete"
    assert status["accepted"] == status["points"] == 30
    assert status["acceptance"] is None
    assert rig("verify", finished, cwd=tmp_path).returncode == 0
    resumed = rig("resume", finished, cwd=tmp_path)
    assert resumed.returncode == 0
    assert "nothing to resume" in resumed.stderr
    assert rig("hold", finished, cwd=tmp_path).returncode == 2
    exported = rig("export", finished, "--out", "data.csv", cwd=tmp_path)
    assert exported.returncode == 0
    assert "SIMULATED" in exported.stderr
    from_run = json.loads(rig("fit", finished, "--json", cwd=tmp_path).stdout)
    from_table = json.loads(rig("fit", "data.csv", "--json", cwd=tmp_path).stdout)
    assert from_run["data"]["simulated"]
    assert from_run["sensors"] == from_table["sensors"]


def test_simulated_is_said_wherever_a_simulated_run_is_shown(finished, tmp_path):
    for arguments in (("status", finished), ("fit", finished), ("trace", finished, "--report", "r.html")):
        done = rig(*arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "SIMULATED" in done.stdout
    assert "SIMULATED" in (tmp_path / "r.html").read_text()
    assert rig("verify", finished, cwd=tmp_path).stdout.startswith("SIMULATED")
    rig("export", finished, "--out", "data.csv", cwd=tmp_path)
    assert rig("fit", "data.csv", cwd=tmp_path).stdout.startswith("SIMULATED")


def test_an_edited_run_file_is_refused_by_resume_and_named_by_verify(tmp_path):
    path = dry(tmp_path)
    changed = bytearray(path.read_bytes())
    at = changed.rfind(b'"mean":')
    digit = next(i for i in range(at + 7, at + 30) if changed[i : i + 1].isdigit())
    changed[digit] = ord("1") if changed[digit] != ord("1") else ord("2")
    path.write_bytes(bytes(changed))
    for command in ("verify", "resume", "fit", "trace"):
        done = rig(command, path, cwd=tmp_path)
        assert done.returncode == 1
        assert "was changed after it was written" in done.stderr
    refused = rig("export", path, "--out", "data.csv", cwd=tmp_path)
    assert refused.returncode == 1
    assert "--salvage" in refused.stderr
    saved = rig("export", path, "--salvage", "--out", "data.csv", cwd=tmp_path)
    assert saved.returncode == 0
    assert "NOT VERIFIED" in saved.stderr
    assert len((tmp_path / "data.csv").read_text().splitlines()) == 31


def test_a_finished_run_is_not_changed_by_resume_and_no_run_file_is_overwritten(finished, tmp_path):
    before = finished.read_bytes()
    assert rig("resume", finished, cwd=tmp_path).returncode == 0
    for arguments in (
        ("export", finished, "--out", finished),
        ("fit", finished, "--out", finished),
        ("trace", finished, "--report", finished),
    ):
        done = rig(*arguments, cwd=tmp_path)
        assert done.returncode == 2
        assert "is not overwritten" in done.stderr
    assert finished.read_bytes() == before
    assert {p.name for p in finished.parent.iterdir()} == {finished.name, "short.toml"}


def test_rig_sim_writes_over_no_file_of_yours(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH)
    done = rig("sim", "bench.toml", "--live", "bench.toml", "--for", 1, cwd=tmp_path)
    assert done.returncode == 1
    assert "bench.toml exists" in done.stderr
    assert (tmp_path / "bench.toml").read_text() == BENCH


def test_what_a_lost_log_took_is_said(tmp_path):
    write_short(tmp_path)
    arguments = ("run", "short.toml", "--bench", LAB / "bench.toml", "--dry", "--kill-at-point", 12)
    done = in_its_own_process(*arguments, cwd=tmp_path)
    assert done.returncode == -9
    path = tmp_path / done.stdout.strip()
    path.with_name(path.name + "-wal").unlink()
    live = json.loads(path.with_suffix(".live").read_text())
    path.with_suffix(".live").write_text(json.dumps({**live, "done": 12}))
    resumed = rig("resume", path, cwd=tmp_path)
    assert resumed.returncode == 0
    assert "12 are lost (was its -wal file removed?)" in resumed.stderr


def test_a_dry_run_stays_dry_whatever_bench_it_was_given(tmp_path):
    write_short(tmp_path)
    (tmp_path / "bench.toml").write_text(
        BENCH.replace('name = "attitude-lab"', 'name = "attitude-lab"\nsimulated = true')
        + "\n[live]\nspeed = 10\nepoch_utc = 0\nstarted_utc = 0\n"
    )
    arguments = ("run", "short.toml", "--bench", "bench.toml", "--dry", "--kill-at-point", 12)
    done = in_its_own_process(*arguments, cwd=tmp_path)
    assert done.returncode == -9
    resumed = rig("resume", done.stdout.strip(), cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr


def test_names_are_text_and_not_markup(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH.replace('name = "attitude-lab"', 'name = "lab [/x]"'))
    write_short(tmp_path, SHORT.replace('name = "short"', 'name = "short [/y] [bold"'))
    done = rig("run", "short.toml", "--bench", "bench.toml", "--dry", cwd=tmp_path)
    assert done.returncode == 0
    for arguments in (("status", done.stdout.strip()), ("fit", done.stdout.strip()), ("trace", done.stdout.strip())):
        shown = rig(*arguments, cwd=tmp_path)
        assert shown.returncode == 0, shown.stderr
    assert "short [/y] [bold on lab [/x]" in rig("status", done.stdout.strip(), cwd=tmp_path).stdout


def test_a_sensors_axis_is_the_benchs_and_temperature_is_not_required(tmp_path):
    """A sensor named zed along y, and a bench that records no temperature."""
    text = BENCH.replace("[sensors.y]", "[sensors.zed]")
    start, end = text.index("[temperatures"), text.index("# Checked on the whole run list")
    (tmp_path / "bench.toml").write_text(text[:start] + text[end:])
    write_short(tmp_path)
    done = rig("run", "short.toml", "--bench", "bench.toml", "--dry", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    fitted = json.loads(rig("fit", done.stdout.strip(), "--json", cwd=tmp_path).stdout)
    assert fitted["sensors"]["zed_V"]["model"] == "attitude-y"
    assert fitted["sensors"]["zed_V"]["parameters"]["Omega_deg"]["estimate"] < 5


@pytest.mark.parametrize("body", ["garbage", "{}", "[]"])
def test_nonsense_in_a_run_file_is_called_an_edit_by_every_command(tmp_path, body):
    path = dry(tmp_path)
    with sqlite3.connect(path) as db:
        for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f"DROP TRIGGER {name}")
        db.execute("UPDATE record SET body = ? WHERE kind IN ('run', 'observation')", (body,))
    db.close()
    for arguments in (("status", path), ("verify", path), ("resume", path), ("fit", path)):
        done = rig(*arguments, cwd=tmp_path)
        assert done.returncode == 1
        assert "was edited or damaged: record 1 (run) was changed" in done.stderr
        assert "unforeseen" not in done.stderr


def test_outside_acceptance_ends_with_3_and_a_complete_run(tmp_path):
    write_short(tmp_path, SHORT + "[acceptance]\nsigma_E_deg = 1e-9\n")
    done = rig("run", "short.toml", "--bench", LAB / "bench.toml", "--dry", cwd=tmp_path)
    assert done.returncode == 3
    assert "outside acceptance" in done.stderr
    status = json.loads(rig("status", done.stdout.strip(), "--json", cwd=tmp_path).stdout)
    assert status["state"] == "complete"
    assert status["acceptance"]["inside"] is False
    assert set(status["acceptance"]["sensors"]) == {"x_V", "y_V", "z_V"}
    (finished,) = [line for line in done.stderr.splitlines() if line.startswith("x_V is outside acceptance")]
    assert f"  {finished}" in rig("status", done.stdout.strip(), cwd=tmp_path).stdout.splitlines()


def test_on_a_terminal_the_run_files_path_still_goes_to_stdout(tmp_path):
    """The progress bar lives on stderr, which is a terminal here, and leaves stdout alone."""
    write_short(tmp_path, SHORT.replace("replications = 2", "replications = 1"))
    master, terminal = pty.openpty()
    command = [sys.executable, "-m", "rig", "run", "short.toml", "--bench", str(LAB / "bench.toml"), "--dry"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=terminal, text=True, cwd=tmp_path) as process:
        os.close(terminal)
        shown = bytearray()
        with contextlib.suppress(OSError):  # how a pseudo-terminal says that its other end has closed
            while chunk := os.read(master, 4096):
                shown += chunk
        out = process.communicate()[0]
    os.close(master)
    assert process.returncode == 0
    assert (tmp_path / out.splitlines()[0]).exists()
    assert out.count("\n") == 1
    assert b"15/15 points" in shown


def test_the_evening_question(tmp_path):
    lab = example("attitude-lab")
    done = rig("plan", lab / "procedure.toml", "--bench", lab / "bench.toml", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["points"] == 13 * 25 * 6
    assert 15 * 3600 < answer["seconds"]["total"] < 25 * 3600
    assert answer["seconds"]["total"] < answer["seconds"]["latest"]
    assert answer["overdue"] == [] or "calibration is due" in answer["overdue"][0]
    assert files(tmp_path) == set()


def test_a_reader_that_has_seen_enough_is_no_fault(finished):
    command = [sys.executable, "-m", "rig", "fit", str(finished)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        said = process.stderr.read().decode()
        assert process.wait() == 0, said
    assert "Traceback" not in said
    assert "unforeseen" not in said


def test_ctrl_c_where_nothing_runs_says_so_and_ends_with_its_code(monkeypatch):
    def interrupted(**_):
        raise KeyboardInterrupt

    monkeypatch.setattr("rig.cli._command", lambda: interrupted)
    done = rig("status")
    assert (done.returncode, done.stderr) == (75, "rig: interrupted\n")


_WHILE_LOADED = """
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "typer":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
"""
_AT_THE_END = "atexit.register(os.kill, os.getpid(), signal.SIGHUP)"


@pytest.mark.parametrize(
    ("when", "code", "says"), [(_WHILE_LOADED, -signal.SIGINT, ""), (_AT_THE_END, 2, "no run file")]
)
def test_a_signal_before_the_command_is_there_or_after_its_end(when, code, says):
    # a process begun in the background of a shell ignores SIGINT, and so do those that it begins
    script = f"""import atexit, os, runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
{when}
sys.argv = ["rig", "verify", "nowhere.sqlite"]
runpy.run_module("rig", run_name="__main__")"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=30)
    assert (ended.returncode, ended.stdout) == (code, "")
    assert says in ended.stderr
    assert bool(ended.stderr) == bool(says)


def closed(stream, *arguments, cwd):
    """`rig` in a shell that closes a standard stream; what the others said."""
    command = f'exec {sys.executable} -m rig "$@" {stream}&-'
    return subprocess.run(
        ["sh", "-c", command, "rig", *map(str, arguments)], capture_output=True, text=True, check=False, cwd=cwd
    )


@pytest.mark.parametrize("as_json", [(), ("--json",)])
def test_a_result_that_goes_nowhere_is_no_success(finished, tmp_path, as_json):
    done = closed("1>", "status", finished, *as_json, cwd=tmp_path)
    assert done.returncode == 1
    assert "the standard output is closed, so the result is lost: send it to a file" in done.stderr
    assert "unforeseen" not in done.stderr


def test_a_run_does_not_need_a_standard_output(tmp_path):
    done = closed("1>", "run", write_short(tmp_path), "--bench", LAB / "bench.toml", "--dry", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (run,) = (tmp_path / "runs").glob("*.sqlite")
    assert rig("verify", run).returncode == 0


def test_messages_do_not_go_among_results_where_their_stream_is_closed(tmp_path):
    done = closed("2>", "fit", "none.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")


def test_a_question_without_anybody_to_answer_is_no_unforeseen_error(finished, tmp_path):
    done = closed("0<", "confirm", finished, "--list", cwd=tmp_path)
    assert "unforeseen" not in done.stderr
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "arguments", [("trace", "a" * 300), ("fit", "a" * 5000), ("status", "a" * 300), ("chart", "a" * 300, "b")]
)
def test_a_name_that_is_too_long_is_a_matter_of_the_command(tmp_path, arguments):
    done = rig(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "too long" in done.stderr


def test_a_calibration_that_is_no_text_is_said_in_words(tmp_path):
    (tmp_path / "c.json").write_bytes(b'{"data": "\x90"}')
    done = rig("infer", "c.json", "data.csv", "-o", "o.csv", cwd=tmp_path)
    assert (done.returncode, "it is not UTF-8 text (byte 10)" in done.stderr) == (2, True), done.stderr
