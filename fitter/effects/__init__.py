"""The catalogues of effects a calibration may lack, each a declarative entry: of attitude, and of pressure.

The order is the order in which equally good explanations are named: simplest and most usual cause first.
"""

from fitter.effects.effect import Alias, Effect, Entry, Scene, Signed, Stratum, Term
from fitter.effects.head import (
    AXES_NOT_SQUARE,
    BACKLASH_PITCH,
    BACKLASH_ROLL,
    GEAR_PITCH,
    GEAR_ROLL,
    HEAD_ONCE,
    HEAD_TILT,
    HEAD_TWICE,
    INDEX_ERROR,
    ROLL_HEAD_ONCE,
    ROLL_HEAD_TWICE,
    ROLL_WOBBLE,
)
from fitter.effects.memory import CREEP, HYSTERESIS_PITCH, HYSTERESIS_ROLL, SETTLING_PITCH, SETTLING_ROLL
from fitter.effects.package import ISOLATION_PADS, MOUNTING_SLIP
from fitter.effects.pressure import GROWING_NOISE, PRESSURE_CATALOGUE
from fitter.effects.pressure_scene import PressureEffect, PressureScene, PressureTerm
from fitter.effects.pressure_separation import separate_pressure
from fitter.effects.sensor import (
    CROSS_AXIS,
    DAILY_CYCLE,
    OFFSET_DRIFT,
    SECOND_ORDER,
    SENSITIVITY_DRIFT,
    THIRD_ORDER,
)
from fitter.effects.separation import separate
from fitter.effects.steps import INDEX_SHIFT, OFFSET_STEP, OFFSET_STEP_UNRECORDED, SENSITIVITY_STEP
from fitter.effects.thermal import (
    ALIGNMENT_TEMPERATURE,
    OFFSET_TEMPERATURE,
    SENSITIVITY_TEMPERATURE,
    THERMAL_GRADIENT,
    THERMAL_LAG,
)
from fitter.effects.voltmeter import (
    VOLTMETER_GAIN_DRIFT,
    VOLTMETER_NONLINEARITY,
    VOLTMETER_RANGE,
    VOLTMETER_ZERO_DRIFT,
)

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
    MOUNTING_SLIP,
    VOLTMETER_RANGE,
    GEAR_PITCH,
    GEAR_ROLL,
    OFFSET_STEP_UNRECORDED,
)

__all__ = [
    "CATALOGUE",
    "GROWING_NOISE",
    "PRESSURE_CATALOGUE",
    "Alias",
    "Effect",
    "Entry",
    "PressureEffect",
    "PressureScene",
    "PressureTerm",
    "Scene",
    "Signed",
    "Stratum",
    "Term",
    "separate",
    "separate_pressure",
]
