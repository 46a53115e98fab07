"""Stands for load cells with one thing that nobody declared, each written from the physical events.

A cell is loaded in rising and falling series, or in random order. What it truly gives at rest is known: at the room's
usual temperature, half-way through the run, half-way between both directions, long after any change. Nothing of the
effects, models or budgets is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
NOISE_V, USUAL_degC, STEP_S, PUT_S = 1e-4, 21.0, 90.0, 45.0


@dataclass(frozen=True, eq=False)
class Night:
    """One run at a stand.

    Attributes:
        force: (n,) weights, kN, in order of time.
        replicate: (n,) number of the replication, from 1.
        side: (n,) +1 where the weights went up, -1 where they went down, 0 at the start.
        time: (n,) of the reading since the start, s; the weights were put on `PUT_S` before.
        room: (n,) temperature, degC.
        since: (n,) time since the weights were put on, s.
        before: (n,) weights before that, kN.
    """

    force: Array
    replicate: Array
    side: Array
    time: Array
    room: Array
    since: Array
    before: Array


Effect = Callable[[Night, Array, Rng], tuple[Array, Array]]
"""(n,) what is added to the readings, and (p,) what is added at rest at some forces, both up to the size."""


def night(rng: Rng, *, series: bool) -> Night:
    """Three replications of 0 to 10 kN, up and down or in random order, in a room that warms and cools."""
    once = [np.concatenate([np.arange(11.0), np.arange(9.0, -1.0, -1.0)]) for _ in range(3)]
    if not series:
        once = [rng.permutation(one) for one in once]
    force = np.concatenate(once)
    moved, side = np.diff(force), np.zeros(len(force))
    for i, move in enumerate(moved, start=1):
        side[i] = np.sign(move) or side[i - 1]
    time = STEP_S * (1.0 + np.arange(len(force))) + rng.uniform(0.0, 1.0, len(force))
    period, phase = rng.uniform(2000.0, 4000.0), rng.uniform(0.0, 6.28)
    room = USUAL_degC + np.sin(6.2832 * time / period + phase) + 0.2 * rng.standard_normal(len(force))
    put, before = np.full(len(force), -np.inf), np.zeros(len(force))
    last, now = 0.0, 0.0
    for i, (load, read) in enumerate(zip(force, time, strict=True)):
        if load != now or i == 0:
            last, now = now, load
            put[i] = read - PUT_S
        else:
            put[i] = put[i - 1]
        before[i] = last
    return Night(force, np.repeat([1.0, 2.0, 3.0], 21), side, time, np.round(room, 3), time - put, before)


def _spring(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """A spring goes on giving way for minutes after every change, second by second."""
    still, before, now, missing = 0.0, 0.0, 0, []
    for load, read in zip(one.force, one.time, strict=True):
        while now < read:
            if now >= read - PUT_S and load != before:
                still, before = still + load - before, load
            still -= still / 180.0
            now += 1
        missing.append(-still)
    return np.array(missing), np.zeros_like(at)


def _loop(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """A bow that rises on one way and falls on the other."""
    return one.side * (1.0 - ((one.force - 5.0) / 5.0) ** 2), np.zeros_like(at)


def _slack(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """A joint that sticks out to the side from which it came."""
    return one.side.copy(), np.zeros_like(at)


def _drifting(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """The amplifier's zero moves all the time; the calibration is for the middle of the readings."""
    since = one.time - one.time.mean()
    return since, np.zeros_like(at)


def _jump(one: Night, at: Array, rng: Rng) -> tuple[Array, Array]:
    """A plug is touched once; the calibration is for the mean of the readings before and after."""
    after = (np.arange(len(one.time)) >= rng.integers(18, 46)).astype(float)
    return after, np.full_like(at, after.mean())


def _warming(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """The electronics warm up; at rest they are warm."""
    return np.exp(-one.time / 900.0), np.zeros_like(at)


def _gain_drifts(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """The supply goes down; the calibration is for the middle of the run."""
    return one.force * (one.time - 0.5 * (one.time[0] + one.time[-1])), np.zeros_like(at)


def _room_offset(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """The zero follows the room."""
    return one.room - USUAL_degC, np.zeros_like(at)


def _room_gain(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """The modulus of the spring follows the room."""
    return one.force * (one.room - USUAL_degC), np.zeros_like(at)


def _bends(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """A curve of its own: it is the cell's, at rest, too."""
    return one.force**2, at**2


def _cubic(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    return (one.force - 5.0) ** 3, (at - 5.0) ** 3


def _stop(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """From 7 kN on a stop takes a part of the force."""
    return -np.maximum(one.force - 7.0, 0.0), -np.maximum(at - 7.0, 0.0)


def _previous(one: Night, at: Array, _: Rng) -> tuple[Array, Array]:
    """A part of the reading before is still there."""
    return np.concatenate([[0.0], one.force[:-1]]) - one.force, np.zeros_like(at)


@dataclass(frozen=True)
class Undeclared:
    """An effect, and whether weights go in series."""

    effect: Effect
    series: bool = True


EFFECTS: Mapping[str, Undeclared] = {
    "creep": Undeclared(_spring),
    "hysteresis": Undeclared(_loop),
    "direction": Undeclared(_slack),
    "drift": Undeclared(_drifting),
    "step": Undeclared(_jump),
    "warm-up": Undeclared(_warming),
    "sensitivity drift": Undeclared(_gain_drifts),
    "room": Undeclared(_room_offset),
    "room, gain": Undeclared(_room_gain),
    "square": Undeclared(_bends),
    "cube": Undeclared(_cubic),
    "stop": Undeclared(_stop),
    "carry-over": Undeclared(_previous, series=False),
}


@dataclass(frozen=True, eq=False)
class Stand:
    """One laboratory's run of a cell.

    Attributes:
        night: what happened.
        volts: (n,) recorded outputs.
        at_rest: (p,) true outputs at some forces.
    """

    night: Night
    volts: Array
    at_rest: Array


@dataclass(frozen=True)
class Meter:
    """An instrument of another laboratory, by the law of its textbook.

    Attributes:
        quantity: column of what is set.
        low: its value where a cell bears nothing.
        high: that where a cell bears 10 kN.
        declared: the model that its laboratory declares: its law, without the effect.
        law: (n,) its output at values of the quantity and room temperatures, with two coefficients near one.
    """

    quantity: str
    low: float
    high: float
    declared: str
    law: Callable[[Array, Array, float, float], Array]

    def set_to(self, force: Array) -> Array:
        """(n,) what is set in place of forces."""
        return self.low + (self.high - self.low) * force / 10.0


METERS: Mapping[str, Meter] = {
    # Nernst's slope of 198.4 uV/K and decade
    "pH electrode": Meter(
        "buffer_pH",
        2.0,
        12.0,
        "1 + I((room_degC + 273.15) * (buffer_pH - 7))",
        lambda x, room, a, b: 0.01 * a - 1.984e-4 * b * (room + 273.15) * (x - 7.0),
    ),
    # King (Phil. Trans. A 214 (1914) 373): the power of a hot wire, with the exponent that calibrations find
    "hot-wire anemometer": Meter(
        "speed_m_per_s", 0.5, 20.5, "1 + I(speed_m_per_s^0.45)", lambda x, _, a, b: 1.2 * a + 0.8 * b * x**0.45
    ),
    # a turbine turns in proportion to the flow, less what its bearing takes
    "turbine flow meter": Meter(
        "flow_m3_per_h",
        1.0,
        11.0,
        "1 + flow_m3_per_h + I(1/flow_m3_per_h)",
        lambda x, _, a, b: 0.2 * a * x - 0.05 * b / x,
    ),
}


def stand(name: str, at: Array, rng: Rng, rms: float, meter: Meter | None = None) -> Stand:
    """A stand with so much of an effect that the declared model leaves `rms` times the scatter of readings.

    Args:
        name: of the effect.
        at: (p,) forces, or what stands for them of another meter.
        rng: draws everything.
        rms: size of the effect.
        meter: in place of a load cell.
    """
    one = EFFECTS[name]
    happened = night(rng, series=one.series)
    added, rests = one.effect(happened, at, rng)
    usual = np.full_like(at, USUAL_degC)
    if meter is None:
        start, slope = rng.normal(0.0, 0.01), rng.uniform(0.45, 0.55)
        line = np.column_stack([np.ones_like(happened.force), happened.force])
        output, still = start + slope * happened.force, start + slope * at
    else:
        a, b = rng.uniform(0.9, 1.1, 2)
        x = meter.set_to(happened.force)
        output, still = meter.law(x, happened.room, a, b), meter.law(meter.set_to(at), usual, a, b)
        parts = [meter.law(x, happened.room, *one) for one in ((1.0, 0.0), (0.0, 1.0))]
        line = np.column_stack([np.ones_like(x), *parts])
    left = added - line @ np.linalg.lstsq(line, added, rcond=None)[0]
    size = rms * NOISE_V / float(np.sqrt(np.mean(left**2))) * rng.choice([-1.0, 1.0])
    volts = output + size * added + rng.normal(0.0, NOISE_V, len(added))
    return Stand(happened, volts, still + size * rests)
