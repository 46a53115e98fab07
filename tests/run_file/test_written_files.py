"""What a command writes: where a link leads, never over what it reads or another result, and all of it or nothing."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from unittest.mock import patch

import pytest
from command import rig
from dry import LAB, dry
from small_run import write_small

from proving.truth import whole_plot as whole_plot_truth
from rig.errors import UsageError
from rig.files.atomic import check_files, check_writable, write_whole
from rig.run_file.live import live_path, read_json, replace_json, request_path, send_request
from rig.tables import write_csv
from rig.tables.faults import COLUMNS


def files(folder):
    return {path.name for path in folder.iterdir()}


def put(path, text="new"):
    write_whole(path, lambda file: file.write(text))


def test_a_link_stays_and_the_file_it_leads_to_is_written(tmp_path):
    folder = tmp_path / "far"
    folder.mkdir()
    for name, target in (("old.csv", "far/old.csv"), ("twice.csv", "old.csv"), ("none.csv", folder / "none.csv")):
        (tmp_path / name).symlink_to(target)
    (folder / "old.csv").write_text("old")
    put(tmp_path / "twice.csv")
    put(tmp_path / "none.csv")
    assert all((tmp_path / name).is_symlink() for name in ("old.csv", "twice.csv", "none.csv"))
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"old.csv": "new", "none.csv": "new"}


@pytest.mark.parametrize(
    ("name", "leads_to", "says"),
    [
        ("stdout", "/proc/self/fd/{fd}", "is not a regular file"),
        ("device", "/dev/null", "is not a regular file"),
        ("loop", "loop", "symbolic links"),
        ("lost", "there/is/no.csv", "does not exist"),
    ],
)
def test_a_link_that_leads_to_no_file_is_refused_and_stays(tmp_path, name, leads_to, says):
    cap = tmp_path / "cap.txt"
    with cap.open("w") as held:
        link = tmp_path / name
        link.symlink_to(leads_to.format(fd=held.fileno()))
        with pytest.raises(UsageError, match=says):
            put(link)
    assert link.is_symlink()
    assert cap.read_text() == ""
    assert files(tmp_path) == {name, "cap.txt"}


def test_the_standard_output_of_another_name_is_refused(tmp_path):
    with pytest.raises(UsageError, match="is not a regular file"):
        check_writable(Path("/dev/stdout"))


def test_a_files_mode_stays(tmp_path):
    path = tmp_path / "private.csv"
    for mode in (0o600, 0o664):
        path.write_text("old")
        path.chmod(mode)
        put(path)
        assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new", mode)


def test_a_write_protected_file_is_refused(tmp_path):
    path = tmp_path / "kept.csv"
    path.write_text("old")
    path.chmod(0o400)
    with pytest.raises(UsageError, match="write-protected; choose another name, or make it writable"):
        put(path)
    assert path.read_text() == "old"


@pytest.mark.parametrize("length", [245, 255])
def test_a_name_may_be_as_long_as_the_file_system_lets_it(tmp_path, length):
    path = tmp_path / ("a" * (length - 4) + ".csv")
    put(path)
    assert path.read_text() == "new"
    assert files(tmp_path) == {path.name}


def test_a_name_that_is_too_long_is_refused_with_a_way_out(tmp_path):
    with pytest.raises(UsageError, match="cannot be written: File name too long; choose another name"):
        put(tmp_path / ("a" * 256))


def test_nothing_is_left_behind_where_writing_is_interrupted(tmp_path):
    def stopped(file):
        file.write("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a.csv", stopped)
    assert files(tmp_path) == set()


def test_the_name_is_given_when_the_content_is_on_the_disk(tmp_path):
    done = []
    with (
        patch("os.fsync", lambda file: done.append(("synced", os.fstat(file).st_size))),
        patch("os.replace", lambda *_: done.append(("named", 0))),
    ):
        put(tmp_path / "a.csv", "four")
    assert done == [("synced", 4), ("named", 0)]


def test_one_file_twice_is_refused_however_it_is_named(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "link").symlink_to("a.x")
    for other in ("a.x", "sub/../a.x", "link"):
        with pytest.raises(UsageError, match="are the same file"):
            check_files([tmp_path / "a.x", None, tmp_path / other], [])
    check_files([tmp_path / "a.x", tmp_path / "b.x"], [])


def test_what_is_read_through_a_link_is_not_overwritten(tmp_path):
    (tmp_path / "data.csv").write_text("x\n1\n")
    (tmp_path / "link").symlink_to("data.csv")
    with pytest.raises(UsageError, match="is an input"):
        check_files([tmp_path / "link"], [tmp_path / "data.csv"])


def test_the_log_of_a_run_file_is_not_overwritten(tmp_path):
    run = tmp_path / "r.sqlite"
    run.write_bytes(b"SQLite format 3\0")
    for beside in ("r.sqlite-wal", "r.sqlite-shm", "r.sqlite-journal", "r.head", "r.live", "r.request"):
        with pytest.raises(UsageError, match="is a run file or belongs to one, and is not overwritten"):
            check_writable(tmp_path / beside)
    assert check_writable(tmp_path / "other-wal") == tmp_path / "other-wal"


def test_a_report_and_a_calibration_in_one_file_are_refused_before_any_work(tmp_path):
    data = whole_plot_truth.simulate(whole_plot_truth.Bench(), seed=1)
    columns = {name: getattr(data, name) for name in ("whole_plot", "order", "elapsed_s", "pressure_psia")}
    columns |= {name: getattr(data, name) for name in ("sensor_temperature_degC", "sse_temperature_degC")}
    write_csv({**columns, **data.outputs}, tmp_path / "plots.csv")
    done = rig("fit", "plots.csv", "--report", "same.x", "--out", "./same.x", cwd=tmp_path)
    assert (done.returncode, "are the same file" in done.stderr) == (2, True), done.stderr
    done = rig("fit", "plots.csv", "--report", "r.html", "--out", "no/c.json", cwd=tmp_path)
    assert (done.returncode, "does not exist" in done.stderr) == (2, True), done.stderr
    assert files(tmp_path) == {"plots.csv"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return dry(tmp_path_factory.mktemp("finished"))


def test_faults_do_not_overwrite_a_file_that_nobody_named(finished, tmp_path):
    (tmp_path / "night.faults.csv").write_text("precious\n")
    done = rig("export", finished, "--all", "-o", "night.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert "night.faults.csv, the file of faults and decisions with --all, is not such a table" in done.stderr
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"night.faults.csv": "precious\n"}


def test_nothing_is_written_where_the_faults_cannot_be(finished, tmp_path):
    (tmp_path / "b.faults.csv").mkdir()
    done = rig("export", finished, "--all", "-o", "b.csv", cwd=tmp_path)
    assert (done.returncode, "b.faults.csv is a folder" in done.stderr) == (2, True)
    assert files(tmp_path) == {"b.faults.csv"}


def test_an_export_can_be_made_again(finished, tmp_path):
    for _ in range(2):
        assert rig("export", finished, "--all", "-o", "night.csv", cwd=tmp_path).returncode == 0
    assert (tmp_path / "night.faults.csv").read_text().splitlines()[0] == ",".join(COLUMNS)


@pytest.mark.parametrize("name", ["bench.toml", "small.toml", "link", "old.sqlite"])
def test_a_log_is_not_added_to_another_file_of_the_run(tmp_path, name):
    (tmp_path / "bench.toml").write_text((LAB / "bench.toml").read_text())
    (tmp_path / "old.sqlite").write_bytes(b"SQLite format 3\0")
    write_small(tmp_path)
    (tmp_path / "link").symlink_to("bench.toml")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    done = rig("run", "small.toml", "--bench", "bench.toml", "--dry", "--log", name, cwd=tmp_path)
    assert (done.returncode, "must not be appended to; choose another" in done.stderr) == (2, True), done.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_log_is_not_added_to_the_run_that_is_resumed(finished):
    before = finished.read_bytes()
    done = rig("resume", finished, "--log", finished)
    assert (done.returncode, "is a run file or belongs to one, and must not be appended" in done.stderr) == (2, True), (
        done.stderr
    )
    assert finished.read_bytes() == before


@pytest.mark.parametrize("tape", ["bench.toml", "LIVE.toml"])
def test_a_tape_is_not_added_to_another_file_of_the_simulated_bench(tmp_path, tape):
    (tmp_path / "bench.toml").write_text((LAB / "bench.toml").read_text())
    done = rig("sim", "bench.toml", "--live", "LIVE.toml", "--tape", tape, "--for", 1, cwd=tmp_path)
    assert (done.returncode, "is another file of the same command" in done.stderr) == (2, True), done.stderr
    assert files(tmp_path) == {"bench.toml"}
    assert (tmp_path / "bench.toml").read_text() == (LAB / "bench.toml").read_text()


def test_a_tape_keeps_nobody_waiting_for_the_other_end_of_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "old.sqlite").write_bytes(b"SQLite format 3\0")
    for tape, says in (("pipe", "pipe is not a regular file"), ("old.sqlite", "is a run file"), (".", "is a folder")):
        done = rig("sim", LAB / "bench.toml", "--live", "LIVE.toml", "--tape", tape, "--for", 1, cwd=tmp_path)
        assert (done.returncode, says in done.stderr) == (2, True), done.stderr
    assert files(tmp_path) == {"pipe", "old.sqlite"}


def test_a_simulated_bench_does_not_take_the_place_of_a_link_that_leads_nowhere(tmp_path):
    (tmp_path / "LIVE.toml").symlink_to("gone.toml")
    done = rig("sim", LAB / "bench.toml", "--live", "LIVE.toml", "--for", 1, cwd=tmp_path)
    assert done.returncode == 1
    assert "LIVE.toml exists" in done.stderr
    assert (tmp_path / "LIVE.toml").is_symlink()


def test_a_masked_unit_is_not_installed_without_a_word(tmp_path):
    write_small(tmp_path)
    made = rig("run", "small.toml", "--bench", LAB / "bench.toml", "--dry", "--create-only", cwd=tmp_path)
    run = tmp_path / made.stdout.strip()
    unit = tmp_path / "systemd" / "user" / f"rig-{run.stem}.service"
    unit.parent.mkdir(parents=True)
    unit.symlink_to("/dev/null")
    done = rig("service", run, "--user", "--install", env={"XDG_CONFIG_HOME": str(tmp_path)})
    assert (done.returncode, f"{unit} is not a regular file" in done.stderr) == (2, True), done.stderr
    assert unit.is_symlink()


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (("--world", "."), 78, ". is a folder; name the world file in it"),
        (("--bench", "none.toml"), 78, "bench file none.toml does not exist"),
        (("--world", "wrong.toml"), 78, "wrong.toml is not valid TOML"),
        (("--out", "wrong.toml"), 2, "wrong.toml is not a folder; name one for the run file with --out"),
    ],
)
def test_a_confirming_run_looks_at_its_files_before_its_work(finished, tmp_path, options, code, says):
    (tmp_path / "wrong.toml").write_text("[[[")
    with patch("rig.verbs.confirm.open_traced", side_effect=AssertionError("its work began")):
        done = rig("confirm", finished, "--dry", *options, cwd=tmp_path)
    assert (done.returncode, says in done.stderr) == (code, True), done.stderr


def test_a_run_file_with_a_long_name_can_be_asked_to_stop(tmp_path):
    run = tmp_path / ("a" * 240 + ".sqlite")
    replace_json(live_path(run), {"session": 1})
    with patch("rig.run_file.live.controller_alive", return_value=True):
        asked = send_request(run, "stop")
    assert read_json(request_path(run)) == {"id": asked, "session": 1, "verb": "stop"}
    assert files(tmp_path) == {live_path(run).name, request_path(run).name}
