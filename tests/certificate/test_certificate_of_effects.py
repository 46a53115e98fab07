"""Certificates of runs in which the trace found an effect beside the declared model."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from types import SimpleNamespace

import pytest
from command import rig

from rig.fitter.rounding import rounded_df
from rig.verbs.budget.evaluation import budget_of, run_with_register, shapes_at
from rig.verbs.budget.found import Found, with_notes
from rig.verbs.budget.result import budget
from rig.verbs.certificate.html import html
from rig.verbs.certificate.request import CertificateRequest
from rig.verbs.certificate.result import Made, make
from rig.verbs.certificate.runs import read_run

LAB = Path(__file__).parents[2] / "examples" / "load-cell-lab"
DAY = date(2026, 11, 24)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cell")
    files = (str(LAB / name) for name in ("procedure.toml", "bench.toml", "world.toml"))
    procedure, bench, world = files
    rig("run", procedure, "--bench", bench, "--world", world, "--dry", "--out", str(folder))
    (found,) = folder.glob("*.sqlite")
    return found


@pytest.fixture(scope="module")
def declared(run) -> Made:
    return make(CertificateRequest((run,), DAY, settings=LAB / "certificate.toml"))


@pytest.fixture(scope="module")
def traced(run) -> Made:
    return make(CertificateRequest((run,), DAY, settings=LAB / "certificate.toml", traced=True))


def at_rest(F: float) -> float:
    """Output of the example's world without its creep, V."""
    return 0.0123 + 0.50021 * F - 0.000004 * F**2


def _outputs(made: Made) -> dict[float, object]:
    (table,) = made.document.tables
    ones = [one for one in table.results if one.label.startswith("output")]
    return {float(one.label.split()[-2]): one for one in ones}


@pytest.mark.parametrize("F", [2.0, 5.0, 10.0])
def test_a_result_is_within_its_uncertainty_of_the_curve_at_rest(declared, traced, F):
    for made in (declared, traced):
        one = _outputs(made)[F]
        assert abs(one.estimate - at_rest(F)) < one.factor * one.standard


def test_a_traced_certificate_has_the_numbers_of_the_traced_budget(run, traced):
    at = [{"force_kN": F} for F in (2, 5, 10)]
    whole = budget_of(run_with_register(run), at=at, options={"traced": True})
    found = {one.name: one for table in traced.document.tables for one in table.results}
    for one in whole.budgets:
        assert (found[one.name].estimate, found[one.name].standard) == (one.value, one.standard_uncertainty)
    (model,) = traced.document.models
    assert "with the effects that were found (cell: creep:force_kN (at rest, when" in model
    assert "lies within it with the stated coverage probability" in html(traced.document)


def test_without_acceptance_the_effect_is_a_line_of_each_result_that_it_moves(declared, traced):
    other = {one.name: one for one in traced.budgets[0].budgets}
    for one in declared.budgets[0].budgets:
        (line,) = [
            c
            for c in one.contributions
            if c.name
            == "effects beside the declared model: creep:force_kN (at rest, when force_kN has long been what it is)"
        ]
        assert line.kind == "B"
        if "inferred" not in one.name:
            assert line.standard_uncertainty >= abs(one.value - other[one.name].value)
    inferred = next(one for one in declared.budgets[0].budgets if one.name == "cell inferred force at force 10 kN")
    (line,) = [c for c in inferred.contributions if c.name.startswith("effects beside")]
    assert line.standard_uncertainty > 0.0025  # 1.5 mV over 0.5 V/kN


def test_type_a_is_of_three_replications_and_up_and_down_have_a_line(declared, traced):
    """63 readings in three replications, up and down 2.5 mV apart at 5 kN: not 60 degrees of freedom, and no secret."""
    (one,) = [one for one in declared.budgets[0].budgets if one.name == "cell output at force 5 kN"]
    lines = {line.name: line for line in one.contributions}
    assert lines["scatter of readings"].df == pytest.approx(2.0, abs=0.01)
    assert lines["reversibility of cell_V"].standard_uncertainty == pytest.approx(0.0025 / 2, rel=0.1)
    every = [line.name for one in traced.budgets[0].budgets for line in one.contributions]
    assert "reversibility of cell_V" not in every  # without the creep they do not differ
    notes = " ".join(declared.document.notes)
    assert "by the results of 3 replications" in notes
    assert "rising and falling series differ" in notes


def test_without_acceptance_the_page_does_not_say_that_the_value_lies_within(declared):
    page = html(declared.document)
    assert "lies within it with the stated coverage probability" not in page
    assert "rig certificate" not in page, "a customer's page has no command lines"
    assert "force_kN²: coefficients of the declared model over the range of this run" in page
    assert "no properties of the item. Under their table stands which" in page


def test_a_coefficient_that_has_absorbed_a_part_of_an_effect_says_so_under_its_table(declared, traced):
    page = html(declared.document)
    absorbed = [one for one in declared.document.tables[0].notes if "absorbed" in one]
    assert absorbed == [
        "Coefficient 1 has absorbed a part of creep:force_kN: without it in the model it is 0.01106 V, with it "
        "0.01229 V, a change of 1.4 times its standard uncertainty."
    ], "at rest it is 0.0123 V; the other coefficients change by less than their uncertainties"
    assert absorbed[0] in page
    assert not [one for one in traced.document.tables[0].notes if "absorbed" in one]


@pytest.mark.parametrize("count", [3, 4])
def test_a_budget_tells_a_few_such_coefficients_one_by_one_and_many_in_a_line(declared, count):
    one = declared.budgets[0]
    absorbed = {f"cell coefficient {k}": f"has absorbed {k}" for k in range(count)}
    told = [n for n in with_notes(one.of, Found(()), replace(one, absorbed=absorbed)).notes if "absorbed" in n]
    few = [f"cell coefficient {k} has absorbed {k}" for k in range(3)]
    many = "cell coefficient 0, cell coefficient 1, cell coefficient 2, cell coefficient 3 have absorbed a part of the"
    assert (told == few) if count == 3 else (len(told) == 1 and told[0].startswith(many))


def test_more_than_error_without_a_cause_is_not_called_no_effect(declared):
    """ "No effect was found" stood beside "left more than error": a reader saw a contradiction."""
    one = declared.budgets[0]

    def notes(*unnamed: bool) -> str:
        outcomes = [SimpleNamespace(sensor=f"s{n}", named=(), unnamed=left) for n, left in enumerate(unnamed)]
        return "; ".join(with_notes(one.of, Found(outcomes), one).notes)

    assert "no effect was found" in notes(False)
    assert "left more than error in s1 and found no cause" in notes(False, True)
    assert "no effect was found" not in notes(False, True)


def test_the_table_of_effects_has_sizes_in_the_outputs_unit_and_the_time_constant_with_its_interval(declared):
    """The world's creep has 240 s; this run's is one of the few of which the interval ends below it."""
    (effect,) = declared.document.effects
    assert effect.size == (
        "0.000983 V rms, 0.0029 V from end to end (0.0009811 to 0.0009858 V rms); "
        "time constant 236.3 s (233.9 to 238.8 s)"
    )
    page = html(declared.document)
    assert "time constant 236.3 s" in page
    assert "the output still moves" in page
    assert "in units of" not in page


def test_conformity_counts_the_effect(declared, traced, run, tmp_path):
    text = (LAB / "certificate.toml").read_text().replace("deviation = 0.05", "deviation = 0.015")
    (tmp_path / "certificate.toml").write_text(text)
    narrow = [
        make(CertificateRequest((run,), DAY, settings=tmp_path / "certificate.toml", traced=one))
        for one in (False, True)
    ]
    words = [one.document.statements[0] for one in narrow]
    assert words[0].verdict == "conditionalFail"
    assert float(words[0].probability) > 0.3  # 0.094 without the line
    assert words[1].verdict == "pass"


def test_an_effect_that_a_further_run_confirmed_is_in_the_results(monkeypatch, run, traced):
    ask = read_run.__globals__["found_in"]

    def judged(of, path, later, equipment):
        answer = SimpleNamespace(effect="creep:force_kN", verdict="confirmed", members=(), holding=("creep:force_kN",))
        return replace(ask(of, path), confirmed=SimpleNamespace(answers=(answer,), paths=later))

    monkeypatch.setitem(read_run.__globals__, "found_in", judged)
    made = make(CertificateRequest((run,), DAY, settings=LAB / "certificate.toml", confirmed_by=(run,)))
    assert made.document.tables == traced.document.tables
    assert made.document.models == traced.document.models


@pytest.mark.parametrize(("df", "printed"), [(59.9999999, "60"), (59.99, "59"), (60.0000001, "60"), (1e9, "∞")])
def test_rounding_errors_take_no_degree_of_freedom(df, printed):
    assert rounded_df(df) == printed


def test_a_prediction_with_the_effects_is_refused_by_fit_with_the_command_that_makes_it(run):
    done = rig("fit", run, "--traced", "--at", "force_kN=2")
    assert done.returncode == 2
    assert "with effects beside it: rig budget RUN --traced --at NAME=VALUE" in done.stderr
    made = rig("budget", run, "--traced", "--at", "force_kN=2", "--full")
    assert "cell output at force 2 kN" in made.stdout


def test_the_budget_of_a_run_has_the_numbers_of_its_certificate(run, declared):
    """It was of the declared model without a word about the effect, with Student's t where limits dominate."""
    found = budget(run, at=[{"force_kN": F} for F in (2, 5, 10)])
    for mine, theirs in zip(found.found.budgets, declared.budgets[0].budgets, strict=True):
        assert (mine.name, mine.value) == (theirs.name, theirs.value)
        assert mine.expanded_uncertainty == pytest.approx(theirs.expanded_uncertainty, rel=1e-12)
        assert mine.coverage_factor == theirs.coverage_factor
    (told,) = [note for note in found.notes() if note.startswith("the run was traced")]
    assert "each result that these effects move has a line for them" in told
    assert sum("lacks creep:force_kN" in note for note in found.notes()) == 1  # it was said twice
    accepted = budget(run, traced=True)
    assert not [note for note in accepted.notes() if note.startswith("the run was traced")]


def test_the_terminal_says_how_results_with_the_effects_are_stated(run, tmp_path):
    settings = tmp_path / "certificate.toml"  # a copy: the register of numbers is written beside it
    settings.write_text((LAB / "certificate.toml").read_text())
    done = rig("certificate", run, "--settings", settings, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "--traced states those with them" in " ".join(done.stderr.split())


def test_what_a_simulation_leaves_out_of_a_budget_is_said(run):
    (told,) = [note for note in budget(run, trials=2000).notes() if "not traced" in note]
    assert told.endswith("without --monte-carlo effects are looked for and counted")


def test_coverage_factors_are_by_shape_where_limits_dominate_as_on_a_certificate():
    assert shapes_at(0.95) == "where limits dominate"
    assert shapes_at(0.99) is False
