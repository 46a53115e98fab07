"""What remembers the last extreme, or gets used to its work, is said, and no name that it looks like stands alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proving.truth import whole_plot
from proving.truth.attitude import D1, simulate
from proving.truth.attitude_hidden import CLEAN, sized
from rig.fitter.trace.engine import family
from rig.fitter.trace.latches import latches
from rig.procedures.attitude.trace import trace
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table

X, BRIDGE = "x_V", "bridge_1_mV"


def leaned(up, order, tip):
    """1 where the last tip beyond a limit was up, 0 where it was down."""
    state, out = 0.0, np.empty(len(up))
    for k in order:
        state = 1.0 if up[k] > tip else 0.0 if up[k] < -tip else state
        out[k] = state
    return out


def test_a_latch_keeps_its_state_between_its_limits():
    values = np.array([0.0, 0.5, 1.0, 0.6, 0.4, 0.1, 0.5])
    wide = latches(values, np.arange(7))[:, 0]
    assert wide.tolist() == [0, -1, 0, 1, 1, 0, -1]
    turned = latches(values[::-1], np.arange(7)[::-1])[:, 0]
    assert turned[::-1].tolist() == wide.tolist()
    assert latches(np.ones(7), np.arange(7)).shape == (7, 0)
    assert latches(np.linspace(0.0, 1.0, 40), np.arange(40)).shape == (40, 0)  # it rises once: a step in time


def test_a_loose_part_that_stays_where_it_fell_is_no_pad():
    """It leans on the sensor or not, as the last strong tip across the sensor left it."""
    data, truth = simulate(CLEAN, D1(180, 13, 13, replications=4), seed=1)
    pitch, roll = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    across = np.cos(pitch) * np.cos(roll)
    leans = leaned(across, np.argsort(data.order), 0.4) * (np.sin(pitch) + 0.4)
    sd = float(np.std(data.outputs[X] - truth[X]))
    outputs = {**data.outputs, X: data.outputs[X] + 1.5 * sd * leans / np.std(leans)}
    sensor = trace(replace(data, outputs=outputs), validate=False).sensors[X]
    assert all(effect.doubtful for effect in sensor.effects if effect.stratum != "noise")
    assert any("after the last strong tip along" in one.cause for one in sensor.unnamed)


def traced(columns, **told):
    return trace_general(roles_of(Table("table.csv", columns, simulated=True, provenance={}), Roles(**told))[0])


def test_a_spring_that_snaps_is_said_to_follow_the_last_extreme(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)
    rng = np.random.default_rng(5)
    x = rng.uniform(-5.0, 5.0, 120)
    y = 3.0 + 2.0 * x + 2.0 * leaned(x, np.arange(120), 2.5) + rng.standard_normal(120)
    columns = {"t_s": np.arange(120.0) * 60.0, "x": x, "y": y}
    result = traced(columns, response="y", formula="1 + x", time="t_s")
    assert all(effect.doubtful for effect in result.added)
    assert any(one.cause == "after the last extreme of x" for one in result.unnamed)


def of_two_people(off, turn):
    """A table that two people measured by turns, some rows each, and what the trace says of it."""
    rng = np.random.default_rng([2, 7])
    n = 90
    who = np.arange(n) // turn % 2
    x, t = rng.permutation(np.linspace(-5.0, 5.0, n)), np.cumsum(60.0 + 5.0 * rng.random(n))
    y = 3.0 + 2.0 * x + off(who, t) + rng.standard_normal(n)
    columns = {"t_s": t, "x": x, "operator": 1.0 + who, "y": y}
    result = traced(columns, response="y", formula="1 + x", time="t_s", group=("operator",))
    return result.verdict, {effect.effect: effect.doubtful for effect in result.added}


def test_a_beginner_who_gets_better_is_no_warm_up(monkeypatch):
    """His readings are off, less with each one: an offset of his and a warm-up of the instrument look like that."""
    monkeypatch.setattr(family, "MOST", 500)
    verdict, names = of_two_people(lambda who, _t: 9.0 * (who == 0) / np.sqrt(np.maximum(np.cumsum(who == 0), 1)), 9)
    assert verdict == "partly explained"
    assert all(names.values())


def test_a_warm_up_beside_an_offset_of_a_person_is_what_it_is(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)
    verdict, names = of_two_people(lambda who, t: 2.5 * who + 5.0 * np.exp(-t / 900.0), 3)
    assert verdict == "explained"
    assert names == {"group-offset:operator": None, "warm-up:t_s": None}


def test_a_range_that_a_meter_leaves_late_is_said_to_follow_the_last_extreme():
    data = whole_plot.simulate(seed=31)
    p = data.pressure_psia
    low = leaned(p - 0.5 * np.ptp(p), np.argsort(data.order), 0.2 * np.ptp(p))
    outputs = {BRIDGE: data.outputs[BRIDGE] + 1.5 * whole_plot.SUBPLOT * low}
    found = trace_whole_plots(replace(data, outputs=outputs), validate=False).sensors[BRIDGE]
    assert [one.cause for one in found.unnamed] == ["within whole plots, after the last extreme of the pressure"]
    assert not found.effects


def test_what_a_channel_keeps_of_the_one_before_it_is_no_hysteresis_alone():
    """The foil of a hold capacitor gives back a part of another sensor's voltage in the row before."""
    data, truth = simulate(CLEAN, D1(180, 13, 13, replications=4), seed=1)
    rows = np.argsort(data.order)
    kept = np.zeros(len(rows))
    kept[rows[1:]] = data.outputs["z_V"][rows[:-1]] - np.mean(data.outputs["z_V"])
    sd = float(np.std(data.outputs[X] - truth[X]))
    outputs = {**data.outputs, X: data.outputs[X] + 1.5 * sd * kept / np.std(kept)}
    sensor = trace(replace(data, outputs=outputs), validate=False).sensors[X]
    assert all(effect.doubtful for effect in sensor.effects if effect.stratum != "noise")
    assert any("after the attitudes before" in one.cause for one in sensor.unnamed)


def test_what_happens_only_when_a_range_has_just_changed_is_said(monkeypatch):
    """A relay that was just thrown has a thermal voltage: nothing to add, before."""
    monkeypatch.setattr(family, "MOST", 500)
    rng = np.random.default_rng(3)
    n = 120
    span = 1.0 + (np.cumsum(rng.random(n) < 0.25) % 3)
    just = np.concatenate([[False], np.diff(span) != 0])
    x = rng.permutation(np.linspace(-5.0, 5.0, n))
    y = 3.0 + 2.0 * x + 2.0 * just + rng.standard_normal(n)
    columns = {"t_s": np.arange(n) * 60.0, "x": x, "range": span, "y": y}
    result = traced(columns, response="y", formula="1 + x", time="t_s")
    assert all(effect.doubtful for effect in result.added)
    assert any(one.cause == "in rows where range has just changed" for one in result.unnamed)


def test_a_cause_of_all_sensors_is_doubtful_where_one_of_them_still_has_a_period():
    """What a press next door does while it holds is seen in one sensor, and may be what another one shows."""
    plan = D1(180, 13, 13, replications=4)
    data, truth = simulate(sized("pads", 0.6, plan), plan, seed=1)
    sd = float(np.std(data.outputs["y_V"] - truth["y_V"]))
    holds = 1.5 * sd * np.sin(2.0 * np.pi * data.order / 6.43)
    for given, doubtful in (
        (data, False),
        (replace(data, outputs={**data.outputs, "y_V": data.outputs["y_V"] + holds}), True),
    ):
        found = [effect for one in trace(given, validate=False).sensors.values() for effect in one.effects]
        named = [effect for effect in found if effect.stratum != "noise"]
        assert {effect.effect for effect in named} == {"isolation-pad-deflection"}
        assert [bool(effect.doubtful) for effect in named] == [doubtful] * len(named)


def test_a_name_is_doubtful_where_another_transducer_follows_a_shape_without_one():
    data = whole_plot.simulate(
        whole_plot.Bench((whole_plot.Transducer(), whole_plot.Transducer(sensitivity=1.9))), seed=31
    )
    p, (one, other) = data.pressure_psia, data.outputs
    bent = {**data.outputs, one: data.outputs[one] + 25.0 * whole_plot.SUBPLOT * (p / np.max(p)) ** 3}
    wave = whole_plot.SUBPLOT * data.pressure_side * np.sin(3.0 * p)
    known = [effect for effect in PRESSURE_CATALOGUE if not effect.name.startswith("hysteresis")]
    for outputs, doubtful in ((bent, False), ({**bent, other: bent[other] + wave}, True)):
        found = trace_whole_plots(replace(data, outputs=outputs), validate=False, catalogue=known).sensors[one]
        (effect,) = (effect for effect in found.effects if effect.stratum != "noise")
        assert effect.effect == "pressure-third-order"
        assert ("follows a shape without a name" in str(effect.doubtful)) == doubtful == bool(effect.doubtful)
