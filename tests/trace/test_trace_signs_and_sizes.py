"""Signs and sizes that the engine of traces asks for, and what it sees of whole plots."""

import gc
from dataclasses import dataclass
from weakref import ref

import numpy as np
import pytest

from proving.truth.whole_plot import Bench, Transducer, simulate
from proving.truth.whole_plot_hidden import hide
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Independent
from rig.fitter.trace.engine.problem import Candidate, Problem
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.pressure.trace import trace_whole_plots

N = 60


@dataclass(frozen=True)
class Effect:
    """What an engine needs of an entry."""

    name: str
    source: str = "setting"


def judge_of(sign=0, most=np.inf):
    """One candidate whose coefficient is 2 in units of its column."""
    rng = np.random.default_rng(5)
    x = rng.standard_normal(N)
    one = Candidate(Effect("bend"), TableTerm(("x",), x[:, None]), None, sign, most)
    y = 2.0 * x + rng.standard_normal(N)
    return TableJudge(Problem(y, np.ones((N, 1)), (one,), Independent(N), np.ones(N), ordered=False))


@pytest.mark.parametrize(
    ("sign", "most", "found"), [(0, np.inf, True), (1, 3.0, True), (-1, np.inf, False), (0, 1.0, False)]
)
def test_a_coefficient_of_an_impossible_sign_or_size_is_no_finding(sign, most, found):
    judge = judge_of(sign, most)
    assert judge.best(()) == ((0,) if found else ())
    assert (judge.p_adjusted((0,), 0) <= ALPHA) == found
    assert judge.significant((0,), 0) == found
    assert judge.adjusted((), 0) <= ALPHA  # but for that


def test_simulated_tables_go_with_their_judge():
    """Not when rubbish is collected: a run's are a hundred megabytes."""
    gc.disable()
    try:
        judge = judge_of()
        judge.family(0).adjust("bend", 3.0)
        problem = ref(judge.problem)
        del judge
        assert problem() is None
    finally:
        gc.enable()


def named(found):
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.effects if e.stratum != "noise"}


def test_a_step_between_whole_plots_is_seen_nearer_to_their_error():
    """1.5 sd of a whole plot: the error of whole plots is estimated with it."""
    hidden = hide(["interruption"], [1.5], seed=3, transducers=1)
    found = trace_whole_plots(hidden.data, hidden.model, validate=False)
    (effect,) = (e for e in found.sensors["bridge_1_mV"].effects if e.stratum != "noise")
    assert "offset-step" in (effect.effect, *effect.aliases)


def test_the_error_on_left_out_whole_plots_is_that_of_the_same_search():
    hidden = hide(["hysteresis"], [0.6], seed=3, transducers=1)
    found = trace_whole_plots(hidden.data, hidden.model).sensors["bridge_1_mV"]
    assert [effect.effect for effect in found.effects] == ["hysteresis"]
    assert found.after.cv_rms < found.before.cv_rms


def test_a_line_that_would_have_to_overshoot_is_refused():
    bench = Bench((Transducer(), Transducer(sensitivity=1.7)), carry_over=-8e-4)
    found = trace_whole_plots(simulate(bench, seed=2), validate=False)
    assert "carry-over" not in {c.effect.name for c in found.chosen}
    assert "carry-over" in {r.effect for t in found.sensors.values() for r in t.refused}
