"""What noise that was found does to intervals: by dense matrices, and by ordinary least squares without the rows."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from test_trace_tables_noise import WHEN, N, wandering_covariances

from rig.fitter.trace.engine.noise import Independent, Wandering
from rig.fitter.trace.engine.problem import Problem
from rig.procedures.general.trace.intervals import in_words, moved, understated

RNG = np.random.default_rng(11)
X = np.column_stack([np.ones(N), np.linspace(0.0, 9.0, N), RNG.normal(size=N)])
EXTRA = np.sin(np.arange(N))[:, None]
"""Column of an effect that was found beside the declared model."""


def judge(*, noise=None, sd=None, y=None, held=None, columns=X, effect=EXTRA):
    candidates = (SimpleNamespace(term=SimpleNamespace(columns=effect)),)
    problem = Problem(
        y=np.zeros(N) if y is None else y,
        declared=columns,
        candidates=candidates,
        noise=Independent(N) if noise is None else noise,
        sd=np.ones(N) if sd is None else sd,
        ordered=True,
    )
    return SimpleNamespace(problem=problem, held=lambda chosen: held)


def dense(model, covariance):
    """True standard errors of least squares over those it states, for errors of that covariance."""
    inverse = np.linalg.inv(model.T @ model)
    truth = inverse @ model.T @ covariance @ model @ inverse
    residual = np.eye(len(model)) - model @ inverse @ model.T
    stated = np.trace(residual @ covariance) / (len(model) - model.shape[1]) * inverse
    return np.sqrt(np.diag(truth) / np.diag(stated))


def ordinary(model, y):
    """Coefficients, residual standard deviation and standard errors by the normal equations."""
    inverse = np.linalg.inv(model.T @ model)
    b = inverse @ model.T @ y
    s = np.sqrt(np.sum((y - model @ b) ** 2) / (len(y) - model.shape[1]))
    return b, s, s * np.sqrt(np.diag(inverse))


@pytest.mark.parametrize("chosen", [(), (0,)])
@pytest.mark.parametrize("weighted", [False, True])
def test_understated_standard_errors_by_dense_matrices(chosen, weighted):
    noise, sd = Wandering(WHEN), np.linspace(0.5, 3.0, N)
    given = judge(noise=noise, sd=sd)
    row = sd if weighted else np.ones(N)
    far = 0.0
    for at, covariance in enumerate(wandering_covariances(row)):
        expected = dense(np.hstack([X, EXTRA][: 1 + len(chosen)]), row[:, None] * covariance * row)[:3]
        np.testing.assert_allclose(understated(given, chosen, at=at, weighted=weighted), expected, rtol=1e-8)
        far = max(far, float(np.max(expected)))
    assert far > 2.0


def test_units_of_the_columns_do_not_matter():
    scale = np.array([1e-9, 1e9, 1.0])
    y = X @ [1.0, 0.2, -0.4] + RNG.normal(size=N)
    noise = Wandering(WHEN)
    for at in (0, 5):
        plain, scaled = (
            understated(judge(columns=c, noise=noise), (0,), at=at, weighted=False) for c in (X, X * scale)
        )
        np.testing.assert_allclose(scaled, plain, rtol=1e-8)
    held = y + np.where(np.arange(N) == 3, 5.0, 0.0)
    plain, scaled = (moved(judge(columns=c, y=y, held=held), (0,)) for c in (X, X * scale))
    np.testing.assert_allclose(scaled[0], plain[0], rtol=1e-8)
    assert scaled[1] == pytest.approx(plain[1], rel=1e-8)


def test_columns_that_rows_do_not_determine_say_nothing():
    twice = np.column_stack([X, 3.0 * X[:, 1]])
    empty = np.column_stack([X, np.zeros(N)])
    y = RNG.normal(size=N)
    for columns in (twice, empty):
        assert understated(judge(columns=columns), (), at=0, weighted=False) is None
        assert moved(judge(columns=columns, y=y, held=y), ()) is None
    assert moved(judge(columns=RNG.normal(size=(N, N)), y=y, held=y), ()) is None  # no row is left for the error


@pytest.mark.parametrize("chosen", [(), (0,)])
def test_by_how_much_readings_that_stand_alone_move_least_squares(chosen):
    held = X @ [1.0, 0.2, -0.4] + RNG.normal(size=N)
    y = held.copy()
    y[[4, 11]] += [9.0, -7.0]
    model = np.hstack([X, EXTRA][: 1 + len(chosen)])
    (b, s, _), (b_without, s_without, errors) = ordinary(model, y), ordinary(model, held)
    shift, wider = moved(judge(y=y, held=held), chosen)
    np.testing.assert_allclose(shift, ((b - b_without) / errors)[:3], rtol=1e-9)
    assert wider == pytest.approx(s / s_without, rel=1e-9)
    assert wider > 1.5


def test_a_response_that_fits_exactly_without_them_is_no_division_by_zero():
    held = X @ [1.0, 0.2, -0.4]
    y = held.copy()
    y[4] += 1.0
    shift, wider = moved(judge(y=y, held=held), ())
    assert np.all(np.isfinite(shift))
    assert wider > 1e9


OVER = "true standard errors over those of least squares of independent rows: "


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        (None, ""),
        ([], ""),
        ([1.0499, 0.9501, 1.0], "least squares of independent rows of one scatter states standard errors right to 5 %"),
        ([2.0, 1.0, 0.6], OVER + "the intercept 2, x2 0.6"),
        ([2.0, 1.0, 0.9, 1.2, 1.0], OVER + "the intercept 2, x2 0.9, x3 1.2"),
        ([2.0, 1.0, 0.9, 1.2, 3.0], OVER + "x2 0.9, x3 1.2, x4 3"),
        ([2.0, 1.51, 0.9, 1.2, 3.0], OVER + "x1 1.5, x2 0.9, x3 1.2"),
    ],
)
def test_it_is_said_of_three_coefficients_at_most(factors, words):
    given = None if factors is None else np.array(factors)
    assert in_words(["1", "x1", "x2", "x3", "x4"], given) == words
