"""The catalogue of effects that an attitude calibration may lack, each a declarative entry.

An entry stands in the module of its cause (head, package, sensor, ...) and in the order below. It also needs a
simulated truth (`proving/truth/attitude_hidden.py`). Its `source` says whether it stays in the calibration
(`procedures/attitude/infer/calibrate.py`).

A laboratory adds an effect of its own without code here: `RIG_EFFECTS`, CONTRIBUTING.md.

The order is the order of preference among equally good explanations: simplest and most usual cause first.
"""

from __future__ import annotations

import numpy as np

from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import gears, head, memory, package, sensor, steps, thermal, voltmeter
from rig.procedures.attitude.effects.effect import Effect
from rig.procedures.present.catalogue_table import catalogue_table

CATALOGUE: tuple[Effect, ...] = (
    package.ISOLATION_PADS,
    thermal.OFFSET_TEMPERATURE,
    thermal.SENSITIVITY_TEMPERATURE,
    thermal.ALIGNMENT_TEMPERATURE,
    steps.OFFSET_STEP,
    steps.SENSITIVITY_STEP,
    sensor.OFFSET_DRIFT,
    sensor.SENSITIVITY_DRIFT,
    head.BACKLASH_PITCH,
    head.BACKLASH_ROLL,
    memory.HYSTERESIS_PITCH,
    memory.HYSTERESIS_ROLL,
    memory.SETTLING_PITCH,
    memory.SETTLING_ROLL,
    memory.CREEP,
    sensor.SECOND_ORDER,
    sensor.THIRD_ORDER,
    voltmeter.VOLTMETER_NONLINEARITY,
    head.HEAD_ONCE,
    head.HEAD_TWICE,
    head.ROLL_HEAD_ONCE,
    head.ROLL_HEAD_TWICE,
    head.INDEX_ERROR,
    head.HEAD_TILT,
    head.AXES_NOT_SQUARE,
    head.ROLL_WOBBLE,
    sensor.CROSS_AXIS,
    voltmeter.VOLTMETER_ZERO_DRIFT,
    voltmeter.VOLTMETER_GAIN_DRIFT,
    thermal.THERMAL_GRADIENT,
    thermal.THERMAL_LAG,
    sensor.DAILY_CYCLE,
    steps.INDEX_SHIFT,
    package.SCALE_ATTITUDE,
    head.CABLE,
    sensor.ASYMMETRY,
    sensor.DEAD_ZONE,
    sensor.SATURATION,
    sensor.MAGNETIC,
    head.BACKLASH_TEMPERATURE,
    head.TILT_DRIFT,
    head.TILT_DAILY,
    package.MOUNTING_SLIP,
    voltmeter.VOLTMETER_RANGE,
    gears.GEAR_PITCH,
    gears.GEAR_ROLL,
    steps.OFFSET_STEP_UNRECORDED,
    steps.SENSITIVITY_STEP_UNRECORDED,
    package.MOUNTING_SLIP_UNRECORDED,
)


def explained(topic: str) -> str:
    """Effects for `rig explain effects`, "" for other topics.

    With the names of their columns in a run with two replications and an interruption.
    """
    if topic != "effects":
        return ""
    row, at = np.arange(288), np.arange(288.0)
    data = AttitudeData(
        replicate=1 + row // 144,
        order=row,
        elapsed_s=60.0 * at,
        pitch_deg=-180.0 + 30.0 * (at % 12),
        roll_deg=-180.0 + 30.0 * (at // 12 % 12),
        sensor_temperature_degC=23.0 + 0.01 * at,
        outputs={"x_V": np.sin(np.radians(30.0 * (at % 12)))},
        block=row // 144,
    )
    rows = ((effect, [term.name for term in effect.terms(data)]) for effect in CATALOGUE)
    return f"## Attitude sensors\n\n{catalogue_table(rows)}"
