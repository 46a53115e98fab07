"""Intervals after looking: they hold as often as stated, whatever the goal."""

from __future__ import annotations

import numpy as np
import pytest

from proving.goals import stopped
from rig.fitter.sequential import t_of, widening


def test_one_look_needs_no_wider_interval():
    assert widening(5.0, 1.0, 1, 6) == 1.0


@pytest.mark.parametrize(
    ("df", "more", "looks", "first", "low", "high"),
    [(5.0, 1.0, 20, 6, 1.08, 1.16), (57.0, 20.0, 20, 3, 1.0, 1.02), (900.0, 100.0, 10, 6, 1.0, 1.005)],
)
def test_the_fewer_degrees_of_freedom_the_wider(
    df: float, more: float, looks: int, first: int, low: float, high: float
):
    assert low <= widening(df, more, looks, first) <= high


def test_starr_s_coverage_of_t_alone_is_below_the_stated_one_and_ours_is_not():
    """Errors that were estimated too small stop early: 1,500 runs, binomial sd 0.6 %."""
    rng = np.random.default_rng(3)
    told = [stopped(rng) for _ in range(1500)]
    covered, by_t = np.mean([one.covered for one in told]), np.mean([one.by_t for one in told])
    assert by_t < covered
    assert 0.938 < covered < 0.972
    met = [one for one in told if one.met]
    assert np.mean([one.replications for one in met]) < 1.15 * np.mean([one.oracle for one in met])


def test_t_is_student_s():
    assert t_of(10.0) == pytest.approx(2.228139, abs=1e-6)


@pytest.mark.parametrize("shape", ["normal", "rectangular"])
def test_an_expanded_uncertainty_holds_in_spite_of_looking_as_well(shape: str):
    """The reference's error is as large as that of the scatter at the goal: 600 runs, binomial sd 0.9 %."""
    rng = np.random.default_rng(5)
    covered = np.mean([stopped(rng, 1.0, shape).covered for _ in range(600)])
    assert 0.93 < covered < 0.98
