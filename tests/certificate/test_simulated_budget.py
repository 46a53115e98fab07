"""Budgets of runs checked by simulation of the whole evaluation."""

from __future__ import annotations

import json
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from command import rig
from general_lab import run_dry
from test_budget_command import BENCH, REGISTER
from test_influences import attitude

from rig.procedures.errors import DataError
from rig.procedures.evaluate.budgeting import Shift
from rig.procedures.evaluate.influences import influences
from rig.procedures.evaluate.simulated_budget import together, whole
from rig.procedures.evaluate.stated import PlaceConstant, Stated, Statements
from rig.procedures.present.blocks import Grid, Line
from rig.verbs.budget.evaluation import simulated_notes
from rig.verbs.budget.result import Budget, budget


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A dry run whose voltmeter has limits of error, ten times wider than all else."""
    folder = tmp_path_factory.mktemp("stand")
    bench = BENCH.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    bench = bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')
    (folder / "equipment.toml").write_text(REGISTER.replace("standard = 0.1\nrange", "half_width = 2\nrange"))
    return Path(run_dry(folder, bench=bench)[0])


def errors_of_a_laboratory():
    """An offset and a gain of the voltmeter, which act on readings in use, too; tilts of the base; gravity."""
    volts = {"x_V": 1.0, "y_V": 1.0, "z_V": 1.0}
    meter = [
        Stated("offset", "c", volts, "offset", np.zeros_like, lambda x: np.full_like(x, 1e-4), reads=True),
        Stated("gain", "c", volts, "gain", np.zeros_like, lambda x: 3e-5 * np.abs(x), reads=True),
    ]
    place = [
        PlaceConstant("gravity", 9.8, 1e-4, np.inf, "survey"),
        PlaceConstant("levelling", 0.0, 5e-3, np.inf, "level"),
    ]
    return Statements(meter, {one.name: one for one in place})


def test_without_errors_the_evaluation_gives_the_results_and_with_small_ones_what_the_budget_says():
    evaluation = attitude()
    found = influences(evaluation, errors_of_a_laboratory(), same_meter=True)
    p = len(found.influences)
    assert p == 5
    evaluate = whole(evaluation, found.shifts)
    values = evaluation.results.values
    errors = np.vstack([np.zeros(p), 0.1 * np.random.default_rng(3).normal(size=(4, p))])
    results = evaluate(errors)
    assert results[0] == pytest.approx(values, rel=1e-12, abs=1e-12)
    linear = errors @ np.array([one.sensitivities for one in found.influences])
    largest = np.max([np.abs(one.sensitivities) for one in found.influences], axis=0)
    assert np.max(np.abs(results - values - linear) / np.maximum(largest, 1e-12)) < 1e-3


def test_changes_of_the_same_input_add_up():
    first = Shift({"a": np.array([1.0, 2.0])}, lambda _, v: v + 1.0, {"g": 9.9})
    second = Shift({"a": np.array([0.5, 0.5]), "b": np.array([3.0, 3.0])}, lambda _, v: 2.0 * v, {"g": 9.7, "h": 1.5})
    found = together([first, second, Shift()], {"g": 9.8, "h": 1.0})
    assert found.columns["a"].tolist() == [1.5, 2.5]
    assert found.columns["b"].tolist() == [3.0, 3.0]
    assert found.in_use("a", np.array([10.0])).tolist() == [31.0]
    assert found.constants == pytest.approx({"g": 9.8, "h": 1.5})


@pytest.fixture(scope="module")
def simulated(run) -> Budget:
    """With 60 %, for which few trials tell: the half-width is 1.04 standard deviations if rectangular; k is 0.84."""
    return budget(run, at=[{"force_kN": 4.0}], probability=0.6, trials=600, seed=5)


def test_a_budget_that_a_rectangular_error_dominates_is_said_to_differ(simulated):
    told = simulated.to_json()
    force = next(one for one in told["results"] if one["name"] == "cell inferred force at force 4 kN")
    drawn = force["simulated"]
    assert (drawn["trials"], drawn["agrees"]) == (600, False)
    half = 0.5 * (drawn["interval"][1] - drawn["interval"][0])
    assert half / force["standard_uncertainty"] == pytest.approx(0.6 * sqrt(3.0), abs=0.1)
    assert drawn["mean"] == pytest.approx(force["value"], abs=4.0 * force["standard_uncertainty"] / sqrt(600))
    assert any("simulation (JCGM 101): 600 trials, seed 5" in note for note in told["notes"])
    assert any(note.startswith("cell inferred force at force 4 kN: the simulated interval") for note in told["notes"])


def test_people_see_both_intervals_and_a_verdict(simulated):
    lines = [block.text for block in simulated.blocks() if isinstance(block, Line)]
    assert any("by simulation of the whole evaluation" in line for line in lines)
    grid = next(block for block in simulated.blocks() if isinstance(block, Grid) and "simulated" in block.columns)
    assert {row[-1] for row in grid.rows} <= {"yes", "no", "not decided"}
    assert len(grid.rows) == len(simulated.found.budgets)


def test_what_needs_more_trials_is_said(simulated):
    checks = simulated.found.checks
    undecided = sum(check.agrees is None for check in checks)
    notes = simulated_notes(simulated.found.budgets, checks, 5)
    assert 0 < undecided < len(checks)
    assert f"for {undecided} of {len(checks)} results this needs more trials to be decided" in notes


def test_without_the_option_nothing_is_simulated(run):
    told = budget(run, at=[{"force_kN": 4.0}])
    assert told.found.checks == ()
    assert not any("simulat" in note for note in told.notes())


def test_coverage_factors_by_shape_are_those_of_a_rectangular_distribution(run):
    found = budget(run, at=[{"force_kN": 4.0}], shapes=True)
    force = next(one for one in found.found.budgets if one.name == "cell inferred force at force 4 kN")
    assert force.contributions[0].share > 0.97
    assert force.coverage_factor == pytest.approx(1.66, abs=0.02)
    assert any("by the shapes of the distributions" in note for note in found.notes())
    with pytest.raises(DataError, match="coverage factors by shape are for 94 to 96 %"):
        budget(run, probability=0.99, shapes=True)


def test_too_few_trials_are_refused(run):
    done = rig("budget", run, "--monte-carlo", "500")
    assert done.returncode == 2
    assert "--monte-carlo 500: 95 % need at least 2000 trials" in done.stderr


def test_the_command_checks_budgets_with_95_percent(run):
    done = rig("budget", run, "--at", "force_kN=4", "--monte-carlo", "2000", "--seed", "5", "--shapes", "--json")
    assert done.returncode == 0, done.stderr
    force = next(one for one in json.loads(done.stdout)["results"] if one["name"].startswith("cell inferred"))
    half = 0.5 * (force["simulated"]["interval"][1] - force["simulated"]["interval"][0])
    assert force["expanded_uncertainty"] / half == pytest.approx(1.0, abs=0.04)
    assert force["simulated"]["agrees"] is not False
