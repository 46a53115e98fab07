"""Designs and orders against the paper's numbers and against what an order must balance."""

from __future__ import annotations

import itertools
import random
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.procedures.attitude.designs import Design, fraction, grid, roll_circle, tumble, uniform
from rig.procedures.attitude.orders import random_order, reversed_pass, walk


@pytest.mark.parametrize(
    ("pitch", "roll", "pitch_every", "roll_every", "points"),
    [
        (19, 13, 3, 4, 139),  # section 7, figure 21(b): 139 of 247
        (5, 13, 2, 2, 53),  # section 9.2.2
        (13, 7, 2, 2, 73),  # section 9.3.4
    ],
)
def test_fractional_designs_have_the_papers_number_of_points(pitch, roll, pitch_every, roll_every, points):
    full = grid("D", uniform(-90, 90, pitch), uniform(-180, 180, roll))
    assert len(fraction(full, pitch_every=pitch_every, roll_every=roll_every)) == points


@given(st.integers(1, 6), st.integers(1, 6), st.integers(1, 5), st.integers(1, 5))
def test_fraction_counts_follow_eq_109_and_keep_the_boundary(a, b, pitch_every, roll_every):
    n, m = a * pitch_every + 1, b * roll_every + 1
    kept = set(fraction(grid("D", range(n), range(m)), pitch_every=pitch_every, roll_every=roll_every).cells)
    expected = n * ((m - 1) / roll_every + 1) + (m - 1) * (1 - 1 / roll_every) * ((n - 1) / pitch_every + 1)
    assert len(kept) == round(expected)
    assert {(i, j) for i in range(n) for j in range(m) if i in (0, n - 1) or j in (0, m - 1)} <= kept


def test_fraction_that_would_lose_a_boundary_is_refused():
    with pytest.raises(ValueError, match="not a multiple"):
        fraction(grid("D", range(6), range(13)), pitch_every=2, roll_every=2)


def test_tumble_designs_are_equations_56_and_57():
    assert sorted(tumble(roll=True).points_deg()) == sorted([(-90, 0), (0, 0), (90, 0), (180, 0), (0, -90), (0, 90)])
    assert sorted(tumble(roll=False).points_deg()) == sorted([(-90, 0), (0, 0), (90, 0), (180, 0)])


def test_experiments_of_the_paper_have_325_247_and_481_points():
    for pitch, step, roll, points in ((30, 5, 25, 325), (90, 10, 13, 247), (180, 10, 13, 481)):
        design = grid("D1", uniform(-pitch, pitch, 2 * pitch // step + 1), roll_circle(roll, repeat_180=True))
        assert len(design) == points


def test_minimal_roll_circle_has_no_attitude_twice():
    angles = roll_circle(64, repeat_180=False)
    assert angles[0] == -180
    assert angles[-1] == 180 - 360 / 64
    assert len(angles) == 64


def full(n: int, m: int) -> Design:
    return grid("D", range(n), range(m))


@given(st.integers(1, 7), st.integers(1, 7))
def test_a_serpentine_visits_every_point_once_and_moves_one_axis_by_one_step(n, m):
    path = list(walk(full(n, m), backwards=False, up_and_down=False))
    assert Counter((v.row, v.column) for v in path) == Counter(full(n, m).cells)
    for before, after in itertools.pairwise(path):
        assert abs(after.row - before.row) + abs(after.column - before.column) == 1
        if after.row == before.row:
            assert after.roll_side == after.column - before.column
        else:
            assert after.pitch_side == after.row - before.row


def test_walking_backwards_is_the_same_path_approached_from_the_other_sides():
    there = list(walk(full(4, 3), backwards=False, up_and_down=False))
    back = list(walk(full(4, 3), backwards=True, up_and_down=False))
    assert [(v.row, v.column, -v.pitch_side, -v.roll_side) for v in reversed(there)] == [
        (v.row, v.column, v.pitch_side, v.roll_side) for v in back
    ]


def test_up_and_down_visits_every_point_from_both_sides():
    path = list(walk(full(5, 3), backwards=False, up_and_down=True))
    assert Counter((v.row, v.column, v.pitch_side) for v in path) == Counter(
        (i, j, side) for i, j in full(5, 3).cells for side in (1, -1)
    )


def test_abba_balances_direction_against_a_linear_trend_over_four_replications():
    directions = [-1 if reversed_pass(r, "abba") else 1 for r in (1, 2, 3, 4)]
    assert directions == [1, -1, -1, 1]
    assert sum(d * r for r, d in enumerate(directions)) == 0


@given(st.integers(0, 2**32))
def test_random_orders_balance_the_sides(seed):
    visits = list(random_order(full(5, 4), random.Random(seed)))
    assert Counter((v.row, v.column) for v in visits) == Counter(full(5, 4).cells)
    assert sum(v.pitch_side for v in visits) == 0
    assert sum(v.roll_side for v in visits) == 0
