"""`rig fit RUN --traced` of any laboratory: what a trace finds is in the calibration, or left out with a word."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command import rig
from general_lab import PROCEDURE, WORLD, run_dry

from rig.fitter.effects.history import NOTHING
from rig.procedures.errors import DataError
from rig.procedures.general.budget_traced import TracedEvaluation
from rig.procedures.general.effects.time_columns import lagging
from rig.procedures.general.infer import CurveCalibration
from rig.procedures.general.infer_table import infer_general, infer_sensors
from rig.procedures.general.model_settings import SensorModel
from rig.procedures.general.of_runs import RunModels, fit_run
from rig.procedures.general.traced import fit_traced
from rig.procedures.tables.table import Table
from rig.tables.table_of_run import run_table

LEVELS = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5, 6, 7]")
HIDDEN = WORLD.replace("noise = 1e-5", 'hidden = "0.0004*force_kN^2 + 0.0003*force_side"\nnoise = 1e-5')


def test_a_square_is_in_the_calibration_and_a_backlash_is_left_out_with_a_word(tmp_path):
    run, _ = run_dry(tmp_path, LEVELS, world=HIDDEN)
    done = rig("fit", run, "--traced", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    found = {name: one["estimate"] for name, one in told["coefficients"].items()}
    assert found["force_kN^2"] == pytest.approx(0.0004, rel=0.02)
    assert found["1"] == pytest.approx(0.1, abs=3e-5)
    assert told["sigma_E"] < 6e-5  # three readings of 20 ms: 4e-5; the backlash alone is 30e-5
    for notes in (told["notes"], told["calibration"]["notes"]):
        assert any("second-order:force_kN is in the calibration" in note for note in notes)
        assert any(note.startswith("direction:") and "was fitted and taken off" in note for note in notes)


@pytest.fixture(scope="module")
def in_air(tmp_path_factory):
    """A run of two sensors beside which a temperature was recorded; one follows it, and so does another's line."""
    run, _ = run_dry(tmp_path_factory.mktemp("air"), LEVELS.replace("replications = 2", "replications = 4"))
    table = run_table(run)
    n = len(table)
    air = 20.0 + 6.0 * np.sin(np.arange(n) / 3.0)
    cell = table.columns["cell_V"] + 0.004 * (air - 20.0)
    return replace(table, columns={**table.columns, "air_degC": air, "cell_V": cell})


def test_an_effect_of_a_recorded_temperature_is_in_the_calibration_and_needs_it_of_the_readings(in_air):
    asked = RunModels.of(in_air)
    assert asked is not None
    told = fit_traced(asked, (), NOTHING).to_json()
    assert any("readings in use need air_degC (14" in note for note in told["calibration"]["notes"])
    calibration = CurveCalibration.from_dict(told["calibration"])
    truth = 0.1 + 0.5 * 3.0 + 0.004 * -5.0
    readings = {"cell_V": np.array([truth]), "air_degC": np.array([15.0])}
    found = infer_general(calibration, lambda needed: Table("r.csv", readings, False, {}))
    assert found.columns["force_kN"][0] == pytest.approx(3.0, abs=3e-4)
    assert found.columns["force_kN_lo95"][0] < 3.0 < found.columns["force_kN_hi95"][0]
    with pytest.raises(DataError, match="none of the columns force_kN, air_degC"):
        infer_general(calibration, lambda needed: Table("r.csv", {"cell_V": readings["cell_V"]}, False, {}))


def test_a_budget_with_such_an_effect_is_at_its_mean_in_the_run(in_air):
    every = TracedEvaluation(in_air, [{"force_kN": 3.0}]).each[0]
    assert every.has_points
    assert every.at["air_degC"] == pytest.approx(in_air.columns["air_degC"].mean(), rel=1e-3)


def test_of_a_lag_of_a_recorded_quantity_what_stays_at_rest_is_in_the_calibration(in_air):
    air, t = in_air.columns["air_degC"], in_air.columns["elapsed_s"]
    late = lagging(air, np.diff(t), 3.0 * float(np.median(np.diff(t))))
    plain = in_air.columns["cell_V"] - 0.004 * (air - 20.0)
    table = replace(in_air, columns={**in_air.columns, "cell_V": plain + 0.004 * (late - 20.0)})
    asked = RunModels.of(table)
    assert asked is not None
    told = fit_traced(asked, (), NOTHING).to_json()
    found = {name: one["estimate"] for name, one in told["coefficients"].items()}
    (slope,) = (size for name, size in found.items() if "air_degC" in name)
    assert slope == pytest.approx(0.004, rel=0.03)
    assert any("holds at rest, when air_degC has long been what it is" in note for note in told["notes"])


def test_columns_that_no_sensor_needs_are_named(in_air):
    asked = RunModels.of(replace(in_air, columns={k: v for k, v in in_air.columns.items() if k != "air_degC"}))
    assert asked is not None
    one = CurveCalibration.from_dict(fit_run(asked).to_json()["calibration"])
    two = replace(one, response="other_V")
    readings = {"cell_V": np.array([1.6]), "other_V": np.array([1.6]), "air_degC": np.array([15.0])}
    found = infer_sensors({"cell_V": one, "other_V": two}, lambda needed: Table("r.csv", readings, False, {}))
    assert list(found.unused.columns) == ["air_degC"]


def test_a_sensor_whose_curve_needs_a_column_that_is_not_there_is_not_left_out_without_a_word(in_air):
    """Its output is in the table, so a value is wanted: with exit code 0 nobody reads why it is missing."""
    formulas = {"cell_V": "1 + force_kN", "other_V": "1 + force_kN + force_kN:air_degC"}
    asked = RunModels.of(replace(in_air, columns={**in_air.columns, "other_V": in_air.columns["cell_V"]}))
    assert asked is not None
    models = {output: SensorModel(formula=text, standard=None, abscissa=None) for output, text in formulas.items()}
    fitted = fit_run(replace(asked, models=models)).to_json()["sensors"]
    both = {output: CurveCalibration.from_dict(one["calibration"]) for output, one in fitted.items()}
    readings = {"cell_V": np.array([1.6]), "other_V": np.array([1.6])}
    with pytest.raises(DataError, match="To infer by cell_V alone, leave the column other_V out of the table"):
        infer_sensors(both, lambda needed: Table("r.csv", readings, False, {}))
    del readings["other_V"]
    assert infer_sensors(both, lambda needed: Table("r.csv", readings, False, {})).quantities == ("force_kN",)


def test_it_is_for_run_files(tmp_path):
    (tmp_path / "t.csv").write_text("x,y\n" + "".join(f"{i},{2 * i}\n" for i in range(9)))
    done = rig("fit", tmp_path / "t.csv", "--response", "y", "--formula", "1 + x", "--traced")
    assert done.returncode == 2
    assert "--traced is for the sensors of a run file" in " ".join(done.stderr.split())
