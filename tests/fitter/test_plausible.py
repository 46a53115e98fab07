"""No effect is named with a size that its cause cannot have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proving.truth.attitude import Bench, Plan, Sensor, simulate
from rig.procedures.attitude.trace import SensorTrace, trace

BENCH = Bench(sensors=(Sensor("x"),))
SMALL = Plan(np.linspace(-30.0, 30.0, 13), np.linspace(-180.0, 180.0, 7), replications=4)


def saturated(full_V: float) -> SensorTrace:
    data, _ = simulate(BENCH, SMALL, 5)
    volts = full_V * np.tanh(data.outputs["x_V"] / full_V)
    return trace(replace(data, outputs={"x_V": volts}), validate=False).sensors["x_V"]


def test_a_saturated_sensor_is_no_gear_with_an_error_of_degrees() -> None:
    data, _ = simulate(BENCH, SMALL, 5)
    found = saturated(0.8 * float(np.ptp(data.outputs["x_V"])) / 2.0)
    degrees = [e.contribution_V.max() / found.S_V for e in found.added if "head" in e.effect or "gear" in e.effect]
    assert all(np.degrees(size) < 2.0 for size in degrees)
    refused = {one.effect: one for one in found.refused}
    assert "sensor-third-order" in refused
    assert "no cause of that name reaches more than 10 % of the sensitivity at 1 g: refused" in (
        refused["sensor-third-order"].sentence
    )
    shown = {one["effect"]: one for one in found.outcome().to_json()["refused"]}
    assert shown["sensor-third-order"]["largest"] == "10 % of the sensitivity at 1 g"
    assert any(one.sentence in found.notes for one in found.refused)
    assert found.unnamed


def test_an_effect_of_a_plausible_size_keeps_its_name() -> None:
    data, _ = simulate(replace(BENCH, sensors=(replace(BENCH.sensors[0], cubic=2e-3),)), SMALL, 5)
    found = trace(data, validate=False).sensors["x_V"]
    assert [e.effect for e in found.added] == ["sensor-third-order"]
    assert found.refused == ()
