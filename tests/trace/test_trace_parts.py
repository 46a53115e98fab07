"""What only some rows do, and what whole plots do each by its own amount: it is said, and noise there is not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from proving.truth.whole_plot import SUBPLOT, Bench, Run, Transducer, simulate
from rig.fitter.trace.engine import family
from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.noise import Wandering
from rig.fitter.trace.in_part import p_in_part
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.parts import in_parts
from rig.procedures.general.trace.run import problem_of
from rig.procedures.general.trace.unmodelled import UnmodelledSmooth
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table

ONE = "bridge_1_mV"


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def read_by_three(seed, adds, n=120):
    """y = 3 + 2 x + error of sd one + what is added; three people in turns of four rows."""
    rng = np.random.default_rng([seed, n])
    who = rng.permutation(np.resize(np.arange(3), n // 4)).repeat(4)
    columns = {"x": rng.uniform(0.0, 10.0, n), "t_s": np.cumsum(60.0 + 5.0 * rng.random(n))}
    columns["humidity"] = 45.0 + 8.0 * np.sin(columns["t_s"] / 900.0) + rng.standard_normal(n)
    columns["who"] = who.astype(np.float64)
    columns["y"] = 3.0 + 2.0 * columns["x"] + adds(columns) + rng.standard_normal(n)
    told = Roles(response="y", formula="1 + x", time="t_s", candidates=("who", "humidity"))
    return roles_of(Table("table.csv", columns, simulated=True, provenance={}), told)[0]


def to_the_nearest_mark(c):
    return np.where(c["who"] == 1.0, 4.0 * (np.round(c["x"] / 1.4) * 1.4 - c["x"]), 0.0)


def damp_leak(c):
    return np.where(c["who"] == 2.0, 0.6 * np.maximum(c["humidity"] - 46.0, 0.0), 0.0)


def in_parts_of(data):
    return in_parts(UnmodelledSmooth(TableJudge(problem_of(data)), (), data))


@pytest.mark.parametrize(("adds", "words"), [(to_the_nearest_mark, "is 1"), (damp_leak, "is 2")])
def test_what_one_person_does_is_found(adds, words):
    """A saw tooth over the dial, and a threshold in the humidity: both were "nothing to add"."""
    found = in_parts_of(read_by_three(4, adds))
    assert found is not None
    assert f"in the rows whose who {words}" in found.cause


def test_what_one_person_does_is_said():
    """In the whole trace, as something without a name."""
    result = trace_general(read_by_three(4, to_the_nearest_mark))
    assert result.verdict == "unexplained"
    assert [one.cause.split(", ")[-1] for one in result.unnamed] == ["in the rows whose who is 1"]


def read_by_name(seed, size, of):
    """What the trace says of a saw tooth over the dial in the readings of some of Ada, Bo and Cy, a column of text."""
    rng = np.random.default_rng(seed)
    who = rng.permutation(np.resize(np.arange(3), 60)).repeat(2)
    x = rng.uniform(0.0, 10.0, who.size)
    tooth = np.where(np.isin(who, of), size * (np.round(x / 1.4) * 1.4 - x), 0.0)
    columns = {"x": x, "t_s": 60.0 * np.arange(who.size), "y": 3.0 + 2.0 * x + tooth + rng.standard_normal(who.size)}
    text = {"reader": np.array(["Ada", "Bo", "Cy"])[who]}
    table = Table("table.csv", columns, simulated=True, provenance={}, text=text)
    return trace_general(roles_of(table, Roles(response="y", formula="1 + x", time="t_s"))[0])


def test_a_large_shape_of_one_person_is_said_of_that_person():
    """It was a sure period of all, then a doubtful one."""
    result = read_by_name(5, 9.0, [1])
    assert result.verdict == "unexplained"
    assert [one.cause for one in result.unnamed] == ["periodic over x, 7 periods, in the rows whose reader is Bo"]
    assert [one.effect for one in result.effects] == ["noise-grows"]


def test_a_name_that_one_of_three_people_does_not_earn_is_doubtful():
    result = read_by_name(7, 4.0, [0, 2])
    (period,) = [e for e in result.effects if e.effect == "periodic:x"]
    assert "changes with reader" in (period.doubtful or "")


def test_noise_of_one_person_is_no_shape():
    """Four times the others' noise with long tails: limit 1 % of tables."""
    rng = np.random.default_rng(8)

    def wild(c):
        return np.where(c["who"] == 0.0, 4.0 * rng.standard_t(3.0, c["x"].size), 0.0)

    assert not any(in_parts_of(read_by_three(seed, wild)) for seed in range(12))


def test_the_p_of_a_part_is_uniform_without_a_shape():
    """Its scatter twice as large for half of the rows: 5 % of 2,000 parts below 0.05, and 1 % below 0.01."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-1.0, 1.0, 40)
    taken, columns = np.column_stack([np.ones(40), x]), np.column_stack([x**2, x**3])
    sd = np.where(np.arange(40) % 2, 1.0, 2.0)
    ps = np.array([p_in_part(sd * rng.standard_normal(40), taken, columns)[0] for _ in range(2000)])
    assert np.mean(ps < 0.05) < 0.05 + 3 * np.sqrt(0.05 / 2000)
    assert np.mean(ps < 0.01) < 0.01 + 3 * np.sqrt(0.01 / 2000)
    assert np.mean(ps < 0.05) > 0.02


def test_a_wander_without_columns_is_nothing():
    """LAPACK's solver of bands wrote beyond an array without columns: the program ended."""
    assert Wandering(np.arange(50.0)).whiten(np.array([0, 5]), np.empty((50, 0))).shape == (2, 50, 0)


def test_a_few_hurried_whole_plots_are_said():
    """A tenth of the last step of pressure is missing in three of twenty whole plots: it was "nothing to add"."""
    data = simulate(Bench((Transducer(),)), Run(), seed=6)
    change = np.nan_to_num(data.pressure_psia - data.previous_pressure_psia)
    hurried = np.isin(data.whole_plot_index, (3, 9, 15))
    outputs = {ONE: data.outputs[ONE] - 12.0 * SUBPLOT * np.where(hurried, change / np.std(change), 0.0)}
    one = trace_whole_plots(replace(data, outputs=outputs), validate=False).sensors[ONE]
    assert any("after the pressure before, clearly in" in left.cause for left in one.unnamed)


def test_larger_noise_in_some_whole_plots_is_no_shape():
    """Six times the error in three of twenty whole plots, and sensitivities drawn again in each."""
    for seed in range(2):
        data = simulate(Bench((Transducer(),), sensitivity_sd=1e-3), Run(), seed=seed)
        rng = np.random.default_rng(seed)
        wild = np.where(np.isin(data.whole_plot_index, (3, 9, 15)), 6.0 * SUBPLOT, 0.0) * rng.standard_normal(len(data))
        one = trace_whole_plots(replace(data, outputs={ONE: data.outputs[ONE] + wild}), validate=False).sensors[ONE]
        assert not any("by its own amount" in left.cause for left in one.unnamed)


def test_what_the_whole_plot_before_ended_with_is_remembered():
    """It fades in a fifth of an hour, as a seal that recovers: it was noise with a memory only."""
    data = simulate(Bench((Transducer(),)), Run(), seed=8)
    index = data.whole_plot_index
    rows = [np.flatnonzero(index == plot)[np.argsort(data.order[index == plot])] for plot in range(index.max() + 1)]
    rows.sort(key=lambda of: data.order[of[0]])
    dose = np.zeros(len(data))
    for last, now in pairwise(rows):
        dose[now] = data.pressure_psia[last[-3:]].mean()
    fading = (dose - dose[dose > 0].mean()) * (dose > 0) * np.exp(-data.since_s / 720.0)
    outputs = {ONE: data.outputs[ONE] + 2.5 * SUBPLOT * fading / np.std(fading)}
    one = trace_whole_plots(replace(data, outputs=outputs), validate=False).sensors[ONE]
    assert any("at which the one before ended" in left.cause for left in one.unnamed)


def test_a_tenth_of_a_degree_within_whole_plots_counts():
    """Its temperature drifts by a little in each whole plot, and the transducer follows: that was a remainder."""
    data = simulate(Bench((Transducer(offset_warm=(0.3, 0.0)),)), Run(), seed=6)
    rng = np.random.default_rng(2)
    slope = rng.uniform(-0.25, 0.25, int(data.whole_plot_index.max()) + 1)[data.whole_plot_index]
    moved = slope * data.since_s / data.since_s.max()
    outputs = {ONE: data.outputs[ONE] + 0.3 * moved}
    warmer = replace(data, sensor_temperature_degC=data.sensor_temperature_degC + moved, outputs=outputs)
    sensor = trace_whole_plots(warmer, validate=False).sensors[ONE]
    assert sensor.added == ()
    assert [one.stratum for one in sensor.unnamed] == ["noise"]


def test_one_whole_plot_that_is_off_is_no_sure_name():
    """At an end of a temperature that was visited once it is a knee as well: that was named without a mark."""
    for seed in (71005, 71029):
        data = simulate(Bench(apart_mV=0.2), Run(), seed)
        named = [e for e in trace_whole_plots(data, validate=False).sensors[ONE].effects if e.stratum != "noise"]
        assert [e.effect for e in named] == ["offset-knee"]
        assert "one whole plot" in (named[0].doubtful or "")
