"""A source set in one unit, and a model of what a standard reads of it in another: a valve in V, flow in kg/min.

The stranger's flow bench: the only way was to call volts kg/min.
"""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from flow_bench import BENCH, PROCEDURE

from rig.bench.config import parse_bench, parse_toml
from rig.errors import ConfigurationError
from rig.sims.physics.laboratory import Laboratory
from rig.sims.physics.thermal import Lab
from rig.sims.physics.truth import LabTruth, read_truth, sensor_axes
from rig.tables.set_in import put_in_place
from rig.tables.table_of_run import run_table

STANDARD = """
[instruments.coriolis]
driver = "scpi-meter"
address = "socket://192.0.2.33:5025"
maker = "EMERSON"
model = "CMF010"
asset = "REF-01"
unit = "kg_per_min"
fetch = "READ?"
reading_s = 1
[references.flow_kg_per_min]
reader = "coriolis"
of = "valve_V"
"""
BENCH = BENCH.replace('unit = "kg_per_min"', 'unit = "V"').replace("flow_kg_per_min", "valve_V") + STANDARD
PROCEDURE = (
    PROCEDURE.replace("[factors.flow_kg_per_min]", "[factors.valve_V]")
    .replace("[0.5, 1, 1.5, 2, 2.5, 3, 3.5]", "[1, 2.5, 4, 5.5, 7, 8.5, 10]")
    .replace("180*flow_kg_per_min", "180*valve_V/2")
)
WORLD = """
seed = 5
[references.flow_kg_per_min]
formula = "0.5*valve_V - 0.012*valve_V^2"
noise = 0.0002
[sensors.mfs]
formula = "50 + 180*flow_kg_per_min + -3*flow_kg_per_min^2"
noise = 0.1
hidden = "0.15*flow_kg_per_min^3"
"""
EQUIPMENT = """
name = "flow laboratory"
[equipment.REF-01]
maker = "EMERSON"
model = "CMF010"
serial = "1"
[equipment.REF-01.certificate]
number = "C1"
laboratory = "an institute"
date = 2025-12-01
due = 2027-06-30
[[equipment.REF-01.says]]
quantity = "flow_kg_per_min"
behaves = "gain"
unit = "%"
half_width = 0.1
[equipment.DC-01]
[equipment.CNT-01]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("valve")
    for file, text in (("bench.toml", BENCH), ("procedure.toml", PROCEDURE), ("world.toml", WORLD)):
        (folder / file).write_text(text)
    (folder / "register.toml").write_text(EQUIPMENT)
    (folder / "registered.toml").write_text(f'equipment = "register.toml"\n{BENCH}')
    return folder


@pytest.fixture(scope="module")
def path(folder):
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("**/*.sqlite")
    return path


def test_it_is_planned(folder):
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=folder)
    assert told.returncode == 0, told.stderr
    assert "no precision is predicted: flow_kg_per_min of its model is only known when read" in told.stdout
    assert "valve_V is varied and in no sensor's model" not in told.stdout
    registered = rig("plan", "procedure.toml", "--bench", "registered.toml", cwd=folder)
    assert "flow_kg_per_min of the model is only known when it is read" in registered.stdout
    assert "as in output = " not in registered.stdout, "it was proposed, and then refused"


def test_both_the_setting_and_what_was_read_are_in_the_table(path):
    table = run_table(path)
    assert table.factors == ("flow_kg_per_min",)
    columns = table.columns
    volts, flow = columns["valve_set_V"], columns["flow_kg_per_min"]
    assert sorted(set(volts.tolist())) == [1, 2.5, 4, 5.5, 7, 8.5, 10]
    np.testing.assert_allclose(flow, 0.5 * volts - 0.012 * volts**2, atol=0.001)
    nominal = {v: set(columns["flow_set_kg_per_min"][volts == v].tolist()) for v in set(volts.tolist())}
    assert all(len(one) == 1 for one in nominal.values()), "one nominal value at each setting"
    assert min(nominal[10.0]) == pytest.approx(3.8, abs=0.002)
    rising = np.diff(volts) > 0
    assert np.all(columns["flow_side"][1:][rising] == 1.0)


def test_it_is_fitted_and_traced_in_the_unit_of_the_standard(path):
    told = json.loads(rig("fit", path, "--json").stdout)
    terms = told["coefficients"]
    assert set(terms) == {"1", "flow_kg_per_min", "flow_kg_per_min^2"}
    found = json.loads(rig("trace", path, "--json").stdout)["sensors"]["mfs_Hz"]
    cubic = next(one for one in found["effects"] if one["effect"] == "third-order:flow_kg_per_min")
    assert abs(cubic["coefficients"][0] - 0.15) < 3.0 * cubic["stderr"][0]
    assert not any("valve" in one["effect"] for one in found["effects"])


def test_its_standard_counts_in_the_budget(path, folder):
    told = json.loads(
        rig("budget", path, "--equipment", folder / "register.toml", "--at", "flow_kg_per_min=2", "--json").stdout
    )
    result = next(one for one in told["results"] if "output at flow 2 kg/min" in one["name"])
    gain = next(one for one in result["contributions"] if one["name"] == "REF-01 gain of flow_kg_per_min")
    assert gain["standard_uncertainty"] == pytest.approx(2.0 * 0.001 / 3**0.5 * 168.0, rel=0.05), "flow times slope"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            ('of = "valve_V"', ""),
            r"is not a factor \(valve_V\), and the bench does not read it as what one of them sets",
        ),
        (('of = "valve_V"', 'of = "pump_V"'), r"references.flow_kg_per_min.of = 'pump_V' is not a factor here"),
        (('unit = "kg_per_min"', 'unit = "g_per_s"'), "channel input of coriolis reads g_per_s, not kg_per_min"),
    ],
)
def test_what_does_not_fit_is_said_by_plan(folder, tmp_path, change, says):
    (tmp_path / "bench.toml").write_text(BENCH.replace(*change))
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=tmp_path)
    assert told.returncode == 78
    assert says.replace("\\", "") in told.stderr


def test_a_world_may_have_a_lag_of_it():
    """60 s after a step a lag of 60 s is behind by 1/e of the step: of the flow, which is no multiple of the volts."""
    bench, lag = parse_toml(BENCH, "bench"), {"of": "flow_kg_per_min", "time_constant_s": 60}
    truth = read_truth({**parse_toml(WORLD, "world"), "lags": {"late": lag}}, sensor_axes(bench))
    lab = Laboratory(truth, bench, Lab(LabTruth(), 0.0), 0.0, {})
    valve = lab.source("valve")
    valve.set(100.0, 2.0)
    valve.set(1000.0, 4.0)
    flow = [0.5 * v - 0.012 * v**2 for v in (2.0, 4.0)]
    assert lab._variables(1060.0)["late"] == pytest.approx((flow[0] - flow[1]) * np.exp(-1.0), rel=1e-6)


@pytest.mark.parametrize("formula", ["", 'formula = "reading*2"\n'])
def test_a_world_may_give_a_standard_an_error_of_its_own(formula):
    """The sensors follow the flow; the standard reads 1 % and 0.01 kg/min more than flows, whatever its formula."""
    bench = parse_toml(BENCH + formula, "bench")
    world = parse_toml(WORLD.replace("noise = 0.0002", 'error = "0.01 + 0.01*flow_kg_per_min"'), "world")
    lab = Laboratory(read_truth(world, sensor_axes(bench)), bench, Lab(LabTruth(), 0.0), 0.0, {})
    lab.source("valve").set(0.0, 4.0)
    flow = 0.5 * 4.0 - 0.012 * 4.0**2
    told = lab.standard("flow_kg_per_min", 900.0, 901.0, noisy=True) * (2.0 if formula else 1.0)
    assert told == pytest.approx(1.01 * flow + 0.01, rel=1e-9)
    assert lab.clean("mfs", 900.0, 901.0) == pytest.approx(50 + 180 * flow - 3 * flow**2 + 0.15 * flow**3, rel=1e-9)


def test_a_wrong_variable_of_that_error_is_said_by_plan(folder, tmp_path):
    (tmp_path / "world.toml").write_text(WORLD.replace("noise = 0.0002", 'error = "0.01*flow"'))
    told = rig("plan", folder / "procedure.toml", "--bench", folder / "bench.toml", "--world", tmp_path / "world.toml")
    assert told.returncode == 78
    assert "references.flow_kg_per_min.error: flow is not known here" in told.stderr


@pytest.mark.parametrize(
    ("world", "says"),
    [
        ('[lags.creep]\nof = "force_kN"\n', "lags.creep.of = 'force_kN' is none of this bench"),
        ('[draws.seat]\nof = "force_kN"\n', "draws.seat.of = 'force_kN' is none of this bench"),
        ('[sensors.other]\nformula = "1"\n', "sensors.other is not known"),
        ("[sources.force_kN]\nrest = 1\n", "force_kN"),
        ('[sensors.mfs]\nformula = "force_kN"\n', "sensors.mfs.formula: force_kN is not known here"),
    ],
)
def test_a_world_that_does_not_fit_the_bench_is_refused_by_plan_with_its_name(folder, tmp_path, world, says):
    text = WORLD[: WORLD.index("[sensors.mfs]")] if "[sensors.mfs]" in world else WORLD
    (tmp_path / "stranger.toml").write_text(text + world)
    planned = rig(
        "plan", folder / "procedure.toml", "--bench", folder / "bench.toml", "--world", tmp_path / "stranger.toml"
    )
    assert planned.returncode == 78
    assert planned.stderr.startswith("rig: ")
    assert "stranger.toml: " in planned.stderr
    assert says in planned.stderr


def test_what_a_factor_sets_itself_is_not_read_of_another():
    twice = BENCH.replace('valve_V = "valve"', 'valve_V = "valve"\nflow_kg_per_min = "valve"')
    with pytest.raises(ConfigurationError, match=r"and factors\.flow_kg_per_min sets it itself"):
        parse_bench(twice, "bench.toml")


CHAMBER = """
[instruments.chamber]
driver = "scpi-source"
address = "socket://192.0.2.32:5025"
maker = "WEISS"
model = "C180"
unit = "degC"
low = 0
high = 60
set = "TEMP {value}"
decimals = 2
readback = 0.01
setpoint = "TEMP?"
read = "READ?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
tolerance = 0.1
dwell_s = 60
time_constant_s = 120
[instruments.thermometer]
driver = "scpi-meter"
address = "socket://192.0.2.34:5025"
maker = "FLUKE"
model = "1502A"
unit = "degC"
fetch = "READ?"
reading_s = 1
[temperatures.air_degC]
reader = "thermometer"
channel = "input"
place = "chamber_degC"
"""


def test_a_described_meter_reads_the_temperature_where_its_thermometer_is(tmp_path):
    """It read 0 degC, and the soak waited for it for eight hours."""
    bench = BENCH.replace("[factors]", '[factors]\nchamber_degC = "chamber"') + CHAMBER
    bench = bench.replace("[limits]", "[limits]\nchamber_degC = [5, 50]")
    factor = "[factors.chamber_degC]\nlevels = [20, 30]\nhard = true\ntolerance = 0.5\n"
    procedure = PROCEDURE.replace("[factors.valve_V]", f"{factor}[factors.valve_V]").replace("replications = 3", "")
    procedure = procedure.replace("+ flow_kg_per_min^2", "+ flow_kg_per_min^2 + chamber_degC")
    for file, text in (("bench.toml", bench), ("procedure.toml", procedure), ("world.toml", WORLD)):
        (tmp_path / file).write_text(text)
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (path,) = tmp_path.glob("**/*.sqlite")
    columns = run_table(path).columns
    np.testing.assert_allclose(columns["air_degC"], columns["chamber_set_degC"], atol=0.6)


def test_two_quantities_may_be_set_by_one_factor_that_has_a_standard_too():
    valve = SimpleNamespace(name="valve_V", set_name="valve_set_V", axis="valve")
    run_list = SimpleNamespace(factors=[valve], factor=lambda name: valve)
    of_valve = SimpleNamespace(text=lambda key: "valve_V", everything=dict)
    tables = [("flow_kg_per_min", of_valve), ("drop_kPa", of_valve)]
    bench = SimpleNamespace(table=lambda name: SimpleNamespace(tables=lambda: tables))
    rows = [
        {"valve_V": v + 0.001, "valve_set_V": v, "flow_kg_per_min": 0.5 * v, "drop_kPa": 9.0 - v, "valve_side": 1.0}
        for v in (1.0, 2.0, 2.0)
    ]
    assert put_in_place(rows, run_list, bench) == dict.fromkeys(("flow_kg_per_min", "drop_kPa"), "valve_set_V")
    assert [row["valve_set_V"] for row in rows] == [1.0, 2.0, 2.0]
    assert [row["flow_set_kg_per_min"] for row in rows] == [0.5, 1.0, 1.0]
    assert [row["drop_set_kPa"] for row in rows] == [8.0, 7.0, 7.0]
    assert {row["flow_side"] for row in rows} == {1.0}
    assert {row["drop_side"] for row in rows} == {-1.0}, "it falls where the valve opens"
    assert not any({"valve_V", "valve_side"} & row.keys() for row in rows)


def test_a_factor_that_is_read_in_another_unit_is_in_no_model(folder):
    """It passed plan and run, and `rig fit` had no such column in the morning."""
    (folder / "volts.toml").write_text(PROCEDURE.replace('"1 + flow_kg_per_min', '"1 + valve_V + flow_kg_per_min'))
    told = rig("plan", "volts.toml", "--bench", "bench.toml", cwd=folder)
    assert told.returncode == 78
    assert "valve_V sets flow_kg_per_min, which is read in its place: write flow_kg_per_min" in told.stderr


def test_the_first_row_has_the_side_from_which_it_was_approached_and_no_value_that_nobody_read(path):
    """Its side was 0, and it came from a flow that was extrapolated to 0 V."""
    table = run_table(path)
    first = int(np.argmin(table.columns["elapsed_s"]))
    assert table.columns["flow_side"][first] == 1
    assert set(table.columns["flow_side"].tolist()) <= {1.0, -1.0}
    start = table.columns["flow_from_kg_per_min"]
    assert np.isnan(start[first])
    assert np.isfinite(np.delete(start, first)).all()


def test_a_value_that_nobody_read_is_no_correction_by_a_certificate(path, folder):
    """A column with a gap counted as changed, and the budget said that certificates had corrected it."""
    told = rig("budget", path, "--equipment", folder / "register.toml")
    assert told.returncode == 0, told.stderr
    assert "corrected by the certificates" not in told.stderr
