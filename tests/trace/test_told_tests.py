"""Tests that are told the true columns, against which searches are held (proving/statistics/told.py)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from proving.statistics import tables_power
from proving.statistics.told import free_of, powers


def told(rank, size, level, rows):
    rng = np.random.default_rng(3)
    declared = np.column_stack([np.ones(rows), np.linspace(-1.0, 1.0, rows)])
    free = free_of(declared)
    columns = free @ rng.standard_normal((rows, rank))
    effect = columns.sum(axis=1)
    effect *= size * rows**0.5 / np.linalg.norm(effect)
    apart = np.abs(np.subtract.outer(np.arange(rows), np.arange(rows)))
    roots = [np.linalg.cholesky(free @ rho**apart @ free.T) for rho in (0.0, 0.6)]
    held = {"independent": 1, "correlated": 2}
    return powers(columns, {"it": effect, "none": 0.0 * effect}, roots, held, level, rng, (10_000, 2000))


@pytest.mark.parametrize("rank", [1, 4])
def test_with_independent_errors_it_is_the_f_test_of_these_columns(rank):
    level, size, rows = 0.002, 1.0, 24
    found = told(rank, size, level, rows)
    df = rows - 2 - rank
    exact = stats.ncf.sf(stats.f.isf(level, rank, df), rank, df, size**2 * rows)
    assert found["it"]["independent"] == pytest.approx(exact, abs=0.1)
    assert found["none"]["independent"] == pytest.approx(level, abs=0.004)


def test_a_level_that_is_held_for_correlated_errors_too_costs_power():
    found = told(1, 0.6, 0.01, 24)
    assert found["it"]["correlated"] < found["it"]["independent"]
    assert found["none"]["correlated"] <= 0.02


def test_values_of_a_constant_count_as_the_independent_shapes_among_them():
    rng = np.random.default_rng(5)
    one, other = np.linalg.qr(rng.standard_normal((30, 2)))[0].T[:, :, None]
    assert tables_power._independent([one]) == pytest.approx(1.0)
    assert tables_power._independent([one, 3.0 * one]) == pytest.approx(1.0)
    assert tables_power._independent([one, other]) == pytest.approx(2.0)
    assert tables_power._independent([np.hstack([one, other]), np.hstack([other, one + other])]) == pytest.approx(1.0)
