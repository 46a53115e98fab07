"""Motion, play and lag in closed form, against numerical integration and first principles."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.sims.physics.head import HeadMechanics
from rig.sims.physics.truth import HeadTruth
from rig.sims.physics.undeclared import ARCSEC, Backlash, HeadError
from rig.sims.world import World

TARGETS = st.lists(st.tuples(st.floats(-180, 180), st.floats(0.0, 40.0)), min_size=1, max_size=6)


def head(world: World, lag_s: float = 0.3, backlash: Backlash | None = None, **truth: float) -> HeadMechanics:
    return HeadMechanics(world, HeadTruth(**truth), backlash or Backlash(), (), lag_s)


def test_a_long_move_takes_the_time_of_its_trapezoid() -> None:
    world = World()
    mechanics = head(world, start_pitch_deg=0.0, backlash_arcsec=0.0, creep_arcsec=0.0)
    mechanics.move("pitch", 50.0, 5.0, 2.5)
    ends = 50.0 / 5.0 + 5.0 / 2.5
    assert mechanics.moving("pitch", ends - 1e-6)
    assert not mechanics.moving("pitch", ends + 1e-6)
    assert mechanics.encoder_deg("pitch", 2.0) == pytest.approx(5.0)
    assert mechanics.encoder_deg("pitch", ends) == pytest.approx(50.0)
    assert mechanics.speed_deg_per_s("pitch", 5.0) == pytest.approx(5.0)


@given(TARGETS, st.floats(1.0, 20.0), st.floats(1.0, 50.0))
def test_whatever_interrupts_it_motion_is_continuous_bounded_and_ends_on_target(
    commands: list[tuple[float, float]], speed: float, acceleration: float
) -> None:
    world = World()
    mechanics = head(world, creep_arcsec=0.0)
    last = mechanics.encoder_deg("pitch", 0.0)
    dt = 0.02
    for target, pause in commands:
        mechanics.move("pitch", target, speed, acceleration)
        for _ in range(int(pause / dt)):
            world.sleep(dt)
            here = mechanics.encoder_deg("pitch", world.now())
            assert abs(here - last) <= speed * dt * (1 + 1e-6) + 1e-9
            last = here
        last = mechanics.encoder_deg("pitch", world.now())
    world.sleep(800.0)
    assert not mechanics.moving("pitch", world.now())
    assert mechanics.encoder_deg("pitch", world.now()) == pytest.approx(commands[-1][0], abs=1e-9)


@given(TARGETS)
def test_the_lagged_angle_obeys_its_differential_equation(commands: list[tuple[float, float]]) -> None:
    """tau y' = u - y, integrated by exponential steps over what the encoder does."""
    world = World()
    lag = 0.4
    mechanics = head(world, lag)
    axis = mechanics.axes["roll"]
    seen = axis.seen_deg(0.0)
    dt = 0.01
    for target, pause in commands:
        mechanics.move("roll", target, 8.0, 16.0)
        for _ in range(int(min(pause, 4.0) / dt)):
            t = world.now()
            driving = axis.encoder_deg(t + dt / 2)
            seen = driving + (seen - driving) * np.exp(-dt / lag)
            world.sleep(dt)
            assert axis.seen_deg(world.now()) == pytest.approx(seen, abs=2e-3)


def test_stopping_takes_the_stopping_distance() -> None:
    world = World()
    mechanics = head(world, start_pitch_deg=0.0, backlash_arcsec=0.0)
    mechanics.move("pitch", 90.0, 6.0, 3.0)
    world.sleep(5.0)
    before = mechanics.encoder_deg("pitch", 5.0)
    mechanics.stop("pitch")
    world.sleep(10.0)
    assert not mechanics.moving("pitch", world.now())
    assert mechanics.encoder_deg("pitch", world.now()) - before == pytest.approx(6.0**2 / (2 * 3.0))


def test_an_axis_creeps_the_last_arc_seconds() -> None:
    world = World()
    mechanics = head(world, start_pitch_deg=0.0, creep_arcsec=3.0, creep_time_constant_s=0.5)
    mechanics.move("pitch", 10.0, 5.0, 5.0)
    while mechanics.moving("pitch", world.now()):
        world.sleep(0.01)
    short = 10.0 - mechanics.encoder_deg("pitch", world.now())
    assert short == pytest.approx(3 * ARCSEC, rel=0.03)
    world.sleep(0.5)
    assert 10.0 - mechanics.encoder_deg("pitch", world.now()) == pytest.approx(short * np.exp(-1), rel=1e-6)


def arrive(side: int, world: World, mechanics: HeadMechanics) -> float:
    mechanics.move("pitch", 20.0 - 2.0 * side, 5.0, 5.0)
    world.sleep(60.0)
    mechanics.move("pitch", 20.0, 5.0, 5.0)
    world.sleep(60.0)
    return mechanics.true_deg("pitch", world.now()) - mechanics.encoder_deg("pitch", world.now())


def test_hidden_play_shows_as_a_step_between_sides_of_approach() -> None:
    world = World()
    mechanics = head(world, backlash=Backlash(pitch_arcsec=5.0))
    up, down, up_again = (arrive(side, world, mechanics) for side in (1, -1, 1))
    assert down - up == pytest.approx(5.0 * ARCSEC)
    assert up_again == pytest.approx(up)


def test_the_table_stands_still_while_hidden_play_is_taken_up() -> None:
    world = World()
    mechanics = head(world, backlash=Backlash(roll_arcsec=3600.0), start_roll_deg=0.0, creep_arcsec=0.0)
    mechanics.move("roll", 10.0, 5.0, 5.0)
    world.sleep(20.0)
    table = mechanics.true_deg("roll", world.now())
    assert table == pytest.approx(9.5)
    mechanics.move("roll", 9.3, 5.0, 5.0)
    world.sleep(20.0)
    assert mechanics.true_deg("roll", world.now()) == pytest.approx(9.5)
    mechanics.move("roll", 8.0, 5.0, 5.0)
    world.sleep(20.0)
    assert mechanics.true_deg("roll", world.now()) == pytest.approx(8.5)


def test_gear_play_before_the_encoder_costs_time_on_a_reversal_and_no_angle() -> None:
    durations = []
    for arcsec in (0.0, 3.0):
        world = World()
        mechanics = head(world, backlash_arcsec=arcsec, start_pitch_deg=0.0)
        mechanics.move("pitch", 10.0, 5.0, 5.0)
        world.sleep(60.0)
        began = world.now()
        mechanics.move("pitch", 5.0, 5.0, 5.0)
        durations.append(mechanics.axes["pitch"].leg(inf).end - began)
        world.sleep(60.0)
        assert mechanics.true_deg("pitch", world.now()) == mechanics.encoder_deg("pitch", world.now())
    assert durations[1] - durations[0] == pytest.approx((2 * 3 * ARCSEC / 5.0) ** 0.5)


def test_head_errors_are_on_the_table_and_not_on_the_encoder() -> None:
    world = World()
    error = HeadError("pitch", 2.0, 1.0, 30.0)
    mechanics = HeadMechanics(world, HeadTruth(), Backlash(), (error,), 0.3)
    mechanics.move("pitch", 60.0, 5.0, 5.0)
    world.sleep(100.0)
    difference = mechanics.true_deg("pitch", world.now()) - mechanics.encoder_deg("pitch", world.now())
    assert difference == pytest.approx(2.0 * ARCSEC)
    assert mechanics.true_deg("roll", world.now()) == mechanics.encoder_deg("roll", world.now())


@pytest.mark.parametrize(("speed", "acceleration"), [(0.0, 5.0), (5.0, 0.0), (-1.0, 5.0)])
def test_motion_needs_a_speed_and_an_acceleration(speed: float, acceleration: float) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        head(World()).move("pitch", 1.0, speed, acceleration)
