"""The least value between two ends: as SciPy finds it, and it always ends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from rig.fitter.least import least


@pytest.mark.parametrize("seed", range(20))
def test_it_is_where_scipy_finds_it(seed):
    print("seed", seed)
    rng = np.random.default_rng(seed)
    place, width = rng.uniform(-3.0, 3.0), 10.0 ** rng.uniform(-1.0, 1.0)

    def function(x: float) -> float:
        return -1.0 / (1.0 + ((x - place) / width) ** 2) + 0.01 * x**2

    found, known = least(function, -5.0, 5.0), minimize_scalar(function, bounds=(-5.0, 5.0), method="bounded")
    assert found.x == pytest.approx(known.x, abs=3e-5)
    assert found.value == pytest.approx(known.fun, abs=1e-9)


def test_it_ends_at_an_end():
    assert least(lambda x: x, 2.0, 7.0).x == pytest.approx(2.0, abs=2e-5)
    assert least(lambda x: -x, 2.0, 7.0).x == pytest.approx(7.0, abs=2e-5)


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e12, 1e300])
def test_it_ends_whatever_the_numbers_are(scale):
    asked: list[float] = []

    def function(x: float) -> float:
        asked.append(x)
        return abs(x / scale - 0.3)

    least(function, 0.0, scale)
    assert len(asked) < 100


def test_nothing_but_nan_ends_too():
    assert math.isnan(least(lambda _: math.nan, 0.0, 1.0).value)
