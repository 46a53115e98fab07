"""Which rows are named as gross errors does not hang on the last bits of their readings.

Symmetric designs with equal errors at opposite settings have subsets of rows that fit equally well.
"""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.arrays import FloatArray
from rig.fitter.gross.forward_search import gross_errors


def symmetric(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Columns of a line, and readings whose errors have the opposite sign at the opposite setting."""
    x = np.repeat(np.linspace(-1.0, 1.0, int(rng.integers(3, 6))), int(rng.integers(3, 6)))
    errors = rng.integers(-2, 3, x.size) * 0.01
    errors[rng.choice(x.size // 2, int(rng.integers(1, 4)), replace=False)] += float(rng.choice([0.5, 1.0, 3.0]))
    return np.column_stack([np.ones_like(x), x]), 2.0 * x + errors - errors[::-1]


@pytest.mark.parametrize("seed", range(12))
def test_readings_changed_in_their_last_bits_have_the_same_gross_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns, y = symmetric(rng)
    named = {
        tuple(gross_errors(y * (1.0 + 1e-15 * rng.integers(-2, 3, y.size)), columns).rows.tolist()) for _ in range(5)
    }
    assert len(named) == 1, named


def test_some_of_them_are_named() -> None:
    every = [symmetric(np.random.default_rng(seed)) for seed in range(12)]
    assert any(gross_errors(y, columns).rows.size for columns, y in every)
