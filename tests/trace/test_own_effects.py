"""A laboratory's own effects: written as formulas, found by their name, refused with a reason where they are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, simulate
from proving.truth.whole_plot import simulate as simulate_pressure
from rig.effects import laboratory_effects
from rig.errors import ConfigurationError
from rig.fitter.effects.entry import Largest
from rig.fitter.effects.own import own_effects
from rig.procedures.attitude.effects import CATALOGUE, Effect
from rig.procedures.attitude.effects.own import GRAMMAR as OF_ATTITUDE
from rig.procedures.attitude.trace import trace
from rig.procedures.errors import DataError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.own import GRAMMAR as OF_PRESSURE
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.trace import trace_whole_plots

DRAUGHT = """
[[effect]]
name = "draught"
cause = "a draught from the door"
scope = "sensor"
stratum = "between-point"
unit = "V"
columns = ["exp(cos(pitch))*sin(3*roll)"]
separate_by = "close the door"
usual_size = "1e-5 V"
"""

GRAMMARS = (OF_ATTITUDE, OF_PRESSURE)


def attitude_catalogue() -> tuple[Effect, ...]:
    return with_own(CATALOGUE, laboratory_effects(), Effect)


def pressure_catalogue() -> tuple[PressureEffect, ...]:
    return with_own(PRESSURE_CATALOGUE, laboratory_effects(), PressureEffect)


def test_what_a_laboratory_adds_is_found_by_its_name(tmp_path, monkeypatch):
    file = tmp_path / "effects.toml"
    file.write_text(DRAUGHT)
    monkeypatch.setenv("RIG_EFFECTS", str(file))
    data, _ = simulate(Bench(), D1(180, 13, 13), seed=1)
    draught = 2e-5 * np.exp(np.cos(np.radians(data.pitch_deg))) * np.sin(3 * np.radians(data.roll_deg))
    data = replace(data, outputs={**data.outputs, "x_V": data.outputs["x_V"] + draught})
    (effect,) = trace(data, attitude_catalogue()).sensors["x_V"].effects
    assert effect.effect == "draught"
    assert effect.coefficients[0] == pytest.approx(2e-5, abs=4 * effect.stderr[0])
    assert effect.separate_by.startswith("close the door")


def test_without_a_file_the_catalogue_is_ours(monkeypatch):
    monkeypatch.delenv("RIG_EFFECTS", raising=False)
    assert attitude_catalogue() == CATALOGUE


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("sin(3*roll)", "open('x')"), "not understood"),
        (("sin(3*roll)", "sin(3*rool)"), "rool"),
        (("sin(3*roll)", "sin(3*"), "draught: a column is not understood: something is missing at the end"),
        (("sin(3*roll)", "sin(roll, 3)"), r"sin\(\) takes one value"),
        (("sin(3*roll)", "(" * 41 + "roll" + ")" * 41), "nested more than 40 deep"),
        (("sin(3*roll)", "C(roll)"), "there is no function C here"),
        (("sin(3*roll)", "roll.real"), "roll.real"),
        (('scope = "sensor"', 'scope = "rig"'), "scope is sensor or package"),
        (('unit = "V"', ""), "missing or unknown: unit"),
        (('name = "draught"', 'name = "cross-axis"'), "two effects are called cross-axis"),
        (("[[effect]]", "[[effects]]"), "nothing else"),
        (("exp(cos(pitch))*sin(3*roll)", "sin"), "not understood"),
        (('unit = "V"', "unit = 3"), "unit is a text"),
        (('["exp(cos(pitch))*sin(3*roll)"]', "[1]"), "a text of up to"),
        (('["exp(cos(pitch))*sin(3*roll)"]', "[]"), "a list of formulas"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, monkeypatch, change, says):
    file = tmp_path / "effects.toml"
    file.write_text(DRAUGHT.replace(*change))
    monkeypatch.setenv("RIG_EFFECTS", str(file))
    with pytest.raises((ConfigurationError, DataError), match=says):
        attitude_catalogue()
    assert own_effects(DRAUGHT, GRAMMARS).effects[0].name == "draught"


STICKING = """
[[effect]]
name = "sticking-diaphragm"
cause = "the diaphragm gives way in waves"
scope = "sensor"
stratum = "subplot"
unit = "mV"
columns = ["sin(6.2832*P/1.7)"]
separate_by = "read pressures in steps of 0.1 psi"
usual_size = "1e-2 mV"
"""


def test_an_effect_of_transducers_can_be_added_too(tmp_path, monkeypatch):
    file = tmp_path / "effects.toml"
    file.write_text(DRAUGHT + STICKING)
    monkeypatch.setenv("RIG_EFFECTS", str(file))
    assert [effect.name for effect in attitude_catalogue()[len(CATALOGUE) :]] == ["draught"]
    assert [effect.name for effect in pressure_catalogue()[len(PRESSURE_CATALOGUE) :]] == ["sticking-diaphragm"]
    data = simulate_pressure(seed=2)
    (name,) = data.transducers
    waves = 0.03 * np.sin(2 * np.pi * data.pressure_psia / 1.7)
    data = replace(data, outputs={name: data.outputs[name] + waves})
    (effect,) = trace_whole_plots(data, "full", pressure_catalogue()).sensors[name].effects
    assert effect.effect == "sticking-diaphragm"
    assert effect.coefficients[0] == pytest.approx(0.03, abs=4 * effect.stderr[0])
    with pytest.raises(ValueError, match="scope is sensor or line"):
        own_effects(STICKING.replace('scope = "sensor"', 'scope = "package"'), GRAMMARS)


@pytest.mark.parametrize("formula", ["0/0", "9**9**9**9*pitch", "(-1)**0.5*pitch", "1/(roll-roll)"])
def test_a_column_that_is_no_number_is_refused_by_its_text(formula):
    (effect,) = own_effects(DRAUGHT.replace("exp(cos(pitch))*sin(3*roll)", formula), GRAMMARS).effects
    data, _ = simulate(Bench(), D1(180, 5, 5, replications=2), seed=1)
    with pytest.raises(ValueError, match="effect's column"):
        trace(data, (effect,), validate=False)


def test_a_bound_that_whole_plots_do_not_ask_is_refused():
    with pytest.raises(ValueError, match="is at_most, not largest"):
        replace(PRESSURE_CATALOGUE[0], largest=Largest(1.0, "1 psi"))
