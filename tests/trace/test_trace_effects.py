"""Every effect of the catalogue, made by rotations and physics in `proving/truth`, must be found by its name.

One scenario an effect at least; a catalogue entry without a scenario fails `test_every_effect_has_a_scenario`.
"""

import re
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, Plan, Sensor, simulate, told_the_truth
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized
from rig.procedures.attitude.effects import CATALOGUE, separate
from rig.procedures.attitude.effects.effect import PREREQUISITES
from rig.procedures.attitude.evaluate import attitude_sentence
from rig.procedures.attitude.trace import trace

X, Y, Z = "x_V", "y_V", "z_V"
SMALL = D1(180, 13, 13, replications=4)


def on_x(**errors):
    return (Sensor("x", **errors), Sensor("y"), Sensor("z"))


@dataclass(frozen=True)
class Scenario:
    """What is wrong with a bench, and the only thing that may be reported for it, by sensor."""

    effect: str
    bench: Bench
    sensors: tuple[str, ...]
    coefficient: float | None = None
    """Of the first term on the first sensor."""
    options: dict = field(default_factory=dict)
    plan: Plan = SMALL
    size: str = ""
    """Of the cause, exactly; the tests allow what noise does to it."""


PAD = "isolation-pad-deflection"
# deg per g about y by weight along x, on an x sensor of 5 V/g: S c/2 times sin 2a cos R, in volts
SAG = 8e-4
NUMBER = re.compile(r"(?<![\^\w])-?\d[\d.]*(?:e-?\d+)?")
SAG_V = 5.0 * np.radians(SAG) / 2

SCENARIOS = {
    "pads, in the pitch plane": Scenario(PAD, Bench(compliance={("y", "x"): SAG}), (X, Z), SAG_V, size="8.00e-4 deg/g"),
    "pads, in two planes": Scenario(
        PAD,
        Bench(compliance={("y", "x"): SAG, ("z", "x"): 5e-4}),
        (X, Y, Z),
        size="8.00e-4 deg/g (about y by weight along x), 5.00e-4 deg/g (about z by weight along x)",
    ),
    "pads, by weight across": Scenario(PAD, Bench(compliance={("y", "z"): SAG}), (X, Z), size="8.00e-4 deg/g"),
    "offset and temperature": Scenario(
        "offset-temperature", Bench(sensors=on_x(b_per_degC=5e-5)), (X,), 5e-5, size="50 uV/degC"
    ),
    "sensitivity and temperature": Scenario(
        "sensitivity-temperature", Bench(sensors=on_x(S_per_degC=2e-5)), (X,), 1e-4, size="20 ppm/degC"
    ),
    "offset and time": Scenario("offset-drift", Bench(sensors=on_x(b_per_h=2e-6)), (X,), 2e-6, size="2 uV/h"),
    "sensitivity and time": Scenario(
        "sensitivity-drift", Bench(sensors=on_x(S_per_h=8e-7)), (X,), 4e-6, size="0.8 ppm/h"
    ),
    "an interruption": Scenario(
        "offset-step", Bench(sensors=on_x(b_step=3e-5)), (X,), 3e-5, options={"break_at": 0.4}, size="30 uV"
    ),
    "backlash of pitch": Scenario(
        "backlash-pitch", Bench(pitch_backlash_deg=3e-4), (X, Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "backlash of roll": Scenario("backlash-roll", Bench(roll_backlash_deg=3e-4), (Y, Z), 3e-4, size="1.08 arcsec"),
    "square": Scenario("sensor-second-order", Bench(sensors=on_x(quadratic=4e-6)), (X,), 2e-5, size="4 ug/g^2"),
    "cube": Scenario("sensor-third-order", Bench(sensors=on_x(cubic=6e-6)), (X,), 3e-5, size="6 ug/g^3"),
    "product": Scenario("cross-axis", Bench(sensors=on_x(cross=1e-5)), (X,), 2.5e-5, size="10 ug/g^2"),
    "pitch scale, once": Scenario(
        "head-once-per-turn", Bench(pitch_error_deg=(3e-4, 0, 0, 0)), (X, Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "pitch scale, once, both phases": Scenario(
        "head-once-per-turn", Bench(pitch_error_deg=(2e-4, 2e-4, 0, 0)), (X, Y, Z), 2e-4, size="1.018 arcsec"
    ),
    "pitch scale, twice": Scenario(
        "head-twice-per-turn", Bench(pitch_error_deg=(0, 0, 3e-4, 0)), (X, Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "pitch scale, twice, cosine": Scenario(
        "head-twice-per-turn", Bench(pitch_error_deg=(0, 0, 0, 3e-4)), (X, Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "roll scale, once": Scenario(
        "roll-head-once-per-turn", Bench(roll_error_deg=(3e-4, 0, 0, 0)), (Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "roll scale, once, cosine": Scenario(
        "roll-head-once-per-turn", Bench(roll_error_deg=(0, 3e-4, 0, 0)), (Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "roll scale, twice": Scenario(
        "roll-head-twice-per-turn", Bench(roll_error_deg=(0, 0, 3e-4, 0)), (Y, Z), 3e-4, size="1.08 arcsec"
    ),
    "roll scale, twice, cosine": Scenario(
        "roll-head-twice-per-turn", Bench(roll_error_deg=(0, 0, 0, 3e-4)), (Y, Z), 3e-4, size="1.08 arcsec"
    ),
}


def test_every_effect_has_a_scenario():
    of_any_size = {hidden.effect for hidden in HIDDEN.values()}
    assert of_any_size == {effect.name for effect in CATALOGUE}
    assert {scenario.effect for scenario in SCENARIOS.values()} <= of_any_size


NEW = [name for name, hidden in HIDDEN.items() if hidden.effect not in {s.effect for s in SCENARIOS.values()}]


@pytest.mark.parametrize("name", NEW)
def test_effect_of_one_standard_deviation_is_named_and_predicted(name):
    """Nothing else is reported; and outputs are predicted as they are without noise, not as the column has them."""
    hidden = HIDDEN[name]
    bench = sized(name, 1.0, SMALL)
    data, truth = simulate(bench, SMALL, seed=2, **hidden.options)
    found = trace(data, validate=False)
    classes = [{e.effect, *e.aliases} for t in found.sensors.values() for e in t.added]
    assert classes
    assert all(hidden.effect in one for one in classes)
    predicted, told = found.predict(data), {s: told_the_truth(bench, [CLEAN], data, s) for s in data.sensors}
    wrong, least = (np.sqrt(np.mean([(p[s] - truth[s]) ** 2 for s in data.sensors])) for p in (predicted, told))
    assert wrong < 1.6 * least


AS_GOOD = {"offset and temperature", "offset and time", "cube", "roll scale, once", "roll scale, once, cosine"}
"""Small or of the lowest order over their variable: a smooth shape over it is as likely, and the name is doubtful."""


@pytest.mark.parametrize("name", SCENARIOS)
def test_effect_is_named(name):
    scenario = SCENARIOS[name]
    data, _ = simulate(scenario.bench, scenario.plan, seed=1, **scenario.options)
    found = trace(data, validate=False)
    assert {s: {e.effect for e in t.added} for s, t in found.sensors.items() if t.added} == {
        s: {scenario.effect} for s in scenario.sensors
    }
    first = found.sensors[scenario.sensors[0]]
    effect = first.added[0]
    if name in AS_GOOD:
        assert first.verdict == "partly explained"
        assert "shape without a name" in (effect.doubtful or "")
        assert f"doubtful: {effect.effect} (" in attitude_sentence(scenario.sensors[0], first)
    else:
        assert (first.verdict, effect.doubtful) == ("explained", None)
    assert effect.p_adjusted < 0.035
    assert effect.share > 0.85
    assert np.std(first.residual_after_V) < np.std(first.residual_before_V)
    assert NUMBER.sub("#", effect.size) == NUMBER.sub("#", scenario.size)
    sizes = [[float(n) for n in NUMBER.findall(text)] for text in (effect.size, scenario.size)]
    np.testing.assert_allclose(*sizes, rtol=0.15)
    assert effect.to_json()["size"] == effect.size
    if scenario.coefficient is not None:
        assert abs(effect.coefficients[0] - scenario.coefficient) < 5 * effect.stderr[0] + 0.01 * scenario.coefficient


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_entries_are_complete(effect):
    data, _ = simulate(Bench(), D1(60, 7, 9, replications=2), seed=0, break_at=0.5)
    assert effect.cause
    assert effect.separate_by
    assert effect.usual_size
    assert set(effect.needs) <= set(PREREQUISITES)
    assert set(effect.known_aliases) <= {other.name for other in CATALOGUE} - {effect.name}
    assert all(alias.when and alias.separate_by for alias in effect.known_aliases.values())
    assert hasattr(data, effect.against)
    names = [term.name for term in effect.terms(data)]
    assert names
    assert len(set(names)) == len(names)


def test_effects_are_found_by_the_axis_told_not_by_the_name():
    """A cross-axis term is that of the sensor's own axis, whatever its channel is called."""
    data, _ = simulate(Bench(sensors=on_x(cross=1e-5)), SMALL, seed=1)
    swapped = {"y_1": data.outputs[X], "z_1": data.outputs[Y], "x_1": data.outputs[Z]}
    found = trace(replace(data, outputs=swapped, axes={"y_1": "x", "z_1": "y", "x_1": "z"}), validate=False)
    assert {s: t.declared for s, t in found.sensors.items()} == {
        "y_1": "attitude-x",
        "z_1": "attitude-y",
        "x_1": "attitude-z",
    }
    (effect,) = found.sensors["y_1"].added
    assert effect.effect == "cross-axis"
    assert effect.terms == trace(data, validate=False).sensors[X].added[0].terms


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_every_pair_can_be_told_apart_by_something_about_that_pair(effect):
    for other in CATALOGUE:
        if other is effect:
            continue
        told, back = separate(effect, other), separate(other, effect)
        # no rule is missing: what is left would be the alias' experiment, which differs from one way to the other
        assert told == back or {effect.name, other.name} & {*effect.known_aliases, *other.known_aliases}
        kinds = {effect.source, other.source}
        assert "pads" not in told or "package" in kinds
        assert "sag" not in told or "package" in kinds
        in_time = {one.stratum for one in (effect, other)} != {"between-point"}
        assert "temperature" not in told or in_time
        assert "backlash" not in told or kinds & {"pitch axis", "roll axis"}
        assert "voltage standard" not in told or "voltmeter" in kinds


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        ("head-once-per-turn", "head-twice-per-turn", r"beyond \+-30 deg of pitch"),
        ("roll-head-twice-per-turn", "roll-head-once-per-turn", r"beyond \+-30 deg of roll"),
        ("sensor-second-order", "sensor-third-order", "cube changes sign"),
        ("offset-temperature", "sensitivity-drift", "another enclosure temperature"),
        ("isolation-pad-deflection", "offset-drift", "stays with the point"),
        ("backlash-roll", "sensitivity-temperature", "once from each side"),
        ("head-twice-per-turn", "isolation-pad-deflection", "stays with the head"),
        ("offset-step", "sensitivity-temperature", "without an interruption"),
        ("cross-axis", "sensor-third-order", "across"),
        ("offset-temperature", "offset-drift", "another enclosure temperature"),
    ],
)
def test_what_tells_two_apart(first, second, says):
    by_name = {effect.name: effect for effect in CATALOGUE}
    assert re.search(says, separate(by_name[first], by_name[second]))
    assert re.search(says, separate(by_name[second], by_name[first]))


def test_periods_of_the_head_over_a_small_range_are_told_apart_by_a_larger_one():
    plan = Plan(np.linspace(-30, 30, 25), np.array([0.0]))
    data, _ = simulate(Bench(sensors=(Sensor("x"),), pitch_error_deg=(0, 0, 2e-3, 0)), plan, seed=1)
    (effect,) = trace(data, validate=False).sensors[X].added
    assert {"head-once-per-turn", "head-twice-per-turn"} <= {effect.effect, *effect.aliases}
    for alias in effect.aliases:
        by_name = {entry.name: entry for entry in CATALOGUE}
        assert separate(by_name[effect.effect], by_name[alias]) in effect.separate_by


def test_a_slip_within_a_replication_is_placed_for_a_sensor_that_does_not_show_every_turn():
    """An x sensor does not see a turn about its own axis, so that only two of the three columns are left."""
    plan = D1(90, 13, 5)
    data, _ = simulate(CLEAN, plan, 5)
    x = replace(data, outputs={"x_V": data.outputs["x_V"]}, axes={"x_V": "x"})
    half = x.elapsed_s >= np.median(x.elapsed_s[x.replicate == 2])
    tilt = np.cos(np.radians(x.pitch_deg)) * np.cos(np.radians(x.roll_deg)) * 5.0 * np.radians(0.004)
    slipped = replace(x, outputs={"x_V": x.outputs["x_V"] + tilt * half})
    found = [e for e in trace(slipped, validate=False).sensors["x_V"].added if e.effect == "mounting-slip-unrecorded"]
    assert found
