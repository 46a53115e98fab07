"""The tracer on whole-plot runs: effects found by name, clean runs, the paper's cubic, and what nights leave behind."""

import json
from dataclasses import replace

import numpy as np
import pytest

from proving.truth.whole_plot import (
    CUBIC,
    GROWING,
    PAIRS,
    SUBPLOT,
    WHOLE_PLOT,
    Bench,
    Run,
    Transducer,
    simulate,
)
from proving.truth.whole_plot_hidden import HIDDEN, hide
from rig.fitter import RankError
from rig.fitter.arithmetic_text import FormulaError
from rig.fitter.trace.chance import ALPHA
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.separation import separate_pressure
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.judge import WholePlotJudge
from rig.procedures.pressure.trace.problem import pose
from rig.procedures.pressure.trace.run import scene_of

ONE = "bridge_1_mV"
# the truth's coefficient at the amplitude in HIDDEN, where it has one in the unit of the effect
TRUE = {
    "cubic": 1e-3,
    "bend, sensor": 4e-5,
    "bend, electronics": 5e-5,
    "gain, sensor squared": 2e-6,
    "sensor cubed": 3e-6,
    "electronics cubed": 5e-6,
    "hysteresis": 5e-3,
    "creep": 1.2e-3,
    "carry-over": 4e-4,
    "interruption": 0.08,
    "interruption, gain": 3e-3,
    "drift of whole plots": 4e-3,
    "drift within": 8e-3,
    "gain drifts": 1e-4,
    "reference drifts": 4e-5,
    "reference zero drifts": 1.5e-3,
    "head": 5.0,
    "leak": 8e-3,
    "gas is warmed by compression": 3e-3,
    "friction that turns": -5e-3,
}
# the data cannot tell these from others, which are simpler or more usual and lead their class
LED_BY = {
    "sensor by electronics squared": "sensor-temperature-third-order",
    "electronics by sensor squared": "sse-temperature-third-order",
    "supply, time": "reference-drift",
    "reference bends": "pressure-third-order",
    "boss touches down": "dead-band",  # with pressures as far apart as these
    "gas cools the bridge": "dead-band",  # the same
    "supply settles": "reference-drift",
}
LARGER = {"sticks in the cold": 0.75}
"""What is 0.2 sd at 0.6, beside what there is of it at every temperature."""
BESIDE = {"sticks in the cold": {"hysteresis"}, "transpiration": {"reference-nonlinearity"}}
"""What there is of it at every temperature; and what this noise has besides, at p = 0.033, with a mark."""
DOUBTED = {
    "corner": {"gain, sensor squared", "gain, electronics squared"},
    "coefficient that changes": {"sticks in the cold"},
    "chance alone": {"joint with play"},
    "explain these data alike": {"reference bends"},
    "found together": {"transpiration"},
    "a shape without a name": {"sensor lags"},
}
"""What is doubted: powers that a knee explains as well over five temperatures; friction that grows in the
cold, as another memory may; what is not clear enough in twenty whole plots; a curve that a bent reference, a knee or a
stop has as well; two names of one shape; a lag whose time constant five steps hardly tell.
"""
# a declared model, and what the ordinary transducer has beyond it
UNDECLARED = {
    "II.C": ("sensitivity-temperature", ("P*T_sensor",)),
    "1 + P + P^2 + P:T_sensor + P:T_SSE": ("offset-temperature", ("T_sensor",)),
    "(P + T_sensor + T_SSE)^2 + T_sensor^2 + T_SSE^2": ("pressure-second-order", ("P^2",)),
    "(P + T_sensor + T_SSE)^2 + P^2": ("offset-temperature-second-order", ("T_sensor^2",)),
}


def effects_of(found):
    """Transducer and effect, for everything but the noise."""
    return {(s, e.effect) for s, t in found.sensors.items() for e in t.effects if e.stratum != "noise"}


def problem_of(data, model="full", catalogue=PRESSURE_CATALOGUE):
    names, columns = named_formula(model).columns(data.table)
    return pose(data, names, columns, scene_of(data), catalogue)


def coefficient_of(data, name):
    """Of a candidate by itself, as a trace would estimate it."""
    judge = WholePlotJudge.of(problem_of(data))
    j = next(k for k, c in enumerate(judge.candidates) if c.effect.name == name)
    return judge.coefficients((j,))[j]


@pytest.mark.parametrize("name", HIDDEN)
def test_effect_is_named(name):
    """Two transducers; 0.6 sd of a reading within whole plots, 2.5 of a whole plot between them."""
    one = HIDDEN[name]
    hidden = hide([name], [LARGER.get(name, 2.5 if one.between else 0.6)], seed=5, transducers=2)
    found = trace_whole_plots(hidden.data, hidden.model, validate=False)
    assert {effect for _, effect in effects_of(found)} == {LED_BY.get(name, one.expected)} | BESIDE.get(name, set())
    trace = found.sensors[ONE]
    effect = next(e for e in trace.effects if e.effect not in BESIDE.get(name, ()))
    assert one.expected in (effect.effect, *effect.aliases)
    reason = next((why for why, names in DOUBTED.items() if name in names), "")
    assert trace.verdict == ("partly explained" if reason else "explained")
    assert reason in (effect.doubtful or "")
    assert effect.p_adjusted <= ALPHA
    assert effect.share > (0.7 if name not in BESIDE else 0.1)
    assert effect.separate_by
    assert effect.stratum == ("whole-plot" if one.between else "subplot")
    if name in TRUE:
        assert effect.coefficients[0] == pytest.approx(TRUE[name] * hidden.scales[0], abs=4 * effect.stderr[0])
        assert effect.half_width_95[0] > 1.95 * effect.stderr[0]


@pytest.mark.parametrize("model", UNDECLARED)
def test_terms_a_declared_model_lacks_are_named(model):
    bench = Bench((Transducer(offset_warm2=(3e-5, 0.0, 0.0), offset_warm=(2e-3, 0.0), bend=-2e-3),))
    found = trace_whole_plots(simulate(bench, seed=1), model, validate=False)
    assert (found.sensors[ONE].declared, found.sensors[ONE].verdict) == (model, "explained")
    by_name = {e.effect: e for e in found.sensors[ONE].effects}
    name, terms = UNDECLARED[model]
    assert by_name[name].terms == terms
    assert by_name[name].formulas == tuple(term.replace("*", ":") for term in terms)
    # declared from then on, nothing is left to name
    extended = " + ".join([str(named_formula(model)), *(f for e in by_name.values() for f in e.formulas)])
    assert effects_of(trace_whole_plots(simulate(bench, seed=1), extended, validate=False)) == set()


def test_every_effect_is_hidden_somewhere():
    hidden = {one.expected for one in HIDDEN.values()} | {name for name, _ in UNDECLARED.values()}
    assert hidden | {"outlying-whole-plot"} == {effect.name for effect in PRESSURE_CATALOGUE}


def test_a_whole_plot_that_stands_apart_is_the_noises():
    """13 sd of a whole plot's error: pointed at, no effect, and nothing of it is predicted."""
    data = simulate(Bench(apart_mV=0.2), seed=2)
    found = trace_whole_plots(data, validate=False)
    (effect,) = found.sensors[ONE].effects
    assert (effect.effect, effect.stratum) == ("outlying-whole-plot", "noise")
    assert effect.coefficients[0] == pytest.approx(0.2, abs=4 * effect.stderr[0])
    plot = int(effect.terms[0].removeprefix("whole plot "))
    rows = data.whole_plot == plot
    assert np.mean(data.outputs[ONE][rows] - found.predict(data)[ONE][rows]) == pytest.approx(0.2, abs=4 * WHOLE_PLOT)


def test_third_order_temperature_is_a_class_of_two():
    """x^3 = x z^2 on a spherical central composite, beside the second order."""
    for truth, cubed, mixed in (
        (Transducer(offset_warm3=(3e-6, 0.0)), "sensor-temperature-third-order", "sensor-by-sse-squared"),
        (Transducer(offset_mixed=(0.0, 5e-6)), "sse-temperature-third-order", "sse-by-sensor-squared"),
    ):
        (effect,) = trace_whole_plots(simulate(Bench((truth,)), seed=2), validate=False).sensors[ONE].effects
        assert (effect.effect, effect.stratum) == (cubed, "whole-plot")
        assert mixed in effect.aliases
        assert effect.separation[mixed] < 0.5  # readbacks scatter by 0.05 degC
        assert effect.df[0] == pytest.approx(13, abs=0.2)
        assert "corners" in effect.separate_by


@pytest.mark.parametrize(
    ("bench", "run"),
    [
        (Bench(), Run()),
        (Bench(subplot=GROWING), Run()),
        (Bench(3 * (Transducer(),), shared_sd=2e-3), Run()),
        (Bench(), Run(broken={2: 5, 5: 1, 9: 8, 14: 1})),
        (Bench(whole_plot=0.0), Run()),
        (Bench(sensitivity_sd=1e-3), Run()),
        (Bench(long_tails=True), Run(interrupted=True)),
    ],
    ids=["clean", "growing sd", "shared error", "broken", "no whole-plot error", "sensitivity again", "long tails"],
)
def test_nothing_is_reported_where_nothing_is(bench, run):
    """Three runs each, fixed seeds; the rates over 100: python -m proving whole-plots clean."""
    reported = [effects_of(trace_whole_plots(simulate(bench, run, seed), validate=False)) for seed in range(200, 203)]
    assert reported == [set()] * 3


def test_the_cubic_of_the_paper_and_nothing_else():
    """Scatter growing as 0.4 + 0.3 P; 20 seeds: python -m proving whole-plots cubic."""
    for seed in range(3):
        found = trace_whole_plots(simulate(Bench((Transducer(cubic=CUBIC),), GROWING), seed=seed), validate=False)
        assert effects_of(found) == {(ONE, "pressure-third-order")}
        (cubic, noise) = found.sensors[ONE].effects
        assert cubic.coefficients[0] == pytest.approx(CUBIC, abs=4 * cubic.stderr[0])
        assert cubic.formulas == ("P^3",)
        assert (noise.effect, noise.stratum) == ("noise-grows", "noise")
        for value, truth, error in zip(noise.coefficients, GROWING, noise.stderr, strict=True):
            assert value == pytest.approx(truth, abs=4 * error)
            assert error < 0.25 * truth


def test_noise_that_does_not_grow_is_not_said_to():
    runs = [trace_whole_plots(simulate(seed=seed), validate=False).sensors[ONE] for seed in range(20, 27)]
    assert not any(t.effects for t in runs)
    assert np.median([t.before.fit.sigma_subplot for t in runs]) == pytest.approx(SUBPLOT, rel=0.1)
    assert np.median([t.before.fit.sigma_wholeplot for t in runs]) == pytest.approx(WHOLE_PLOT, rel=0.25)


def test_whole_plot_effects_have_the_t_test_of_whole_plot_means():
    """Against ordinary least squares on the twenty means, which share no code with the strata."""
    data = simulate(Bench((Transducer(drift=1e-3),)), seed=4)
    flat = replace(
        data,
        **{
            name: np.round(getattr(data, name) / 1e-6) * 1e-6
            if name == "pressure_psia"
            else np.array([np.mean(getattr(data, name)[data.whole_plot == w]) for w in range(20)])[data.whole_plot]
            for name in ("pressure_psia", "sensor_temperature_degC", "sse_temperature_degC")
        },
    )
    flat = replace(flat, pressure_psia=np.round(flat.pressure_psia, 2), pressure_side=None)
    found = coefficient_of(flat, "sensor-temperature-third-order")
    means = [
        np.array([np.mean(v[flat.whole_plot == w]) for w in range(20)])
        for v in (flat.outputs[ONE], flat.sensor_temperature_degC, flat.sse_temperature_degC)
    ]
    y, a, b = means[0], means[1] - flat.sensor_temperature_degC.mean(), means[2]
    x = np.column_stack([np.ones(20), a, b, a * a, a * b, b * b, a**3])
    beta, rss, *_ = np.linalg.lstsq(x, y, rcond=None)
    stderr = np.sqrt(rss[0] / 13 * np.linalg.inv(x.T @ x)[-1, -1])
    assert found.value == pytest.approx(beta[-1], rel=1e-8)
    assert found.stderr == pytest.approx(stderr, rel=1e-8)
    assert found.df == pytest.approx(13)


def test_subplot_effects_have_the_coefficient_of_least_squares_with_indicators():
    data = simulate(Bench((Transducer(cubic=2e-3),)), Run(broken={3: 5, 7: 1}), seed=5)
    found = coefficient_of(data, "pressure-third-order")
    p, a, b = data.pressure_psia, data.sensor_temperature_degC + 90.0, data.sse_temperature_degC
    indicators = np.eye(data.whole_plots.size)[data.whole_plot_index]
    x = np.column_stack([indicators, p, p * p, p * a, p * b, p**3])
    y = data.outputs[ONE]
    beta, rss, *_ = np.linalg.lstsq(x, y, rcond=None)
    df = y.size - x.shape[1]
    stderr = np.sqrt(rss[0] / df * np.linalg.inv(x.T @ x)[-1, -1])
    # temperatures scatter by 0.05 degC within whole plots, which indicators cannot follow
    assert found.value == pytest.approx(beta[-1], abs=0.05 * stderr)
    assert found.stderr == pytest.approx(stderr, rel=0.02)
    assert found.df == pytest.approx(df, abs=3)


def test_broken_whole_plots_keep_their_readings():
    """Five of eleven, then the same temperatures again under a new identity; and single readings."""
    run = Run(broken={1: 5, 6: 1, 12: 1, 13: 10})
    data = simulate(Bench((Transducer(cubic=CUBIC),)), run, seed=1)
    assert len(data) == 237
    assert data.whole_plots.size == 24
    found = trace_whole_plots(data)
    assert effects_of(found) == {(ONE, "pressure-third-order")}
    assert found.sensors[ONE].after.cv_rms < 2.5 * WHOLE_PLOT
    drifting = trace_whole_plots(simulate(Bench((Transducer(drift=3e-3),)), run, seed=1), validate=False)
    assert effects_of(drifting) == {(ONE, "whole-plot-drift")}


def test_transducers_tell_the_line_from_themselves():
    """The same column, of the line if all transducers show it alike in psi, of one if only that shows it."""
    for bench, expected in (
        (Bench(3 * (Transducer(),), carry_over=6e-4), {(f"bridge_{k}_mV", "carry-over") for k in (1, 2, 3)}),
        (Bench((Transducer(), Transducer(creep=1.5e-3), Transducer())), {("bridge_2_mV", "creep")}),
    ):
        found = trace_whole_plots(simulate(bench, seed=1), validate=False)
        assert effects_of(found) == expected
        (effect,) = found.sensors["bridge_2_mV"].effects
        assert effect.doubtful is None, "few simulated runs bound p, and that bound is no reason for doubt"
        # three creeps that happen to be alike take two columns more than one line
        assert effect.separation["creep" if effect.effect == "carry-over" else "carry-over"] > 1.5
    alone = (
        trace_whole_plots(simulate(Bench((Transducer(creep=1.5e-3),)), seed=1), validate=False).sensors[ONE].effects[0]
    )
    assert {"creep", "carry-over"} <= {alone.effect, *alone.aliases}
    assert "second gauge" in alone.separate_by


def test_what_all_transducers_show_alike_may_be_the_reference():
    alike = Bench(tuple(Transducer(offset=k, cubic=CUBIC) for k in range(3)))
    notes = trace_whole_plots(simulate(alike, seed=1), validate=False).sensors["bridge_3_mV"].notes
    assert any("the same in all 3 transducers" in note and "reference" in note for note in notes)
    different = Bench(tuple(Transducer(cubic=k * CUBIC) for k in (1.0, -1.0, 2.0)))
    assert not any(
        "same in all" in n for n in trace_whole_plots(simulate(different, seed=1), validate=False).sensors[ONE].notes
    )


@pytest.mark.parametrize(
    "sizes",
    [(0.8, 1.2, 0.9, 1.1), (1.0, 0.85, 1.2, 0.92, 1.12, 0.81, 1.04)],
    ids=("4", "7"),
)
def test_what_transducers_do_not_agree_on_is_not_the_line(sizes):
    """Each its own cubic, differing by 20 %: not a bent reference and what some transducers add to it."""
    bench = Bench(tuple(Transducer(offset=0.1 * k, cubic=part * CUBIC) for k, part in enumerate(sizes)), GROWING)
    found = trace_whole_plots(simulate(bench, seed=0), validate=False)
    assert effects_of(found) == {(sensor, "pressure-third-order") for sensor in found.sensors}
    for part, trace in zip(sizes, found.sensors.values(), strict=True):
        cubic = trace.effects[0]
        assert cubic.coefficients[0] == pytest.approx(part * CUBIC, abs=4 * cubic.stderr[0])


@pytest.mark.parametrize("own", [0.0, CUBIC], ids=["alike", "one bends by itself too"])
def test_a_bent_reference_stays_among_the_explanations(own):
    bench = Bench((Transducer(cubic=own), *3 * (Transducer(),)), GROWING, reference_cubic=CUBIC / 2)
    found = trace_whole_plots(simulate(bench, seed=0), validate=False)
    for trace in found.sensors.values():
        effect = trace.effects[0]
        assert "reference-nonlinearity" in (effect.effect, *effect.aliases)
        assert "second gauge" in effect.separate_by
        besides = "reference-nonlinearity explains as much as pressure-third-order only with pressure-third-order"
        assert any(n == f"{besides} in {ONE} besides" for n in trace.notes) == (own > 0.0)


def test_a_line_that_one_transducer_adds_to_is_still_the_line():
    drifting = Bench((Transducer(sensitivity_drift=4e-4), *3 * (Transducer(),)), reference_per_h=2e-4)
    found = trace_whole_plots(simulate(drifting, seed=1), validate=False)
    line = {(sensor, "reference-drift") for sensor in found.sensors}
    assert effects_of(found) == {*line, (ONE, "sensitivity-drift")}
    # of the same column each has its part, and neither the other's
    assert all(e.share > 0.1 for trace in found.sensors.values() for e in trace.effects)
    assert any("sensitivity-drift" in e.aliases for e in found.sensors["bridge_3_mV"].effects)
    apart = Bench(tuple(Transducer(sensitivity_drift=4e-4 * part) for part in (1.0, -0.8, 0.7, 1.4)))
    found = trace_whole_plots(simulate(apart, seed=1), validate=False)
    assert effects_of(found) == {(sensor, "sensitivity-drift") for sensor in found.sensors}
    assert "reference-drift" not in found.sensors[ONE].effects[0].aliases


def test_units_are_those_of_the_terms_that_are_found():
    """Of the effects whose terms have not all the same unit."""
    shown = {}
    for name in ("supply, time", "supply, electronics"):
        hidden = hide([name], [0.6], seed=3, transducers=2)
        catalogue = tuple(effect for effect in PRESSURE_CATALOGUE if effect.name == "excitation")
        (effect,) = trace_whole_plots(hidden.data, hidden.model, catalogue, validate=False).sensors[ONE].effects
        shown[effect.terms] = effect.unit, effect.size.split(" ")[-1]
    assert shown == {("V*time",): ("1/h", "ppm/h"), ("V*T_SSE",): ("1/degC", "ppm/degC")}
    bent = simulate(Bench(2 * (Transducer(bend=0.0),), reference_cubic=5e-3), seed=1)
    (reference,) = (effect for effect in PRESSURE_CATALOGUE if effect.name == "reference-nonlinearity")
    found = trace_whole_plots(bent, catalogue=(reference,), validate=False).sensors[ONE]
    assert (found.effects[0].terms, found.effects[0].unit) == (("P^3",), "psi/psi^3")
    assert found.effects[0].size.endswith(" psi/psi^3")
    assert found.outcome().to_json()["fitted"]["coefficients"]["reference-nonlinearity: P^3"]["unit"] == "psi/psi^3"


def test_json_is_the_object_the_design_promises():
    data = simulate(Bench((Transducer(cubic=CUBIC, drift=5e-3),), GROWING), seed=7)
    report = json.loads(json.dumps(trace_whole_plots(data).to_json("night.csv"), allow_nan=False))
    assert report["data"] == {"file": "night.csv", "points": 220, "kind": "whole-plot"}
    one = report["sensors"][ONE]
    assert (one["declared"], one["verdict"]) == ("full", "explained")
    assert set(one["before"]) == set(one["after"])
    assert {"sigma_subplot", "sigma_wholeplot", "reading_error_pct", "cv_rms"} <= set(one["before"])
    assert one["before"]["sigma_E"] is None
    assert one["before"]["T_S"] is None
    assert len(one["before"]["reading_error_pct"]) == 8
    assert {e["effect"] for e in one["effects"]} == {
        "pressure-third-order",
        "whole-plot-drift",
        "noise-grows",
    }
    promised = {
        "effect",
        "stratum",
        "term",
        "coefficients",
        "stderr",
        "unit",
        "p_adjusted",
        "share",
        "aliases",
        "doubtful",
    }
    for effect in one["effects"]:
        assert promised | {"separate_by", "lo95", "hi95", "peak_mV", "peak_psi"} <= set(effect)
        assert effect["lo95"][0] < effect["coefficients"][0] < effect["hi95"][0]
    assert set(one["fitted"]["coefficients"]) >= {"1", "P", "T_sensor:T_SSE", "pressure-third-order: P^3"}
    assert one["after"]["sigma_wholeplot"] < one["before"]["sigma_wholeplot"]
    assert one["after"]["cv_rms"] < one["before"]["cv_rms"]


def test_same_data_same_answer_in_any_order_of_rows():
    data = simulate(Bench((Transducer(cubic=CUBIC, settling=8e-3),)), seed=8)
    first = trace_whole_plots(data, validate=False)
    assert trace_whole_plots(data, validate=False).to_json() == first.to_json()
    shuffled = trace_whole_plots(data.take(np.random.default_rng(1).permutation(len(data))), validate=False)
    assert effects_of(shuffled) == effects_of(first) == {(ONE, "pressure-third-order"), (ONE, "subplot-drift")}
    for mine, theirs in zip(first.sensors[ONE].effects, shuffled.sensors[ONE].effects, strict=True):
        np.testing.assert_allclose(mine.coefficients, theirs.coefficients, rtol=1e-6)


def test_prediction_with_the_effects_beats_that_without():
    quiet = {"subplot": (1e-9, 0.0), "whole_plot": 0.0}
    bench = Bench((Transducer(cubic=CUBIC, creep=2e-3),))
    truth = simulate(replace(bench, **quiet), seed=12)
    found = trace_whole_plots(simulate(bench, seed=11), validate=False)
    plain = trace_whole_plots(simulate(bench, seed=11), catalogue=(), validate=False)
    error, without = (np.std(t.predict(truth)[ONE] - truth.outputs[ONE]) for t in (found, plain))
    assert plain.sensors[ONE].effects == ()
    assert error < 0.8 * without
    assert len(found.predict(truth.take(np.arange(7)))[ONE]) == 7


def test_what_no_effect_explains_is_shown_and_not_named():
    """A kink at one pressure and an outlying pair of temperatures: nothing in the catalogue looks like them."""
    data = simulate(seed=13)
    kink = data.outputs[ONE] + 0.015 * np.isclose(data.pressure_psia, 0.79, atol=0.01)
    one = trace_whole_plots(replace(data, outputs={ONE: kink}), validate=False).sensors[ONE]
    assert one.verdict in ("unexplained", "partly explained")
    (rest,) = one.unnamed
    assert rest.cause.startswith("within whole plots, over the pressure")
    assert rest.share > 0.2


def test_what_varies_smoothly_is_shown_with_its_variable():
    """A wave over pressure that no term of the catalogue follows; and none of five clean runs has anything left."""
    data = simulate(seed=13)
    wave = data.outputs[ONE] + 0.013 * np.sin(3.2 * data.pressure_psia)
    one = trace_whole_plots(replace(data, outputs={ONE: wave}), validate=False).sensors[ONE]
    assert one.verdict in ("unexplained", "partly explained")
    assert all(effect.doubtful for effect in one.effects)
    assert one.unnamed[0].cause == "within whole plots, over the pressure"
    assert not any(trace_whole_plots(simulate(seed=s), validate=False).sensors[ONE].unnamed for s in range(5))


def test_a_reading_that_stands_out_is_pointed_at():
    data = simulate(seed=1)
    spoilt = data.outputs[ONE].copy()
    spoilt[17] += 0.2
    one = trace_whole_plots(replace(data, outputs={ONE: spoilt}), validate=False).sensors[ONE]
    (effect,) = one.effects
    assert (effect.effect, effect.stratum) == ("outliers", "noise")
    assert effect.terms[0].startswith("order 17 at ")
    assert effect.coefficients[0] == pytest.approx(0.2, abs=4 * SUBPLOT)
    assert one.after.residual_mV[17] == pytest.approx(0.2, abs=4 * (SUBPLOT + WHOLE_PLOT))
    json.dumps(effect.to_json(), allow_nan=False)


def test_readings_that_stand_out_neither_hide_nor_make_an_effect():
    bench = Bench((Transducer(cubic=1e-3),), outliers=4, outliers_sd=50.0)
    trace = trace_whole_plots(simulate(bench, seed=2), validate=False).sensors[ONE]
    assert [e.effect for e in trace.effects] == ["pressure-third-order", "outliers"]
    assert len(trace.effects[1].terms) == 4
    assert any("count as three standard deviations" in note for note in trace.notes)


@pytest.mark.parametrize("pressures", ["random", "ascending"])
def test_errors_that_are_remembered_are_no_effect(pressures):
    """Correlation 0.8 from reading to reading; the rates: python -m proving whole-plots clean."""
    found = trace_whole_plots(simulate(Bench(remembered=0.8), Run(pressures=pressures), seed=4), validate=False)
    (effect,) = found.sensors[ONE].effects
    assert (effect.effect, effect.stratum) == ("autocorrelation", "noise")
    assert effect.coefficients[0] == pytest.approx(0.8, abs=0.2)


def test_two_effects_that_hide_each_other_are_both_named():
    """Each moves whole plots' contributions to the other up and down, which the other's standard error allows for."""
    hidden = hide(["gradient", "drift within"], [0.5, 0.5], seed=4)
    found = trace_whole_plots(hidden.data, validate=False)
    assert effects_of(found) == {(ONE, "thermal-gradient"), (ONE, "subplot-drift")}


def test_temperatures_still_settling_are_no_effect():
    run = Run(unsettled=0.1)
    assert not any(effects_of(trace_whole_plots(simulate(Bench(), run, s), validate=False)) for s in range(4))


def test_two_replications_have_offsets_of_their_own():
    pairs = tuple(PAIRS)
    first, second = (simulate(Bench((Transducer(cubic=CUBIC),)), Run(pairs), seed) for seed in (1, 2))
    joined = {
        name: np.concatenate([getattr(first, name), getattr(second, name) + shift])
        for name, shift in (
            ("whole_plot", 20),
            ("order", 220),
            ("elapsed_s", 2e5),
            ("pressure_psia", 0),
            ("sensor_temperature_degC", 0),
            ("sse_temperature_degC", 0),
        )
    }
    both = type(first)(
        **joined,
        outputs={ONE: np.concatenate([first.outputs[ONE], second.outputs[ONE] + 0.2])},
        replicate=np.repeat([1, 2], 220),
    )
    found = trace_whole_plots(both, validate=False)
    assert effects_of(found) == {(ONE, "pressure-third-order")}
    assert found.sensors[ONE].after.fit.sigma_replicate > 0.05


@pytest.mark.parametrize(
    ("pairs", "model"),
    [
        (((0.0, 0.0),) * 4, "1 + P + P^2"),
        (((0.0, 0.0),) * 2, "1 + P"),
        (((-1.0, 0.0), (0.0, 0.0), (1.0, 0.0)) * 2, "P * T_sensor + P^2"),
    ],
    ids=["one temperature", "two whole plots", "one temperature varied"],
)
def test_little_data_is_no_reason_to_fail(pairs, model):
    found = trace_whole_plots(simulate(Bench((Transducer(bend=-1e-3 if "^" in model else 0.0),)), Run(pairs), 1), model)
    json.dumps(found.to_json(), allow_nan=False)
    assert found.sensors[ONE].verdict == "nothing to add"


def test_data_that_cannot_be_judged_are_refused_with_the_reason():
    data = simulate(seed=1)
    with pytest.raises(FormulaError):
        trace_whole_plots(data, "1 + P +")
    with pytest.raises(RankError, match=r"do not determine T_SSE, .* at the 2 pairs of temperatures"):
        trace_whole_plots(simulate(Bench(), Run(((0.0, 0.0), (1.0, 0.0))), seed=1))
    with pytest.raises(ValueError, match="show no error"):
        trace_whole_plots(replace(data, outputs={ONE: 2.0 * data.pressure_psia}), "1 + P")
    with pytest.raises(ValueError, match="one whole plot"):
        trace_whole_plots(data.take(data.whole_plot == 3), "1 + P")


def test_zero_pressure_has_no_reading_error():
    data = simulate(seed=1)
    at_zero = replace(data, pressure_psia=np.where(data.pressure_psia < 0.05, 0.0, data.pressure_psia))
    assert trace_whole_plots(at_zero, validate=False).sensors[ONE].before.reading_error_pct["0"] is None


@pytest.mark.parametrize("effect", PRESSURE_CATALOGUE, ids=lambda effect: effect.name)
def test_entries_are_complete(effect):
    data = simulate(Bench(), Run(interrupted=True), seed=1)
    names = [term.name for term in effect.terms(data)]
    assert names
    assert len(set(names)) == len(names)
    assert all(term.column(scene_of(data)).shape == (220,) for term in effect.terms(data))
    assert effect.cause
    assert effect.separate_by
    assert effect.usual_size
    assert hasattr(data, effect.against)
    assert set(effect.known_aliases) <= {other.name for other in PRESSURE_CATALOGUE} - {effect.name}
    for other in PRESSURE_CATALOGUE:
        if other is not effect:
            # no rule is missing: what is left would be the alias' experiment, which differs from one way to the other
            assert separate_pressure(effect, other) == separate_pressure(other, effect)


def test_the_time_constant_of_a_creep_has_an_interval():
    """Its size had one. The truth's element has 0.3 h; the catalogue has 0.15 and 0.5 h."""
    bench = Bench((replace(Transducer(), creep=4e-3, creep_h=0.3),))
    for seed in (3, 6):
        (effect,) = trace_whole_plots(simulate(bench, seed=seed), validate=False).sensors[ONE].effects
        (constant,) = effect.constants
        low, high = constant["interval_95"]
        assert low < 0.3 * 3600.0 < high < 10.0 * low
        assert low < constant["estimate"] < high
        assert constant["name"] == "time constant"
