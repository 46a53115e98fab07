"""A shape without a name as an answer: its curve in its band, the nearest names with their distance."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.trace.flexible import waves
from rig.fitter.trace.shape import Axis, ResidualAndWaves, nearest_sentence, shape_of, smoothed, standing_for

N, LEVELS = 300, 15


def bump(x):
    return 2.0 * np.exp(-0.5 * ((x - 0.3) / 0.12) ** 2)


def settings(n=N):
    return np.tile(np.linspace(-1.0, 1.0, LEVELS), n // LEVELS)


def left_by_line(x, columns):
    """What a straight line leaves of columns (n, m)."""
    basis = np.linalg.qr(np.column_stack([np.ones(x.size), x]))[0]
    return columns - basis @ (basis.T @ columns)


def seen_in(x, y, scale=1.0, most=14):
    columns = left_by_line(x, waves(x, most))
    left = left_by_line(x, y[:, None])[:, 0]
    rough = np.arange(1.0, columns.shape[1] + 1)
    return ResidualAndWaves(left, columns, left * scale, columns * scale, rough, x.size - 2)


def shape_in(x, y, names=(), **more):
    axis = Axis("x_mm", "x", "mm", x, settable=True)
    return shape_of(seen_in(x, y, **more), axis, None, names, unit="V", p=1e-6, stratum="row")


def test_the_band_holds_the_truth_in_95_of_100_cells():
    """Over the curve and over runs; a band half as wide would hold it in two thirds."""
    x = settings()
    truth = left_by_line(x, bump(x)[:, None])[:LEVELS, 0]
    held, narrow = [], []
    for seed in range(60):
        shape = shape_in(x, bump(x) + np.random.default_rng(seed).standard_normal(N))
        off = np.abs(shape.estimate - truth) / shape.stderr
        held.append(np.mean(off < 1.96))
        narrow.append(np.mean(off < 0.98))
    assert 0.90 < np.mean(held) < 0.99
    assert np.mean(narrow) < 0.80


def test_the_metric_may_have_any_scale():
    x, y = settings(), bump(settings()) + np.random.default_rng(1).standard_normal(N)
    one, other = shape_in(x, y), shape_in(x, y, scale=250.0)
    assert other.estimate == pytest.approx(one.estimate)
    assert other.stderr == pytest.approx(one.stderr)
    assert other.rms == pytest.approx(one.rms)
    assert one.rms == pytest.approx(np.std(left_by_line(x, bump(x)[:, None])), rel=0.15)


def test_noise_alone_is_no_shape():
    x = settings()
    shapes = [shape_in(x, np.random.default_rng(seed).standard_normal(N)) for seed in range(20)]
    assert sum(one is not None for one in shapes) <= 2


def test_nearest_names_are_told_by_what_they_explain_and_by_how_far_they_are_behind():
    x = settings()
    y = bump(x) + np.random.default_rng(2).standard_normal(N)

    def name(text, columns):
        return text, left_by_line(x, columns), np.linalg.norm(columns, axis=0)

    names = [
        name("square", x[:, None] ** 2),
        name("the bump itself", bump(x)[:, None]),
        name("a bump beside it", bump(x - 0.25)[:, None]),
        name("a bump beside it", bump(x + 0.1)[:, None]),
        name("a line", x[:, None]),
        name("half of it", np.column_stack([np.where(x < 0.3, bump(x), 0.0)])),
    ]
    near = shape_in(x, y, names).nearest
    assert near[0].effect == "the bump itself"
    assert len(near) == 3
    assert "a line" not in [one.effect for one in near]
    assert near[0].explains > 0.9
    assert near[0].behind < 3.0
    beside = next(one for one in near if one.effect == "a bump beside it")
    assert 0.2 < beside.explains < near[0].explains
    assert beside.behind > 5.0
    assert nearest_sentence(near).startswith(f"nearest: the bump itself explains {int(100 * near[0].explains)} % of it")


def test_where_no_name_is_near_that_is_said():
    x = settings()
    y = bump(x) + np.random.default_rng(2).standard_normal(N)
    far = np.sin(40.0 * np.arange(N))[:, None]
    near = shape_in(x, y, [("hum", left_by_line(x, far), np.linalg.norm(far, axis=0))]).nearest
    assert near == ()
    assert nearest_sentence(near) == "nearest: none; no name explains as much as 5 % of it"


def test_more_points_are_proposed_where_there_are_few():
    rng = np.random.default_rng(3)
    x = np.round(np.concatenate([rng.uniform(-1.0, 0.2, 280), rng.uniform(0.2, 1.0, 20)]), 1)
    shape = shape_in(x, 1.5 * np.sin(6.0 * x) + rng.standard_normal(N))
    assert "narrower" in shape.more
    told = shape.more.partition("at x ")[2].partition(" mm")[0].replace(" and", ",").split(", ")
    assert len(told) >= 2
    assert all(float(one) > 0.2 for one in told)


def test_what_cannot_be_set_is_proposed_in_another_order():
    x = settings()
    axis = Axis("elapsed_s", "time", "h", x)
    shape = shape_of(seen_in(x, bump(x) + np.random.default_rng(4).standard_normal(N)), axis, None, (), unit="V",
                     p=0.0, stratum="row")  # fmt: skip
    assert "in another order" in shape.more


def test_a_surface_has_a_cell_for_each_pair():
    x = settings()
    side = np.repeat([-1.0, 1.0], N // 2)
    columns = side[:, None] * waves(x, 8)
    y = side * np.sin(3.0 * x) + np.random.default_rng(5).standard_normal(N)
    seen = ResidualAndWaves(y, columns, y, columns, np.arange(1.0, 9.0), N)
    shape = shape_of(seen, Axis("x", "x", "", x), Axis("side", "side", "", side), (), unit="", p=0.0, stratum="row")
    assert shape.estimate.size == 2 * LEVELS
    assert set(shape.y) == {-1.0, 1.0}
    up, down = (shape.estimate[np.flatnonzero(shape.y == s)] for s in (1.0, -1.0))
    assert up == pytest.approx(-down, abs=1e-9)
    assert np.sum(shape.rows) == N


def test_smoothing_takes_no_waves_that_are_not_there():
    x = settings()
    coefficients, spread = smoothed(3.0 * np.cos(np.pi * (x + 1)), waves(x, 14), np.arange(1.0, 15.0))
    assert coefficients[1] == pytest.approx(3.0, rel=0.02)
    assert np.all(np.abs(np.delete(coefficients, 1)) < 0.1)
    assert np.all(np.linalg.eigvalsh(spread) > 0)


def test_cells_of_a_surface_stand_in_rows_and_columns_whatever_the_rounding():
    """Means of three and of seven values of 0.1 are not the same double."""
    rng = np.random.default_rng(6)
    x, y = (rng.choice([0.1, 0.2, 0.3, 0.7, 1.1], N) for _ in range(2))
    columns = waves(x, 3)[:, :, None] * waves(y, 3)[:, None, :]
    columns = columns.reshape(N, -1)
    left = 2.0 * columns[:, 0] + rng.standard_normal(N)
    seen = ResidualAndWaves(left, columns, left, columns, np.arange(1.0, columns.shape[1] + 1), N)
    shape = shape_of(seen, Axis("x", "x", "", x), Axis("y", "y", "", y), (), unit="", p=0.0, stratum="row")
    assert len(set(shape.x.tolist())) == len(set(shape.y.tolist())) == 5
    assert shape.estimate.size == 25


def test_a_shape_stands_for_a_name_that_is_near_it_and_for_no_other():
    x = settings()
    y = bump(x) + np.random.default_rng(7).standard_normal(N)
    column = bump(x - 0.1)[:, None]
    hum = np.sin(40.0 * np.arange(N))[:, None]
    names = [(t, left_by_line(x, c), np.linalg.norm(c, axis=0)) for t, c in (("bump", column), ("hum", hum))]
    shape = shape_in(x, y, names)
    places = [("nothing", None), ("over x", shape)]
    assert standing_for(("bump", "another"), places) == ("over x", shape)
    assert standing_for(("hum",), places) is None
