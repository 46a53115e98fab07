"""Where the next hour of a loop with a goal helps most, by the numbers of both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rig.fitter.confirm import NOTHING, Separation
from rig.loop.hours import HoursLeft, Stake, planned
from rig.procedures.plan.further_runs import Variation
from rig.verbs.confirm import Proposal

COUNT = 4
"""Replications so far."""


def run_of(chance: float, hours: float, effect: str = "step") -> Proposal:
    pair = (effect, NOTHING)
    separation = Separation(effect, {pair: 3.0}, {pair: (2.0, 4.0)}, {pair: chance})
    procedure: Any = None
    return Proposal(Variation("the same again", procedure), (separation,), hours, "12 points x 1 replication", None)


def stake_of(half: float = 2.0, shift: float = 0.0, without: float = 2.0, least: float = 0.0) -> Stake:
    """One value with a goal of 1, and one question."""
    one = (np.array([float(value)]) for value in (1.0, half, least))
    return Stake(*one, np.array([[shift]]), np.array([[without]]), ("step",))


def left(loop_h: float = 20.0, goal_h: float = 20.0, needed: int = 12) -> HoursLeft:
    return HoursLeft(loop_h, goal_h, 1.0, needed)


def test_replications_make_smaller_what_is_scatter_and_the_run_what_hangs_on_the_question():
    stake = stake_of(half=3.0, shift=4.0, without=1.0)
    assert stake.error(COUNT) == pytest.approx(5.0)
    assert stake.error(COUNT, 3 * COUNT) == pytest.approx(np.hypot(1.5, 4.0))
    assert stake.error(COUNT, 0, run_of(1.0, 1.0)) == pytest.approx(1.0)
    assert stake.error(COUNT, 0, run_of(0.5, 1.0)) == pytest.approx(np.sqrt(0.5 * 25.0 + 0.5 * 1.0))
    assert stake.error(COUNT, 0, run_of(1.0, 1.0, effect="another")) == pytest.approx(5.0)


def test_what_no_replication_makes_smaller_stays():
    assert stake_of(half=5.0, least=4.0).error(COUNT, 8 * COUNT) == pytest.approx(np.hypot(1.0, 4.0))


def test_the_value_farthest_from_its_goal_counts():
    wide, zero = np.array([1.0, 2.0]), np.zeros((1, 2))
    stake = Stake(np.array([1.0, 0.5]), wide, 0.0 * wide, zero, wide[None, :], ("step",))
    assert stake.error(COUNT) == pytest.approx(4.0)


def test_a_question_on_which_the_goal_hangs_comes_first():
    plan = planned(stake_of(shift=2.0), COUNT, run_of(0.9, 1.0), left())
    assert plan.run_next
    assert "one more replication takes 5% from the error" in plan.why
    assert "a further run, the same again, 12 points x 1 replication, 60 min, 26% (0.26 per hour)" in plan.why
    assert plan.why.endswith("the run comes first")


def test_a_question_on_which_nothing_hangs_does_not():
    plan = planned(stake_of(), COUNT, run_of(1.0, 0.1), left(loop_h=12.7))
    assert not plan.run_next
    assert plan.why.endswith("1 of the goal with the run and 11 more replications, 1 with 12 more replications alone"
                             ": the goal has the time")  # fmt: skip


def test_a_long_run_waits_for_replications_that_bring_more_in_an_hour():
    stake = stake_of(half=4.0, shift=1.5, without=4.0)
    assert not planned(stake, COUNT, run_of(1.0, 5.0), left(needed=60, loop_h=40.0, goal_h=40.0)).run_next
    assert planned(stake, 15 * COUNT, run_of(1.0, 5.0), left(needed=4, loop_h=40.0, goal_h=40.0)).run_next


@pytest.mark.parametrize(("chance", "first"), [(0.9, True), (0.1, False)])
def test_with_time_for_one_of_both_the_smaller_error_at_the_end_decides(chance: float, first: bool):
    plan = planned(stake_of(shift=2.0), COUNT, run_of(chance, 2.0), left(loop_h=2.5, goal_h=2.5))
    assert plan.run_next is first
    assert "with the run and 0 more replications" in plan.why
    assert "with 2 more replications alone" in plan.why


def test_replications_that_would_miss_their_deadline_come_before_the_run():
    stake = stake_of(shift=2.0)
    assert planned(stake, COUNT, run_of(0.9, 1.0), left(goal_h=3.0)).why.endswith("the run would pass their deadline")
    assert planned(stake, COUNT, run_of(0.9, 1.0), left(goal_h=20.0)).run_next


def test_a_run_in_which_somebody_changes_the_bench_comes_last():
    plan = planned(stake_of(shift=2.0), COUNT, run_of(0.9, 1.0), left(), returns=False)
    assert not plan.run_next
    assert plan.why.endswith("somebody changes the bench in the run")


def test_the_question_on_which_most_hangs_is_asked_first():
    """Of two runs that settle one question each, in the same time."""
    one, shift = np.ones(1), np.array([[0.1], [3.0]])
    stake = Stake(one, 2.0 * one, 0.0 * one, shift, np.full((2, 1), 2.0), ("small", "large"))
    runs = [run_of(0.95, 1.0, effect) for effect in ("small", "large")]
    assert max(runs, key=lambda run: stake.gain_per_h(COUNT, run)) is runs[1]
    assert stake.gain_per_h(COUNT, run_of(0.95, 2.0, "large")) == pytest.approx(stake.gain_per_h(COUNT, runs[1]) / 2)
