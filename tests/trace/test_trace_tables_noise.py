"""Noise that rows share, held against matrices written out; the family, against draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import fdtrc

from proving.statistics.tables import found_or_alike
from proving.truth.table import MISSING, Lab, options, simulate
from rig.fitter.trace.engine import both
from rig.fitter.trace.engine.both import STEPS, WANDERS, Both
from rig.fitter.trace.engine.family import family_of
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import WIDE, Wandering
from rig.fitter.trace.engine.problem import Problem
from rig.fitter.trace.engine.robust import excess
from rig.fitter.trace.engine.score import View, score
from rig.fitter.trace.engine.shared import RATIOS, Shared
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects.scene import TableScene
from rig.procedures.general.trace import search_table, trace_general
from rig.procedures.general.trace.candidates import candidates_of
from rig.procedures.tables.table import Table

N = 14
WHEN = np.cumsum(np.random.default_rng(2).uniform(0.3, 2.0, N))
GROUP = np.array([0, 0, 0, 1, 1, 2, 2, 2, 2, 3, 3, 3, 4, 4])


SD = np.random.default_rng(8).uniform(0.3, 3.0, N)


def wandering_covariances(sd=np.ones(N)):  # noqa: B008  # not changed
    """Every covariance of the grid, entry by entry: share c^|t - s|, or q min(t, s) for a walk, and white noise.

    Rows are divided by `sd`, which is of their white noise.
    """
    correlation, share, step, white = Wandering(WHEN)._grid
    apart, since = np.abs(WHEN[:, None] - WHEN), np.minimum(WHEN[:, None], WHEN) - WHEN[0]
    for c, s, q, w in zip(correlation, share, step, white, strict=True):
        slow = q * since if q else s * c**apart if c else 0.0 * apart
        yield slow / np.outer(sd, sd) + w * np.eye(N)


def shared_covariances(sd=np.ones(N)):  # noqa: B008  # not changed
    together = (GROUP[:, None] == GROUP) / np.outer(sd, sd)
    return [np.eye(N) + ratio * together for ratio in (0.0, *RATIOS)]


def both_covariances(sd=np.ones(N)):  # noqa: B008  # not changed
    noise = Both(GROUP, when=WHEN)
    wander, together = list(wandering_covariances(sd)), (GROUP[:, None] == GROUP) / np.outer(sd, sd)
    grid = [0, *(noise.wander.nearest(c, share) for c, share in WANDERS), *map(noise.wander.walk, STEPS)]
    assert len(set(grid)) == len(grid)
    return [wander[w] + ratio * together for w in grid for ratio in both.RATIOS]


@pytest.mark.parametrize(
    ("noise", "covariances"),
    [
        (Wandering(WHEN), list(wandering_covariances())),
        (Shared(GROUP), shared_covariances()),
        (Both(GROUP, when=WHEN), both_covariances()),
        (Wandering(WHEN).over(SD), list(wandering_covariances(SD))),
        (Shared(GROUP).over(SD), shared_covariances(SD)),
        (Both(GROUP, when=WHEN).over(SD), both_covariances(SD)),
    ],
    ids=["wandering", "shared", "both", "wandering of unequal rows", "shared by unequal rows", "both, unequal rows"],
)
def test_whitening_and_colouring_are_those_of_the_matrices(noise, covariances):
    every = np.arange(len(covariances))
    white = noise.whiten(every, np.eye(N))
    for g, v in enumerate(covariances):
        np.testing.assert_allclose(white[g] @ v @ white[g].T, np.eye(N), atol=1e-10)
        assert noise.log_det[g] == pytest.approx(np.linalg.slogdet(v)[1], abs=1e-9)
        colour = noise.colour(g, np.eye(N))
        np.testing.assert_allclose(colour @ colour.T, v, atol=1e-10)
        np.testing.assert_allclose(noise.root(g, np.eye(N)), colour.T, atol=1e-10)
        np.testing.assert_allclose(noise.variances(g), np.diag(v), rtol=1e-9)
        if isinstance(noise, Wandering):
            assert noise.memory[g] == pytest.approx(v.sum() / np.trace(v), rel=1e-9)


def test_many_columns_are_whitened_row_by_row_to_the_same_numbers():
    """Of few columns LAPACK is faster, of many one pass over the rows."""
    noise, columns = Wandering(WHEN), np.random.default_rng(3).standard_normal((N, 2 * WIDE))
    for g in (1, len(noise.prior) - 1):
        wide = noise.whiten(np.array([g]), columns)[0]
        few = [noise.whiten(np.array([g]), columns[:, k : k + 10])[0] for k in range(0, 2 * WIDE, 10)]
        assert wide == pytest.approx(np.column_stack(few), rel=1e-13, abs=1e-15)
        assert noise.colour(g, wide) == pytest.approx(columns, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("n", "told"), [(10, False), (600, True)])
def test_the_slowest_noise_that_is_plausible(n, told):
    """In ten rows of independent errors much slower noise is plausible; in 600 that wander, next to none."""
    noise = Wandering(np.arange(n, dtype=np.float64))
    at = int(np.argmin(np.abs(noise.correlation - 0.89))) if told else 0
    y = noise.colour(at, np.random.default_rng(4).standard_normal((n, 1)))
    beside = Grid.of(noise, y[:, 0], np.ones((n, 1))).beside()
    slowest = beside.slowest_of(np.ones(len(noise.slow), np.bool_))
    assert (noise.memory[slowest] < 2.0 * noise.memory[at]) == told
    assert beside.reml[slowest] > beside.reml.max() - 2.0


def test_short_tables_of_errors_that_are_alike_report_little():
    """Before the slowest plausible noise was asked, one in five of such tables reported something."""
    lab, hits = Lab(12, 0, clock=True, design="sweeps", ar=0.9), []
    for seed in range(15):
        data, _ = roles_of(Table("simulated", simulate(lab, seed), True, {}), Roles(**options(lab)))
        if search_table(data).chosen:
            hits.append(seed)
    assert len(hits) <= 2, hits


def test_the_family_holds_what_it_promises():
    """400 tables of noise: the best of all candidates is below 5 % adjusted in 5 % of them, within 3 sd of counting."""
    rng = np.random.default_rng(5)
    x, c = rng.uniform(0, 10, 30), rng.standard_normal(30)
    scene = TableScene({"x": x}, {"c": c}, {}, None, None)
    declared = np.column_stack([np.ones(30), x])
    problem = Problem(
        y=rng.standard_normal(30),
        declared=declared,
        candidates=candidates_of(scene, "y", np.eye(30)[:, :2])[0],
        noise=Shared(np.arange(30)),
        sd=np.ones(30),
        ordered=False,
    )
    names = [candidate.effect.name for candidate in problem.candidates]
    only = np.ones(1, np.bool_)
    view, best = View.of(problem, 0), []
    family = family_of(problem, 0, np.ones(len(names)), 1, without=only, beside=only, scatter=view.only)
    for _ in range(400):
        found, _ = score(view, rng.standard_normal(30), (), range(len(problem.candidates)))
        p = fdtrc(found.rank, found.df, found.ratio / found.scatter)
        best.append(min(family.adjust(name, -np.log(one)) for name, one in zip(names, p, strict=True)))
    assert 0.05 * 400 - 3 * np.sqrt(19) < np.sum(np.array(best) <= 0.05) < 0.05 * 400 + 3 * np.sqrt(19)


def test_a_reading_alone_is_held_back_and_a_level_is_not():
    rng = np.random.default_rng(6)
    left = rng.standard_normal(100)
    spike, level = left.copy(), left.copy()
    spike[40] += 12.0
    level[60:70] += 12.0
    assert np.flatnonzero(excess(spike, ordered=True)).tolist() == [40]
    assert not np.any(excess(level, ordered=True))


@pytest.mark.parametrize("name", ["drift", "step"])
def test_what_changes_with_a_clock_is_named_although_a_wander_could_do_it(name):
    """One sd of it in 120 rows. What is slower than noise is a drift itself, and less probable here than this one."""
    missing = MISSING[name]
    for seed in range(2):
        columns = simulate(missing.lab, seed, missing.at(1.0))
        data, _ = roles_of(Table("simulated", columns, True, {}), Roles(**options(missing.lab)))
        result = search_table(data)
        names = {result.judge.candidates[j].effect.name for j in result.chosen}
        assert names == {f"{name}:t_s"}, seed


@pytest.mark.parametrize("order", ["rising", "random"])
@pytest.mark.parametrize("off", [1.0, 4.0])
def test_a_curve_beside_a_gross_error_is_found(order, off):
    """Fifty or two hundred standard deviations of a row: the curve has four, rms."""
    hits, names = 0, []
    for seed in range(3):
        rng = np.random.default_rng([205, seed])
        x = np.linspace(0.0, 10.0, 40)
        x = x if order == "rising" else rng.permutation(x)
        y = 1.0 + 2.0 * x + 0.01 * (x - 5.0) ** 2 + 0.02 * rng.standard_normal(40)
        y[rng.integers(6, 34)] += off
        names.append(list(found_or_alike({"x": x, "y": y}, {"response": "y", "formula": "1 + x"})))
        hits += names[-1] in (["second-order:x"], ["saturation:x"])
    assert hits == 3, names


def test_a_gross_error_does_not_hide_what_an_effect_takes_away():
    """The standard error of a row falls to that of the readings: a row that stands alone counts as three of them."""
    rng = np.random.default_rng(206)
    x = rng.permutation(np.linspace(0.0, 10.0, 80))
    y = 1.0 + 2.0 * x + 0.01 * (x - 5.0) ** 2 + 0.02 * rng.standard_normal(80)
    y[20] += 4.0
    table = Table("simulated", {"x": x, "y": y}, True, {})
    traced = trace_general(roles_of(table, Roles(response="y", formula="1 + x"))[0])
    assert traced.verdict == "explained"
    assert 0.018 < traced.after.fit.sigma_E < 0.024
    assert 0.05 < traced.before.fit.sigma_E < 0.1
    assert traced.after.cv_rms < 0.03


def test_errors_with_memory_name_the_drift_that_they_may_be():
    """55 rows in random order cannot tell a drift of four standard errors from errors that are alike."""
    rng = np.random.default_rng(3)
    x, t = rng.permutation(np.tile(np.linspace(0.0, 10.0, 11), 5)), 60.0 * np.arange(55)
    along = t - t.mean()
    y = 1.0 + 2.0 * x + rng.normal(size=55) + 5.0 * along / np.sqrt(along @ along)
    table = Table("simulated", {"x": x, "t": t, "y": y}, True, {})
    result = trace_general(roles_of(table, Roles(response="y", formula="1 + x", time="t"))[0])
    (finding,) = [one for one in result.effects if one.effect == "autocorrelation"]
    assert "drift:t" in finding.aliases
    assert "these data cannot tell it from" in finding.cause
