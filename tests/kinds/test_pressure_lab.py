"""The pressure laboratory dry, from bench file to inferred pressure, through every byte of every protocol."""

from __future__ import annotations

import csv
import json
from collections import Counter

import numpy as np
import pytest
from command import rig
from dry_pressure import EACH, IN_ALL, LAB, SHORT, Killed, dry
from few_sensors import with_sensors

from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.procedures.kinds import kind_of_table
from rig.procedures.pressure import settings as whole_plot
from rig.procedures.pressure.fitted import fit_whole_plots
from rig.procedures.pressure.table import whole_plot_data
from rig.run_file.read.reader import RunReader
from rig.runs.accepted import judge
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.tables import write_csv
from rig.tables.table_of_run import run_table

HERE = (1, 7)
"""The transducers of most tests; all seven are on the line in that of the vacuum pump."""


def cut_off(folder):
    """A run that a power cut hit in the middle of its third whole plot."""
    bench, world = with_sensors(LAB, folder, *(f"bridge_{i}" for i in HERE))
    return dry(folder, bench=bench, world=world, kill_at=2 * EACH + 3)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return cut_off(tmp_path_factory.mktemp("pressure"))


def test_a_power_cut_costs_one_whole_plot_and_no_reading(run):
    with RunReader.open(run) as reader:
        reader.verify()
        lost = [r.data for r in reader.records("event") if r.status == "whole-plot-lost"]
        accepted = [r for r in reader.records("observation") if r.status == "accepted"]
    assert [entry["planned"] for entry in lost] == [3]
    assert lost[0]["kept"] == 3
    sizes = Counter(r.whole_plot for r in accepted)
    assert sizes == {1: 5, 2: 5, 3: 3, 4: 5, 5: 5, 6: 5}
    assert {r.run_index for r in accepted} == set(range(IN_ALL))


def test_the_table_holds_what_was_measured_beside_what_was_asked_for(run):
    table = run_table(run)
    kind = kind_of_table(table)
    assert kind is not None
    assert kind.name == "whole-plot"
    columns = table.columns
    assert list(columns)[:7] == [
        "replicate",
        "whole_plot",
        "order",
        "elapsed_s",
        "pressure_psia",
        "sensor_temperature_degC",
        "sse_temperature_degC",
    ]
    bridges_follow_the_pressure_that_was_measured(run, HERE)
    for measured, asked, band in (
        ("pressure_psia", "pressure_set_psia", 0.002),
        ("sensor_temperature_degC", "sensor_temperature_set_degC", 1.0),
        ("sse_temperature_degC", "sse_temperature_set_degC", 1.0),
    ):
        assert 0 < np.abs(columns[measured] - columns[asked]).max() < band
    assert len(np.unique(whole_plot_data(table).whole_plot)) == 6


def test_the_same_seed_gives_the_same_observations(tmp_path, run):
    again = run_table(cut_off(tmp_path))
    for name, values in run_table(run).columns.items():
        np.testing.assert_array_equal(again.columns[name], values, err_msg=name)


def bridges_follow_the_pressure_that_was_measured(run, bridges):
    """About 2 mV/psi: a slope far from that means a wrong unit, channel or reference."""
    columns = run_table(run).columns
    assert [c for c in columns if c.endswith("_mV")] == [f"bridge_{i}_mV" for i in bridges]
    for i in bridges:
        slope, _ = np.polyfit(columns["pressure_psia"], columns[f"bridge_{i}_mV"], 1)
        assert 1.7 < slope < 2.3


def test_fit_report_calibration_and_inference_on_the_command_line(tmp_path, run):
    out, page = tmp_path / "calibration.json", tmp_path / "methods.html"
    options = ("--formula", "1 + P + P^2 + T_sensor + T_SSE", "--method", "in-flight zero + WLS")
    done = rig("fit", run, *options, "--out", out, "--report", page, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["data"]["kind"] == "whole-plot"
    sensor = found["sensors"]["bridge_1_mV"]
    assert set(sensor["methods"]) == {"GLS", "weighted response", "WLS", "in-flight zero", "in-flight zero + WLS"}
    assert sensor["coefficients"]["P"]["estimate"] == pytest.approx(2.0, abs=0.2)
    assert sensor["sigma_wholeplot"] > sensor["sigma_subplot"] > 0
    text = page.read_text()
    assert text.count("data:image/png") == len(HERE)
    assert "SIMULATED" in text

    flight, vacuum, answers = (tmp_path / name for name in ("flight.csv", "vacuum.csv", "answers.csv"))
    columns = run_table(run).columns
    row = {name: columns[name][0] for name in ("sensor_temperature_degC", "sse_temperature_degC")}
    b = {name: v["estimate"] for name, v in sensor["methods"]["in-flight zero + WLS"]["coefficients"].items()}
    hot = b["1"] + b["T_sensor"] * row["sensor_temperature_degC"] + b["T_SSE"] * row["sse_temperature_degC"]
    shift, psia = 0.05, np.array([0.2, 1.0, 2.0, 9.0])
    readings = hot + shift + b["P"] * psia + b["P^2"] * psia**2
    head = "bridge_1_mV,sensor_temperature_degC,sse_temperature_degC\n"
    tail = ",{sensor_temperature_degC!r},{sse_temperature_degC!r}\n".format(**{k: float(v) for k, v in row.items()})
    flight.write_text(head + "".join(f"{float(v)!r}{tail}" for v in readings))
    vacuum.write_text(head + f"{float(hot + shift)!r}{tail}")
    done = rig("infer", out, flight, "--zero", vacuum, "--out", answers)
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(answers.read_text().splitlines()))
    assert [float(r["pressure_psia"]) for r in rows[:3]] == pytest.approx(psia[:3], abs=1e-6)
    assert all(
        float(r["pressure_psia_lo95"]) < p < float(r["pressure_psia_hi95"])
        for r, p in zip(rows, psia[:3], strict=False)
    )
    assert rows[3]["pressure_psia"] == ""
    assert "outside the calibrated" in rows[3]["flag"]
    done = rig("infer", out, flight, "--out", answers)
    assert "no zero was read in vacuum" in done.stderr
    with_error = list(csv.DictReader(answers.read_text().splitlines()))
    assert float(with_error[0]["pressure_psia_sd"]) > 2 * float(rows[0]["pressure_psia_sd"])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: text[: len(text) // 2], "is not a calibration file"),
        (lambda text: text.replace('"kind": "pressure"', '"kind": "angles"'), "is not a calibration file"),
        (lambda text: "[]", "is not a calibration file"),
    ],
)
def test_a_calibration_file_that_is_none_is_refused(tmp_path, run, spoil, message):
    out, flight = tmp_path / "calibration.json", tmp_path / "flight.csv"
    fitted = fit_whole_plots(run_table(run), "1 + P + T_sensor + T_SSE")
    out.write_text(spoil(json.dumps(fitted.to_json())))
    flight.write_text("bridge_1_mV,sensor_temperature_degC,sse_temperature_degC\n1,20,20\n")
    done = rig("infer", out, flight, "--out", tmp_path / "answers.csv")
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "answers.csv").exists()


def test_a_csv_table_says_the_same_as_the_run_file(tmp_path, run):
    path = tmp_path / "run.csv"
    assert rig("export", run, "--out", path).returncode == 0
    options = ("--formula", "1 + P + T_sensor + T_SSE", "--json")
    one, other = (json.loads(rig("fit", data, *options).stdout)["sensors"] for data in (run, path))
    assert one == other


def test_the_trace_reports_both_strata(tmp_path, run):
    done = rig(
        "trace",
        run,
        "--formula",
        "1 + P + P^2 + T_sensor + T_SSE + P:T_sensor",
        "--report",
        tmp_path / "t.html",
        "--json",
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["data"]["kind"] == "whole-plot"
    for sensor in found["sensors"].values():
        assert sensor["before"]["sigma_wholeplot"] is not None
        assert sensor["before"]["sigma_E"] is None
        assert sensor["sentence"]
    assert "whole plot 3 lost" in (tmp_path / "t.html").read_text()


def test_acceptance_is_by_reading_error(tmp_path, run):
    procedure = tmp_path / "p.toml"
    for limit, inside in ((1e-6, False), (1e6, True)):
        procedure.write_text(SHORT + f"[acceptance]\nreading_error_pct = {limit}\n")
        plan = load_plan(procedure, LAB / "bench.toml")
        verdicts = judge(plan.procedure, run)
        assert {v.inside for v in verdicts} == {inside}
        assert "0.12 psia" in verdicts[0].found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('pressure_psia = "supply"\n', ""), "does not say what sets pressure_psia"),
        (('pressure_psia = "supply"', 'pressure_psia = "scanner"'), "scanner cannot set pressure_psia"),
        (
            ('sse_temperature_degC = "sse_chamber"', 'sse_temperature_degC = "scanner"'),
            "scanner cannot set sse_temperature",
        ),
        (('pressure_psia = "supply"', 'pressure_psia = "suply"'), "is not an instrument here"),
        (("sensor_chamber_degC = [-140, 40]", "sensor_chamber_degC = [15, 40]"), "outside 15 to 40"),
        (
            ("pressure_psia = [0, 15.5]", "pressure_psia = [0, 6]"),
            "limits.pressure_psia = 0 to 6 does not include the atmosphere",
        ),
        (("high_psia = 6 ", "high_psia = 2 "), "the instrument's own limits"),
        (('place = "sse"', 'place = "elsewhere"'), "place"),
        (('pressure_psia = "supply"', 'pressure = "supply"'), "factors.pressure: the name is a column and must end"),
        (('sse_temperature_degC = "sse_chamber"', 'sse_temperature_degC = "sensor_chamber"'), "cannot set both"),
        (('unit = "mV"', 'unit = "V"'), 'unit = "mV"'),
        (('unit = "mV"', 'unit = "mV"\naxis = "x"'), "must not have an axis"),
    ],
)
def test_a_bench_that_cannot_carry_the_design_out_is_refused_before_anything_moves(tmp_path, change, message):
    bench, procedure = tmp_path / "bench.toml", tmp_path / "p.toml"
    bench.write_text((LAB / "bench.toml").read_text().replace(*change))
    assert bench.read_text() != (LAB / "bench.toml").read_text()
    procedure.write_text(SHORT)
    done = rig("run", procedure, "--bench", bench, "--dry", "--out", tmp_path / "runs")
    assert done.returncode == 78, done.stderr
    assert message in done.stderr.replace("\n", " ")
    assert not list(tmp_path.glob("runs/*"))


def test_a_vacuum_pump_that_fails_ends_the_night_safe_and_the_run_goes_on_when_it_is_back(tmp_path):
    world, procedure = tmp_path / "world.toml", tmp_path / "short.toml"
    world.write_text((LAB / "world.toml").read_text() + "[pressure_line]\nvacuum_lost_h = 1.2\nvacuum_back_h = 3\n")
    procedure.write_text(SHORT)
    plan = load_plan(procedure, LAB / "bench.toml", dry=True, world=world)
    paths = []
    result = start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=lambda _: None)
    assert result.outcome is Outcome.FAULT
    assert "vacuum lost" in result.message
    assert 0 < len(result.state.accepted) < IN_ALL
    resumed = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None, dry_gap_s=3 * 3600.0)
    assert resumed.outcome is Outcome.COMPLETE, resumed.message
    bridges_follow_the_pressure_that_was_measured(paths[0], range(1, 8))


def test_a_temperature_left_beyond_the_limits_is_refused_beforehand(tmp_path):
    procedure = tmp_path / "p.toml"
    procedure.write_text(SHORT.replace("[soak]\n", "[soak]\nrenew_degC = 60\n"))
    with pytest.raises(ConfigurationError, match=r"is changed to .* degC first \(soak.renew_degC\), outside"):
        load_plan(procedure, LAB / "bench.toml")


def test_a_dead_transducer_does_not_stop_the_others(tmp_path, run):
    table = run_table(run)
    columns = {**table.columns, "bridge_7_mV": np.full(len(table), 0.5)}
    path = tmp_path / "dead.csv"
    write_csv(columns, path)
    options = ("--formula", "1 + P + P^2 + T_sensor + T_SSE", "--json")
    for command in ("fit", "trace"):
        done = rig(command, path, *options)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert found["left_out"] == {"bridge_7_mV": "reads 0.5 mV throughout"}
        assert list(found["sensors"]) == ["bridge_1_mV"]


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"pressure_psia": -1.0}, "column pressure_psia: -1 is wrong"),
        ({"sensor_temperature_degC": -390.0}, "column sensor_temperature_degC: -390 is wrong"),
        ({"whole_plot": 1e300}, "too large"),
        ({"order": 1.0}, "order 1 is there twice"),
    ],
)
def test_numbers_that_cannot_be_are_named_with_their_row(tmp_path, run, columns, message):
    table = run_table(run)
    changed = {name: values.copy() for name, values in table.columns.items()}
    for name, value in columns.items():
        changed[name][4] = value
    path = tmp_path / "bad.csv"
    write_csv(changed, path)
    done = rig("fit", path, "--formula", "1 + P")
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_that_another_version_began_goes_on_by_the_run_list_it_began_with(monkeypatch, tmp_path):
    """Earlier ones did not leave a pressure with which a whole plot began where the one before had ended."""
    procedure, paths = tmp_path / "short.toml", []
    procedure.write_text(SHORT)

    def killed(news):
        if news.done >= EACH + 2:
            raise Killed

    sides = whole_plot._sides
    with monkeypatch.context() as before:
        before.setattr(whole_plot, "_sides", lambda pressures, _last: sides(pressures, None))
        plan = load_plan(procedure, LAB / "bench.toml", dry=True, world=LAB / "world.toml")
        with pytest.raises(Killed):
            start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=killed)
    assert plan.run_list.sha256() != plan.procedure.expand().sha256()
    result = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE, result.message
    with RunReader.open(paths[0]) as reader:
        reader.verify()
        assert reader.run_list().sha256() == plan.run_list.sha256()
