"""What a trace of a table works out at once, or not at all, is what it would be each time by itself."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from proving.truth.table import MISSING, Lab, options, simulate
from rig.fitter.linear import orthonormal
from rig.fitter.resolution import least_robust_sd, robust_sd
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine import family, judge
from rig.fitter.trace.engine import problem as problems
from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.lengths import Simulated
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import WIDE, Independent, Wandering
from rig.fitter.trace.engine.rivals import rivals
from rig.fitter.trace.engine.score import View
from rig.fitter.trace.engine.shared import Shared
from rig.fitter.trace.jointly import nearest, ranks
from rig.fitter.trace.search import prune
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects.of_instruments import BORDERS, range_gain, range_step
from rig.procedures.general.effects.scene import Stood, TableScene
from rig.procedures.general.effects.time_columns import lagging
from rig.procedures.general.trace import cross, trace_general
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

LARGE = Lab(2600, 4, clock=True)
"""So many rows and candidates that every family has the fewest draws."""


def data_of(lab, seed=1, effect=None):
    columns = simulate(lab, seed, effect)
    return roles_of(Table("simulated", columns, True, {}), Roles(**options(lab)))[0]


def test_where_nothing_is_found_no_part_of_the_rows_is_searched(monkeypatch):
    """There is one model then, and the left-out error of it: the search of parts was a third of a trace."""
    searched = []
    search = cross.search_and_name
    monkeypatch.setattr(cross, "search_and_name", lambda *args, **told: searched.append(1) or search(*args, **told))
    for effect, times in ((None, 0), (MISSING["drift"].at(1.0), 5)):
        searched.clear()
        found = trace_general(data_of(Lab(200, 3, clock=True), effect=effect))
        assert bool(found.effects) == bool(times)
        assert len(searched) == times
        before, after = found.before.cv_rms, found.after.cv_rms
        assert after < before if times else after == before


def test_a_certain_score_needs_no_simulation_and_has_the_p_of_one(monkeypatch):
    """A drift of one sd in 2,600 rows."""
    asked = []
    simulated = judge.family_of
    monkeypatch.setattr(judge, "family_of", lambda *args, **told: asked.append(args[1]) or simulated(*args, **told))
    problem = problem_of(data_of(LARGE, effect=MISSING["drift"].at(1.0)))
    quick = TableJudge(problem)
    found = quick.best(())
    p = quick.p_adjusted(found, found[0])
    assert [problem.candidates[j].effect.name for j in found] == ["drift:t_s"]
    assert not asked
    assert quick.is_bound(p)
    monkeypatch.setattr(judge, "CERTAIN", np.inf)
    slow = TableJudge(problem)
    assert slow.best(()) == found
    assert slow.p_adjusted(found, found[0]) == p
    assert asked


def test_names_of_a_large_table_are_not_looked_for_again_in_its_parts(monkeypatch):
    """Their sizes are estimated anew; a search of each part was a third of the trace of a lag in 4,800 rows."""
    problem = problem_of(data_of(Lab(1200, 2, clock=True), effect=MISSING["drift"].at(1.0)))
    whole = TableJudge(problem)
    found = whole.best(())
    monkeypatch.setattr(cross, "search_and_name", None)
    errors, words, _ = cross.left_out(problem, whole, found, np.array([7]))
    assert words == "random rows"
    assert errors[1] < 0.8 * errors[0]


def test_what_is_plainly_nothing_is_not_held_against_simulated_tables(monkeypatch):
    """Its own p is above the level, and that of the best of all effects is larger still."""
    asked = []
    simulated = judge.family_of
    monkeypatch.setattr(judge, "family_of", lambda *args, **told: asked.append(args[1]) or simulated(*args, **told))
    problem = problem_of(data_of(Lab(1200, 2, clock=True)))
    quick, slow = TableJudge(problem), TableJudge(problem)
    weak = list(quick.promising(()))[-3:]
    assert all(quick.adjusted((), j, ALPHA) > ALPHA for j in weak)
    assert not asked
    assert all(slow.adjusted((), j) > 2.0 * ALPHA for j in weak)
    assert asked


def test_one_weak_effect_is_dropped_without_its_exact_p():
    asked = []

    class Of:
        """A judge in which 2 is weak, and 3 weaker without it."""

        def unit(self, j):
            return (j,)

        def p_adjusted(self, chosen, j):
            return self.p_up_to(chosen, j, np.inf)

        def p_up_to(self, chosen, j, most):
            asked.append((j, most))
            return {2: 0.4, 3: 0.01 if 2 in chosen else 0.5}.get(j, 0.001)

    assert prune(Of(), (1, 2, 3, 4)) == (1, 4)
    assert {most for _, most in asked} == {ALPHA}


def test_an_effect_that_chance_explains_is_refused_before_all_others_are_simulated(problem, monkeypatch):
    """With the same decision: further effects only raise p."""
    monkeypatch.setattr(family, "MOST", 400)
    whole, part = (TableJudge(problem).family(20) for _ in range(2))
    assert not part.tails
    exact = {(name, score): whole.adjust(name, score) for name in problem.named for score in (2.0, 6.0, 9.0, 40.0)}
    assert not whole.waiting
    left = []
    for (name, score), p in exact.items():
        bound = part.adjust(name, score, ALPHA)
        left.append(len(part.waiting))
        assert (bound > ALPHA) == (p > ALPHA), (name, score)
        assert bound == p if p <= ALPHA else bound <= p
    assert left[0] > 0
    assert left[-1] == 0  # nothing but all effects shows that none looks as good


def test_an_effect_of_a_large_table_that_chance_does_not_explain_is_found_before_all_others_are_simulated(monkeypatch):
    """With the same decision: those that wait count as if each of them were as likely to look as good (Bonferroni)."""
    monkeypatch.setattr(judge, "CERTAIN", np.inf)
    problem = problem_of(data_of(Lab(1200, 2, clock=True), effect=MISSING["drift"].at(0.25)))
    drift = next(j for j, one in enumerate(problem.candidates) if one.effect.name == "drift:t_s")
    large = TableJudge(problem)
    quick = large.adjusted((), drift, ALPHA)
    assert any(one.waiting for one in large.families.values())
    exact = large.adjusted((), drift)
    assert large.p_adjusted((drift,), drift) == exact, "what is reported is not a bound"
    assert exact <= quick <= ALPHA


def test_a_family_does_not_hold_the_search_that_asked_for_it(problem):
    """A search has whitened candidates under several covariances: 110 MB of 4,800 rows."""
    asking = TableJudge(problem)
    families, gone = asking.families, weakref.ref(asking)
    asking.family(0)
    del asking
    gc.collect()
    assert families
    assert gone() is None


def test_a_clean_table_is_searched_with_few_effects_simulated(monkeypatch):
    monkeypatch.setattr(family, "MOST", 400)
    judge = TableJudge(problem_of(data_of(Lab(200, 2))))
    assert judge.best(()) == ()
    assert all(one.waiting for one in judge.families.values())


def test_the_least_p_is_known_without_a_simulation_only_in_a_large_table():
    """In a small one the number of draws depends on covariances that a simulation tells."""
    assert family.least_of(problem_of(data_of(Lab(60)))) is None
    assert family.least_of(problem_of(data_of(LARGE))) == pytest.approx(1.0 / (1.0 + family.FEWEST))


def test_each_part_of_the_rows_is_whitened_once(monkeypatch):
    views = []
    of = View.of.__func__
    monkeypatch.setattr(View, "of", classmethod(lambda cls, *args: views.append(args) or of(cls, *args)))
    data = data_of(Lab(200, 2, clock=True), effect=MISSING["temperature"].at(1.0))
    problem = problem_of(data)
    whole = TableJudge(problem)
    found = whole.best(())
    whole.family(whole.beside(found).best)
    views.clear()
    errors, words, _ = cross.left_out(problem, whole, found, np.empty(0, np.int64))
    assert words == "random rows"
    assert errors[1] < errors[0]
    every = [one for one, _ in views if len(one.candidates) == len(problem.candidates)]
    assert len(every) == cross.FOLDS


@pytest.fixture(scope="module")
def problem():
    """With pairs of columns, blocks of three or more, and a candidate that is nearly declared."""
    return problem_of(data_of(Lab(150, 2, groups=5, clock=True), effect=MISSING["group gain"].at(0.5)))


@pytest.mark.parametrize("at", [0, 20])
def test_bases_of_all_candidates_are_those_of_each(problem, at):
    view = View.of(problem, at)
    every, each = view.units(), view.blocks((), range(len(problem.candidates)))
    assert {1, 2, 4} <= set(every.rank.tolist())
    assert every.rank.tolist() == each.rank.tolist()
    left = np.random.default_rng(1).standard_normal((problem.n, 3))
    assert every.gains(left) == pytest.approx(each.gains(left), rel=1e-4, abs=1e-5)
    assert view.width == each.units.shape[1]


def noises(problem):
    """One of each kind, in rows of different sd."""
    sd, when, group = np.linspace(0.5, 2.0, problem.n), np.arange(problem.n) * 1.3, np.arange(problem.n) // 6
    yield from ((problem.noise, 20), (problem.noise, 0), (Independent(problem.n), 0))
    every = (Wandering(when), 12), (Wandering(when), 44), (Shared(group), 3), (Both(group, when=when), 40)
    yield from ((noise.over(sd), at) for noise, at in every)


def test_a_simulation_has_the_lengths_and_gains_of_whitened_candidates(problem):
    """It whitens residuals back in their place."""
    left = np.random.default_rng(8).standard_normal((problem.n, 3))
    for noise, at in noises(problem):
        sd = np.ones(problem.n) if getattr(noise, "sd", None) is None else noise.sd
        own = replace(problem, noise=noise, sd=sd)
        view, lean = View.of(own, at), Simulated(own)
        rest = left - view.basis @ (view.basis.T @ left)
        each, found = view.units(), lean.under(at)
        assert found.rank.tolist() == each.rank.tolist()
        gains = found.gains(lean.columns.T @ noise.back(at, rest).astype(np.float32), rest)
        assert gains == pytest.approx(each.gains(rest), rel=2e-3, abs=1e-4)


def test_a_simulation_keeps_no_whitened_candidates_of_other_covariances(monkeypatch):
    views = []
    of = View.of.__func__
    monkeypatch.setattr(View, "of", classmethod(lambda cls, *args: views.append(args[1]) or of(cls, *args)))
    judge = TableJudge(problem_of(data_of(Lab(120, clock=True))))
    families = judge.family(20), judge.family(20, "fast")
    assert not views
    for one in families:
        one.adjust("drift:t_s", 9.0)
    assert set(views) == {20}


@pytest.mark.parametrize("n", [7, 33, 200])
def test_many_columns_are_filtered_as_few_are(n):
    when = np.cumsum(np.random.default_rng(9).exponential(1.0, n))
    noise = Wandering(when, sd=np.linspace(0.5, 2.0, n))
    columns, sums = np.random.default_rng(10).standard_normal((2, n, WIDE))
    for at in (0, 1, 25, 44):
        white = noise.whiten(np.array([at]), columns)[0]
        few = np.hstack([noise.whiten(np.array([at]), columns[:, k : k + 40])[0] for k in range(0, WIDE, 40)])
        assert white == pytest.approx(few, rel=1e-12, abs=1e-12)
        assert noise.back(at, sums).T @ columns == pytest.approx(sums.T @ white, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("n", [20, 90, 300])
def test_covariances_filtered_together_are_those_of_each(n):
    noise = Wandering(np.cumsum(np.random.default_rng(11).exponential(1.0, n)), sd=np.linspace(0.5, 2.0, n))
    for width in (0, 1, 3, WIDE):
        columns, every = np.random.default_rng(12).standard_normal((n, width)), np.arange(len(noise.prior))
        together = noise.whiten(every, columns)
        for at in every.tolist():
            assert np.array_equal(together[at], noise.whiten(np.array([at]), columns)[0])
        assert np.array_equal(noise.whiten(np.array([7, 3]), columns), together[[7, 3]])


def test_lengths_and_remainders_are_those_of_whole_columns(problem):
    view, columns = View.of(problem, 0), problem.columns
    basis = orthonormal(problem.declared)
    assert view.columns == pytest.approx(columns - basis @ (basis.T @ columns), abs=1e-7 * np.abs(columns).max())
    about = np.linalg.norm(columns - columns.mean(axis=0), axis=0)
    assert view.length == pytest.approx(np.maximum(about, 1e-6 * np.linalg.norm(columns, axis=0)), rel=1e-9)


def test_the_gain_of_several_candidates_is_that_of_their_basis(problem):
    """Also of one that the others nearly replace."""
    view, rng = View.of(problem, 20), np.random.default_rng(2)
    left = rng.standard_normal(problem.n)
    for _ in range(30):
        some = rng.choice(len(problem.candidates), 6, replace=False).tolist()
        assert view.gain(some, left) == pytest.approx(float(np.sum((view.extra(some).T @ left) ** 2)), rel=1e-6)
    assert view.gain((), left) == 0.0


def test_a_rival_is_priced_by_its_own_gain_where_no_column_can_drop_out(problem, monkeypatch):
    view, rng = View.of(problem, 20), np.random.default_rng(7)
    left, single = rng.standard_normal(problem.n), np.flatnonzero(np.diff(view.start) == 1)
    for _ in range(5):
        rest = tuple(rng.choice(len(problem.candidates), 4, replace=False).tolist())
        known = view.all_kept(rest)[view.start[:-1]]
        gains = view.gains(rest, left)[0]
        assert np.mean(known[single]) > 0.9
        for j in set(single[known[single]].tolist()) - set(rest):
            assert view.gain((*rest, j), left) == pytest.approx(view.gain(rest, left) + gains[j], rel=1e-9)
    twice = view.picked((5,))[0]
    assert not view.all_kept((5,))[twice]
    asked = []
    gain = View.gain
    monkeypatch.setattr(View, "gain", lambda *args: asked.append(1) or gain(*args))
    rivals(problem, view, left, (3, 20), problem.candidates[3].effect.name)
    assert len(asked) < 10


def test_another_response_has_the_same_grid(problem):
    y, other = np.random.default_rng(3).standard_normal((2, problem.n))
    once = Grid.of(problem.noise, y, problem.declared).of_response(other).beside(problem.of((3,)))
    fresh = Grid.of(problem.noise, other, problem.declared).beside(problem.of((3,)))
    assert once.reml == pytest.approx(fresh.reml, rel=1e-12)


@pytest.mark.parametrize("taken", [(3,), (20,), (3, 20), (40, 3)])
def test_a_model_with_columns_fewer_or_further_has_the_likelihoods_of_one_made_anew(problem, taken):
    y, some = np.random.default_rng(6).standard_normal(problem.n), (3, 20, 40, 41)
    rest = tuple(j for j in some if j not in taken)
    fresh = Grid.of(problem.noise, y, problem.model(rest)).beside()
    whole = Grid.of(problem.noise, y, problem.declared).with_columns(problem.of(some))
    assert whole.beside().reml == pytest.approx(Grid.of(problem.noise, y, problem.model(some)).beside().reml, rel=1e-12)
    ends = problem.declared.shape[1] + np.cumsum([0, *(problem.of((j,)).shape[1] for j in some)])
    picked = np.concatenate([np.arange(ends[some.index(j)], ends[some.index(j) + 1]) for j in taken])
    for one in (whole.without(picked), Grid.of(problem.noise, y, problem.model((*some,))).without(picked)):
        assert one.reml == pytest.approx(fresh.reml, rel=1e-11)
        assert one.ml == pytest.approx(fresh.ml, rel=1e-11)
    assert Grid.of(problem.noise, y, problem.model((3, 3))).without(picked[:1]) is None


def test_weak_effects_are_looked_for_without_a_new_model_for_each(monkeypatch):
    """Those in the model are taken out of it in turn, which needs its products alone."""
    made = []
    of = Grid.of.__func__
    monkeypatch.setattr(Grid, "of", classmethod(lambda cls, *args: made.append(1) or of(cls, *args)))
    judge, chosen = TableJudge(problem_of(data_of(Lab(150, 2, groups=5, clock=True)))), (3, 20, 40, 41)
    for j in chosen:
        judge.p_adjusted(chosen, j)
    assert len(made) == 1
    assert set(judge._models.known) == {(), chosen}


def test_a_part_of_a_problem_stacks_no_columns_and_has_the_same(problem):
    kept = np.arange(0, problem.n, 2)
    part = problem.rows(kept)
    assert np.array_equal(part.columns, problem.columns[kept])
    assert np.array_equal(part.columns, part.of(range(len(part.candidates))))
    other = problem.candidates[5].term
    moved = problem.with_terms({4: other}) if other.columns.shape == problem.candidates[4].term.columns.shape else part
    assert np.array_equal(moved.columns, moved.of(range(len(moved.candidates))))


@pytest.mark.parametrize("known", [(), ("since",), ("since", "start")])
def test_a_lag_is_its_recursion(known):
    rng = np.random.default_rng(4)
    v, gap, tau = rng.standard_normal(50), rng.random(49) * (rng.random(49) > 0.1), 0.7
    since, start = rng.random(50), rng.standard_normal(50) if "start" in known else np.concatenate([v[:1], v[:-1]])
    state = [v[0] + (start[0] - v[0]) * np.exp(-since[0] / tau)]
    for i, dt in enumerate(gap):
        decay = np.exp(-dt / tau)
        slope = np.exp(-min(since[i + 1], dt) / tau) if known else (1.0 - decay) / (dt / tau) if dt else 1.0
        state.append(decay * state[-1] + (slope - decay) * start[i + 1] + (1.0 - slope) * v[i + 1])
    stood = Stood(since, start if "start" in known else None) if known else None
    assert lagging(v, gap, tau, stood) == pytest.approx(np.array(state), rel=1e-14, abs=1e-14)


@pytest.mark.parametrize("inside", [0.5, 0.95])
@pytest.mark.parametrize("step", [1e-15, 0.01, 1.0])
def test_the_limit_of_a_robust_scale_is_that_of_bisection(step, inside):
    """Of steps of the size of rounding errors, of small and of large ones; one for all rows, or one for each."""
    rng = np.random.default_rng(5)
    for n in (3, 20, 301):
        left = np.round(rng.standard_normal(n) / step) * step if step > 1e-9 else rng.standard_normal(n)
        steps = np.full(n, step) if n % 2 else step / rng.uniform(0.3, 3.0, n)
        size, half = np.abs(left), 0.5 * steps
        low, high = 0.0, float(np.max(size + half))
        for _ in range(60):
            middle = 0.5 * (low + high)
            covered = np.minimum(middle, size + half) - np.maximum(-middle, size - half)
            enough = np.mean(np.clip(covered / (2.0 * half), 0.0, 1.0)) >= inside
            low, high = (low, middle) if enough else (middle, high)
        floor = np.sqrt(np.mean(steps**2) / 12.0)
        normal = {0.5: 0.6744897501960817, 0.95: 1.959963984540054}[inside]
        expected = np.sqrt(max((high / normal) ** 2 - floor**2, floor**2))
        assert robust_sd(left, steps, inside) == pytest.approx(expected, rel=1e-12)
        assert 0.0 < least_robust_sd(left, steps) <= robust_sd(left, steps)
        assert least_robust_sd(left) <= robust_sd(left)


def test_rows_close_to_each_other_are_looked_for_once(problem, monkeypatch):
    asked = []
    monkeypatch.setattr(problems, "nearest", lambda *args: asked.append(1) or nearest(*args))
    moved = replace(problem, sd=np.linspace(1.0, 2.0, problem.n))
    assert np.array_equal(moved.near, problem.near)
    assert len(asked) <= 1
    assert np.array_equal(problem.near[:, :4], nearest(ranks(problem.quantities.values)))


@pytest.mark.parametrize("terms", [range_step, range_gain])
def test_a_range_may_end_at_no_more_borders_than_can_be_told(terms):
    """Between two of them its place is refined; where there are few settings, it may end between any two."""
    rng = np.random.default_rng(13)
    for count, most in ((1300, BORDERS), (50, 50)):
        size = np.geomspace(1e-3, 10.0, count)[rng.permutation(np.arange(1300) % count)]
        scene = TableScene({"x": size}, {}, {}, None, None)
        found = terms(scene, "x")
        assert len(found) == most - (count == 50)
        assert [one.profile.high for one in found[:-1]] == pytest.approx([one.profile.value for one in found[1:]])
