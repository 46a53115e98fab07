"""`rig budget --traced` of general and pressure runs: effects are in the model, look-alikes in a line."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from certificate_lab import REGISTER
from command import rig
from general_lab import BENCH, PROCEDURE, WORLD, run_dry

from proving.truth.pressure import HOMOSCEDASTIC, simulate
from rig.procedures.general.budget_traced import TracedEvaluation as GeneralTraced
from rig.procedures.general.model_settings import SensorModel
from rig.procedures.general.of_runs import RunModels
from rig.procedures.general.traced import WithEffects
from rig.procedures.pressure.budget import PressureEvaluation
from rig.procedures.pressure.budget_traced import TracedEvaluation
from rig.procedures.pressure.trace import trace_whole_plots
from rig.tables.table_of_run import run_table
from rig.verbs.budget.result import budget

SQUARE = 3e-5
"""V/kN2, so small that the data cannot tell it from other curves."""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stand")
    bench = BENCH.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    (folder / "equipment.toml").write_text(REGISTER)
    procedure = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5]").replace("replications = 2", "replications = 3")
    world = WORLD.replace("noise = 1e-5", f'hidden = "{SQUARE}*force_kN^2"\nnoise = 1e-5')
    bench = bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')
    return run_dry(folder, procedure, bench=bench, world=world)[0]


def test_a_general_budget_has_the_causes_that_look_alike(run):
    """It takes a second, for a trace of the run."""
    told = budget(run, traced=True, at=[{"force_kN": 4.5}]).found
    by_name = {one.name: one for one in told.budgets}
    output = by_name["cell output at force 4.5 kN"]
    (model,) = (line for line in output.contributions if line.name.startswith("model: "))
    assert model.name.startswith("model: cell_V, second-order:force_kN, or ")
    others = model.name.partition(", or ")[2].split(" or ")
    assert {"third-order:force_kN", "fourth-order:force_kN"} <= set(others)
    table = run_table(run)
    x, y = table.columns["force_kN"], table.columns["cell_V"]

    def curve(power: int) -> float:
        columns = np.vander(x, 2, increasing=True), (x**power)[:, None]
        a, b, c = np.linalg.lstsq(np.hstack(columns), y, rcond=None)[0]
        return float(a + b * 4.5 + c * 4.5**power)

    known = sum((curve(power) - curve(2)) ** 2 for power in (3, 4)) / (len(others) + 1)
    assert model.standard_uncertainty >= 0.99 * known**0.5 > 1e-6
    truth = 0.1 + 0.5 * 4.5 + SQUARE * 4.5**2
    assert abs(output.value - truth) < output.expanded_uncertainty
    assert "force_kN^2 is" not in by_name
    assert "cell coefficient force_kN^2" in by_name
    assert any("second-order:force_kN is in the model of the results" in note for note in told.notes)
    assert not any("do not cover" in note for note in told.notes)


def test_a_calibration_with_effects_has_the_model_error_of_the_budget_in_its_intervals(run, tmp_path):
    kept, readings = tmp_path / "c.json", tmp_path / "readings.csv"
    assert rig("fit", run, "--traced", "--out", kept).returncode == 0
    readings.write_text("cell_V\n2.350608\n")
    done = rig("infer", kept, readings, "--out", tmp_path / "out.csv")
    assert done.returncode == 0, done.stderr
    assert "second-order:force_kN, or " in done.stderr
    assert "it is in the intervals, as in the budget of the run" in " ".join(done.stderr.split())
    (row,) = csv.DictReader((tmp_path / "out.csv").read_text().splitlines())
    by_name = {one.name: one for one in budget(run, traced=True, at=[{"force_kN": 4.5}]).found.budgets}
    force = by_name["cell inferred force at force 4.5 kN"]
    assert any(line.name.startswith("model:") for line in force.contributions)
    assert float(row["force_kN"]) == pytest.approx(4.5, abs=1e-3)
    assert float(row["force_kN_sd"]) == pytest.approx(force.standard_uncertainty, rel=1e-3)


def test_without_it_a_budget_says_what_it_lacks(run):
    names = {line.name for one in budget(run).found.budgets for line in one.contributions}
    assert not any(name.startswith("model:") for name in names)


def test_a_pressure_budget_has_the_causes_that_look_alike():
    """The reference's own curve looks like the transducers' third order: by that cause P^3 is not in the model."""
    at = [(1.0, -90.0, 0.0), (3.2, -100.0, 10.0)]
    data, _ = simulate(replace(HOMOSCEDASTIC, cubic_mV_per_psi3=0.004), 3)
    evaluation = TracedEvaluation(data, "full", at, trace_whole_plots(data, "full", validate=False))
    assert list(evaluation.notes()) == ["with the effect pressure-third-order, as terms of the model: P^3"]
    (model,) = evaluation.model_errors()
    assert model.name == "model: pressure-third-order, or reference-nonlinearity"
    plain = PressureEvaluation(data, "full", at).each[0]
    own = evaluation.each[0]
    moved = plain.values(plain.fitted, own.readings)[-4:] - own.values(own.fitted, own.readings)[-4:]
    assert np.sqrt(np.diag(model.covariance))[-4:] == pytest.approx(np.abs(moved) / 2**0.5)
    truth = replace(HOMOSCEDASTIC, cubic_mV_per_psi3=0.004).output_mV(*np.array(at).T)
    sd = np.sqrt(np.diag(evaluation.results.type_a.covariance))[-4:-2]
    assert np.all(np.abs(own.readings - truth) < 3 * sd)
    assert np.all(np.abs(own.readings - truth) < np.abs(plain.readings - truth))


def test_a_cause_with_one_more_factor_gives_the_same_inferred_quantity(run):
    """Both are factors of the run, and the model says of neither that a reading determines it."""
    table = run_table(run)
    x, rng = table.columns["force_kN"], np.random.default_rng(1)
    room = 21.0 + 0.08 * x**2 + 0.05 * rng.standard_normal(len(x))
    y = 0.1 + 0.5 * x + 2e-3 * x**2 + 1e-5 * rng.standard_normal(len(x))
    table = replace(table, factors=("force_kN", "oven_degC"), columns={**table.columns, "oven_degC": room, "cell_V": y})
    curve, oven = (
        RunModels(table, {"cell_V": SensorModel(formula=f"1 + force_kN + {term}", standard=None, abscissa=None)})
        for term in ("force_kN^2", "oven_degC")
    )
    others = (("cell_V", "second-order:force_kN", "temperature:oven_degC", oven),)
    found = WithEffects(curve, {}, others, off={}, slopes={}, by_side={}, outcomes=())
    at = {"force_kN": 4.5, "oven_degC": 22.0}
    ((_, _, _, moved),) = GeneralTraced(table, [at], found)._moved
    a, b, c = np.linalg.lstsq(np.column_stack([np.ones_like(x), x, room]), y, rcond=None)[0]
    u, v, w = np.linalg.lstsq(np.vander(x, 3, increasing=True), y, rcond=None)[0]
    reading = u + v * 4.5 + w * 4.5**2
    assert moved[-1] == pytest.approx((reading - a - c * 22.0) / b - 4.5, rel=1e-6)
    assert moved[-2] == pytest.approx(a + b * 4.5 + c * 22.0 - reading, rel=1e-6)
