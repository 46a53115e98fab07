"""Confirming an effect of pressure transducers on a run nobody has seen; the truth is proving/truth/whole_plot.py's."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from dry_pressure import LAB, SHORT, dry
from few_sensors import with_sensors

from proving.truth.whole_plot import Bench, Run, Transducer, simulate
from rig.fitter.confirm import NOTHING, Later, confirm, confirm_all, questions_of, separation
from rig.procedures.pressure.confirming import WholePlotConfirming
from rig.procedures.pressure.options import FitOptions
from rig.procedures.pressure.together import WholePlotTogether
from rig.procedures.pressure.trace import trace_whole_plots
from rig.verbs.confirm import judge, open_traced, otherwise
from rig.verbs.confirm.calibration import with_confirmed

CUBIC = 6e-3
MODEL = "1 + P + T_sensor + T_SSE"
DAY_S = 86400.0
QUESTION = "pressure-third-order", NOTHING
FEWER = Run(pairs=((-1.0, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (0.0, 0.0)))


def together(first_bench: Bench, later_bench: Bench) -> tuple[WholePlotTogether, tuple]:
    first = simulate(first_bench, seed=4)
    found = trace_whole_plots(first)
    later = simulate(later_bench, FEWER, seed=5)
    return WholePlotTogether.of(found, first, [Later(later, DAY_S * 2)]), questions_of(found)


def test_a_cubic_that_is_there_is_confirmed_with_its_size() -> None:
    bench = Bench(transducers=(Transducer(cubic=CUBIC), Transducer()))
    both, (question,) = together(bench, bench)
    answer = confirm(both, question)
    assert answer.verdict == "confirmed"
    (best,) = answer.members
    assert best.effect == "pressure-third-order"
    low, high = best.intervals[0]
    assert low < CUBIC < high
    error = confirm_all(both, (question,)).errors["bridge_1_mV"]
    assert error.after < error.before


def test_one_that_was_there_on_the_first_night_only_is_not() -> None:
    both, (question,) = together(Bench(transducers=(Transducer(cubic=CUBIC),)), Bench())
    assert confirm(both, question).verdict == "none holds"


def test_a_forecast_owes_nothing_to_the_outputs_of_the_later_run() -> None:
    bench = Bench(transducers=(Transducer(cubic=CUBIC),))
    both, questions = together(bench, bench)
    blind = replace(both.data, outputs={name: np.where(both.fresh, 0.0, v) for name, v in both.data.outputs.items()})
    forecast = separation(replace(both, scene=replace(both.scene, data=blind)), questions)
    assert forecast[0].sigmas[QUESTION] == pytest.approx(separation(both, questions)[0].sigmas[QUESTION], rel=1e-9)


def test_the_forecast_is_the_judges_figure_which_counts_both_runs() -> None:
    """The response stays from run to run, so that an effect in the first run alone is as bad as none in either.

    With the same pressures in both, readings with errors alike and nothing between whole plots, what shows the effect
    grows as the root of all readings.
    """
    bench = Bench(transducers=(Transducer(cubic=CUBIC),), whole_plot=0.0)
    first = simulate(bench, seed=4)
    found = trace_whole_plots(first)
    seen = []
    for times in (1, 4):
        later = simulate(bench, Run(pairs=times * FEWER.pairs), seed=5)
        (told,) = separation(WholePlotTogether.of(found, first, [Later(later, 2 * DAY_S)]), questions_of(found))
        seen.append(told.sigmas[QUESTION])
    n = len(first)
    few, many = (times * len(FEWER.pairs) * 11 for times in (1, 4))
    assert seen[1] / seen[0] == pytest.approx(np.sqrt((n + many) / (n + few)), rel=0.02)


@pytest.fixture(scope="module")
def followed(tmp_path_factory) -> tuple[Path, dict]:
    """A run of the simulated bench, and what `rig confirm` told of it."""
    folder = tmp_path_factory.mktemp("followed")
    bench, world = with_sensors(LAB, folder, "bridge_1", "bridge_2")
    first = dry(folder, text=SHORT.replace("seed = 2", "seed = 7"), bench=bench, world=world)
    done = rig("confirm", first, "--dry", "--json", "--formula", MODEL, "--out", folder)
    assert done.returncode in (0, 3), done.stderr
    return first, json.loads(done.stdout)


def test_the_command_confirms_on_the_simulated_bench(followed) -> None:
    told = followed[1]
    assert told["effects"]
    errors = told["error"].values()
    assert sum(e["after_psi"] for e in errors) < sum(e["before_psi"] for e in errors)


def test_a_calibration_takes_what_was_confirmed_and_says_by_which_run(followed) -> None:
    first, told = followed
    fitted = rig("fit", first, "--confirmed-by", told["run"], "--formula", MODEL, "--json")
    assert fitted.returncode == 0, fitted.stderr
    result = json.loads(fitted.stdout)
    record = result["confirmed_by"]
    assert record["by_run_id"] in told["run"]
    assert [effect["verdict"] for effect in record["effects"]] == [effect["verdict"] for effect in told["effects"]]
    added = {term for effect in record["effects"] for term in effect["terms"]}
    assert set(result["sensors"]["bridge_1_mV"]["coefficients"]) == {"1", "P", "T_sensor", "T_SSE"} | added


def test_what_is_not_confirmed_adds_nothing_to_a_calibration(followed) -> None:
    """As above, had no member of any class predicted the later run."""
    opened = open_traced(Path(followed[0]), formula=MODEL)
    confirmed = judge(opened, Path(followed[1]["run"]))
    answers = tuple(
        replace(answer, members=tuple(replace(member, p_changed=0.0, fits=False) for member in answer.members))
        for answer in confirmed.answers
    )
    assert {answer.verdict for answer in answers} == {"none holds"}
    judged = replace(confirmed.judged, answers=answers)
    result = with_confirmed(opened, replace(confirmed, judged=judged), FitOptions(formula=MODEL)).to_json()
    record = result["confirmed_by"]
    assert all(effect["terms"] == [] and "nothing was added" in effect["used"] for effect in record["effects"])
    coefficients = result["sensors"]["bridge_1_mV"]["coefficients"]
    assert set(coefficients) == {"1", "P", "T_sensor", "T_SSE"}


def test_the_terms_of_what_is_confirmed_are_added(followed) -> None:
    """As above, had one of the effects held alone."""
    opened = open_traced(Path(followed[0]), formula=MODEL)
    confirmed = judge(opened, Path(followed[1]["run"]))
    answers = list(confirmed.answers)
    formulas = {
        (k, member.effect): {candidate.term.formula for candidate in member.terms}
        for k, question in enumerate(opened.questions)
        for member in question.members
        if all(candidate.term.formula for candidate in member.terms)
    }
    (at, effect), terms = next(iter(formulas.items()))
    best = next(m for m in answers[at].members if m.effect == effect)
    ends = tuple((1.0, 2.0) for _ in best.intervals)
    held = replace(best, sigmas=0.0, p_changed=0.5, fits=True, shown=20.0, intervals_together=ends)
    answers[at] = replace(answers[at], members=(held,))
    judged = replace(confirmed.judged, answers=tuple(answers))
    result = with_confirmed(opened, replace(confirmed, judged=judged), FitOptions(formula=MODEL)).to_json()
    record = result["confirmed_by"]
    assert set(record["effects"][at]["terms"]) == terms
    assert f"the calibration has {effect} alone" in record["effects"][at]["used"]
    assert terms <= set(result["sensors"]["bridge_1_mV"]["coefficients"])


@pytest.mark.parametrize(("other", "said"), [("thermal-lag", True), (NOTHING, False)])
def test_what_is_promised_of_two_explanations_is_said_to_be_too_much(other, said) -> None:
    separations = [SimpleNamespace(chances={("hysteresis", other): 0.99})]
    proposal = SimpleNamespace(likely=True, separations=separations, open_pairs=())
    told = list(otherwise(SimpleNamespace(confirming=WholePlotConfirming), proposal))
    assert any("two thirds" in line for line in told) is said
