"""Which of equal values is chosen does not hang on rounding."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter import ties

VALUES = np.array([-np.inf, 3.0, 7.0, 7.0, 5.0, 7.0, 3.0])


@pytest.mark.parametrize("seed", range(20))
def test_rounding_changes_no_choice_and_no_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rounded = VALUES * (1.0 + 1e-12 * rng.standard_normal(VALUES.size))
    assert ties.highest(rounded) == 2
    assert ties.lowest(-rounded) == 2
    assert ties.descending(rounded).tolist() == [2, 3, 5, 4, 1, 6, 0]


def test_a_difference_that_says_something_counts() -> None:
    assert ties.highest(np.array([1.0, 1.0 + 1e-5])) == 1
    assert ties.highest(np.array([1e-12, 2e-12]), unit=1e-12) == 1
    assert ties.below(1.0 - 1e-5, 1.0)
    assert not ties.below(1.0 - 1e-12, 1.0)
    assert not ties.below(1.0, 1.0)


def test_all_impossible_is_the_first() -> None:
    nothing = np.full(3, -np.inf)
    assert ties.highest(nothing) == 0
    assert ties.descending(nothing).tolist() == [0, 1, 2]


@pytest.mark.parametrize("seed", range(20))
def test_the_first_of_equals_in_columns_lists_and_parts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rounded = VALUES * (1.0 + 1e-12 * rng.standard_normal(VALUES.size))
    assert ties.highest_of_each(np.column_stack([rounded, -rounded])).tolist() == [2, 0]
    assert ties.top(rounded, 2).tolist() == [2, 3]
    assert ties.top(rounded, 9).tolist() == [2, 3, 5, 4, 1, 6, 0]
    assert ties.ordered(range(1, 7), key=lambda k: float(rounded[k])) == [1, 6, 4, 2, 3, 5]
    assert ties.least(range(1, 7), key=lambda k: -float(rounded[k])) == 2


def test_tiny_values_are_compared_as_shares() -> None:
    assert ties.ordered([3e-12, 1e-12, 2e-12], key=float) == [1e-12, 2e-12, 3e-12]


def test_no_number_is_last() -> None:
    assert ties.descending(np.array([np.nan, -1.0, np.inf, 2.0])).tolist() == [2, 3, 1, 0]
