"""A share of `python -m proving curves`: 95 % intervals of calibrations of curves hold the truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from proving.statistics.curves import DECLARED, coverage

SEEDS = 12
CASES = coverage().cases


@pytest.mark.parametrize("name", DECLARED)
def test_intervals_hold_as_often_as_they_say(name):
    """No fewer and no more than 12 calibrations allow by chance, once in 10,000; readings of one share its curve."""
    results = [CASES[name](seed) for seed in range(SEEDS)]
    for key in ("infer", "delta", "reading"):
        shares = [np.mean(one[key]) for one in results if one[key]]
        calibrations = stats.binom(len(shares), 0.95)
        assert calibrations.ppf(5e-5) <= sum(shares) <= calibrations.ppf(1 - 5e-5), f"seeds 0 to {SEEDS - 1}: {key}"
    assert sum(one["of"] - len(one["infer"]) for one in results) <= 2
