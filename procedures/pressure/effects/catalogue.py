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
from rig.procedures.pressure.effects.line import (
    CARRY_OVER,
    HEAD_CORRECTION,
    LINE_LEAK,
    REFERENCE_DRIFT,
    REFERENCE_NONLINEARITY,
    REFERENCE_ZERO_DRIFT,
    TRANSPIRATION,
)
from rig.procedures.pressure.effects.memory import (
    CREEP,
    HYSTERESIS,
    HYSTERESIS_TEMPERATURE,
    SENSOR_LAG,
    SSE_LAG,
    THERMAL_GRADIENT,
    THERMAL_HYSTERESIS,
    THERMAL_RATCHET,
)
from rig.procedures.pressure.effects.response import (
    DEAD_BAND,
    OFFSET_KNEE,
    OFFSET_TEMPERATURE,
    OFFSET_TEMPERATURE_SQUARED,
    PRESSURE_CUBED,
    PRESSURE_SQUARED,
    PRESSURE_SQUARED_TEMPERATURE,
    PRESSURE_TEMPERATURE_SQUARED,
    SATURATION,
    SENSITIVITY_KNEE,
    SENSITIVITY_TEMPERATURE,
    SENSOR_BY_SSE_SQUARED,
    SENSOR_TEMPERATURE_CUBED,
    SSE_BY_SENSOR_SQUARED,
    SSE_TEMPERATURE_CUBED,
    TOUCH_DOWN,
)
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.effects.time import (
    DAILY_COURSE,
    EXCITATION,
    OFFSET_STEP,
    ORDER_DRIFT,
    OUTLYING_WHOLE_PLOT,
    SENSITIVITY_DRIFT,
    SENSITIVITY_STEP,
    SENSITIVITY_STEP_UNRECORDED,
    SUBPLOT_DRIFT,
    UNRECORDED_STEP,
    WARM_UP,
)

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
    OFFSET_TEMPERATURE,
    OFFSET_TEMPERATURE_SQUARED,
    PRESSURE_SQUARED,
    SENSITIVITY_TEMPERATURE,
    PRESSURE_CUBED,
    PRESSURE_SQUARED_TEMPERATURE,
    PRESSURE_TEMPERATURE_SQUARED,
    SENSOR_TEMPERATURE_CUBED,
    SSE_TEMPERATURE_CUBED,
    SENSOR_BY_SSE_SQUARED,
    SSE_BY_SENSOR_SQUARED,
    CARRY_OVER,
    CREEP,
    HYSTERESIS,
    HYSTERESIS_TEMPERATURE,
    SENSOR_LAG,
    SSE_LAG,
    THERMAL_GRADIENT,
    THERMAL_HYSTERESIS,
    THERMAL_RATCHET,
    TRANSPIRATION,
    DEAD_BAND,
    TOUCH_DOWN,
    SATURATION,
    OFFSET_KNEE,
    SENSITIVITY_KNEE,
    HEAD_CORRECTION,
    OFFSET_STEP,
    SENSITIVITY_STEP,
    ORDER_DRIFT,
    WARM_UP,
    DAILY_COURSE,
    REFERENCE_ZERO_DRIFT,
    SUBPLOT_DRIFT,
    SENSITIVITY_DRIFT,
    REFERENCE_DRIFT,
    EXCITATION,
    REFERENCE_NONLINEARITY,
    LINE_LEAK,
    UNRECORDED_STEP,
    SENSITIVITY_STEP_UNRECORDED,
    OUTLYING_WHOLE_PLOT,
)
"""Simplest and most usual cause first, as for the attitude sensors."""


def catalogue() -> str:
    """Effects for `rig explain`, with the names of their columns in six days of whole plots with an interruption."""
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
