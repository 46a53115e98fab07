"""For which state of an effect results hold is said below them, with how far the run was away from it."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig

from rig.fitter.confirm import Confirmation
from rig.tables import FileSource
from rig.tables.table_of_run import run_table
from rig.verbs.budget.evaluation import run_with_register
from rig.verbs.budget.found import budget_with, found_in
from rig.verbs.budget.lacking import lacking
from rig.verbs.budget.result import budget
from rig.verbs.certificate.html import html
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import make
from rig.verbs.data.result import fit_source

LAB = Path(__file__).parents[2] / "examples" / "load-cell-lab"
DAY = date(2026, 11, 24)
DRIFT, SIDE = "drift:elapsed_s", "direction:sign(force_side)"
V_PER_H = 0.002


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> list[Path]:
    """A run of a cell whose output drifts and depends on the side, and one that confirms both."""
    folder = tmp_path_factory.mktemp("cell")
    world, bench = (str(LAB / name) for name in ("world.toml", "bench.toml"))
    text = (LAB / "procedure.toml").read_text().replace("[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]", "[0, 2, 4, 6, 8, 10]")
    procedure = folder / "procedure.toml"
    procedure.write_text(text.replace("replications = 3", "replications = 2"))
    hidden = f"{V_PER_H}*elapsed_h + 0.0005*force_side"
    (folder / "world.toml").write_text(Path(world).read_text().replace("-0.0006*creep", hidden))
    made = rig("run", procedure, "--bench", bench, "--world", folder / "world.toml", "--dry", "--out", folder / "first")
    assert made.returncode == 0, made.stderr
    (first,) = folder.glob("first/*.sqlite")
    assert rig("confirm", first, "--dry", "--out", folder / "later").returncode == 0
    (later,) = folder.glob("later/*.sqlite")
    return [first, later]


@pytest.fixture(scope="module")
def found(runs):
    return found_in(run_with_register(runs[0]), runs[0], runs[1:])


def test_the_page_says_for_which_state_results_hold_and_how_far_the_run_was_away(runs):
    """It said that the value by the model with the effects is inside, which held for the mean over the run alone."""
    document = make(CertificateRequest((runs[0],), DAY, settings=LAB / "certificate.toml")).document
    page = html(document)
    assert "the value by the model with them is inside" not in page
    (table,) = document.tables
    told = table.notes[-1]
    assert f"{SIDE} (half-way between both directions)" in document.models[0]
    assert f"{DRIFT} (for its mean over the run)" in document.models[0]
    assert "in these states and conditions" in document.models[0]
    assert DRIFT not in told, "the states stand once on the page"
    columns = run_table(runs[0]).columns
    hidden = V_PER_H * columns["elapsed_s"] / 3600.0 + 0.0005 * columns["force_side"]
    declared = np.vander(columns["force_kN"], 3)
    most = np.max(np.abs(hidden - declared @ np.linalg.lstsq(declared, hidden)[0]))
    assert float(told.split("the model with these effects is ")[1].split()[0]) == pytest.approx(most, rel=0.05)


def test_a_traced_page_says_what_was_left_out_of_its_results(runs):
    asked = CertificateRequest((runs[0],), DAY, settings=LAB / "certificate.toml", traced=True)
    document = make(asked).document
    (table,) = document.tables
    assert "lacks" not in table.notes[-1]
    assert table.notes[-1].startswith("At the worst place of the run (force")
    assert "the output was " in table.notes[-1]
    assert "Where states of effects stand in brackets, this is so in these states." in html(document)
    assert f"{DRIFT} (for its mean over the run)" in document.models[0]


def test_a_line_names_the_state_that_its_number_is_of(runs):
    """The label named the drift; the number was of the results in its mean."""
    lines = {line.name for one in budget(runs[0]).found.budgets for line in one.contributions}
    (label,) = [one for one in lines if one.startswith("effects beside")]
    assert f"{DRIFT} (for its mean over the run)" in label
    assert f"{SIDE} (half-way between both directions)" in label


def test_what_an_uncertainty_does_not_cover_is_said_of_the_result():
    table = SimpleNamespace(columns={"x_mm": np.array([1.0, 1.0, 2.0, 2.0])}, factors=("x_mm",))
    results = SimpleNamespace(names=("y output at x 1 mm", "y output at x 2 mm"), sensors=("y_V", "y_V"))
    results.at = ({"x_mm": 1.0}, {"x_mm": 2.0})
    declared = SimpleNamespace(modelled=lambda: {"y_V": np.zeros(4)}, results=results)
    traced = SimpleNamespace(modelled=lambda: {"y_V": np.array([0.1, -0.1, 0.5, -0.5])}, holds=dict)
    made = [SimpleNamespace(name=name, unit="V", expanded_uncertainty=0.3) for name in results.names]
    told = str(lacking(table, declared, traced, {"y_V": ["drift"]}, made)["y_V"])
    assert "0.5 V away" in told
    assert told.endswith("does not cover that: output at x 2 mm has U = 0.3 V, and the run was up to 0.5 V away there.")


def test_an_effect_that_is_left_open_does_not_take_the_settled_ones_out_of_the_results(runs, found, monkeypatch):
    """One undecided effect sent the results back to the declared model, unlike `rig fit --confirmed-by`."""
    of, at = run_with_register(runs[0]), [{"force_kN": 5.0}]
    asked = {"at": at, "options": None, "shapes": False}
    assert set(found.verdicts.values()) == {"confirmed"}
    judged = Confirmation.verdict.fget
    monkeypatch.setattr(
        Confirmation, "verdict", property(lambda one: "undecided" if one.effect == DRIFT else judged(one))
    )
    made = budget_with(of, found, asked)
    assert made.lacks == {"cell_V": [DRIFT]}
    lines = [line.name for one in made.budgets for line in one.contributions]
    assert "reversibility of cell_V" in lines  # the side is in the model, and its results are half-way
    assert "The model of these results lacks drift:elapsed_s." in str(made.lacking["cell_V"])
    calibration = fit_source(FileSource(runs[0]), {}, (), runs[1:], keep=True)
    kept = calibration.to_json()["budget"]
    assert kept["uncertainty"] == "total"
    assert "reversibility of cell_V" in [line["name"] for line in kept["lines"]["cell_V"]]
    assert any("The model of these results lacks drift:elapsed_s." in note for note in kept["notes"])


def test_a_budget_with_confirmed_effects_is_that_of_the_traced_model(runs):
    confirmed, traced = budget(runs[0], confirmed_by=runs[1:]), budget(runs[0], traced=True)
    pairs = zip(confirmed.found.budgets, traced.found.budgets, strict=True)
    assert all(one.expanded_uncertainty == other.expanded_uncertainty for one, other in pairs)
    done = rig("budget", runs[0], "--confirmed-by", runs[1], "--traced")
    assert done.returncode == 2
    assert "omit --traced" in done.stderr


def test_a_calibration_says_in_use_for_which_state_it_holds(runs, found):
    """A drift that a further run confirmed was taken off the outputs, and no use of the calibration said so."""
    assert set(found.verdicts.values()) == {"confirmed"}
    kept = fit_source(FileSource(runs[0]), {}, (), runs[1:], keep=True).to_json()["budget"]
    (states,) = [note for note in kept["notes"] if "Results hold" in note]
    assert f"of {DRIFT}, for its mean over the run" in states
    assert any("the output was" in note and "away from these states" in note for note in kept["notes"])
