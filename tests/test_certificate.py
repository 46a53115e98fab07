"""What is said of an effect: its interval is one, its sentence holds what a certificate needs."""

from __future__ import annotations

import base64
from dataclasses import replace

import pytest
from attitude_hidden import on_x
from attitude_truth import D1, simulate
from whole_plot_truth import Bench, Run, Transducer
from whole_plot_truth import simulate as simulate_whole_plots

from fitter.effects.sizes import amplitude, each, relative
from fitter.trace import trace, trace_whole_plots
from rig.closed_loop import AttitudeTraced, WholePlotTraced
from rig.closed_loop.certificate import Change, size_95, with_words
from rig.report.whole_plot_effects import effect_figures
from rig.report.words import chance, percent
from rig.tables import Table

EFFECT = {
    "effect": "creep",
    "cause": "it gives way",
    "stratum": "point-by-replication",
    "coefficients": [2.0, -1.0],
    "size": "2 ppm",
    "p_adjusted": 0.003,
    "p_adjusted_is_bound": False,
    "share": 0.004,
    "aliases": [],
}


def worded(effect=EFFECT, left_out=None, remains=(), size="1.9 to 2.1 ppm"):
    return with_words(
        "x_V",
        {**effect},
        [0.1, None],
        size,
        [Change("the error goes", 3e-4, 2e-4, "deg")],
        left_out,
        remains,
        "1e-4 deg",
    )


def test_a_size_has_the_interval_of_its_coefficients():
    assert size_95(each("deg/g"), {"y": 1.5e-3}, {"y": 1e-5}, 5.0) == "1.49e-3 to 1.51e-3 deg/g"
    assert size_95(each("deg/g"), {"y": -1.5e-3}, {"y": 1e-5}, 5.0) == "-1.51e-3 to -1.49e-3 deg/g"
    assert size_95(each(""), {"y": 1e-5}, {"y": 3e-5}, 5.0) == "-2.00e-5 to 4.00e-5"
    assert size_95(relative("ppm"), {"y": 1e-4, "z": 2e-4}, {"y": 1e-5, "z": 2e-5}, 5.0) == "18 to 22 ppm, 36 to 44 ppm"


def test_an_amplitude_has_the_interval_of_both_phases_together():
    """3 and 4 make 5; with an error of 0.5 in each the amplitude's is 0.5 too, whichever way it points."""
    values, halves = {"sin": 3 / 3600, "cos": 4 / 3600}, {"sin": 0.5 / 3600, "cos": 0.5 / 3600}
    assert size_95(amplitude, values, halves, 5.0) == "4.5 to 5.5 arcsec"
    assert size_95(amplitude, {"sin": 0.1 / 3600, "cos": 0.0}, halves, 5.0) == "0 to 0.6 arcsec"


def test_a_sentence_holds_what_a_certificate_needs():
    said = worded(left_out=Change("that left out", 3.1e-4, 2.2e-4, "deg"))
    assert said["interval_95"] == [[1.9, 2.1], None]
    assert said["size_95"] == "1.9 to 2.1 ppm"
    for part in (
        "lacks creep (it gives way). Its size is 2 ppm (95 % interval 1.9 to 2.1 ppm, conditional on the selection)",
        "explains less than 1 % of the error in excess of scatter",
        "over all that was searched, is 0.003",
        "the error goes from 0.0003 to 0.0002 deg, that left out from 0.00031 to 0.00022 deg.",
        "Beside that nothing stands out from the noise; readings that repeat one setting scatter by 1e-4 deg. ",
        "not confirmed by a measurement of its own.",
    ):
        assert part in said["sentence"]
    assert "bear it out" not in said["sentence"]


def test_a_sentence_says_what_speaks_against_it():
    said = worded(
        {**EFFECT, "aliases": ["drift", "step"], "p_adjusted_is_bound": True},
        left_out=Change("that left out", 3.1e-4, 3.2e-4, "deg"),
        remains=[{"share": 0.4, "where": "between points"}],
    )["sentence"]
    assert "or what these data cannot tell from it: drift, step. If it is the former, its size is" in said
    assert "is below 0.003" in said
    assert "from 0.00031 to 0.00032 deg, which does not bear it out." in said
    assert "Unexplained remains: 40 % of the excess, between points;" in said


def test_a_finding_about_the_noise_adds_nothing():
    said = worded({**EFFECT, "stratum": "noise"}, size="")["sentence"]
    assert said.startswith("x_V: it gives way (2 ppm; ")
    assert said.endswith("nothing is added to the model for it.")


def test_what_is_too_small_to_tell_is_told_as_that():
    assert chance({"p_adjusted": 1e-40}) == "< 1e-06"
    assert [percent(part) for part in (0.0, 0.004, 0.006, 0.9951)] == ["0 %", "less than 1 %", "1 %", "100 %"]


def test_an_effect_that_is_constant_in_replications_is_known_no_better_than_they_agree():
    """1.6e-4 V were put in; replications have offsets of their own, by which readings alone are off several errors."""
    bench = replace(on_x(b_pitch_side=1.6e-4), offset_sd=1.0)
    data, _ = simulate(bench, D1(90, 13, 13), 1000)
    traced = AttitudeTraced(Table("night", {"pitch_deg": data.pitch_deg}, True, {}), data, trace(data, validate=False))
    effect = next(e for e in traced.to_json()["sensors"]["x_V"]["effects"] if e["effect"] == "hysteresis-pitch")
    (low, high), (stderr,), (value,) = effect["interval_95"][0], effect["stderr"], effect["coefficients"]
    assert low < 1.6e-4 < high
    assert abs(value - 1.6e-4) < 3 * stderr
    assert low + high == pytest.approx(2 * value)


def test_an_effect_of_a_transducer_has_interval_sentence_and_figure():
    """5e-3 mV to each side were put in; whole plots' own errors are no witness against what varies within them."""
    data = simulate_whole_plots(Bench((Transducer(hysteresis=5e-3),)), Run(), 1)
    table = Table("run", {"pressure_psia": data.pressure_psia}, True, {})
    traced = WholePlotTraced(table, data, trace_whole_plots(data), {})
    (effect,) = traced.to_json()["sensors"]["bridge_1_mV"]["effects"]
    assert effect["effect"] == "hysteresis"
    low, high = effect["interval_95"][0]
    assert low < 5e-3 < high
    assert effect["size_95"] == f"{low * 1e3:.2f}e-3 to {high * 1e3:.2f}e-3 mV to each side"
    assert "their own error included, from" in effect["sentence"]
    assert "bear it out" not in effect["sentence"]
    (figure,) = effect_figures(traced, "bridge_1_mV").values()
    assert base64.b64decode(figure).startswith(b"\x89PNG")
