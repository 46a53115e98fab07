"""Residuals on the page while some readings are missing, or are numbers that no quantity has."""

from __future__ import annotations

import numpy as np
import pytest

from rig.procedures.pressure.expected import model_columns
from rig.watch.reading import ShownObservation
from rig.watch.residuals import residuals

N = 60


def _seen(odd: dict[int, float | None]) -> list[ShownObservation]:
    """Observations of a transducer; `odd` gives the temperature of some, None for not read."""
    rng = np.random.default_rng(20261123)
    made = []
    for i in range(N):
        pressure, sensor, sse = rng.uniform(0.1, 5.0), rng.uniform(-120.0, 40.0), rng.uniform(-20.0, 50.0)
        temperatures = {"sensor_temperature_degC": (sensor, 0.0, 1), "sse_temperature_degC": (sse, 0.0, 1)}
        if i in odd:
            value = odd[i]
            temperatures.pop("sensor_temperature_degC")
            if value is not None:
                temperatures["sensor_temperature_degC"] = (value, 0.0, 1)
        bridge = 0.1 + 2.0 * pressure + 1e-4 * sensor + 0.005 * rng.standard_normal()
        made.append(
            ShownObservation(
                seq=i,
                elapsed_s=60.0 * i,
                utc_s=1.7e9 + 60.0 * i,
                index=i,
                whole_plot=i // 10,
                setpoints={"pressure_psia": pressure},
                outputs={"bridge_mV": (bridge, 0.0, 1)},
                temperatures=temperatures,
                references={},
                environment={},
                flags=(),
            )
        )
    return made


@pytest.mark.parametrize("temperature", [None, -1e308, 1e155, float("inf")])
def test_one_temperature_that_is_missing_or_absurd_costs_one_residual(temperature):
    found = residuals(_seen({4: temperature}), None, "whole-plot", {}, {})
    (sensor,) = found["sensors"]
    assert [i for i, value in enumerate(sensor["values"]) if value is None] == [4]
    assert 2.0 < sensor["rms"] < 8.0  # microvolts; the scatter is 5


def test_columns_of_an_observation_without_a_temperature_are_nan():
    columns = model_columns(
        {
            "pressure_psia": np.array([1.0, 2.0]),
            "sensor_temperature_degC": np.array([3.0, np.nan]),
            "sse_temperature_degC": np.array([4.0, 5.0]),
        },
        {},
    )
    assert columns is not None
    assert np.isfinite(columns[0]).all()
    assert np.isnan(columns[1]).all()


def test_residuals_of_a_sensor_with_a_model_of_its_own_are_of_that_model():
    """The page of the bath showed the thermocouple with the thermometers' model: 1 mV where 0.3 uV are left."""
    rng = np.random.default_rng(20261124)
    seen = []
    for i in range(40):
        bath, current = float(rng.uniform(0.0, 100.0)), float(rng.uniform(5e-4, 2e-3))
        outputs = {"prt_mV": 1e5 * current * (1.0 + 4e-3 * bath), "couple_mV": 0.04 * bath, "lamp_mV": 1.0 + current}
        noisy = {name: (value + 3e-4 * rng.standard_normal(), 0.0, 1) for name, value in outputs.items()}
        seen.append(
            ShownObservation(
                i, 60.0 * i, 1.7e9, i, None, {"bath_degC": bath, "current_A": current}, noisy, {}, {}, {}, ()
            )
        )
    declared = {
        "formula": "0 + current_A + current_A:bath_degC",
        "couple": {"formula": "0 + bath_degC + bath_degC^2"},
        "lamp": {"formula": "a + b*current_A", "start": {"a": 1.0, "b": 1.0}},
    }
    found = residuals(seen, None, "general", declared, {})
    assert [one["name"] for one in found["sensors"]] == ["couple_mV", "prt_mV"], "lamp's is not linear: none is shown"
    assert all(0.2 < one["rms"] < 0.4 for one in found["sensors"]), "microvolts"
    assert "3 points are not enough" in residuals(seen[:3], None, "general", declared, {})["why_none"]
    with_one_model = residuals(seen, None, "general", {"formula": declared["formula"]}, {})
    assert next(one for one in with_one_model["sensors"] if one["name"] == "couple_mV")["rms"] > 100.0
