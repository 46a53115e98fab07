"""Readings of a point that contradict one another, where the procedure declares no limit of scatter."""

from __future__ import annotations

import csv

import ideal_pressure_bench as pressure
import numpy as np
import pytest
from few_points import Killed, accepted, attitude, kill_where, records, run, session_of_whole_plots, whole_plot
from general_lab import BENCH, PROCEDURE, REFERENCE, WORLD_WITH_STANDARD, run_dry, written
from ideal_bench import new_run, run_session
from typer.testing import CliRunner

from rig.cli.commands import app
from rig.engine.measuring import Channel
from rig.engine.session import Outcome
from rig.engine.sweeps import Sweeps
from rig.run_file.read.reader import RunReader
from rig.run_file.state.own_scatter import ALARM, FEWEST, LOOK_BACK, Contradiction, OwnScatter
from rig.run_file.verify.sense import judged
from rig.tables import FileForm, read_any_csv
from rig.tables.csv_files import read_csv
from rig.tables.table_of_run import run_table
from rig.verbs.plan.result import plan

CASES = {
    "another sign": [10.0, -10.0, -10.0, -10.0, -10.0],
    "one digit": [1.23456, 1.23454, 1.23856, 1.23455, 1.23456],
    "in mV": [1.23456, 1.23454, 1234.56, 1.23455, 1.23456],
    "a factor of a thousand": [5.0001, 5.0002, 0.0050001, 5.0001, 5.0002],
}
OTHER_READINGS = 4


def measured(monkeypatch, change):
    """Every measurement of the first output is changed by `change(number from 0, readings)`; returns them all."""
    seen, measure = [], Sweeps.measure

    def changed(self, *args):
        found = measure(self, *args)
        name, channel = next(iter(found.outputs.items()))
        found.outputs[name] = Channel(tuple(change(len(seen), list(channel.readings))))
        seen.append(found.outputs[name].readings)
        return found

    monkeypatch.setattr(Sweeps, "measure", changed)
    return seen


def scattered(number, n, sd=1e-4, about=0.0):
    return [float(f"{about + x:.7f}") for x in sd * np.random.default_rng([7, number]).normal(size=n)]


def shown(path):
    """Flags of every accepted point, and what was rejected there."""
    found = accepted(path)
    return [r.data["flags"] for r in found], [
        [one["contradictory"] for one in r.data.get("rejected", [])] for r in found
    ]


def contradictions(path):
    return [r for r in records(path, "event", "warning") if r.data["cause"] == "contradictory"]


def defects(path):
    with RunReader.open(path) as reader:
        return [str(one) for one in judged(reader, 100).findings]


# --- what contradicts, and what does not ----------------------------------------------------------------------


@pytest.mark.parametrize("before", [0, FEWEST, 40])
@pytest.mark.parametrize("case", CASES)
def test_one_reading_that_stands_apart_contradicts_the_others_from_the_first_point_on(case, before):
    own = OwnScatter()
    for point in range(before):
        own.add(point, {"x_V": [r + 0.1 * point for r in scattered(point, 5, 1e-5)]})
    found = own.contradiction({"x_V": CASES[case], "y_V": scattered(99, 5)})
    assert found is not None
    assert found.name == "x_V"
    assert f"once, and {'' if case == 'another sign' else 'from '}" in found.words


@pytest.mark.parametrize("readings", [[0.0, 0.01], [1.0, 1.01], [0.5, 0.5, 0.51, 0.51]])
def test_readings_of_which_none_is_alone_are_held_against_the_points_before(readings):
    own = OwnScatter()
    assert own.contradiction({"x_V": readings}) is None, "nothing is known yet"
    for point in range(12):
        own.add(point, {"x_V": [point % 4 / 2 + r for r in scattered(point, len(readings), 1e-5)]})
    found = own.contradiction({"x_V": readings})
    assert found is not None
    assert "x_V scatters by" in found.words
    assert "and usually by" in found.words


def noises(kind, value):
    return {
        "constant": 1e-4,
        "proportional": 1e-4 * value + 1e-6,
        "both": 1e-4 * np.hypot(1.0, value),
        "falling": 1e-4 * (10.0 - value) + 1e-6,
    }[kind]


@pytest.mark.parametrize("kind", ["constant", "proportional", "both", "falling"])
@pytest.mark.parametrize("order", ["random", "up"])
def test_clean_runs_have_no_more_than_one_false_alarm_in_a_thousand_points(kind, order):
    alarms = points = 0
    for n in (2, 3, 5, 10):
        for seed in range(5):
            g, own = np.random.default_rng([seed, n]), OwnScatter()
            levels = np.linspace(0.0, 10.0, 11)
            for value in np.concatenate([g.permutation(levels) if order == "random" else levels for _ in range(5)]):
                read = {f"{x}_V": (value + noises(kind, value) * g.normal(size=n)).tolist() for x in "xyz"}
                alarms, points = alarms + (own.contradiction(read) is not None), points + 1
                own.add(points, read)
    assert ALARM < 1e-3
    assert alarms <= 1e-3 * points


@pytest.mark.parametrize("digits", [0.05, 0.2, 0.5, 1.0])
def test_a_change_of_the_last_digit_is_no_contradiction(digits):
    for n in (2, 3, 5, 10):
        for scale in (1.0, 1.0 / 3.0):  # a decimal instrument, and one whose readings a formula converts
            g, own = np.random.default_rng([n, 5]), OwnScatter()
            for point in range(60):
                exact = (point % 4) * g.uniform(0.0, 2.0) + 1e-3 * digits * g.normal(size=n)  # often at zero itself
                read = {"x_V": [scale * round(x, 3) for x in exact]}
                assert own.contradiction(read) is None, (n, scale, point, read)
                own.add(point, read)


def test_a_meter_that_shows_its_last_digits_about_zero_does_not_contradict_itself():
    for readings in ([1.2e-5, -1.2e-5, 1.2e-5], [1.0, -1.0, -1.0, -1.0], [0.01, 0.0, 0.0, 0.0, 0.0]):
        assert OwnScatter().contradiction({"x_V": readings}) is None


def test_a_slow_drift_within_a_point_is_no_contradiction():
    own = OwnScatter()
    for point in range(20):
        own.add(point, {"x_V": scattered(point, 10)})
    creep = [1e-3 * (1.0 - np.exp(-i / 3.0)) for i in range(10)]
    assert own.contradiction({"x_V": [a + b for a, b in zip(creep, scattered(50, 10), strict=True)]}) is None


def test_a_noise_that_has_changed_for_good_is_usual_after_a_few_points():
    own, found = OwnScatter(), []
    for point in range(60):
        read = {"x_V": scattered(point, 5, 1e-4 if point < 30 else 3e-3)}
        found.append(own.contradiction(read) is not None)
        own.add(point, read)
    assert not any(found[:30])
    assert any(found[30:33])
    assert not any(found[36:])


# --- in a run -------------------------------------------------------------------------------------------------


def run_attitude(folder, replications=2, readings=4):
    again = attitude(replications=replications, measure={"readings": readings})
    return again, new_run(folder, again)


def test_a_point_that_contradicts_itself_once_is_read_again(tmp_path, monkeypatch):
    spike = {2: [10.0, -10.0, -10.0, -10.0]}
    measured(monkeypatch, spike.get)
    path, _ = run(tmp_path, attitude(measure={"readings": 4}))
    flags, rejected = shown(path)
    assert flags == [[], [], [], []]
    assert rejected == [[], [], ["x_V"], []]
    assert accepted(path)[2].data["rejected"][0]["outputs"]["x_V"]["readings"] == spike[2]
    assert contradictions(path) == []
    assert defects(path) == []


def test_a_point_that_contradicts_itself_again_and_again_is_flagged_and_told_once(tmp_path, monkeypatch):
    measured(monkeypatch, lambda number, r: [10.0, -10.0, -10.0, -10.0 - number * 1e-4] if number >= 2 else r)
    path, _ = run(tmp_path, attitude(measure={"readings": 4, "repeats": 1}))
    assert shown(path) == ([[], [], ["contradictory"], ["contradictory"]], [[], [], ["x_V"], ["x_V"]])
    (told,) = contradictions(path)
    assert told.data["message"].startswith(
        "x_V reads 10 V once, and from -10.0003 to -10 V the other 3 times, at point 2"
    )
    assert defects(path) == []


def test_the_policy_for_noise_decides_about_contradictions_too(tmp_path, monkeypatch):
    measured(monkeypatch, lambda number, readings: [10.0, -10.0, -10.0, -10.0] if number == 1 else readings)
    procedure = attitude(measure={"readings": 4, "repeats": 0}, faults={"noisy": ["abort"]})
    path = new_run(tmp_path, procedure)
    outcome, _, _, message = run_session(path, procedure=procedure)
    assert outcome is Outcome.FAULT
    assert message.startswith("x_V reads 10 V once, and -10 V the other 3 times, at point 1")


def test_a_declared_limit_is_the_only_one(tmp_path, monkeypatch):
    measured(monkeypatch, lambda number, r: [0.1, 0.1, 0.1, 0.2 + number * 1e-6])
    path, _ = run(tmp_path, attitude(measure={"readings": 4, "max_sd_V": 0.1}))
    assert shown(path) == ([[]] * 4, [[]] * 4)


def test_whole_plots_are_read_again_and_flagged_too(tmp_path, monkeypatch):
    measured(
        monkeypatch,
        lambda number, r: [5.0, 5.0001, -5.0] if not number else [0.1 * number + 0.001 * i for i in range(3)],
    )
    procedure, bench = whole_plot(measure={"readings": 3, "max_sd_mV": None, "repeats": 0}), pressure.PressureBench()
    path = pressure.new_run(tmp_path, procedure)
    outcome, message = session_of_whole_plots(path, procedure, bench)
    assert outcome is Outcome.COMPLETE, message
    assert shown(path)[0][0] == ["contradictory"]
    assert defects(path) == []


def test_any_laboratory_reads_again_and_flags_too(tmp_path, monkeypatch):
    spoilt = {3: [2.1, 2.1001, 0.0021], 4: [2.1, 2.1001, 0.0021], 5: [2.1, 2.1001, 0.0021]}
    measured(monkeypatch, spoilt.get)
    path, _ = run_dry(tmp_path)
    flags, rejected = shown(path)
    assert flags == [["contradictory"] if i == 3 else [] for i in range(len(flags))]
    assert rejected[3] == ["cell_V", "cell_V"]
    assert defects(path) == []


@pytest.mark.parametrize("killed_at", [3, 6, 7])
def test_a_resumed_run_decides_as_if_it_had_never_stopped(tmp_path, monkeypatch, killed_at):
    """Two readings that differ are a contradiction only beside the points before."""

    def change(number, readings):
        return [0.5, 0.51] if number >= 7 else scattered(number, 2, 1e-6, 0.5)

    procedure = attitude(replications=2, measure={"readings": 2, "repeats": 0})
    path = new_run(tmp_path, procedure)
    seen = measured(monkeypatch, change)
    with pytest.raises(Killed):
        run_session(path, procedure=procedure, on_progress=kill_where(lambda news: news.done == killed_at))
    del seen[killed_at:]
    assert run_session(path, procedure=procedure)[0] is Outcome.COMPLETE
    assert shown(path)[0] == [[]] * 7 + [["contradictory"]]
    assert defects(path) == []


@pytest.mark.parametrize("killed", [False, True])
def test_the_first_points_are_looked_at_again_when_there_are_others(tmp_path, monkeypatch, killed):
    def change(number, readings):
        return [0.5, 0.51] if number == 1 else scattered(number, 2, 1e-6, 0.5)

    procedure = attitude(replications=3, measure={"readings": 2})
    path = new_run(tmp_path, procedure)
    seen = measured(monkeypatch, change)
    if killed:
        with pytest.raises(Killed):
            run_session(path, procedure=procedure, on_progress=kill_where(lambda news: news.done == LOOK_BACK - 1))
        del seen[LOOK_BACK - 1 :]
    assert run_session(path, procedure=procedure)[0] is Outcome.COMPLETE
    (told,) = contradictions(path)
    assert told.data["message"].startswith("x_V scatters by 0.0071 V (sd), and usually by")
    assert "at point 1, which was one of the first" in told.data["message"]
    assert defects(path) == []


def test_a_mark_that_the_readings_do_not_bear_out_is_found(tmp_path, monkeypatch):
    contradiction = OwnScatter.contradiction
    calls = []

    def said_thrice(self, readings, again=None):
        calls.append(readings)
        return Contradiction("cell_V", -1, "") if len(calls) in (3, 4, 5) else contradiction(self, readings, again)

    with monkeypatch.context() as patched:
        patched.setattr(OwnScatter, "contradiction", said_thrice)
        path, _ = run_dry(tmp_path)
    assert shown(path)[0][2] == ["contradictory"]
    (found,) = defects(path)
    assert "marked as contradictory, and its readings do not contradict one another" in found


def told(result):
    return "\n".join(str(getattr(block, "text", "")) for block in result.blocks())


def test_the_plan_says_what_has_no_limit(tmp_path):
    procedure, bench, _ = written(tmp_path)
    assert plan(procedure, bench).to_json()["scatter_without_limit"] == ["cell_V"]
    assert "cell_V: it is compared with the run's own scatter" in told(plan(procedure, bench))
    procedure, bench, _ = written(tmp_path, PROCEDURE.replace("readings = 3", "readings = 1"))
    assert "cell_V: one reading a point has none" in told(plan(procedure, bench))
    limited = PROCEDURE.replace("readings = 3", "readings = 3\nmax_sd_V = 0.001")
    procedure, bench, _ = written(tmp_path, limited)
    assert plan(procedure, bench).to_json()["scatter_without_limit"] == []


# --- in an exported table -------------------------------------------------------------------------------------


@pytest.mark.parametrize("asked", [False, True])
def test_an_exported_table_has_scatter_number_and_flags_and_is_read_as_the_run(tmp_path, monkeypatch, asked):
    spoilt = {number: [2.1, 2.1001, 0.0021] for number in (3, 4, 5)}
    measured(monkeypatch, spoilt.get)
    run_file, _ = run_dry(tmp_path, bench=BENCH + REFERENCE, world=WORLD_WITH_STANDARD)
    out = tmp_path / "out.csv"
    assert CliRunner().invoke(app, ["export", str(run_file), "--out", str(out)]).exit_code == 0
    with out.open() as file:
        rows = list(csv.DictReader(file))
    seen = [r.data for r in accepted(run_file)]
    assert [float(row["cell_sd_V"]) for row in rows] == [one["outputs"]["cell_V"]["sd"] for one in seen]
    assert [float(row["force_sd_kN"]) for row in rows] == [one["references"]["force_kN"]["sd"] for one in seen]
    assert {row["readings"] for row in rows} == {"3"}
    assert [row["flag_contradictory"] for row in rows] == ["1" if i == 3 else "0" for i in range(len(rows))]
    run_columns = run_table(run_file).columns
    read = read_csv(out, FileForm(separator=",") if asked else FileForm()).columns
    assert list(read) == list(run_columns)
    assert list(read_any_csv(out, ["cell_V"]).columns) == list(run_columns)
    assert "cell_sd_V" in read_any_csv(out, ["cell_sd_V"]).columns
