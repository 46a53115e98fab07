"""The catalogue of effects that a pressure calibration over temperature may lack.

`response` has the terms of the transducer's own response, `line` those of the line and the reference, `memory` those of
earlier settings, `time` drifts and steps.
"""

from __future__ import annotations

import numpy as np

from rig.fitter.effects.entry import Entry
from rig.fitter.effects.noise_names import NOISE_GROWS
from rig.fitter.effects.sizes import each
from rig.procedures.present.catalogue_table import catalogue_table
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.effects import line, memory, response, time
from rig.procedures.pressure.effects.scene import PressureEffect

GROWING_NOISE = Entry(
    name=NOISE_GROWS,
    cause="readings scatter more the higher the pressure: sd = a + b P",
    source="sensor",
    scope="sensor",
    stratum="noise",
    unit="mV, mV/psi",
    size=each("mV"),
    against="pressure_psia",
    separate_by="repeat the highest and the lowest pressure several times in one whole plot",
    usual_size="3e-4 of the pressure",
)
"""It does not change the mean, so it has no candidate column: `rig.fitter.trace.growing_noise` estimates it."""

PRESSURE_CATALOGUE: tuple[PressureEffect, ...] = (
    response.OFFSET_TEMPERATURE,
    response.OFFSET_TEMPERATURE_SQUARED,
    response.PRESSURE_SQUARED,
    response.SENSITIVITY_TEMPERATURE,
    response.PRESSURE_CUBED,
    response.PRESSURE_SQUARED_TEMPERATURE,
    response.PRESSURE_TEMPERATURE_SQUARED,
    response.SENSOR_TEMPERATURE_CUBED,
    response.SSE_TEMPERATURE_CUBED,
    response.SENSOR_BY_SSE_SQUARED,
    response.SSE_BY_SENSOR_SQUARED,
    line.CARRY_OVER,
    memory.CREEP,
    memory.COMPRESSION_HEAT,
    memory.HYSTERESIS,
    memory.HYSTERESIS_TEMPERATURE,
    memory.SENSOR_LAG,
    memory.SSE_LAG,
    memory.THERMAL_GRADIENT,
    memory.THERMAL_HYSTERESIS,
    memory.THERMAL_RATCHET,
    line.TRANSPIRATION,
    response.DEAD_BAND,
    response.TOUCH_DOWN,
    response.GAS_COOLING,
    response.SATURATION,
    response.OFFSET_KNEE,
    response.SENSITIVITY_KNEE,
    line.HEAD_CORRECTION,
    time.OFFSET_STEP,
    time.SENSITIVITY_STEP,
    time.ORDER_DRIFT,
    time.WARM_UP,
    time.DAILY_COURSE,
    line.REFERENCE_ZERO_DRIFT,
    time.SUBPLOT_DRIFT,
    time.SENSITIVITY_DRIFT,
    line.REFERENCE_DRIFT,
    time.EXCITATION,
    line.REFERENCE_NONLINEARITY,
    line.LINE_LEAK,
    time.UNRECORDED_STEP,
    time.SENSITIVITY_STEP_UNRECORDED,
    time.OUTLYING_WHOLE_PLOT,
)
"""Simplest and most usual cause first, as for the attitude sensors."""


def explained(topic: str) -> str:
    """Effects for `rig explain effects`, "" for other topics.

    With the names of their columns in six days of whole plots with an interruption.
    """
    if topic != "effects":
        return ""
    row, at = np.arange(288), np.arange(288.0)
    data = WholePlotData(
        whole_plot=row // 24,
        order=row,
        elapsed_s=1800.0 * at,
        pressure_psia=0.1 + 0.7 * (at % 8),
        sensor_temperature_degC=-130.0 + 40.0 * (at // 24 % 3),
        sse_temperature_degC=-40.0 + 40.0 * (at // 72),
        outputs={"bridge_mV": 0.2 + 1.4 * (at % 8)},
        block=row // 144,
    )
    rows = ((effect, [term.name for term in effect.terms(data)]) for effect in PRESSURE_CATALOGUE)
    return f"## Whole plots (pressure transducers)\n\n{catalogue_table(rows)}"
