"""An effect with a searched constant, such as a lag: its size and its constant, each with an interval that can be.

A linear error about the constant of a search gave "-33 % in its constant (-56 to -11 %)" for a true lag, and time
constants below zero.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from rig.fitter.confirm.constants import profiled
from rig.fitter.confirm.together import left, solve
from rig.fitter.effects.sizes import each, size_with_95
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.general.effects.columns import searched
from rig.procedures.general.run_terms import Label, RunTerm, columns_of
from rig.verbs.confirm.answers import Confirmed

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


def test_columns_in_several_units_are_fitted_side_by_side_as_one_by_one():
    """With five other columns of other lengths a size had five errors, and `rig confirm` ended by a fault."""
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((40, 5)) * [1.0, 30.0, 0.2, 7.0, 1000.0]
    outputs = rng.standard_normal((40, 2))
    assert left(columns, outputs) == pytest.approx(np.column_stack([left(columns, y) for y in outputs.T]), abs=1e-12)
    assert solve(columns, outputs[:, :1]).shape == (5, 1)


def test_an_interval_without_an_end_can_be_kept_in_a_calibration_file():
    """`rig fit --confirmed-by --out` refused it as too large for a double, and spoke of a column."""
    names = "causes sigmas p_changed missed shown expected p_shown limit fits p_fits place terms zero sizes"
    member = SimpleNamespace(
        **dict.fromkeys(names.split(), 0.0) | {"causes": (), "terms": (), "zero": (), "sizes": {}, "missed": np.nan},
        effect="ageing:elapsed_s",
        coefficients=(1.0, np.nan),
        intervals=((0.5, np.inf), (-np.inf, 2.0)),
        together=(1.0,),
        intervals_together=((0.0, np.inf),),
    )
    answer = SimpleNamespace(
        effect="x", verdict="undecided", holding=(), outliers=(), minor_causes=(), members=(member,)
    )
    (told,) = Confirmed._answer(None, answer)["members"]
    assert json.loads(json.dumps(told, allow_nan=False))["interval_95"] == [[0.5, None], [None, 2.0]]
    assert told["coefficients"] == [1.0, None]


def test_a_constant_at_the_border_of_what_was_tried_is_open_and_said_to_be():
    """It was given as a value, 30 times the named one, as if the data had it."""
    outputs = (-STEPS * GAIN + 0.1 * np.random.default_rng(1).standard_normal(60)) / 0.1
    (one,) = profiled(Scaled(outputs, 0.1), terms(), np.ones((60, 1)), T)
    low, high = one.intervals[1]
    assert low > SEARCHED
    assert one.values[1] == high == np.inf
    assert terms()[1].constant_text(one.values[1], (low, high)).startswith("constant at least ")
    assert terms()[1].constant_text(0.0, (0.0, 29.0)) == "constant at most 29.0"
    assert "not determined" in terms()[1].constant_text(np.inf, (0.0, np.inf))
