"""Rows left out of a fit, against a second fit without them: settings over five decades, the largest ones left out."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.gross.judged import without
from rig.fitter.gross.rows import Rows

LEVELS = np.array([0.005, 0.01, 0.05, 0.1, 0.5, 1, 5, 10, 50, 100, 500, 1000])


@pytest.mark.parametrize("above", [0.004, 0.02, 0.2, 5.0])
@pytest.mark.parametrize("replications", [4, 5])
def test_rows_that_together_have_all_of_a_coefficient_are_not_all_left_out(replications: int, above: float):
    """Before, each of them seemed to keep a share: residuals of 250 V at a scatter of 10 uV, or an exception."""
    x = np.tile(np.concatenate([-LEVELS[::-1], [0.0], LEVELS]), replications)
    y = 1e-5 * np.random.default_rng(1).standard_normal(len(x))
    columns = np.column_stack([np.ones_like(x), x / 1e3, (x / 1e3) ** 3])
    rows = Rows(columns, y, np.ones_like(y), np.full(len(x), -1))
    far = np.flatnonzero(np.abs(x) > above)
    out, left, rss = without(rows, far[np.argsort(-np.abs(x[far]), kind="stable")])
    kept = np.setdiff1d(np.arange(len(x)), out)
    assert 0 < len(out) < len(x)
    fitted = np.linalg.lstsq(columns[kept], y[kept], rcond=1e-14)[0]
    assert rss == pytest.approx(float(np.sum((y[kept] - columns[kept] @ fitted) ** 2)), rel=1e-6)
    assert left[out] == pytest.approx(y[out] - columns[out] @ fitted, abs=3e-6)


def test_a_row_that_alone_has_a_coefficient_is_left_out_by_nobody():
    """Before, the search for rows that can be left out did not end."""
    columns = np.column_stack([np.ones(6), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    rows = Rows(columns, np.arange(6.0), np.ones(6), np.full(6, -1))
    out, _, _ = without(rows, np.array([5]))
    assert out.size == 0
