"""Every axis arrives from its planned side, whatever came before."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rig.engine.motion import Arrival, arrived, plan_legs, recovery_legs
from rig.procedures.plan.run_list import Factor, Point

FACTORS = (Factor("pitch_deg", "pitch", 2.0), Factor("roll_deg", "roll", 2.0))


def point(pitch, roll, pitch_side=1, roll_side=1, index=1):
    return Point(index, 1, None, (pitch, roll), (pitch_side, roll_side))


def drive(legs, now, arrivals):
    """Carry legs out as a head would: it stops exactly where it is sent."""
    now, arrivals = dict(now), dict(arrivals)
    for leg in legs:
        start = dict(now)
        now.update(leg)
        arrived(leg, start, arrivals)
    return now, arrivals


def test_a_step_in_the_planned_direction_goes_straight():
    legs = plan_legs(FACTORS, point(10, 30), {"pitch": 10, "roll": 0}, {"pitch": Arrival(1, 0)}, lambda _: 0.001)
    assert legs == [{"roll": 30}]


def test_an_axis_that_must_come_from_the_other_side_first_goes_beyond():
    now = {"pitch": 10.0, "roll": 30.0}
    arrivals = {"pitch": Arrival(1, 0), "roll": Arrival(1, 0)}
    assert plan_legs(FACTORS, point(10, 30, -1, -1), now, arrivals, lambda _: 0.001) == [
        {"pitch": 12, "roll": 32},
        {"pitch": 10, "roll": 30},
    ]


def test_recovery_goes_beyond_then_through_the_previous_point():
    legs = recovery_legs(FACTORS, point(10, 30), point(10, 0, index=0))
    assert legs == [{"pitch": 8, "roll": -2}, {"pitch": 10, "roll": 0}, {"roll": 30}]


angles = st.integers(-180, 180).map(float)
sides = st.sampled_from((1, -1))
points = st.builds(point, angles, angles, sides, sides)
starts = st.fixed_dictionaries({"pitch": st.floats(-180, 180), "roll": st.floats(-180, 180)})


@given(points, starts, st.dictionaries(st.sampled_from(("pitch", "roll")), st.builds(Arrival, sides, angles)))
def test_whatever_came_before_the_sides_are_as_planned(target, start, arrivals):
    now, after = drive(plan_legs(FACTORS, target, start, arrivals, lambda _: 1e-4), start, arrivals)
    for axis, setpoint, side in zip(("pitch", "roll"), target.setpoints, target.sides, strict=True):
        assert abs(now[axis] - setpoint) <= 1e-4
        assert after[axis].side == side


@given(points, points, starts)
def test_after_an_interruption_both_the_previous_point_and_the_point_are_reached_as_planned(previous, target, start):
    legs = recovery_legs(FACTORS, target, previous)
    now, arrivals = dict(start), {}
    passed = False
    for leg in legs:
        now, arrivals = drive([leg], now, arrivals)
        at_previous = all(now[a] == s for a, s in zip(("pitch", "roll"), previous.setpoints, strict=True))
        if at_previous and {a: v.side for a, v in arrivals.items()} == dict(
            zip(("pitch", "roll"), previous.sides, strict=True)
        ):
            passed = True
    assert passed
    assert (now["pitch"], now["roll"]) == target.setpoints
    assert (arrivals["pitch"].side, arrivals["roll"].side) == target.sides


@given(points, points, starts)
def test_the_first_recovery_leg_arrives_beyond_so_that_the_second_must_come_from_the_planned_side(p, target, start):
    beyond, to_first = recovery_legs(FACTORS, target, p)[:2]
    for axis, side in zip(("pitch", "roll"), p.sides, strict=True):
        assert (to_first[axis] - beyond[axis]) * side == 2.0
