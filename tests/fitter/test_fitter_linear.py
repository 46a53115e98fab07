"""Least squares in blocks, against another solver, by the intervals it gives; certified values: test_nist.py."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nist import PROBLEMS

from rig.fitter import RankError, Triangle, least_squares
from rig.fitter.formula import Formula
from rig.fitter.linear import orthonormal
from rig.fitter.quantiles import f_limit, f_tail, t_limit, t_tail


def powers(x, degree):
    return np.vander(x, degree + 1, increasing=True)


def test_rows_may_come_in_blocks():
    longley = PROBLEMS["Longley"]
    names, columns = Formula.parse(longley.model).columns(longley.columns)
    triangle = Triangle(names)
    for start in range(0, 16, 3):
        triangle = triangle.add(columns[start : start + 3], longley.columns["y"][start : start + 3])
    fit = triangle.solve()
    np.testing.assert_allclose(fit.coefficients, [float(c) for c in longley.coefficients], rtol=1e-9)
    assert fit.n == 16
    assert fit.sigma == pytest.approx(float(longley.sigma), rel=1e-10)


def test_columns_that_cannot_be_told_apart_are_named():
    x = np.linspace(0, 1, 20)
    with pytest.raises(RankError, match=r"cannot tell apart: 1, cos\(pitch\)$"):
        least_squares(np.column_stack([np.ones(20), x, np.full(20, 0.5)]), x, ["1", "sin(pitch)", "cos(pitch)"])
    with pytest.raises(RankError, match="2 observations cannot determine 3 coefficients"):
        least_squares(np.ones((2, 3)), np.ones(2), ["a", "b", "c"])


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(8, 60), k=st.integers(1, 6))
def test_against_another_solver(seed, n, k):
    rng = np.random.default_rng(seed)
    columns, y = rng.normal(size=(n, k)) * 10.0 ** rng.integers(-2, 3, k), rng.normal(size=n)
    fit = least_squares(columns, y, [str(i) for i in range(k)])
    expected, rss, *_ = np.linalg.lstsq(columns, y, rcond=None)
    np.testing.assert_allclose(fit.coefficients, expected, rtol=1e-7, atol=1e-12 * np.abs(expected).max())
    assert fit.rss == pytest.approx(rss[0])
    assert fit.variance_function(columns).sum() == pytest.approx(k)


def test_intervals_hold_what_they_promise():
    rng = np.random.default_rng(3)
    columns = powers(np.linspace(-1, 1, 12), 2)
    at, truth = powers(np.array([0.0, 1.5]), 2), np.array([1.0, -2.0, 0.5])
    inside = np.zeros((2, 2))
    for _ in range(2000):
        fit = least_squares(columns, columns @ truth + rng.normal(size=12), "abc")
        inside[0] += np.abs(fit.predict(at) - at @ truth) <= fit.confidence(at)
        inside[1] += np.abs(fit.predict(at) - at @ truth - 2.0 * rng.normal(size=2)) <= fit.prediction(at, sigma_0=2.0)
    np.testing.assert_allclose(inside[0] / 2000, 0.95, atol=0.015)
    # sigma_0 / sigma takes the estimated sigma back out of eq. (73), which costs a little coverage
    np.testing.assert_allclose(inside[1] / 2000, 0.95, atol=0.03)


def test_orthonormal_drops_what_is_only_rounding():
    x = np.linspace(0, 1, 30)
    columns = np.column_stack([np.ones(30), x, 2 * x - 1, 1e-15 * np.sin(9 * x)])
    basis = orthonormal(columns, length=np.array([5.0, 5.0, 5.0, 5.0]))
    assert basis.shape == (30, 2)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-14)


@pytest.mark.parametrize(
    ("df", "limits"),
    # Table 2's (F)_95 of K points, L parameters, n replications, where the scan and the definitions agree
    [
        ((73 - 3, 73 * 5), 1.33), ((145 - 3, 145 * 5), 1.23), ((4 - 3, 4 * 5), 4.35), ((325 - 4, 325 * 5), 1.15),
        ((53 - 4, 53 * 5), 1.40), ((325 - 4, 325 * 3), 1.16), ((247 - 4, 247 * 5), 1.17), ((481 - 4, 481 * 5), 1.12),
        ((6 - 4, 6 * 5), 3.32), ((73 - 4, 73 * 5), 1.33), ((5, 6 * 243), 2.22), ((3, 4 * 321), 2.61),
        ((5, 6 * 2), 3.11),
    ],
)  # fmt: skip
def test_limits_of_table_2(df, limits):
    assert round(f_limit(0.95, *df), 2) == pytest.approx(limits, abs=0.0101)
    assert f_tail(f_limit(0.95, *df), *df) == pytest.approx(0.05)


def test_a_ratio_that_rounding_made_negative_is_zero():
    """On one processor two equal sums of squares differed by -2e-14, and a calibration could not be written."""
    assert f_tail(-2.8e-14, 1, 27) == 1.0
    assert np.isnan(f_tail(float("nan"), 1, 27))


def test_student_limits():
    # Student's table: two-tailed 95 % for 4, 10 and very many degrees of freedom
    assert [round(t_limit(0.95, df), 3) for df in (4, 10, 1e9)] == [2.776, 2.228, 1.960]
    assert t_tail(2.776, 4) == pytest.approx(0.05, abs=1e-4)


def test_a_basis_that_may_overwrite_its_columns_is_made_in_their_memory():
    """Of a million rows a copy is as much memory as all else."""
    columns = np.asfortranarray(np.random.default_rng(5).normal(size=(20_000, 12)))
    tracemalloc.start()
    try:
        basis = orthonormal(columns, np.ones(12), overwrite=True)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert np.abs(basis.T @ basis - np.eye(12)).max() < 1e-13
    assert peak < 0.3 * columns.nbytes


def test_several_responses_share_a_triangle():
    rng = np.random.default_rng(5)
    columns, y = rng.normal(size=(20, 3)), rng.normal(size=(20, 2))
    both = Triangle(("a", "b", "c")).add(columns[:2], y[:2]).add(columns[2:], y[2:])
    for i in range(2):
        fit, (c, rss, *_) = both.of(i).solve(), np.linalg.lstsq(columns, y[:, i], rcond=None)
        np.testing.assert_allclose(fit.coefficients, c, rtol=1e-12)
        assert fit.rss == pytest.approx(rss[0], rel=1e-12)
    with pytest.raises(ValueError, match="2 columns were given for 3 names"):
        both.add(columns[:, :2], y)
