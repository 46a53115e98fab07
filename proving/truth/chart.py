"""Histories of one sensor with a known kind of drift, read out as whole calibrations on the bench of `attitude`.

A sensor's state is offset, sensitivity, and the two parts of its coning angle. Each moves on its own, in units of what
one calibration can tell: `none` stays, `linear` drifts steadily, `walk` wanders, `scatter` is drawn again at every
calibration and at every use, `step` jumps once at an unknown date. `together` is a walk of all of them by one cause.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from proving.truth.attitude import D1, Array, Bench, Sensor, simulate
from rig.procedures.attitude.data import AttitudeData

KINDS = ("none", "scatter", "walk", "together", "step", "linear")
BENCH = Bench(sensors=(Sensor("x"),), degC_daily=0.0, offset_sd=0.5)
PLAN = D1(90, 5, 5, replications=3)
START = np.array([0.002, 5.0, 0.2, 0.5])
UNIT = np.array([4.5e-6, 1.7e-6, 4e-5, 4e-5])
"""Standard error within one calibration of V, V/g, deg, deg."""
TOGETHER = np.array([1.0, -1.0, 1.0, -1.0])
USAGE = np.meshgrid(np.linspace(-30, 30, 9), np.arange(0, 360, 15.0))


@dataclass(frozen=True)
class History:
    """A sensor's past, and its future.

    Attributes:
        years: (m,) of the calibrations.
        states: (m, 4) true states at these times.
        rate: (4,) of a steady drift, per year.
        kind: of drift.
        size: of it.
        rng: what the future is drawn from.

    """

    years: Array
    states: Array
    rate: Array
    kind: str
    size: float
    rng: np.random.Generator

    def after(self, years: float) -> Array:
        """State so long after the last calibration."""
        last: Array = self.states[-1] + self.rate * years
        if self.kind == "walk":
            last = last + self.rng.normal(0, self.size * np.sqrt(years), 4) * UNIT
        if self.kind == "together":
            last = last + self.rng.normal(0, self.size * np.sqrt(years)) * TOGETHER * UNIT
        if self.kind == "scatter":
            last = START + self.rng.normal(0, self.size, 4) * UNIT
        return last

    def runs(self) -> list[AttitudeData]:
        """What was read at every calibration."""
        return [simulate(bench_of(s), PLAN, int(self.rng.integers(2**32)))[0] for s in self.states]


def draw_history(kind: str, count: int, rng: np.random.Generator, size: float = 3.0) -> History:
    """A history of so many calibrations, half a year apart but for some weeks; `size` in units, and years of them."""
    years = np.arange(count) * 0.5 + rng.uniform(-0.05, 0.05, count)
    years = years - years[0]
    moved, rate = np.zeros((count, 4)), np.zeros(4)
    if kind == "linear":
        rate = size * rng.choice([-1.0, 1.0], 4)
        moved = years[:, None] * rate
    elif kind in ("walk", "together"):
        steps = rng.normal(0, size, (count - 1, 4)) * np.sqrt(np.diff(years))[:, None]
        if kind == "together":
            steps = steps[:, :1] * TOGETHER
        moved[1:] = np.cumsum(steps, axis=0)
    elif kind == "scatter":
        moved = rng.normal(0, size, (count, 4))
    elif kind == "step":
        at = rng.integers(1, count)
        moved[at:] = size * rng.choice([-1.0, 1.0], 4)
    return History(years, START + moved * UNIT, rate * UNIT, kind, size, rng)


def bench_of(state: Array) -> Bench:
    """The bench whose sensor is in a state."""
    b, S, along, across = state
    sensor = Sensor("x", b=b, S=S, Omega_deg=np.hypot(along, across), A_deg=np.degrees(np.arctan2(across, along)))
    return replace(BENCH, sensors=(sensor,))


def largest_error_deg(state: Array, coefficients: Array) -> float:
    """Largest error of the output within +-30 deg of pitch, of a sensor in this state used with (4,) coefficients."""
    pitch, roll = (angle.ravel() for angle in USAGE)
    zero = np.zeros_like(pitch)
    true = bench_of(state).outputs(pitch, roll, zero + 23.0, zero, zero, zero, zero)["x_V"]
    a, r = np.radians(pitch), np.radians(roll)
    h = np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)])
    return float(np.degrees(np.abs(true - h @ coefficients).max() / state[1]))
