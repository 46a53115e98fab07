"""What is said of an effect: its interval is one, its sentence holds what a certificate needs."""

from __future__ import annotations

import base64
from dataclasses import replace
from types import SimpleNamespace

import pytest
from scipy.stats import t as student

from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import on_x
from proving.truth.whole_plot import Bench, Run, Transducer
from proving.truth.whole_plot import simulate as simulate_whole_plots
from rig.fitter.effects.sizes import amplitude, each, relative, size_95
from rig.fitter.trace.outcome import Finding, Outcome, Row
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.evaluate import AttitudeTraced
from rig.procedures.attitude.trace import trace
from rig.procedures.evaluate.certificate import Change, Errors, certificate, with_words
from rig.procedures.present.effect_plots import drawn
from rig.procedures.present.pictures import png
from rig.procedures.present.words import chance, part, percent
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.evaluate import WholePlotTraced
from rig.procedures.pressure.fitted import Declared
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.report import _notes
from rig.procedures.tables.table import Table

EFFECT = Finding(
    kind="effect",
    effect="creep",
    cause="it gives way",
    stratum="point-by-replication",
    coefficients=(2.0, -1.0),
    size="2 ppm",
    p_adjusted=0.003,
    share=0.004,
)
NOISE = replace(EFFECT, kind="noise", stratum="noise", effect="growing", cause="the scatter grows")
REST = Finding("unnamed", "between points", "unnamed", 0.4)
HELPS, LITTLE, HARMS = (Change("the error left out", 3e-4, after, "deg") for after in (2e-4, 2.9e-4, 3.1e-4))


def worded(effect=EFFECT, size="1.9 to 2.1 ppm"):
    return with_words("x_V", effect, [0.1, None], size)


def outcome(findings, after=()):
    return Outcome("x_V", "1 + x", "", findings=findings, before=(), after=after, fitted=(), notes=())


def paragraph(*effects, unnamed=(), left_out=HELPS, hides=""):
    found = outcome((*(worded(effect) for effect in effects), *unnamed))
    changes = [Change("the error", 3e-4, 2e-4, "deg"), Change("that between them", 1.0, 0.5)]
    return certificate(found, Errors(changes, left_out, hides, "1e-4 deg"))


def test_a_size_has_the_interval_of_its_coefficients():
    assert size_95(each("deg/g"), {"y": 1.5e-3}, {"y": 1e-5}, 5.0) == "0.001490 to 0.001510 deg/g"
    assert size_95(each("deg/g"), {"y": -1.5e-3}, {"y": 1e-5}, 5.0) == "-0.001510 to -0.001490 deg/g"
    assert size_95(each(""), {"y": 1e-5}, {"y": 3e-5}, 5.0) == "-0.000020 to 0.000040"
    assert (
        size_95(relative("ppm"), {"y": 1e-4, "z": 2e-4}, {"y": 1e-5, "z": 2e-5}, 5.0)
        == "18.0 to 22.0 ppm, 36.0 to 44.0 ppm"
    )


def test_an_amplitude_has_the_interval_of_both_phases_together():
    """3 and 4 make 5; with an error of 0.5 in each the amplitude's is 0.5 too, whichever way it points."""
    values, halves = {"sin": 3 / 3600, "cos": 4 / 3600}, {"sin": 0.5 / 3600, "cos": 0.5 / 3600}
    assert size_95(amplitude, values, halves, 5.0) == "4.50 to 5.50 arcsec"
    assert size_95(amplitude, {"sin": 0.1 / 3600, "cos": 0.0}, halves, 5.0) == "0.00 to 0.60 arcsec"


def test_an_effects_sentence_stands_alone():
    said = worded()
    assert said.interval_95 == ((1.9, 2.1), None)
    assert said.size_95 == "1.9 to 2.1 ppm"
    assert said.to_json()["interval_95"] == [[1.9, 2.1], None]
    assert said.sentence == (
        "x_V: the declared model lacks creep (it gives way). Its size is 2 ppm (95 % interval 1.9 to 2.1 ppm); it "
        "explains less than 1 % of the error beyond scatter; the probability of anything so clear by chance is 0.003. "
        "Found and sized on the same data."
    )


def test_a_sentence_names_what_looks_alike():
    alike = replace(EFFECT, aliases=("drift", "step", "lag", "cycle", "tilt"), p_adjusted_is_bound=True)
    said = worded(alike, size="").sentence
    assert "(it gives way), or what these data cannot tell from it: drift, step, lag and 2 more. If it is the" in said
    assert "the former, its size is 2 ppm; it explains" in said
    assert "is below 0.003" in said


def test_a_doubtful_name_is_said_to_be_so_before_its_size():
    said = worded(replace(EFFECT, doubtful="a shape without a name explains as much as it does"), size="").sentence
    assert "(it gives way). The name is doubtful: a shape without a name explains as much as it does. Its size" in said


def test_a_finding_about_the_noise_adds_nothing():
    said = worded(replace(EFFECT, kind="noise", stratum="noise"), size="").sentence
    assert said.startswith("x_V: it gives way (2 ppm); ")
    assert said.endswith("nothing is added to the model for it.")


@pytest.mark.parametrize("entry", [*CATALOGUE, *PRESSURE_CATALOGUE], ids=lambda entry: entry.name)
def test_no_effect_of_the_catalogues_makes_a_long_sentence(entry):
    effect = replace(EFFECT, effect=entry.name, cause=entry.cause, aliases=("one", "two", "three", "four"))
    assert max(len(text.split()) for text in worded(effect).sentence.split(". ")) < 60
    assert len(worded(replace(effect, aliases=())).sentence.split()) < 80


def test_a_certificate_says_once_what_all_effects_share():
    said = paragraph(EFFECT, replace(EFFECT, effect="drift", share=1.07), NOISE)
    parts = (
        "x_V: the declared model (1 + x) lacks creep (it gives way). Its size is 2 ppm (95 % interval 1.9 to 2.1 ppm)",
        "It also lacks drift (it gives way). Its size is",
        "it explains all of the error beyond scatter; the probability of anything so clear by chance is 0.003.",
        "The scatter grows (2 ppm); the probability of anything so clear by chance is 0.003; nothing is added to the",
        "With all that was found, the error goes from 0.0003 to 0.0002 deg and that between them from 1 to 0.5. ",
        "The error left out goes from 0.0003 to 0.0002 deg, which supports them. Nothing else",
        " stands out from the noise. ",
        " Readings that repeat one setting scatter by 1e-4 deg. ",
        "Found and sized on the same data; not confirmed by a measurement of its own.",
    )
    places = [said.find(part) for part in parts]
    assert places == sorted(places), said
    assert min(places) == 0
    assert [said.count(part) for part in parts] == [1] * len(parts)


def test_a_certificate_says_what_speaks_against_it():
    grew = "to 0.00031 deg, this grew: the data left out do not confirm what was found"
    assert f"{grew}." in paragraph(EFFECT, left_out=HARMS)
    assert "to 0.00029 deg, which supports it, but weakly: it falls by less than 20 %." in paragraph(
        EFFECT, left_out=LITTLE
    )
    assert f"{grew} (which cannot tell). " in paragraph(EFFECT, left_out=HARMS, hides="which cannot tell")
    assert "to 0.0002 deg, which cannot tell. " in paragraph(EFFECT, hides="which cannot tell")
    same = Change("the error left out", 3e-4, 3e-4, "deg")
    assert "to 0.0003 deg, this did not fall: the data left out do not" in paragraph(EFFECT, left_out=same)
    said = paragraph(EFFECT, unnamed=[REST], left_out=None)
    assert ". Unexplained: 40 % of the error beyond scatter, between points. Readings" in said
    assert "Nothing else" not in said


@pytest.mark.parametrize(
    ("p", "said"),
    [
        (0.03, "T_bias is 1.16, above its 95 % limit of 1.14: by chance this happens in 5 % of sensors; "),
        (1e-4, "T_bias is 1.16, above its 95 % limit of 1.14, by more than chance (p 0.0001): lack of fit is left "),
    ],
)
def test_a_test_beyond_its_limit_is_reconciled_with_nothing_else_standing_out(p: float, said: str) -> None:
    after = {"T_bias": 1.16, "F_bias_95": 1.14, "p_bias": p, "T_b": 0.5, "T_S": 0.5, "F_bS_95": 2.0}
    for findings in ((worded(),), ()):
        found = outcome(findings, tuple(Row(*pair) for pair in after.items()))
        assert said in certificate(found, Errors([HELPS], HELPS))
        within = outcome(findings, tuple(Row(*pair) for pair in {**after, "T_bias": 1.0}.items()))
        assert "T_bias" not in certificate(within, Errors([HELPS], HELPS))


def test_a_left_out_error_of_whole_plots_that_grows_is_noted() -> None:
    data = simulate_whole_plots(Bench((Transducer(hysteresis=5e-3),)), Run(), 1)
    found = trace_whole_plots(data).sensors["bridge_1_mV"]
    worse, better = (replace(found.after, cv_rms=times * found.before.cv_rms) for times in (1.35, 0.9))
    told, untold = ([*_notes(SimpleNamespace(), found.before, one, found.effects, 0)] for one in (worse, better))
    assert any(one.startswith("not confirmed by whole plots left out: ") and "135%" in one for one in told)
    assert not any("not confirmed" in one for one in untold)


def test_a_certificate_says_that_nothing_was_found():
    said = paragraph()
    assert said == (
        "x_V: no effect beyond the declared model (1 + x) stands out from the noise. The error is 0.0003 deg. That "
        "between them is 1. The error left out is 0.0003 deg. Readings that repeat one setting scatter by 1e-4 deg."
    )
    assert "stands out from the noise, which is not what the model assumes. The scatter grows (2 ppm); " in paragraph(
        NOISE
    )
    said = paragraph(unnamed=[REST])
    assert said.startswith(
        "x_V: no effect that was looked for explains what the declared model (1 + x) leaves. The error is"
    )
    assert "Found and sized" not in said
    said = paragraph(unnamed=[replace(REST, added=True)])
    assert "With all that was found, the error goes from" in said
    assert "Without a name: 40 % of the error beyond scatter, between points." in said


def test_what_is_too_small_to_tell_is_told_as_that():
    assert chance({"p_adjusted": 1e-40}) == "< 1e-06"
    assert [percent(share) for share in (0.0, 0.004, 0.01, 0.579)] == ["0 %", "less than 1 %", "1 %", "57 %"]
    assert [part(share) for share in (0.004, 0.989, 0.995, 1.0)] == ["less than 1 %", "98 %", "nearly all", "all"]


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
    free = data.replicates.size - 2  # replications less their mean and the effect: 4.30 for four, 2.78 for six
    assert (high - low) / (2 * stderr) == pytest.approx(student.ppf(0.975, free))


def test_an_effect_of_a_transducer_has_interval_sentence_and_figure():
    """5e-3 mV to each side were put in; whole plots' own errors are no witness against what varies within them."""
    data = simulate_whole_plots(Bench((Transducer(hysteresis=5e-3),)), Run(), 1)
    table = Table("run", {"pressure_psia": data.pressure_psia}, True, {})
    traced = WholePlotTraced(table, data, trace_whole_plots(data), {}, Declared.of(table, None, data))
    found = traced.to_json()["sensors"]["bridge_1_mV"]
    (effect,) = found["effects"]
    assert effect["effect"] == "hysteresis"
    low, high = effect["interval_95"][0]
    assert low < 5e-3 < high
    assert effect["size_95"] == f"{low:.4f} to {high:.4f} mV to each side"
    assert effect["sentence"].removeprefix("bridge_1_mV: the declared model ")[:30] in found["certificate"]
    assert "the whole plots' own errors included, which effects within them do not change" in found["certificate"]
    before, after = (found[side]["cv_rms"] for side in ("before", "after"))
    assert ("this grew: the data left out do not confirm" in found["certificate"]) == (after > before)
    assert "bear it out" not in found["certificate"]
    (figure,) = drawn(traced.outcomes[0].figures).values()
    assert base64.b64decode(png(figure)).startswith(b"\x89PNG")
