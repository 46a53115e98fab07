"""Table 2's analysis of variance: by hand, by its own identities, by simulation, and with points missing."""

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, Sensor, simulate
from rig.fitter import least_squares
from rig.fitter.linear import CONDITION
from rig.fitter.misfit import lacks_fit
from rig.fitter.replication import Rows, _each_alone, analyse
from rig.fitter.sums_of_squares import FTest
from rig.procedures.attitude.fit import fit_attitude
from rig.procedures.attitude.model import attitude_columns

X_ONLY = Bench(sensors=(Sensor("x"),))


def table(columns, y, point, replicate):
    fit = least_squares(columns, y, [str(i) for i in range(columns.shape[1])])
    return fit, analyse(fit, Rows(columns, point, replicate), y)


def test_by_hand():
    """Straight line at x = -1, 0, 1, two replications: every sum of squares worked out on paper.

    Point means 0, 3, 0 above 2 x -> their line is 1 + 2 x, lack of fit 2 (1 + 4 + 1) = 12 on one degree of freedom.
    Deviations from the means are +-1, +-1, +-1: pure error 6 on three. Replication offsets are +1, -1: all of it.
    """
    x = np.tile([-1.0, 0, 1], 2)
    y = np.tile([0.0, 3, 0], 2) + np.repeat([1.0, -1], 3) + 2 * x
    fit, r = table(np.column_stack([np.ones(6), x]), y, np.tile([0, 1, 2], 2), np.repeat([0, 1], 3))
    assert fit.rss == pytest.approx(18)
    assert (r.bias.df_above, r.bias.df_below) == (1, 3)
    assert r.bias.value == pytest.approx((12 / 1) / (6 / 3))
    assert r.sigma_E**2 == pytest.approx(18 / 4)
    assert r.sigma_prec**2 == pytest.approx(18 / 4 * 6 / 18)
    assert r.sigma_bias**2 == pytest.approx(18 / 4 * 12 / 18)
    # each replication alone: offsets 2 and 0 with weight 3, residual 6 + 6 on two degrees of freedom
    assert r.sigma_b**2 == pytest.approx(6.0)
    assert r.drift_b.value == pytest.approx(6.0 / 6.0)
    assert (r.drift_b.df_above, r.drift_b.df_below) == (1, 2)
    assert (r.drift.df_above, r.drift.df_below) == (2, 1)


@pytest.mark.parametrize(
    ("sigma_bias", "sigma_prec", "n", "K", "L", "T_bias"),
    # Table 2 of NASA/TP-1999-209835: figures 24, 28(b), 37, 44(a), 44(b), 44(c), 47(a), 47(b), 47(c), 50 y
    [
        (2.62, 1.79, 6, 145, 3, 11.0),
        (3.54, 1.56, 6, 325, 4, 26.2),
        (4.71, 1.31, 4, 325, 4, 39.4),
        (4.10, 1.42, 6, 247, 4, 42.1),
        (4.17, 1.54, 6, 247, 4, 37.3),
        (3.11, 1.71, 6, 247, 4, 16.8),
        (3.72, 1.71, 6, 481, 4, 23.9),
        (5.08, 1.23, 6, 481, 4, 85.9),
        (4.28, 2.15, 6, 481, 4, 20.0),
        (1.50, 1.33, 6, 6, 4, 19.1),
    ],
)
def test_the_rows_of_table_2(sigma_bias, sigma_prec, n, K, L, T_bias):
    """Residuals built to have the row's sigma_bias and sigma_prec must come back with them and with its T_bias."""
    rng = np.random.default_rng(K)
    pitch = np.linspace(-180, 180, K) if K != 6 else np.array([-90.0, 0, 90, 180, 0, 0])
    roll = rng.uniform(-180, 180, K) if K != 6 else np.array([0.0, 0, 0, 0, 90, -90])
    h = attitude_columns(pitch, roll, roll=L == 4)
    q = np.linalg.qr(h)[0]
    bias = rng.normal(size=K)
    bias -= q @ (q.T @ bias)
    scatter = rng.normal(size=(n, K))
    scatter -= scatter.mean(axis=0)
    share = np.sqrt((n * K - L) / np.array([n * np.sum(bias**2), np.sum(scatter**2)]))
    y = (sigma_bias * share[0] * bias + sigma_prec * share[1] * scatter).ravel()
    point, replicate = np.tile(np.arange(K), n), np.repeat(np.arange(n), K)
    fit, r = table(np.tile(h, (n, 1)), y, point, replicate)
    assert r.sigma_bias == pytest.approx(sigma_bias)
    assert r.sigma_prec == pytest.approx(sigma_prec)
    assert fit.sigma == pytest.approx(np.hypot(sigma_bias, sigma_prec))
    assert r.bias.value == pytest.approx(T_bias, rel=0.012 if K > 6 else 0.02)


def test_limits_follow_from_the_degrees_of_freedom():
    night = analyse_run(X_ONLY, D1(90, 19), 0)
    assert night.bias.limit_95 == pytest.approx(1.17, abs=0.006)  # row 44(a)
    assert night.drift_b.limit_95 == pytest.approx(2.22, abs=0.006)
    assert np.isnan(FTest(1.0, 0, 5).limit_95)


def analyse_run(bench, plan, seed, **kw):
    data, _ = simulate(bench, plan, seed, **kw)
    return fit_attitude(data, "x_V").replication


def test_clean_data_keep_their_level():
    """Under the null every p is uniform: 200 runs of 5 x 9 points x 4, mean and share below 5 % of each."""
    runs = [analyse_run(X_ONLY, D1(60, 5, 9, replications=4), seed) for seed in range(200)]
    for p in (
        [r.bias.p for r in runs],
        [r.drift_b.p for r in runs],
        [r.drift_S.p for r in runs],
        [r.drift.p for r in runs],
    ):
        assert np.mean(p) == pytest.approx(0.5, abs=0.07)
        assert np.mean(np.array(p) < 0.05) < 0.105
    sigma = np.radians(1.5e-4) * 5.0
    assert np.sqrt(np.mean([r.sigma_E**2 for r in runs])) == pytest.approx(sigma, rel=0.02)
    assert np.sqrt(np.mean([r.sigma_pr**2 for r in runs])) == pytest.approx(sigma, rel=0.02)
    # expected shares on clean data: sqrt((K-L)/(nK-L)) = 0.41 and sqrt(K(n-1)/(nK-L)) = 0.91 of sigma
    r = analyse_run(X_ONLY, D1(180, 37), 1)
    assert r.sigma_bias / sigma == pytest.approx(0.41, abs=0.03)
    assert r.sigma_prec / sigma == pytest.approx(0.91, abs=0.03)


def test_drift_of_the_offset_is_seen_where_it_is():
    r = analyse_run(Bench(sensors=(Sensor("x"),), offset_sd=0.3), D1(90, 19), 2)
    assert r.drift_b.p < 1e-6
    assert r.drift_S.p > 1e-3
    assert r.drift.p < 1e-4


def test_a_temperature_coefficient_hides_from_T_bias():
    """Row 28(a): 7.76e-4 deg of which temperature is most, T_bias 1.33, T_S 919."""
    warm = Bench(sensors=(Sensor("x", S_per_degC=2.2e-5),))
    r = analyse_run(warm, D1(90, 19), 3)
    assert r.drift_S.value > 20
    assert r.bias.value < 1.6


def _line(seed, *, cubic=0.0, drift=0.0, walk=0.0, drop=()):
    """25 points of a line in 4 replications, scatter 1: Table 2 of it."""
    rng, x = np.random.default_rng(seed), np.linspace(-1, 1, 25)
    point, replicate = np.tile(np.arange(25), 4), np.repeat(np.arange(4), 25)
    y = cubic * (x**3)[point] + rng.normal(size=100) + drift * (np.arange(4.0) - 1.5)[replicate]
    y += walk * np.cumsum(rng.normal(size=100))
    kept = np.delete(np.arange(100), drop)
    columns = np.column_stack([np.ones(100), x[point]])
    return table(columns[kept], y[kept], point[kept], replicate[kept])[1], columns[kept], y[kept], replicate[kept]


def test_a_lack_of_fit_behind_drift_is_said():
    """Drift in the denominator of T_bias hides a cubic that is plain against what is left without the drift."""
    plain = _line(1, cubic=6.0)[0]
    assert lacks_fit(plain)
    assert plain.blind is None
    r, columns, y, replicate = _line(1, cubic=6.0, drift=30.0, drop=[3, 40])
    assert r.bias.value < r.bias.limit_95
    assert r.blind is not None
    assert lacks_fit(r)
    assert "drift between replications makes its denominator" in r.blind.sentence
    assert "lack of fit is SIGNIFICANT" in r.blind.sentence
    # the same by full least squares on indicators: points and each replication's own line, against the lines alone
    own = np.hstack([columns * (replicate == i)[:, None] for i in range(4)])
    points = (columns[:, 1:] == np.unique(columns[:, 1])).astype(float)
    lines, both = (np.linalg.lstsq(x, y, rcond=1e-10) for x in (own, np.hstack([own, points])))
    rss = [np.sum((y - x @ f[0]) ** 2) for x, f in ((own, lines), (np.hstack([own, points]), both))]
    assert (r.blind.bias.df_above, r.blind.bias.df_below) == (both[2] - lines[2], 98 - both[2])
    mean_squares = (rss[0] - rss[1]) / (both[2] - lines[2]), rss[1] / (98 - both[2])
    assert r.blind.bias.value == pytest.approx(mean_squares[0] / mean_squares[1])


def test_wander_within_replications_is_said_to_hide_a_lack_of_fit():
    wandering = _line(2, cubic=6.0, walk=3.0)[0]
    assert wandering.blind is not None
    assert "cannot see a lack of fit smaller than the wander within replications" in wandering.blind.sentence


def test_nothing_is_said_of_plain_scatter():
    """Seeds 0 to 199: wander is claimed where there is none in 1 of 1000, lack of fit beside drift in 5 of 100."""
    assert sum(bool(b and b.wander) for b in (_line(seed)[0].blind for seed in range(200))) <= 2
    slight = [_line(seed, drift=0.3)[0] for seed in range(40)]
    assert any(r.drift.p < 0.05 and r.blind is None for r in slight), "a drift that inflates nothing hides nothing"
    drifting = [_line(seed, drift=30.0)[0].blind for seed in range(200)]
    assert 2 <= sum(b.lacks_fit for b in drifting) <= 20
    assert np.mean([b.bias.p for b in drifting]) == pytest.approx(0.5, abs=0.07)


def test_missing_points_are_counted_exactly():
    data, _ = simulate(X_ONLY, D1(60, 7, 9, replications=3), 5, drop=0.2)
    r = fit_attitude(data, "x_V").replication
    n, K = len(data), len(np.unique(data.point))
    assert (r.bias.df_above, r.bias.df_below) == (K - 4, n - K)
    assert r.drift_b.df_below == n - 3 * 4
    # the joint test's degrees of freedom and sums of squares, from full least squares on indicators
    y, h = data.outputs["x_V"] - data.outputs["x_V"].mean(), attitude_columns(data.pitch_deg, data.roll_deg)
    points = np.eye(K)[np.unique(data.point, return_inverse=True)[1]]
    own = np.hstack([h * (data.replicate_index == i)[:, None] for i in range(3)])
    small = np.linalg.lstsq(points, y, rcond=None)
    big = np.linalg.lstsq(np.hstack([points, own]), y, rcond=1e-10)

    def rss(x, solved):
        return np.sum((y - x @ solved[0]) ** 2)

    above = rss(points, small) - rss(np.hstack([points, own]), big)
    assert (r.drift.df_above, r.drift.df_below) == (big[2] - K, n - big[2])
    assert r.drift.value == pytest.approx(
        above / (big[2] - K) / (rss(np.hstack([points, own]), big) / (n - big[2])), rel=1e-4
    )


def test_a_replication_cut_short_and_a_single_replication():
    data, _ = simulate(X_ONLY, D1(60, 7, 9, replications=3), 6)
    short = data.take(np.flatnonzero((data.replicate < 3) | (data.order < data.order[data.replicate == 3].min() + 3)))
    r = fit_attitude(short, "x_V").replication
    assert r.n_replications == 2
    assert r.drift_b.df_above == 1
    one = fit_attitude(data.take(np.flatnonzero(data.replicate == 1)), "x_V")
    found = one.to_dict()
    assert found["T_bias"] is None
    assert found["sigma_prec"] is None
    assert found["T_b"] is None
    assert found["T_drift"] is None
    assert found["sigma_E"] > 0


def test_rows_with_effects_span_what_all_their_columns_do():
    """The basis of the model alone is used again for every output; that of all columns at once is by numpy."""
    rng = np.random.default_rng(5)
    data, _ = simulate(X_ONLY, D1(60, 5, 9, replications=4, order="random"), 3)
    extra = rng.standard_normal((len(data), 2)) @ np.array([[1.0, 2.0, 1.0], [0.0, 1.0, 1.0]])
    rows = data.rows.beside(extra)
    own = np.hstack([data.rows.columns * (data.replicate_index == r)[:, None] for r in range(4)] + [extra])
    means = np.eye(rows.n_points)[data.point]
    within = own - means @ np.linalg.lstsq(means, own, rcond=None)[0]
    left, values, _ = np.linalg.svd(within, full_matrices=False)
    basis = left[:, values > 1e-9 * values[0]]
    assert rows.both.rank == basis.shape[1]
    np.testing.assert_allclose(rows.both.expand(rows.both.coordinates(basis)), basis, atol=1e-12)
    assert data.rows.beside(np.empty((len(data), 0))) is data.rows


@pytest.mark.parametrize("middle", [0.0, 5.0])
def test_triangles_made_at_once_give_the_fit_of_each_replication_to_the_bit(middle):
    """Rows in any order, replications of three sizes, one too short; also where fits are refined."""
    rng = np.random.default_rng(4)
    replicate = rng.permutation(np.repeat([0, 1, 2, 3, 5], [9, 7, 2, 9, 8]))
    x, y = middle + rng.uniform(-1, 1, len(replicate)), rng.normal(size=len(replicate))
    columns, names = np.column_stack([np.ones(len(x)), x, x**2]), ("a", "b", "c")
    found = _each_alone(columns, y, replicate, names)
    for one, r in zip(found, (0, 1, 3, 5), strict=True):
        alone = least_squares(columns[replicate == r], y[replicate == r], names)
        assert (alone.condition >= CONDITION) == (middle > 0.0)
        for name in ("coefficients", "root", "rss", "n", "condition"):
            assert np.array_equal(getattr(one, name), getattr(alone, name)), name
