"""Components of the error of rows in groups: offsets, slopes, memory; and several sensors judged together."""

import numpy as np
import pytest

from rig.fitter.trace.engine.both import Both
from rig.fitter.trace.engine.components import PRICE, Components
from rig.fitter.trace.engine.likelihood import Grid
from rig.fitter.trace.engine.noise import Independent, Wandering
from rig.fitter.trace.engine.sensors import Stacked
from rig.fitter.trace.engine.shared import Shared

GROUPS, ROWS = 6, 5


def made(seed=1, *, weighted=True):
    rng = np.random.default_rng(seed)
    order, pressure = rng.permutation(GROUPS * ROWS), rng.uniform(0.0, 10.0, GROUPS * ROWS)
    noise = Components.of(np.repeat(np.arange(GROUPS), ROWS), order, pressure)
    return (noise.over(np.exp(0.3 * rng.standard_normal(order.size))) if weighted else noise), order


def dense(noise, order, at):
    """The covariance by its definition, row by row."""
    offset, slope, memory = noise.grid[at]
    n = order.size
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            if noise.group[i] != noise.group[j]:
                continue
            mine = np.sort(order[noise.group == noise.group[i]])
            apart = abs(int(np.searchsorted(mine, order[i])) - int(np.searchsorted(mine, order[j])))
            shared = offset + slope * noise.variable[i] * noise.variable[j]
            out[i, j] = memory**apart + shared / (noise.sd[i] * noise.sd[j])
    return out


def some_of(noise):
    """Covariances with none, one, two and all of the components."""
    kinds = sorted({tuple(row > 0.0) for row in noise.grid})
    return [int(np.argmax(np.all((noise.grid > 0.0) == kind, axis=1))) for kind in kinds]


def test_whitening_is_that_of_the_covariance():
    noise, order = made()
    one = np.eye(order.size)
    for at in some_of(noise):
        covariance, white, colour = dense(noise, order, at), noise.whiten(np.array([at]), one)[0], noise.colour(at, one)
        assert white @ covariance @ white.T == pytest.approx(one, abs=1e-10)
        assert colour @ colour.T == pytest.approx(covariance, abs=1e-10)
        assert noise.back(at, one) == pytest.approx(white.T, abs=1e-10)
        assert noise.root(at, one) == pytest.approx(colour.T, abs=1e-10)
        assert noise.variances(at) == pytest.approx(np.diag(covariance))
        price = 2.0 * PRICE * np.count_nonzero(noise.grid[at, 1:])
        assert noise.log_det[at] == pytest.approx(np.linalg.slogdet(covariance)[1] + price)


def test_the_first_covariance_is_that_of_independent_rows():
    assert np.all(made()[0].grid[0] == 0.0)


def test_a_row_that_is_left_out_is_remembered_by_none():
    """The row behind it follows the one before, as if it came directly after."""
    noise, order = made(weighted=False)
    first = np.flatnonzero(noise.group == 0)[np.argsort(order[noise.group == 0])]
    kept = np.setdiff1d(np.arange(order.size), first[1:3])
    some = noise.rows(kept)
    number = {int(row): i for i, row in enumerate(kept)}
    assert some.before[number[int(first[3])]] == number[int(first[0])]
    assert np.array_equal(np.bincount(some.group), [ROWS - 2] + [ROWS] * (GROUPS - 1))


def test_groups_without_a_variable_have_no_slopes():
    noise = Components.of(np.repeat(np.arange(3), 4), np.arange(12), np.ones(12))
    assert not np.any(noise.grid[:, 1])


def test_many_columns_are_tried_as_each_by_itself():
    noise, order = made()
    rng = np.random.default_rng(2)
    y, model, more = (rng.standard_normal(shape) for shape in (order.size, (order.size, 2), (order.size, 3)))
    grid = Grid.of(noise, y, model)
    each = grid.each(more)
    for k in range(3):
        assert each[:, k] == pytest.approx(grid.beside(more[:, [k]]).reml, rel=1e-10)


def test_likelihood_finds_what_was_drawn():
    """Twenty groups of eleven rows, as a night has them; the middle of forty estimates."""
    rng, group, x = np.random.default_rng(3), np.repeat(np.arange(20), 11), np.tile(np.linspace(-1.0, 1.0, 11), 20)
    noise = Components.of(group, np.arange(220), x)
    truth = int(np.argmin(np.abs(noise.grid - [2.5, 4.0, 0.55]).sum(axis=1)))
    drawn = noise.colour(truth, rng.standard_normal((220, 40)))
    model = np.column_stack([np.ones(220), x])
    found = np.array([noise.grid[Grid.of(noise, y, model).beside().best] for y in drawn.T])
    assert np.median(found, axis=0) == pytest.approx(noise.grid[truth], rel=0.7)


def test_sensors_one_after_the_other_are_independent():
    one, order = made(1)
    other, _ = made(2)
    both = Stacked((one, other), (order.size, order.size))
    columns = np.random.default_rng(4).standard_normal((2 * order.size, 3))
    at = 40
    apart = [
        part.whiten(np.array([at]), rows)[0] for part, rows in zip((one, other), np.split(columns, 2), strict=True)
    ]
    assert both.whiten(np.array([at]), columns)[0] == pytest.approx(np.vstack(apart))
    assert both.log_det == pytest.approx(one.log_det + other.log_det)
    assert both.whiten(np.array([at]), both.colour(at, columns))[0] == pytest.approx(columns)
    kept = np.array([0, 3, 7, order.size + 2, order.size + 9])
    assert both.rows(kept).rows_of == (3, 2)


def noises():
    rng = np.random.default_rng(4)
    group, when = np.repeat(np.arange(GROUPS), ROWS), np.arange(float(GROUPS * ROWS))
    sd = np.exp(0.3 * rng.standard_normal(group.size))
    parts = (made(2)[0], made(3)[0])
    return {
        "independent": Independent(group.size),
        "wander": Wandering(when),
        "offsets": Shared(group).over(sd),
        "offsets and a wander": Both(group, when=when).over(sd),
        "offsets, slopes and memory": made(2)[0],
        "two sensors": Stacked((parts[0], parts[1].stretched(2.0)), (group.size, group.size)),
    }


@pytest.mark.parametrize("which", list(noises()))
def test_products_of_columns_are_those_of_whitened_ones(which):
    noise, rng = noises()[which], np.random.default_rng(5)
    n = GROUPS * ROWS * (2 if which == "two sensors" else 1)
    one, other = rng.standard_normal((n, 3)), rng.standard_normal((n, 2))
    one[: n // 2, 0] = 0.0
    at = np.unique(rng.integers(0, len(noise.prior), 12))
    white = [noise.white(at, columns) for columns in (one, other)]
    rows = [noise.whiten(at, columns) for columns in (one, other)]
    assert white[0].products(white[1]) == pytest.approx(rows[0].mT @ rows[1], abs=1e-9)
    assert white[0].squares() == pytest.approx(np.sum(rows[0] ** 2, axis=1), abs=1e-9)
    both = np.concatenate(rows, axis=2)
    assert white[0].beside(white[1]).products(white[1]) == pytest.approx(both.mT @ rows[1], abs=1e-9)


@pytest.mark.parametrize("which", list(noises()))
def test_columns_that_one_sensor_has_not_are_none(which):
    """A candidate may be zero in all rows of a sensor: there is nothing to multiply."""
    noise, rng = noises()[which], np.random.default_rng(6)
    n = GROUPS * ROWS * (2 if which == "two sensors" else 1)
    one, none = rng.standard_normal((n, 3)), np.zeros((n, 0))
    at = np.arange(min(5, len(noise.prior)))
    white, empty = noise.white(at, one), noise.white(at, none)
    assert white.products(empty).shape == (len(at), 3, 0)
    assert empty.squares().shape == (len(at), 0)
    both = white.beside(empty)
    assert both.squares() == pytest.approx(white.squares(), rel=1e-12)
