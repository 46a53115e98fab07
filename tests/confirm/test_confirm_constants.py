"""An effect with a searched constant, such as a lag: its size and its constant, each with an interval that can be.

A linear error about the constant of a search gave "-33 % in its constant (-56 to -11 %)" for a true lag, and time
constants below zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from rig.fitter.confirm.constants import profiled
from rig.fitter.effects.sizes import each, size_with_95
from rig.procedures.general.effects.columns import searched
from rig.procedures.general.effects.scene import TableTerm
from rig.procedures.general.run_terms import Label, RunTerm, columns_of

GAIN, TAU, SEARCHED, T = 20.0, 20.0, 30.252, 1.98
STEPS = np.random.default_rng(1).uniform(-4.0, 4.0, 60)
"""Steps of the flow, kg/min, read so many seconds after each:"""
SINCE = np.tile([30.0, 40.0, 60.0], 20)


@dataclass(frozen=True)
class Decays:
    """A run in which each reading remembers the last step alone, with known error."""

    outputs: np.ndarray

    def columns_of(self, terms):
        return np.column_stack([np.zeros((60, 0)), *(term.block.columns for term in terms)])

    def resized_columns(self, terms):
        return np.zeros((60, 0))


def decay(tau):
    return TableTerm((f"lag(flow, {tau:.5g})",), -(STEPS * np.exp(-SINCE / tau))[:, None])


def terms():
    (block,) = (one for one in searched([10.0, SEARCHED, 90.0], decay, log=True) if one.profile.value == SEARCHED)
    return list(columns_of(SimpleNamespace(), block, "mfs_Hz", np.array([9.0])))


def found(seed, noise):
    rng = np.random.default_rng(seed)
    outputs = (decay(TAU).columns[:, 0] * GAIN + noise * rng.standard_normal(60)) / noise
    scaled = [RunTerm(t.effect, t.term, t.sensor, t.block, t.at, t.slope) for t in terms()]
    runs = Scaled(outputs, noise)
    (one,) = profiled(runs, scaled, np.ones((60, 1)), T)
    return one


@dataclass(frozen=True)
class Scaled(Decays):
    noise: float

    def columns_of(self, terms):
        return super().columns_of(terms) / self.noise


def test_the_change_with_the_constant_gives_place_to_the_constant():
    one = found(1, 0.1)
    assert one.places == (0, 1)
    assert one.values == pytest.approx((GAIN, TAU), rel=0.1)
    assert one.names[0] == f"lag(flow, {one.values[1]:.5g})"
    assert isinstance(terms()[0].with_constant(21.0).term, Label)


@pytest.mark.parametrize("noise", [0.05, 0.5, 2.0])
def test_intervals_of_size_and_constant_hold_the_true_ones_and_nothing_impossible(noise):
    seeds = range(40)
    held = np.zeros(2)
    for seed in seeds:
        one = found(seed, noise)
        (low, high), (shortest, longest) = one.intervals
        held += low <= GAIN <= high, shortest <= TAU <= longest
        assert 0.0 <= shortest <= one.values[1] <= longest
        assert low <= one.values[0] <= high
    assert held.min() >= 0.9 * len(seeds)


def test_where_the_readings_set_no_end_it_is_said():
    one = next(one for one in (found(seed, 40.0) for seed in range(20)) if one.intervals[1][0] == 0.0)
    assert not np.all(np.isfinite(one.intervals[0]))
    told = terms()[1].constant_text(12.0, (0.0, 29.0))
    assert told == "constant 12 (at most 29)"
    assert size_with_95(each("Hz"), {"lag": 90.0}, {"lag": (10.0, np.inf)}, 1.0) == "90 Hz (at least 10 Hz)"
    assert size_with_95(each("Hz"), {"lag": 20.1}, {"lag": (18.0, 22.6)}, 1.0) == "20.1 Hz (18.0 to 22.6 Hz)"
    long = size_with_95(each("Hz per unit of flow"), {"lag": 20.1}, {"lag": (18.0, 22.6)}, 1.0)
    assert long == "20.1 Hz per unit of flow (18.0 to 22.6)", "its unit stands there once"
    assert size_with_95(each("Hz"), {"lag": 20.1}, {"lag": (np.nan, np.nan)}, 1.0) == "20.1 Hz"
