"""The span of replications' own parameters beside levels, without its matrix, against the matrix."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, simulate
from rig.fitter import own_span
from rig.fitter.gross.rows import Rows
from rig.fitter.linear import orthonormal
from rig.fitter.own_span import Levels, OwnSpan
from rig.fitter.sums_of_squares import own_parameters

N, N_REP, N_GROUP = 400, 5, 60


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(own_span, "AT_ONCE", 64)


def case(*, weighted):
    """Rows of incomplete replications in any order, some without a group, a group larger than the rows made at once."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal((N, 2))
    columns = np.column_stack([np.ones(N), x, x[:, 0]])  # one depends on another
    own, group = rng.integers(0, N_REP, N), rng.integers(-1, N_GROUP, N)
    group[:70] = 0
    group = np.where(group >= 0, np.unique(np.r_[-1, group], return_inverse=True)[1][1:] - 1, -1)
    weight = rng.uniform(0.5, 2.0, N) if weighted else np.ones(N)
    return columns * weight[:, None], own, group, weight


def held(columns, own, group, weight):
    """The same by a matrix: what levels leave of values, and an orthonormal basis of the rest."""
    levels = weight[:, None] * np.eye(group.max() + 2)[group][:, :-1]
    levels = orthonormal(levels)
    dense = own_parameters(columns, own)
    inside = dense - levels @ (levels.T @ dense)
    return levels, orthonormal(inside, np.linalg.norm(dense, axis=0))


@pytest.mark.parametrize("weighted", [False, True])
def test_a_span_does_what_its_matrix_does(weighted):
    columns, own, group, weight = case(weighted=weighted)
    levels, basis = held(columns, own, group, weight)
    span = OwnSpan(columns, own, Levels(group, weight if weighted else None))
    assert span.rank == basis.shape[1] == 3 * N_REP
    made = span.expand(np.eye(span.rank))
    assert made == pytest.approx(basis @ (basis.T @ made), abs=1e-12)
    assert made.T @ made == pytest.approx(np.eye(span.rank), abs=1e-12)
    y = np.random.default_rng(4).standard_normal(N)
    left = y - levels @ (levels.T @ y)
    assert span.levels.project_out(y) == pytest.approx(left, abs=1e-12)
    assert span.project_out(left) == pytest.approx(left - basis @ (basis.T @ left), abs=1e-12)
    assert span.coordinates(y) == pytest.approx(made.T @ y, abs=1e-12)
    assert span.leverage == pytest.approx(np.sum(basis**2, axis=1), abs=1e-12)
    some = np.array([399, 3, 71, 200])
    assert span.at(some) == pytest.approx(made[some], abs=1e-12)


@pytest.mark.parametrize("weighted", [False, True])
def test_rows_with_own_parameters_are_those_of_all_their_columns(weighted):
    columns, own, group, weight = case(weighted=weighted)
    rng = np.random.default_rng(5)
    y, kept, out = rng.standard_normal(N) * weight, rng.uniform(0.1, 3.0, N), np.array([5, 80, 81, 300])
    short = Rows(columns, y, weight, group, own)
    full = Rows(own_parameters(columns, own), y, weight, group)
    assert (short.df, short.coefficients) == (full.df, full.coefficients)
    assert short.residual == pytest.approx(full.residual, abs=1e-12)
    assert short.kept == pytest.approx(full.kept, abs=1e-12)
    assert short.block(out) == pytest.approx(full.block(out), abs=1e-12)
    assert short.spread(out, y[out]) == pytest.approx(full.spread(out, y[out]), abs=1e-12)
    assert short.residual_of(kept) == pytest.approx(full.residual_of(kept), abs=1e-10)
    some = np.flatnonzero(rng.random(N) < 0.9)
    assert short.some(some).residual == pytest.approx(full.some(some).residual, abs=1e-12)


@pytest.mark.parametrize("order", ["given", "random"])
def test_correlations_of_neighbours_are_those_of_the_whole_projection(order):
    """Traces of white noise seen through the fit, by matrices of all rows."""
    data, _ = simulate(Bench(), D1(180, 5, 5, replications=3, **({} if order == "given" else {"order": order})), seed=2)
    some = np.random.default_rng(1).random(len(data)) < 0.9
    data = data.take(np.flatnonzero(some))
    rows = data.rows.beside(np.random.default_rng(2).standard_normal((len(data), 2)))
    n = len(data)
    points = orthonormal(np.eye(rows.n_points)[rows.point])
    basis = rows.both.expand(np.eye(rows.both.rank))
    maker = np.eye(n) - points @ points.T - basis @ basis.T
    lag = np.zeros((n, n))
    at = np.argsort(data.order)
    lag[at[1:], at[:-1]] = lag[at[:-1], at[1:]] = rows.joined
    trace, square = rows.neighbours
    assert trace == pytest.approx(np.trace(maker @ lag), rel=1e-10)
    assert square == pytest.approx(np.trace(maker @ lag @ maker @ lag), rel=1e-10)


def test_a_long_run_needs_no_matrix_of_all_columns(monkeypatch):
    """Six replications of four columns are 24 numbers a row. All else is in numbers of a row, or of a block."""
    monkeypatch.setattr(own_span, "AT_ONCE", 512)
    data, _ = simulate(Bench(), D1(180, 61, 61), seed=1)
    n, y = len(data), data.outputs["x_V"]
    rows = Rows(data.rows.columns, y, np.broadcast_to(1.0, n), data.point, data.replicate_index)
    tracemalloc.start()
    try:
        assert rows.residual.shape == rows.kept.shape == rows.residual_of(np.ones(n)).shape == (n,)
        assert data.rows.both.project_out(rows.levels.project_out(y)).shape == (n,)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 20 * 8 * n


def test_sides_and_angles_before_are_made_when_they_are_asked_for():
    full, _ = simulate(Bench(), D1(180, 5, 5), seed=1)
    sides = ("pitch_side", "roll_side", "previous_pitch_deg", "previous_roll_deg")
    data = replace(full, **dict.fromkeys(sides))
    assert all(data.__dict__[name] is None for name in sides)
    assert data.pitch_side is data.pitch_side
    assert data.previous_pitch_deg[1:].tolist() == data.pitch_deg[:-1].tolist()
    assert data.take(np.arange(3, 9)).previous_roll_deg.tolist() == data.roll_deg[2:8].tolist()
