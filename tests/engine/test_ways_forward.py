"""What a person is told of a run that cannot simply go on: what was found, and what to do next."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import apsw
import pytest
from command import rig
from dry import LAB
from ideal_bench import new_run, run_session
from small_run import write_small

from rig.engine.session import Outcome, Signals
from rig.engine.time_left import typical_s
from rig.errors import ConfigurationError
from rig.run_file.last_word import head_path
from rig.run_file.live import replace_json, request_path
from rig.run_file.read.reader import RunReader
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.runs.plans import load_plan, stored_plan
from rig.version import versions


def edited(path, statement="UPDATE record SET utc_s = utc_s + 1 WHERE seq = 9"):
    """Change a run file behind the program's back, as somebody who knows its triggers does."""
    db = apsw.Connection(str(path))
    triggers = list(db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"))
    for name, _ in triggers:
        db.execute(f"DROP TRIGGER {name}")
    db.execute(statement)
    for _, sql in triggers:
        db.execute(sql)
    db.close()
    return path


def stopped(path, monkeypatch):
    """A run that `rig stop` has stopped at its third point."""
    ticks = iter(range(10**9))
    monkeypatch.setattr("rig.sims.world.World.stopwatch", lambda _self: float(next(ticks)))

    def progress(told):
        if told.done == 3:
            replace_json(request_path(path), {"id": "1", "session": 1, "verb": "stop"})

    run_session(path, on_progress=progress, signals=Signals())
    return path


# --- rig service ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("install", [(), ("--install",)])
def test_no_service_for_a_run_that_none_could_carry_on(tmp_path, monkeypatch, install):
    env = {"XDG_CONFIG_HOME": str(tmp_path / "config")}
    cases = {
        2: (run_to_its_end(tmp_path), "is complete"),
        4: (stopped(new_run(tmp_path / "stopped"), monkeypatch), "was stopped by a person"),
        1: (edited(run_to_its_end(tmp_path / "edited")), "edited or damaged: record 9"),
    }
    for code, (path, says) in cases.items():
        refused = rig("service", path, "--user", *install, env=env)
        assert (refused.returncode, refused.stdout) == (code, ""), refused.stderr
        assert says in refused.stderr
    assert not (tmp_path / "config").exists()


def run_to_its_end(folder):
    path = new_run(folder)
    run_session(path)
    return path


def test_a_unit_can_be_removed_whatever_became_of_its_run(tmp_path):
    env = {"XDG_CONFIG_HOME": str(tmp_path / "config")}
    path = new_run(tmp_path)
    assert rig("service", path, "--user", "--install", env=env).returncode == 0
    run_session(path)
    assert rig("service", edited(path), "--user", "--remove", env=env).returncode == 0


def test_a_service_for_a_run_at_work_is_printed_with_the_advice_to_wait(tmp_path):
    path = new_run(tmp_path)
    with RunWriter.open(path):
        printed = rig("service", path, "--user")
    assert printed.returncode == 0
    assert printed.stdout.startswith("[Unit]")
    assert "a controller is running on it" in printed.stderr


# --- rig status -------------------------------------------------------------------------------------------------------


def test_status_says_that_a_file_was_edited_and_where(tmp_path):
    path = edited(run_to_its_end(tmp_path))
    shown = rig("status", path)
    assert shown.returncode == 1
    assert "NOT WHOLE: edited or damaged: record 9" in shown.stdout
    assert "rig verify" in shown.stdout
    said = rig("status", path, "--json")
    assert said.returncode == 1
    assert json.loads(said.stdout)["whole"] is False
    listed = json.loads(rig("status", tmp_path, "--json").stdout)
    assert [row["state"] for row in listed] == ["not whole"]
    assert rig("status", tmp_path, "--check").returncode == 1


def test_status_of_a_whole_file_says_nothing_of_it_and_of_one_too_long_that_it_is_not_verified(tmp_path, monkeypatch):
    path = run_to_its_end(tmp_path)
    assert json.loads(rig("status", path, "--json").stdout)["whole"] is True
    assert "verif" not in rig("status", path).stdout
    monkeypatch.setattr("rig.verbs.run.status.VERIFIED", 5)
    shown = rig("status", edited(path))
    assert shown.returncode == 0
    assert f"not verified, {RunReader.open(path).head()[0]} records need some time: rig verify" in shown.stdout
    assert json.loads(rig("status", path, "--json").stdout)["whole"] is None


def test_status_of_a_file_cut_short_says_what_is_gone_and_that_a_resume_measures_it_again(tmp_path, monkeypatch):
    path = stopped(new_run(tmp_path), monkeypatch)
    earlier = head_path(path).read_bytes()
    count = int.from_bytes(earlier[:8], "big")
    head_path(path).write_bytes((count + 3).to_bytes(8, "big") + bytes(32))
    shown = rig("status", path)
    assert shown.returncode == 0
    assert "cut short: head: its last 3 record(s) are missing" in " ".join(shown.stdout.split())
    assert "continue with: rig resume" in shown.stdout


# --- instruments at other addresses -----------------------------------------------------------------------------------


def run_of_a_bench_that_is_gone(folder, served):
    """A run file of real addresses, behind which there is nothing."""
    bench = folder / "bench.toml"
    text = (LAB / "bench.toml").read_text().replace('"/dev/rig/', f'"{folder}/no/')
    live = "\nsimulated = true\n[live]\nspeed = 100\nepoch_utc = 1.0\nstarted_utc = 1.0\n[limits]"
    bench.write_text(text.replace("\n[limits]", live.replace("\nsimulated = true", "", 1) if served else "\n[limits]"))
    if served:
        bench.write_text("simulated = true\n" + bench.read_text())
    plan = load_plan(write_small(folder), bench)
    about = {"dry": False, "software": versions(), "procedure": plan.procedure.name, "bench": plan.bench.name}
    path = folder / "run-1.sqlite"
    genesis = Genesis(path.stem, plan.documents, plan.run_list, plan.bench.simulated, about)
    create(path, genesis, elapsed_s=0.0, utc_s=1.8e9)
    return path, bench


@pytest.mark.parametrize(("served", "says"), [(True, "--bench LIVE.toml"), (False, "--bench BENCH")])
def test_a_resume_that_finds_nobody_at_the_old_addresses_names_the_option_for_new_ones(tmp_path, served, says):
    path, bench = run_of_a_bench_that_is_gone(tmp_path, served)
    refused = rig("resume", path, "--no-notify")
    assert refused.returncode == 1
    assert "cannot be opened" in refused.stderr
    assert f"rig resume {path} {says}" in refused.stderr
    again = rig("resume", path, "--no-notify", "--bench", bench)
    assert "cannot be opened" in again.stderr
    assert says not in again.stderr


@pytest.mark.parametrize(
    ("line", "other", "says"),
    [
        ("nplc = 10", "nplc = 1", "instruments.scanner.nplc was 10.0, is 1.0"),
        ("nplc = 10", "nplc = 10\nrange_V = 1", "instruments.scanner.range_V was 10.0, is 1.0"),
        ('"thermistor-10k"', '"thermistor-5k"', "instruments.scanner.channels was "),
        ('asset = "HD-0417"', 'asset = "HD-9"', "instruments.head.asset was HD-0417, is HD-9"),
        ("due = 2027-03-31", "due = 2028-03-31", "instruments.head.due was 2027-03-31, is 2028-03-31"),
    ],
)
def test_a_resume_on_a_bench_that_measures_otherwise_is_refused_and_one_reached_otherwise_is_not(
    tmp_path, line, other, says
):
    path, bench = run_of_a_bench_that_is_gone(tmp_path, served=False)
    text = bench.read_text()
    assert line in text
    bench.write_text(text.replace(line, other, 1))
    with RunReader.open(path) as run, pytest.raises(ConfigurationError, match="only addresses may differ") as told:
        stored_plan(run, path, bench)
    assert says in str(told.value)
    bench.write_text(
        text.replace("/no/", "/elsewhere/").replace("[instruments.scanner]", "[instruments.scanner]\nbaud = 57600")
    )
    with RunReader.open(path) as run:
        assert "/elsewhere/" in stored_plan(run, path, bench).bench.instruments["scanner"].address


# --- time left --------------------------------------------------------------------------------------------------------


def test_a_process_that_stood_still_for_hours_does_not_make_the_rest_of_the_night_longer(tmp_path):
    told, ordinary = [], []

    def stand_still(bench, _head, reader):
        fetch = reader.fetch

        def late():
            if reader.starts == 7:
                bench.clock.sleep(7200.0)
            return fetch()

        reader.fetch = late

    for folder, spoil, into in (("a", lambda *_: None, ordinary), ("b", stand_still, told)):
        run_session(new_run(tmp_path / folder), spoil=spoil, on_progress=into.append)
    left = [{n.done: n.remaining_s for n in news if n.remaining_s is not None} for news in (ordinary, told)]
    assert left[1].keys() == left[0].keys()
    for done, expected in left[0].items():
        assert left[1][done] == pytest.approx(expected, rel=0.3, abs=10.0), done


def test_ways_that_are_long_by_design_count_in_full():
    assert typical_s([10.0] * 90 + [600.0] * 10) == pytest.approx(69.0)
    assert typical_s([10.0]) == 10.0
    assert typical_s([10.0] * 199 + [3600.0]) == pytest.approx(10.0)


# --- a file that lost its name while it was written -------------------------------------------------------------------


def rescued(path, how):
    """A session in whose middle the file is moved, or an older copy is put in its place: the file at hand, the copy."""
    older = shutil.copy(path, path.with_name("older"))
    found = {"moved": path.with_name("elsewhere") / "moved.sqlite", "renamed": path.with_name("b.sqlite")}.get(
        how, path
    )
    found.parent.mkdir(exist_ok=True)

    def progress(told):
        if told.done == 3 and told.state == "recording":
            if how == "replaced":
                Path(older).replace(path)
            elif not found.exists():
                path.rename(found)

    outcome, _, _, message = run_session(path, on_progress=progress)
    assert outcome is Outcome.FAULT
    (copy,) = path.parent.glob("*-rescued-*.sqlite")
    assert f"rig resume {copy}" in message
    return found, copy


@pytest.mark.parametrize("how", ["moved", "renamed", "replaced"])
def test_a_file_that_was_rescued_says_where_the_run_goes_on_and_is_not_carried_on_beside_it(tmp_path, how):
    path, copy = rescued(new_run(tmp_path), how)
    before = path.read_bytes()
    refused = rig("resume", path)
    assert refused.returncode == 2, refused.stderr
    assert f"which continues: rig resume {copy}" in refused.stderr
    assert path.read_bytes() == before
    assert rig("service", path).returncode == 2
    shown = rig("status", path).stdout
    assert f"continue with: rig resume {copy}" in shown
    checked = rig("verify", path)
    assert checked.returncode == (1 if how == "replaced" else 0), "an older copy lacks what came after it"
    assert f"the run goes on in {copy}" in checked.stdout
    assert f"continue with: rig resume {copy}" in rig("status", copy).stdout
    assert run_session(copy)[0] is Outcome.COMPLETE
    assert rig("resume", path).returncode == 2


def test_all_that_was_observed_is_in_the_file_that_was_moved_too_and_it_can_go_on_if_the_copy_is_lost(tmp_path):
    path, copy = rescued(new_run(tmp_path), "moved")
    with RunReader.open(copy) as one, RunReader.open(path) as other:
        assert list(one.chained()) == list(other.chained())[:-1]
    copy.unlink()
    assert "which does not exist: look for it before you resume here" in rig("status", path).stdout
    assert run_session(path)[0] is Outcome.COMPLETE
