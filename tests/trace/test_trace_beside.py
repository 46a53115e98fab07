"""Rows of several sensors beside a model, over their errors: what each part of them tells, and how well."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from rig.fitter.trace.engine.beside import Errors, View, White
from rig.fitter.trace.engine.between import PRIOR, RHO, alike, p_among
from rig.fitter.trace.engine.components import Components
from rig.fitter.trace.engine.noise import Independent
from rig.fitter.trace.engine.robust import isolated

GROUPS, ROWS = 12, 8
N = GROUPS * ROWS
GROUP = np.repeat(np.arange(GROUPS), ROWS)


def errors_of(variable, offset=9.0, slope=0.0, rho=0.0):
    noise = Components.of(GROUP, np.arange(N), variable)
    return Errors(
        Components(noise.group, noise.before, noise.variable, np.array([[offset, slope, rho]]), np.ones(N)), np.ones(N)
    )


def run(sensors=1, **components):
    """A line declared; one candidate between groups and one within them, of the last sensor, and one of all."""
    rng = np.random.default_rng(8)
    x = np.tile(np.linspace(-1.0, 1.0, ROWS), GROUPS)
    between, within, common = rng.standard_normal(GROUPS)[GROUP], np.tile(rng.standard_normal(ROWS), GROUPS), x**3
    columns = np.zeros((sensors, N, 3))
    columns[-1, :, 0], columns[-1, :, 1], columns[:, :, 2] = between, within, common
    errors = tuple(errors_of(x, **components) for _ in range(sensors))
    y = rng.standard_normal((sensors, N)) + 3.0 * rng.standard_normal((sensors, GROUPS))[:, GROUP]
    return White(errors, np.column_stack([np.ones(N), x]), y, columns)


def test_parts_of_rows_are_orthogonal_and_of_unit_length():
    errors = errors_of(np.tile(np.linspace(-1.0, 1.0, ROWS), GROUPS), slope=4.0, rho=0.5)
    every = np.hstack(errors.parts)
    np.testing.assert_allclose(every.T @ every, np.eye(2 * GROUPS), atol=1e-12)


def test_a_candidate_between_groups_has_the_t_test_of_their_means():
    white = run()
    means = [v.reshape(GROUPS, ROWS).mean(axis=1) for v in (white.outputs[0], white.columns[0, :, 0])]
    y, x = (v - v.mean() for v in means)
    value = float(x @ y / (x @ x))
    stderr = float(np.sqrt(np.sum((y - value * x) ** 2) / (GROUPS - 2) / (x @ x)))
    found = white.coefficients((0,))[0]
    assert (found.value, found.stderr) == pytest.approx((value, stderr), rel=1e-9)
    assert found.df == pytest.approx(GROUPS - 2)


def test_a_candidate_within_groups_has_the_t_test_beside_their_offsets():
    white = run()
    model = np.column_stack([np.eye(GROUPS)[GROUP], white.declared[:, 1], white.columns[0, :, 1]])
    solved, rss, rank, _ = np.linalg.lstsq(model, white.outputs[0], rcond=None)
    error = np.sqrt(rss[0] / (N - rank) * np.linalg.inv(model.T @ model)[-1, -1])
    found = white.coefficients((1,))[1]
    assert (found.value, found.stderr) == pytest.approx((solved[-1], error), rel=1e-9)
    assert found.df == pytest.approx(N - rank)


def test_groups_whose_slopes_differ_are_as_many_numbers_as_there_are_of_them():
    """A slope of all: with the rows' own error alone it would have 80 degrees of freedom."""
    white = run(slope=4.0)
    free = White(white.errors, white.declared[:, :1], white.outputs, white.declared[None, :, 1:])
    assert free.coefficients((0,))[0].df == pytest.approx(GROUPS - 1)


def test_a_common_candidate_is_fitted_to_all_sensors():
    """Two of one error: the mean of what either says; a candidate of one of them is not touched by the other's rows."""
    white = run(2)
    each = [
        White(white.errors[:1], white.declared, white.outputs[[i]], white.columns[[i]]).coefficients((2,))[2]
        for i in range(2)
    ]
    both = white.coefficients((2,))[2]
    assert min(e.value for e in each) < both.value < max(e.value for e in each)
    assert both.stderr == pytest.approx(np.mean([e.stderr for e in each]) / np.sqrt(2.0), rel=0.05)
    assert white.coefficients((0,))[0].value == pytest.approx(
        White(white.errors[1:], white.declared, white.outputs[1:], white.columns[1:]).coefficients((0,))[0].value
    )


def test_rows_without_groups_have_one_level():
    """A table: its residual has the degrees of freedom of least squares, and a mean square of one."""
    white, noise = run(), Independent(N)
    view = View(White((Errors(noise, np.ones(N)),), white.declared, white.outputs, white.columns), None, (1,), None)
    assert view.df == pytest.approx(N - 3.0)
    assert np.sum(view.outputs**2) / view.df[0] == pytest.approx(1.0)
    np.testing.assert_allclose(view.project(white.columns[0, :, [1]].T, 0), 0.0, atol=1e-9)


def test_a_row_is_isolated_beside_its_group_and_not_beside_what_groups_differ_by():
    """Groups differ by thirty times the rows' own error: beside that nothing was isolated."""
    rng = np.random.default_rng(12)
    y = rng.standard_normal(N) + 30.0 * rng.standard_normal(GROUPS)[GROUP]
    basis = np.ones((N, 1)) / np.sqrt(N)
    y[17] += 20.0
    told = isolated(y, basis, ordered=False, step=0.0, near=lambda: None, group=GROUP, sd=np.ones(N))
    assert np.flatnonzero(told).tolist() == [17]
    assert told[17] == pytest.approx(17.0, abs=3.0)
    assert not np.any(isolated(y, basis, ordered=False, step=0.0, near=lambda: None, group=None, sd=np.ones(N)))
    y[::8] += 20.0
    many = isolated(y, basis, ordered=False, step=0.0, near=lambda: None, group=GROUP, sd=np.ones(N))
    assert not np.any(many), "one of eight in each group is an effect"


def test_candidates_alone_are_their_coefficients():
    white = run()
    value, error = white.alone(())
    for j in range(3):
        found = white.coefficients((j,))[j]
        assert value[j] == pytest.approx(found.value)
        assert error[j] == pytest.approx(found.stderr, rel=0.2)  # beside the residual without it


@pytest.mark.parametrize("level", ["whole-plot", "subplot"])
def test_a_level_beside_the_model_has_a_mean_square_of_one(level):
    view = run(2).view(level, (0, 1))
    df = (GROUPS - 1.0, GROUPS - 2.0) if level == "whole-plot" else (N - GROUPS - 1.0, N - GROUPS - 2.0)
    assert view.df == pytest.approx(df)
    assert np.sum(view.outputs**2, axis=1) / view.df == pytest.approx(1.0)
    for i in range(2):
        np.testing.assert_allclose(view.project(np.ones((N, 1)), i), 0.0, atol=1e-9)


def test_a_shape_between_groups_is_averaged_over_correlations_of_neighbours():
    white = run()
    view = white.view("whole-plot", ())
    every, basis = alike(view, np.arange(GROUPS), 0), view.project(white.columns[0, :, :1], 0)
    gain = float(basis[:, 0] @ view.outputs[0]) ** 2 / float(basis[:, 0] @ basis[:, 0])
    independent = special.fdtrc(1, GROUPS - 2, gain / ((GROUPS - 1 - gain) / (GROUPS - 2)))
    alone = p_among(every[:1], basis / np.linalg.norm(basis), view.outputs[0])
    assert alone == pytest.approx(independent, rel=1e-9)
    assert len(every) == len(RHO)
    assert sum(np.exp(one.log_prior) for one in every) == pytest.approx(PRIOR.sum())
    assert 0.0 < p_among(every, basis / np.linalg.norm(basis), view.outputs[0]) <= 1.0
