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
from rig.procedures.attitude.effects.effect import Effect
from rig.procedures.attitude.effects.gears import GEAR_PITCH, GEAR_ROLL
from rig.procedures.attitude.effects.head import (
    AXES_NOT_SQUARE,
    BACKLASH_PITCH,
    BACKLASH_ROLL,
    BACKLASH_TEMPERATURE,
    CABLE,
    HEAD_ONCE,
    HEAD_TILT,
    HEAD_TWICE,
    INDEX_ERROR,
    ROLL_HEAD_ONCE,
    ROLL_HEAD_TWICE,
    ROLL_WOBBLE,
    TILT_DAILY,
    TILT_DRIFT,
)
from rig.procedures.attitude.effects.memory import (
    CREEP,
    HYSTERESIS_PITCH,
    HYSTERESIS_ROLL,
    SETTLING_PITCH,
    SETTLING_ROLL,
)
from rig.procedures.attitude.effects.package import (
    ISOLATION_PADS,
    MOUNTING_SLIP,
    MOUNTING_SLIP_UNRECORDED,
    SCALE_ATTITUDE,
)
from rig.procedures.attitude.effects.sensor import (
    ASYMMETRY,
    CROSS_AXIS,
    DAILY_CYCLE,
    DEAD_ZONE,
    MAGNETIC,
    OFFSET_DRIFT,
    SATURATION,
    SECOND_ORDER,
    SENSITIVITY_DRIFT,
    THIRD_ORDER,
)
from rig.procedures.attitude.effects.steps import (
    INDEX_SHIFT,
    OFFSET_STEP,
    OFFSET_STEP_UNRECORDED,
    SENSITIVITY_STEP,
    SENSITIVITY_STEP_UNRECORDED,
)
from rig.procedures.attitude.effects.thermal import (
    ALIGNMENT_TEMPERATURE,
    OFFSET_TEMPERATURE,
    SENSITIVITY_TEMPERATURE,
    THERMAL_GRADIENT,
    THERMAL_LAG,
)
from rig.procedures.attitude.effects.voltmeter import (
    VOLTMETER_GAIN_DRIFT,
    VOLTMETER_NONLINEARITY,
    VOLTMETER_RANGE,
    VOLTMETER_ZERO_DRIFT,
)
from rig.procedures.present.catalogue_table import catalogue_table

CATALOGUE: tuple[Effect, ...] = (
    ISOLATION_PADS,
    OFFSET_TEMPERATURE,
    SENSITIVITY_TEMPERATURE,
    ALIGNMENT_TEMPERATURE,
    OFFSET_STEP,
    SENSITIVITY_STEP,
    OFFSET_DRIFT,
    SENSITIVITY_DRIFT,
    BACKLASH_PITCH,
    BACKLASH_ROLL,
    HYSTERESIS_PITCH,
    HYSTERESIS_ROLL,
    SETTLING_PITCH,
    SETTLING_ROLL,
    CREEP,
    SECOND_ORDER,
    THIRD_ORDER,
    VOLTMETER_NONLINEARITY,
    HEAD_ONCE,
    HEAD_TWICE,
    ROLL_HEAD_ONCE,
    ROLL_HEAD_TWICE,
    INDEX_ERROR,
    HEAD_TILT,
    AXES_NOT_SQUARE,
    ROLL_WOBBLE,
    CROSS_AXIS,
    VOLTMETER_ZERO_DRIFT,
    VOLTMETER_GAIN_DRIFT,
    THERMAL_GRADIENT,
    THERMAL_LAG,
    DAILY_CYCLE,
    INDEX_SHIFT,
    SCALE_ATTITUDE,
    CABLE,
    ASYMMETRY,
    DEAD_ZONE,
    SATURATION,
    MAGNETIC,
    BACKLASH_TEMPERATURE,
    TILT_DRIFT,
    TILT_DAILY,
    MOUNTING_SLIP,
    VOLTMETER_RANGE,
    GEAR_PITCH,
    GEAR_ROLL,
    OFFSET_STEP_UNRECORDED,
    SENSITIVITY_STEP_UNRECORDED,
    MOUNTING_SLIP_UNRECORDED,
)


def catalogue() -> str:
    """Effects for `rig explain`, with the names of their columns in a run with two replications and an interruption."""
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
