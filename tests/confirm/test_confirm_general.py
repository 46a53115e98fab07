"""`rig confirm` of runs of any laboratory: proposals, a further run, and its judgement."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest
from certificate_lab import REGISTER
from command import rig
from general_lab import BENCH, PROCEDURE, run_dry, written

from rig.bench.config import parse_procedure
from rig.examples import example
from rig.fitter.confirm import Later
from rig.fitter.errors import FitError
from rig.procedures.general.confirming import GeneralConfirming
from rig.procedures.general.effects.of_others import HYSTERESIS
from rig.procedures.general.further_runs import further_runs
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.general.together import GeneralTogether, Observations, Remembered, Whole, join
from rig.verbs.confirm.first import open_traced

CURVED = """seed = 3
[sensors.cell]
formula = "0.1 + 0.5*force_kN"
hidden = "0.0004*force_kN^2"
noise = 1e-5
[person]
sets_s = 20
"""
MORE = PROCEDURE.replace("[0, 1, 2, 5]", "[0, 1, 2, 3, 4, 5, 6, 7]")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A run of a load cell whose declared line lacks a square."""
    path, _ = run_dry(tmp_path_factory.mktemp("first"), MORE, world=CURVED)
    return path


def test_the_missing_term_is_confirmed_by_the_proposed_run_and_goes_into_the_calibration(first, tmp_path):
    done = rig("confirm", first, "--dry", "--out", tmp_path, "--json", "--report", tmp_path / "page.html")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [one["what"] for one in told["proposals"]][:1]
    (effect,) = told["effects"]
    assert (effect["named"], effect["verdict"]) == ("second-order:force_kN", "confirmed")
    low, high = effect["members"][0]["interval_95"][0]
    assert low < 0.0004 < high
    assert told["error"]["cell_V"]["after_V"] < 0.1 * told["error"]["cell_V"]["before_V"]
    assert "second-order:force_kN" in (tmp_path / "page.html").read_text()
    later = next(tmp_path.glob("*.sqlite"))
    fit = rig("fit", first, "--confirmed-by", later, "--json")
    assert fit.returncode == 0, fit.stderr
    found = json.loads(fit.stdout)
    assert found["coefficients"]["force_kN^2"]["estimate"] == pytest.approx(0.0004, rel=0.02)
    assert found["confirmed_by"]["effects"][0]["terms"] == ["cell_V: I(force_kN^2)"]


def test_an_effect_that_is_not_there_in_the_later_run_is_not_confirmed(first, tmp_path):
    later, _ = run_dry(
        tmp_path,
        MORE,
        world=CURVED.replace("0.0004*", "0*").replace("seed = 3", "seed = 4\nepoch = 2030-01-01T00:00:00Z"),
    )
    done = rig("confirm", first, "--by", later, "--json")
    assert done.returncode == 3, done.stderr
    (effect,) = json.loads(done.stdout)["effects"]
    assert effect["verdict"] in ("none holds", "not shown")


@pytest.fixture(scope="module")
def bath(tmp_path_factory):
    """A run of the bath: five sensors, four of which lack self-heating."""
    folder = tmp_path_factory.mktemp("bath")
    for name in ("bench", "procedure", "world"):
        shutil.copy(example("bath-lab") / f"{name}.toml", folder)
    run = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    return folder / run.stdout.splitlines()[0]


def test_all_sensors_with_an_effect_are_judged_together(bath):
    traced = open_traced(bath)
    (question,) = traced.questions
    sensors = {term.sensor for term in question.terms}
    assert sensors == {f"prt_{number}_mV" for number in range(1, 5)}
    later = traced.confirming.later(traced.traced.table)
    both = traced.confirming.beside(later, 86400.0)
    columns = both.untouched(question.terms)
    first_half, second_half = columns[:, : len(later)], columns[:, len(later) :]
    np.testing.assert_allclose(first_half, second_half)  # settings alone decide it
    for place, term in enumerate(question.terms):
        at = both.sensors.index(term.sensor)
        assert np.any(columns[at, :, place])
        assert not np.any(np.delete(columns[:, :, place], at, axis=0))


def test_a_replication_that_was_added_after_the_further_run_is_of_the_first_one(first):
    """Its rows come later, and the columns of every row are those of its own settings and output all the same."""
    traced = open_traced(first)
    later, table = traced.confirming.later(traced.traced.table), traced.traced.table
    added = replace(table, columns={name: v + 7200.0 * (name == "elapsed_s") for name, v in table.columns.items()})
    two = join(table, added, 0.0, ())
    of_run, roles = traced.confirming, {output: one.roles for output, one in traced.confirming.traced.each.items()}
    both = GeneralTogether.of(of_run.found.sensors, roles, two, [Later(later, 3600.0)])
    n = len(table)
    np.testing.assert_array_equal(both.run, np.repeat([0, 1], [2 * n, n]))
    np.testing.assert_array_equal(both.data.outputs["cell_V"], np.tile(table.columns["cell_V"], 3))
    squares = np.tile(table.columns["force_kN"], 3) ** 2
    np.testing.assert_allclose(both.untouched(traced.questions[0].terms)[0, :, 0], squares)
    np.testing.assert_array_equal(both.whole.begins, [0, n, 2 * n])
    (_, smooth), *_ = both.shapes(lasting=True)
    assert smooth[0, both.fresh].any()
    assert not smooth[0, ~both.fresh].any()


def test_the_first_row_of_every_run_says_nothing_of_what_needs_its_direction(first):
    """It is not known from which side the first setting is approached: 0 in the table."""
    table = open_traced(first).traced.table
    n, side = len(table), np.where(np.arange(len(table)) < 1, 0.0, 1.0)
    both = replace(table, columns={k: np.tile(v, 2) for k, v in {**table.columns, "force_side": side}.items()})
    known = {"cell_V": Remembered(sides=("force_side",)), "other_V": Remembered(sides=("none_side",))}
    whole = Whole(both, {}, {}, {}, (0, n), known)
    np.testing.assert_array_equal(np.argmax(whole.started("cell_V"), axis=0), [0, n])
    np.testing.assert_array_equal(whole.started("cell_V").sum(axis=0), [1.0, 1.0])
    assert whole.started("other_V").shape == whole.started("unknown_V").shape == (2 * n, 0)


def test_further_runs_are_procedures_that_differ_in_one_respect(tmp_path):
    files = written(tmp_path, MORE)
    first = parse_procedure(files[0].read_text(), "procedure.toml")
    assert isinstance(first, GeneralProcedure)
    runs = list(further_runs(first, {}, chamber=False))
    kinds = {run.what: run.procedure for run in runs}
    assert set(kinds) == {
        "the same again",
        "settings in random order",
        "force_kN between the settings of the first run",
        "force_kN at the settings of the first run and between them",
        "30 s at each setting before it is read",
    }
    assert kinds["settings in random order"].factors["force_kN"].order == "random"
    assert kinds["force_kN between the settings of the first run"].factors["force_kN"].levels == [
        0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5,
    ]  # fmt: skip
    assert len(kinds["force_kN at the settings of the first run and between them"].factors["force_kN"].levels) == 15
    assert {run.procedure.seed for run in runs} == {first.seed + 1}
    assert [run.procedure.replications for run in runs if run.what == "the same again"] == [1, 2, 4]
    assert {run.wait_s for run in runs} == {0.0, 25.0}
    assert all(run.procedure.expand() for run in runs)


def test_a_loop_over_a_factor_in_random_order_excludes_no_run_in_that_order(tmp_path):
    """One of many alternatives was a loop over a chamber, whose order is random: no run at all was proposed."""
    files = written(tmp_path, MORE)
    swept = parse_procedure(files[0].read_text(), "procedure.toml")
    loop = SimpleNamespace(effect=SimpleNamespace(kind=HYSTERESIS, columns=("sign(force_side)", "force_kN")))
    questions = [SimpleNamespace(members=[SimpleNamespace(terms=[loop])])]
    runs = {run.what: run for run in further_runs(swept, {}, chamber=False)}
    random = runs["settings in random order"].procedure

    def suits(what, first):
        return GeneralConfirming.suits(None, runs[what], first, questions)

    assert suits("the same again", swept)
    assert not suits("settings in random order", swept)
    assert suits("settings in random order", random)


def test_a_later_run_without_a_sensor_of_the_first_is_refused(first):
    table = open_traced(first).traced.table
    with pytest.raises(FitError, match="the confirming run has no cell_V"):
        join(table, replace(table, columns={n: v for n, v in table.columns.items() if n != "cell_V"}), 1.0, ["cell_V"])


def test_rows_of_observations_are_in_order_of_time(first):
    table = open_traced(first).traced.table
    back = replace(table, columns={name: v[::-1] for name, v in table.columns.items()})
    np.testing.assert_array_equal(Observations.of(back).elapsed_s, table.columns["elapsed_s"])


def test_the_report_of_a_trace_shows_every_sensor_and_calls_no_output_unused(bath, tmp_path):
    done = rig("trace", bath, "--json", "--report", tmp_path / "r.html")
    told, page = json.loads(done.stdout), (tmp_path / "r.html").read_text()
    outputs = [f"prt_{number}_mV" for number in range(1, 5)] + ["couple_mV"]
    assert list(told["sensors"]) == outputs
    for name in outputs:
        assert f"<h2>{name} " in page
        assert f"residuals of {name} over" in page
    unused = {one["column"]: one["why"] for one in told["unused"]["columns"]}
    assert not unused.keys() & {*outputs, "bath_degC", "current_A", "bath_set_degC"}
    assert "named with --ignore" not in unused.values()


def test_a_calibration_by_two_runs_with_a_register_is_corrected_by_the_certificates_of_both(tmp_path):
    bench = BENCH.replace('driver = "person"', 'driver = "person"\nasset = "W-1"')
    bench = bench.replace("nplc = 1", 'nplc = 1\nasset = "DVM-1"')
    register = REGISTER.replace('unit = "mV"\nstandard', 'unit = "mV"\ncorrection = 20\nstandard')
    assert register != REGISTER
    runs = []
    for name, change in (("first", ""), ("later", "epoch = 2027-01-01T00:00:00Z\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "equipment.toml").write_text(register)
        runs.append(run_dry(tmp_path / name, MORE, bench=bench, world=change + CURVED)[0])
    done = rig("fit", runs[0], "--confirmed-by", runs[1], "--out", tmp_path / "f.json", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["coefficients"]["1"]["estimate"] == pytest.approx(0.12, abs=1e-4)
    assert "rig infer adds the influences of the register" in told["uncertainty"]


def test_a_level_that_is_another_on_another_day_does_not_show_a_drift(tmp_path):
    """A drift was "shown by 140 standard errors" by the level of the next day; within that run it showed nothing."""
    drift, day_h = "0.02*elapsed_h", 24.0
    first, _ = run_dry(tmp_path / "first", MORE, world=CURVED.replace("0.0004*force_kN^2", drift))
    day = datetime.fromtimestamp(open_traced(first).began_utc_s + 3600.0 * day_h, UTC).isoformat()
    still = CURVED.replace("0.0004*force_kN^2", f"{0.02 * day_h}").replace("seed = 3", f"seed = 4\nepoch = {day}")
    later, _ = run_dry(tmp_path / "later", MORE, world=still)
    done = rig("confirm", first, "--by", later, "--json")
    (effect,) = json.loads(done.stdout)["effects"]
    assert effect["named"].startswith("drift")
    assert effect["verdict"] != "confirmed"
    assert effect["members"][0]["sigmas_shown"] < 4.0  # 40,000 by its level
