"""Physics that no catalogue of whole-plot runs lists: what is left is said, names that are not earned are doubtful."""

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.whole_plot import SUBPLOT, WHOLE_PLOT, Bench, Run, Transducer, simulate
from proving.truth.whole_plot_hidden import hide
from rig.fitter.trace.among_alike import Shape
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.courses import Course, courses
from rig.procedures.pressure.trace.posed import white_of
from rig.procedures.pressure.trace.problem import pose
from rig.procedures.pressure.trace.run import scene_of

ONE = "bridge_1_mV"
SEEDS = (9101, 9104, 9106, 9107)
TWO = Bench((Transducer(), Transducer(sensitivity=1.9)))


def without(*names):
    return [effect for effect in PRESSURE_CATALOGUE if effect.name not in names]


def effects_in(trace):
    return [effect for effect in trace.effects if effect.stratum != "noise"]


@pytest.mark.parametrize(
    ("name", "lacks"),
    [
        ("hysteresis", ("hysteresis", "hysteresis-temperature")),
        ("bend, sensor", ("pressure-squared-temperature",)),
        ("sensor lags", ("thermal-lag",)),
        ("unrecorded step, gain", ("sensitivity-step-unrecorded", "sensitivity-step")),
        ("creep that is remembered", ("creep",)),
    ],
)
def test_what_the_catalogue_lacks_is_said_and_gets_no_name_without_a_mark(name, lacks):
    """One sd of a reading: the like of each was named without a mark, or was nothing to add."""
    data = hide([name], [1.0], seed=101, transducers=2).data
    trace = trace_whole_plots(data, catalogue=without(*lacks), validate=False).sensors[ONE]
    assert trace.verdict in ("unexplained", "partly explained")
    assert all(effect.doubtful for effect in effects_in(trace))
    assert trace.unnamed or effects_in(trace) or [one.effect for one in trace.effects] == ["slopes-differ"]


def test_what_is_left_lives_where_it_was_put():
    """A part of the side of approach times the sine of the pressure: no polynomial, no lack of fit of repeats."""
    data = simulate(seed=31)
    wave = data.pressure_side * np.sin(3.0 * data.pressure_psia)
    outputs = {ONE: data.outputs[ONE] + 0.8 * SUBPLOT * wave}
    trace = trace_whole_plots(replace(data, outputs=outputs), validate=False, catalogue=without("hysteresis")).sensors[
        ONE
    ]
    assert "over the side from which a pressure was reached" in " ".join(one.cause for one in trace.unnamed)


def test_a_period_in_order_is_said():
    """Mains hum that beats with the readings: one period in 4.3 of them, 1.5 sd high, with a phase of its own."""
    data = simulate(seed=32)
    hum = 1.5 * np.sqrt(2.0) * SUBPLOT * np.sin(2.0 * np.pi * data.order / 4.3 + 1.0)
    trace = trace_whole_plots(replace(data, outputs={ONE: data.outputs[ONE] + hum}), validate=False).sensors[ONE]
    assert "one period in 4.3" in " ".join(one.cause for one in trace.unnamed)
    assert trace.verdict == "unexplained"


@pytest.mark.parametrize("seed", [3, 5])
def test_a_dead_band_is_no_transpiration(seed):
    data = hide(["silent below"], [1.0], seed=seed, transducers=2).data
    names = {effect.effect for t in trace_whole_plots(data, validate=False).sensors.values() for effect in t.effects}
    assert "thermal-transpiration" not in names
    assert names


def test_a_second_name_of_the_same_shape_is_doubtful():
    """The line's law is not exactly that of the catalogue: what it lacks there gets no name without a mark."""
    trace = trace_whole_plots(hide(["transpiration"], [2.0], seed=100, transducers=1).data, validate=False).sensors[ONE]
    by_name = {effect.effect: effect for effect in effects_in(trace)}
    assert len(by_name) > 1
    assert "thermal-transpiration" in by_name
    assert all("found together" in effect.doubtful for effect in by_name.values())
    assert trace.verdict == "partly explained"


def of_plots(data, sizes):
    """The run with `sizes` (one of each whole plot in time, any unit) beside the declared model, 2 sd of one."""
    declared = named_formula("full").columns(data.table)[1]
    column = np.asarray(sizes)[data.whole_plot_index]
    basis = np.linalg.qr(declared)[0]
    left = column - basis @ (basis.T @ column)
    column = column / np.sqrt(np.mean(left**2))
    return replace(data, outputs={s: y + 2.0 * WHOLE_PLOT * column for s, y in data.outputs.items()})


def steps_before(data):
    index = data.whole_plot_index
    degC = np.bincount(index, data.sensor_temperature_degC) / np.bincount(index)
    return np.diff(degC, prepend=degC[0])


@pytest.mark.parametrize("seed", [41, 43])
def test_what_whole_plots_remember_in_a_way_of_no_catalogue_is_said(seed):
    """A shock of the temperature, whichever way it goes: was nothing to add."""
    data = simulate(TWO, seed=seed)
    traces = trace_whole_plots(of_plots(data, np.abs(steps_before(data))), validate=False).sensors
    said = [one.cause for trace in traces.values() for one in trace.unnamed]
    assert all("after the step of the transducer's temperature before" in where for where in said)
    assert all(trace.verdict in ("unexplained", "partly explained") for trace in traces.values())
    assert all(effect.doubtful for trace in traces.values() for effect in effects_in(trace))
    assert len(said) == 2


def test_whole_plots_that_wander_are_said_to_be_alike_and_name_nothing():
    """As far as twenty numbers tell, a wander and a slow cause are the same: it is said, as a finding of the noise."""
    rng = np.random.default_rng(47)
    data = simulate(replace(TWO, whole_plot=0.3 * WHOLE_PLOT), seed=47)
    wander = rng.standard_normal(20)
    for k in range(1, 20):
        wander[k] = 0.8 * wander[k - 1] + 0.6 * wander[k]
    traces = trace_whole_plots(of_plots(data, wander), validate=False).sensors
    (said,) = {one.cause for trace in traces.values() for one in trace.unnamed}
    assert said.startswith("between whole plots: errors of neighbours in time are alike")
    assert {(trace.verdict, trace.added) for trace in traces.values()} == {("unexplained", ())}


@pytest.mark.parametrize("rho", [0.0, 0.5])
def test_shapes_between_whole_plots_are_rare_by_chance(rho):
    """Of 40 runs without any effect 1.5 % at most have one; more than 3 of 40 would be once in 300."""
    data = simulate(Bench(), seed=45)
    names, columns = named_formula("full").columns(data.table)
    scene = scene_of(data)
    problem = pose(data, names, columns, scene, PRESSURE_CATALOGUE[:3])
    rng, false = np.random.default_rng(45), 0
    for _ in range(40):
        error = rng.standard_normal(20)
        for k in range(1, 20):
            error[k] = rho * error[k - 1] + np.sqrt(1.0 - rho**2) * error[k]
        noise = SUBPLOT * rng.standard_normal(len(data)) + WHOLE_PLOT * error[problem.whole_plot]
        white = white_of(replace(problem, outputs=noise[None]), np.array([[(WHOLE_PLOT / SUBPLOT) ** 2, 0.0, 0.0]]))
        found = courses(white.view("whole-plot", ()), problem.plots_in_time, scene)
        false += any(not course.slow for course in found.values())
    assert false <= 3


@pytest.mark.parametrize(
    ("bench", "run"),
    [(Bench(remembered=0.8), Run(pressures="ascending")), (Bench(sensitivity_sd=1e-3), Run())],
    ids=["readings remember one another", "sensitivities are drawn again"],
)
def test_noise_within_whole_plots_leaves_nothing(bench, run):
    """All had a shape without a name: repeats were compared as if independent, and so were slopes."""
    found = [trace_whole_plots(simulate(bench, run, seed), validate=False).sensors[ONE] for seed in SEEDS]
    assert sum(bool(one.unnamed or one.added) for one in found) <= 1


def test_errors_of_neighbours_that_are_alike_may_have_a_cause_and_the_finding_says_where_it_is_seen():
    found = Course("along the run", Shape(0, 0.5, 0.001, 0.4), common=False).unnamed()
    assert found.stratum == "noise"
    assert found.cause.endswith("or follow something slow; it may be a cause seen along the run")
