"""The engine on products of strata: the same likelihoods as from rows; attitude runs searched by it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from proving.truth.attitude import D1, Plan, simulate
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized
from rig.fitter.trace.engine.in_strata import InStrata, OfStrata, Stratum
from rig.fitter.trace.engine.problem import Candidate
from rig.fitter.trace.engine.strata import StrataJudge
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.attitude.trace.posed import scatters_alike
from rig.procedures.attitude.trace.robust import in_part

POINTS, VISITS, WIDTHS = 12, 4, (1, 2, 1, 1)
RATIOS = np.array([0.0, 1.0, 6.0])
"""Variance of a point's mean beyond scatter, over that by scatter."""
PLAN = D1(90.0, 13, 9, replications=4)


def made(seed=1):
    """Rows of points that are visited again, and the same as strata within and between points."""
    rng = np.random.default_rng(seed)
    point, width = np.repeat(np.arange(POINTS), VISITS), sum(WIDTHS)
    y, columns = rng.standard_normal(point.size), rng.standard_normal((point.size, width))
    columns[:, 0] = np.linspace(-1.0, 1.0, POINTS)[point]
    y = y + 1.5 * columns[:, 3]
    means = (point[:, None] == np.arange(POINTS)) / np.sqrt(VISITS)
    own = np.arange(width)
    between = Stratum.of_rows(own, means.T @ columns, means.T @ y)
    left, rest = columns - means @ (means.T @ columns), y - means @ (means.T @ y)
    within = Stratum(own, left.T @ rest, float(rest @ rest), float(point.size - POINTS), np.pad(left.T @ left, (0, 1)))
    weight = np.column_stack([np.ones(3), 1.0 / (1.0 + RATIOS)])
    effects = [SimpleNamespace(name=f"effect {k}", source="setting") for k in range(len(WIDTHS))]
    none = np.empty(0)
    problem = InStrata(
        y=none,
        declared=np.empty((0, 0)),
        candidates=tuple(
            Candidate(e, TableTerm((e.name,), np.empty((0, w)))) for e, w in zip(effects, WIDTHS, strict=True)
        ),
        noise=OfStrata(
            0, weight=weight, df=np.array([within.df, between.df]), shape=np.log1p(RATIOS)[:, None], price=np.zeros(3)
        ),
        sd=none,
        ordered=False,
        strata=(within, between),
        length=np.linalg.norm(columns, axis=0),
        part=np.arange(2),
        scatter=np.zeros(2, np.int64),
        of_error=np.array([True, False]),
    )
    return y, columns, means, StrataJudge(problem)


@pytest.mark.parametrize("chosen", [(), (2,), (1, 2), (0, 1, 3)])
def test_likelihoods_are_those_of_the_rows(chosen):
    y, columns, means, judge = made()
    picked = judge.problem.picked(chosen)
    for g, ratio in enumerate(RATIOS):
        covariance = np.eye(len(y)) + ratio * means @ means.T
        white = np.linalg.inv(np.linalg.cholesky(covariance))
        x, left = white @ columns[:, picked], white @ y
        rss = float(np.sum((left - x @ np.linalg.lstsq(x, left, rcond=None)[0]) ** 2)) if chosen else float(left @ left)
        n, log_det = len(y), np.linalg.slogdet(covariance)[1]
        assert judge.beside(chosen).ml[g] == pytest.approx(-0.5 * (n * np.log(rss) + log_det), rel=1e-10)
        det_x = np.linalg.slogdet(x.T @ x)[1] if chosen else 0.0
        reml = -0.5 * ((n - len(picked)) * np.log(rss) + log_det + det_x)
        assert judge.beside(chosen).reml[g] == pytest.approx(reml, rel=1e-10)


def test_what_is_there_is_found_and_nothing_else():
    judge = made()[3]
    assert judge.best(()) == (2,)
    assert judge.best((2,)) == ()


def test_few_draws_find_something_where_nothing_is():
    found = 0
    for seed in range(40):
        judge = made(seed)[3]
        found += bool(judge.best((2,)))
    assert found <= 5


def test_a_p_near_a_limit_hardly_hangs_on_the_draws():
    """Of 1,000 draws a p of 0.05 had a standard deviation of 0.011, and of 400, in a long run, of 0.018."""
    judge = made()[3]
    p = []
    for k in range(20):  # the seed is the number of families before
        one = replace(judge, simulated=[(np.zeros(9), judge.family(0))] * k)
        p += [one.judge((2,), 0, 7.4, 1, 44)]
    print("p", np.mean(p), np.std(p))
    assert 0.04 < np.mean(p) < 0.06
    assert np.std(p) < 0.008


def test_coefficients_are_those_of_the_rows():
    """By generalised least squares; errors by the mean squares within and between points, each by itself."""
    y, columns, means, judge = made()
    chosen = (1, 2)
    picked = judge.problem.picked(chosen)
    found = judge.problem.fitted(2, picked)
    covariance = np.eye(len(y)) + RATIOS[2] * means @ means.T
    x, inverse = columns[:, picked], np.linalg.inv(covariance)
    spread = np.linalg.inv(x.T @ inverse @ x)
    assert found.value == pytest.approx(spread @ x.T @ inverse @ y, rel=1e-9)
    left, meat, uncertain = y - x @ found.value, np.zeros_like(spread), 0.0
    for hat, weight, df in (
        (np.eye(len(y)) - means @ means.T, 1.0, len(y) - POINTS),
        (means @ means.T, 1.0 / (1.0 + RATIOS[2]), POINTS),
    ):
        products = weight * x.T @ hat @ x
        free = df - np.sum(products * spread)
        own = spread @ products @ spread * weight * float(left @ hat @ left) / free
        meat, uncertain = meat + own, uncertain + np.diag(own) ** 2 / free
    assert found.covariance == pytest.approx(meat, rel=1e-9)
    assert found.df == pytest.approx(np.diag(meat) ** 2 / uncertain, rel=1e-9)


def test_a_column_counts_beside_the_largest_lack_of_fit():
    """One between points only, whose errors are 10,000 times scatter: it was no column beside these errors."""
    problem = made()[3].problem
    noise = replace(problem.noise, weight=np.array([[1.0, 1.0], [1.0, 1e-8]]), shape=np.array([[0.0], [18.4]]))
    scores = StrataJudge(replace(problem, noise=noise)).everything(1, ())[0]
    assert scores.rank.tolist() == list(WIDTHS)


def test_a_column_that_others_replace_has_no_coefficient():
    judge = made()[3]
    found = judge.problem.fitted(0, np.array([1, 1]))
    assert found.value[1] == found.covariance[1, 1] == 0.0
    assert found.value[0] == judge.problem.fitted(0, np.array([1])).value[0]


def hidden(name, rms, seed):
    return simulate(sized(name, rms, PLAN), PLAN, seed, **HIDDEN[name].options)[0]


def test_what_changes_from_one_replication_to_the_next_is_told_by_all_that_is_known_of_it():
    """An alignment that follows temperature, at a fifth of a reading's scatter."""
    found = trace(hidden("alignment, temperature", 0.2, 4002), validate=False).sensors["x_V"]
    assert [e.effect for e in found.added] == ["alignment-temperature"]


def test_a_drift_that_replications_agree_about_is_kept():
    """Of four replications whose offsets drift by half a reading's scatter: its coefficient is not fitted beside
    offsets of their own.
    """
    found = trace(hidden("offset drift", 0.5, 110), validate=False).sensors["x_V"]
    assert "offset-drift" in {name for e in found.added for name in (e.effect, *e.aliases)}
    assert found.after.sigma_E < found.before.sigma_E


def test_offsets_that_walk_are_no_drift():
    """Of six replications, ten times as far as a reading scatters."""
    drifts = [one for one in CATALOGUE if one.name == "offset-drift"]
    bench, plan, found = replace(CLEAN, offset_sd=10.0, offset_walk=True), D1(60, 5, 5), 0
    for seed in range(30):
        found += any(
            one.added for one in trace(simulate(bench, plan, seed)[0], drifts, validate=False).sensors.values()
        )
    assert found <= 3


FEW = Plan(np.array([-30.0, 0.0, 30.0]), np.array([-90.0, 0.0, 90.0, 180.0]), replications=2)


def test_a_cause_that_few_readings_repeat_is_no_walk():
    """What a likelihood of few readings costs is no part of what a walk takes away."""
    data = simulate(replace(CLEAN, compliance={("y", "x"): 1.5e-3}), FEW, 1001)[0]
    problem = make_problem(data, CATALOGUE)
    pads = [u for u, (name, _) in enumerate(problem.causes) if name == "isolation-pad-deflection"]
    plain, _, against = max(in_part(problem, (), u) for u in pads)
    assert against > 0.9 * plain > 50.0


def test_sensors_have_one_scatter_until_the_data_say_otherwise():
    """Beside errors of another size in one of them they do, and few readings say nothing against one."""
    x, *others = CLEAN.sensors
    noisy = replace(CLEAN, sensors=(replace(x, S=3.0 * x.S), *others))
    alike = [
        scatters_alike(make_problem(simulate(bench, plan, 5)[0], CATALOGUE))
        for bench, plan in ((CLEAN, FEW), (CLEAN, PLAN), (noisy, FEW), (noisy, PLAN))
    ]
    assert alike == [True, True, False, False]


def test_nothing_is_named_in_a_run_without_effects():
    found = trace(simulate(CLEAN, PLAN, 5)[0], validate=False)
    assert not any(one.added for one in found.sensors.values())


def test_replications_left_out_are_searched_with_what_is_simulated():
    found = trace(hidden("cube", 1.0, 3)).sensors["x_V"]
    assert found.cv_rms_after < 0.9 * found.cv_rms_before
