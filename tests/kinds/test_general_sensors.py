"""Runs of several sensors and factors after the fit: other models, one sensor, inference with known values, charts."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from general_lab import BENCH, PROCEDURE, REFERENCE, WORLD, WORLD_WITH_STANDARD, run_dry

from rig.fitter.arrays import FloatArray
from rig.fitter.formula import Formula
from rig.fitter.trace.engine.family import TableFamily
from rig.procedures.errors import DataError
from rig.procedures.general.charting import GeneralCharting
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.fit import fit_general
from rig.procedures.general.gross import of_table
from rig.procedures.general.infer import CurveCalibration
from rig.procedures.general.infer_table import infer_general
from rig.procedures.general.of_runs import RunModels, fit_run, reader_of
from rig.procedures.general.trace import search_table
from rig.procedures.general.trace.report import _doubt
from rig.procedures.tables.table import Table
from rig.tables.table_of_run import run_table

TWO = BENCH.replace(
    "[sensors.cell]",
    """[instruments.second]
driver = "keysight-34401a"
address = "/dev/rig/second"
nplc = 1
[sensors.other]
reader = "second"
[sensors.cell]""",
)
WORLD_OF_TWO = f"""{WORLD}
[sensors.other]
formula = "0.3 + 0.2*force_kN + 0.001*force_kN^2"
noise = 1e-5
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of two sensors."""
    path, _ = run_dry(tmp_path_factory.mktemp("two"), PROCEDURE, TWO, WORLD_OF_TWO)
    return path


@pytest.mark.parametrize(("late", "read", "said"), [(0.01, 0.01, True), (0.0, 0.01, False), (0.0, 0.0, False)])
def test_settings_that_are_read_back_elsewhere_are_told_where_rows_fit_better_there(run, late, read, said):
    """What comes late is off by the same at every replication; a readback that errs alone makes no row fit better."""
    table = run_table(run)
    late_kN = np.sin(3.0 * table.columns["force_kN"])  # the same whenever a setting comes again
    slope = np.polyfit(table.columns["force_kN"], table.columns["cell_V"], 1)[0]
    there = {
        "cell_V": table.columns["cell_V"] + slope * late * late_kN,
        "force_readback_kN": table.columns["force_kN"] + read * late_kN,
    }
    found = fit_run(RunModels.of(replace(table, columns={**table.columns, **there}))).to_json()["sensors"]
    told = {name: [note for note in one["notes"] if "as read back" in note] for name, one in found.items()}
    assert bool(told["cell_V"]) is said
    assert told["other_V"] == []


def fitted(*arguments: object) -> dict[str, object]:
    done = rig("fit", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert isinstance(found, dict)
    return found


def test_another_formula_is_fitted_to_every_sensor_of_a_run(run):
    sensors = fitted(run, "--formula", "1 + force_kN + force_kN^2")["sensors"]
    assert list(sensors) == ["other_V", "cell_V"]
    assert all(list(one["coefficients"]) == ["1", "force_kN", "force_kN^2"] for one in sensors.values())
    assert sensors["other_V"]["coefficients"]["force_kN^2"]["estimate"] == pytest.approx(0.001, rel=0.01)


def test_one_sensor_of_a_run_is_fitted_by_its_model_or_by_another(run):
    assert list(fitted(run, "--response", "cell_V")["coefficients"]) == ["1", "force_kN"]
    assert list(fitted(run, "--response", "other_V", "--formula", "1 + force_kN^2")["coefficients"]) == [
        "1",
        "force_kN^2",
    ]
    told = rig("trace", run, "--response", "other_V", "--json")
    assert list(json.loads(told.stdout)["sensors"]) == ["other_V"]


def test_a_run_is_fitted_like_any_other_table_if_its_columns_are_asked_for(run):
    found = fitted(run, "--response", "other_V", "--formula", "1 + cell_V + cell_V^2", "--whole-plot", "replicate")
    assert list(found["coefficients"]) == ["1", "cell_V", "cell_V^2"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--response", "cel_V"), "has no output cel_V; its sensors are other_V, cell_V"),
        (("--formula", "1 + force"), "has no column force"),
        (("--model", "callendar"), "--model needs --response, the column to be explained"),
    ],
)
def test_what_a_run_does_not_have_is_said(run, arguments, said):
    done = rig("fit", run, *arguments)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())


def test_outputs_of_a_run_that_were_fitted_are_not_unused(run):
    unused = {one["column"] for one in fitted(run)["unused"]["columns"]}
    assert not unused & {"cell_V", "other_V", "force_kN"}


# --- calibrations over several variables ----------------------------------------------------------------------


def of_two_variables(rng: np.random.Generator) -> tuple[Table, CurveCalibration]:
    """A meter's frequency over flow and water temperature."""
    flow, water = (axis.reshape(-1) for axis in np.meshgrid(np.linspace(5.0, 50.0, 8), [15.0, 25.0, 35.0]))
    y = hertz(flow, water) + 0.05 * rng.standard_normal(flow.size)
    table = Table("bench", {"flow_Lpm": flow, "water_degC": water, "meter_Hz": y}, simulated=True, provenance={})
    result = fit_general(reader_of(table), "meter_Hz", FORMULA, [], None)
    return table, CurveCalibration.from_dict(result["calibration"])


FORMULA = "1 + flow_Lpm + flow_Lpm:water_degC"


def hertz(flow: FloatArray, water: FloatArray) -> FloatArray:
    return 2.0 + 11.0 * flow + 0.01 * flow * water


def test_one_variable_is_inferred_where_the_table_has_the_other():
    rng = np.random.default_rng(1)
    flow, water = rng.uniform(6.0, 48.0, 20), rng.choice([17.0, 31.0], 20)
    inside = total = 0
    for _ in range(12):
        _, calibration = of_two_variables(rng)
        read = hertz(flow, water) + 0.05 * rng.standard_normal(20)
        given = Table("use", {"meter_Hz": read, "water_degC": water}, simulated=True, provenance={})
        found = infer_general(calibration, reader_of(given))
        assert found.quantities == ("flow_Lpm",)
        low, high = (np.asarray(found.columns[f"flow_Lpm_{end}"], float) for end in ("lo95", "hi95"))
        inside, total = inside + int(np.sum((low <= flow) & (flow <= high))), total + 20
        assert any("water_degC of each row is taken as exact" in note for note in found.notes)
    assert 0.90 < inside / total < 0.99  # 95 % of 240, three of their standard errors


def test_a_known_value_outside_the_calibrated_range_is_flagged_and_a_missing_one_leaves_its_row_empty():
    _, calibration = of_two_variables(np.random.default_rng(2))
    columns = {"meter_Hz": np.array([200.0, 200.0, 200.0]), "water_degC": np.array([20.0, 60.0, np.nan])}
    found = infer_general(calibration, reader_of(Table("use", columns, simulated=True, provenance={})))
    flag = list(found.columns["flag"])
    assert flag[0] == ""
    assert flag[1] == "water_degC is outside the calibrated 15 to 35"
    assert flag[2] == "no value of water_degC"
    assert np.isnan(found.columns["flow_Lpm"][2])


@pytest.mark.parametrize(
    ("columns", "quantity", "said"),
    [
        (
            ("meter_Hz",),
            None,
            "has none of the columns flow_Lpm, water_degC: one reading of meter_Hz determines one variable",
        ),
        (("meter_Hz", "flow_Lpm", "water_degC"), None, "say with --quantity which is to be inferred"),
        (("meter_Hz", "water_degC"), "flow", "--quantity flow: the calibration of meter_Hz has flow_Lpm, water_degC"),
        (("meter_Hz",), "flow_Lpm", "has no column water_degC"),
    ],
)
def test_which_variable_is_meant_is_asked_not_guessed(columns, quantity, said):
    table, calibration = of_two_variables(np.random.default_rng(3))
    given = replace(table, columns={name: table.columns[name] for name in columns})
    with pytest.raises(DataError, match=said):
        infer_general(calibration, reader_of(given), quantity=quantity)


def test_a_curve_over_several_variables_is_charted_where_its_coefficients_are_determined():
    rng = np.random.default_rng(4)
    fits = [of_two_variables(rng)[1] for _ in range(3)]
    view = GeneralCharting().view(fits, np.array([0.0, 1.0, 2.0]), None)
    assert view.usage_words == "flow_Lpm 5 to 50, water_degC 15 to 35"
    assert len(view.charted.names) == len(fits[0].coefficients)
    points = [
        {part.partition(" = ")[0]: float(part.partition(" = ")[2]) for part in name.partition(" at ")[2].split(", ")}
        for name in view.charted.names
    ]
    columns = {name: np.array([point[name] for point in points]) for name in points[0]}
    rows = Formula.parse(FORMULA).columns(columns)[1]
    assert np.linalg.cond(rows / np.linalg.norm(rows, axis=0)) < 30.0
    true = hertz(columns["flow_Lpm"], columns["water_degC"])
    values = np.array([series.values for series in view.charted.series])
    assert np.all(np.abs(values - true[:, None]) < 0.2)


def test_runs_of_several_sensors_are_charted_with_their_dates(run, tmp_path):
    world = WORLD_OF_TWO.replace("seed = 3", "seed = 8\nepoch = 2027-01-05T00:00:00Z")
    later, _ = run_dry(tmp_path, PROCEDURE, TWO, world)
    done = rig("chart", run, later, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert list(told["sensors"]) == ["other_V", "cell_V"]
    assert [one["date"] for one in told["data"]["calibrations"]][1] == "2027-01-05"


def test_a_calibration_file_of_a_run_has_the_date_of_the_run(run, tmp_path):
    later, _ = run_dry(
        tmp_path, PROCEDURE, TWO, WORLD_OF_TWO.replace("seed = 3", "seed = 8\nepoch = 2027-01-05T00:00:00Z")
    )
    for k, one in enumerate((run, later)):
        assert rig("fit", one, "--out", str(tmp_path / f"{k}.json")).returncode == 0
    done = rig("chart", str(tmp_path / "0.json"), str(tmp_path / "1.json"), "--json")
    assert done.returncode == 0, done.stderr
    assert [one["date"] for one in json.loads(done.stdout)["data"]["calibrations"]][1] == "2027-01-05"


# --- chance ---------------------------------------------------------------------------------------------------


def test_findings_by_chance_are_counted_over_all_sensors_of_a_run():
    """The best of five independent families of p, at one in twenty for all."""
    rng = np.random.default_rng(5)
    smallest = np.sort(rng.uniform(size=4000) ** 1.5)
    found = 0
    for _ in range(2000):
        drawn = rng.uniform(size=5) ** 1.5
        family = TableFamily({}, smallest, sensors=5)
        found += min(family._rank(float(p)) for p in drawn) <= 0.05
    assert 0.035 < found / 2000 < 0.065


@pytest.mark.parametrize(("t", "bound", "told"), [(370.0, True, False), (3.4, True, True), (370.0, False, True)])
def test_a_bound_of_a_probability_is_no_doubt_about_what_stands_far_beyond_it(t, bound, told):
    """Four sensors of 433 draws each can state 9 of 1,000 at least, and a lag of 370 standard errors was doubtful."""
    effect = SimpleNamespace(
        effect="setting-lag:flow",
        other_causes=0,
        coefficients=(t, 0.1),
        given=(1.0, 1.0),
        df=90.0,
        p_adjusted=0.0092,
        p_adjusted_is_bound=bound,
    )
    said = _doubt(effect, set(), tried=1800)
    assert said == ("chance alone would show as much in 9 of 1,000 runs" if told else None)


# --- the reference standard's own calibration -------------------------------------------------------------------


def test_an_overdue_reference_standard_is_told_by_plan_and_doctor_and_stands_in_the_report(tmp_path):
    bench = BENCH + REFERENCE.replace(
        'formula = "4 * reading"', 'formula = "4 * reading"\nasset = "MM-1"\ndue = 2026-01-03'
    )
    path, _ = run_dry(tmp_path, bench=bench, world=WORLD_WITH_STANDARD)
    planned = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=tmp_path)
    assert planned.returncode == 0, planned.stderr
    flat = " ".join((planned.stdout + planned.stderr).split())
    assert "reference standard of force_kN: its calibration is due 2026-01-03, before this run would end" in flat
    looked = rig("doctor", "--bench", "bench.toml", "--dry", "--json", cwd=tmp_path)
    assert "calibration of the reference standard of force_kN" in looked.stdout
    assert rig("trace", path, "--report", tmp_path / "r.html").returncode == 0
    page = (tmp_path / "r.html").read_text()
    assert "force_kN: asset MM-1, calibration due 2026-01-03, read by standard, force_kN = 4 * reading" in page


# --- settings that a reference standard read ------------------------------------------------------------------


LEVELS = np.tile(np.concatenate([np.arange(5.0, 51.0, 5.0), np.arange(50.0, 4.0, -5.0)]), 6)


def read_by_a_standard(seed: int) -> tuple[FloatArray, FloatArray]:
    """Flows as they are, and as a standard with noise reads them."""
    true = 1.0003 * LEVELS + 0.01
    return true, true + 0.003 * np.random.default_rng(seed).standard_normal(true.size)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_reference_standard_is_no_wave_over_the_settings(seed):
    true, read = read_by_a_standard(seed)
    y = 2.0 + 11.0 * true + 0.002 * np.random.default_rng(seed + 100).standard_normal(true.size)
    columns = {"flow_Lpm": read, "flow_set_Lpm": LEVELS, "elapsed_s": 60.0 * np.arange(true.size), "y_Hz": y}
    table = Table("bench", columns, simulated=True, provenance={})
    found = search_table(roles_of(table, Roles("y_Hz", "1 + flow_Lpm", time="elapsed_s"))[0])
    assert "periodic:flow_Lpm" not in [found.judge.candidates[j].effect.name for j in found.chosen]


def test_a_level_whose_repeats_agree_is_no_gross_error_and_a_single_row_is_one():
    """The declared line lacks what is at the lowest flows; all rows of that level say the same."""
    true, read = read_by_a_standard(7)
    y = 2.0 + 11.0 * true - 80.0 / (true + 0.5) + 0.01 * np.random.default_rng(8).standard_normal(true.size)
    columns = np.column_stack([np.ones_like(read), read, read**2])
    assert not of_table(y, columns).rows.size
    y[7] += 1.0
    assert of_table(y, columns).rows.tolist() == [7]
