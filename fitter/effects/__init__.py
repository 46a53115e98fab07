"""The catalogues of effects a calibration may lack, each a declarative entry: of attitude, and of pressure.

The order is the order in which equally good explanations are named: simplest and most usual cause first.
"""

from fitter.effects.effect import Alias, Effect, Entry, Scene, Stratum, Term
from fitter.effects.package import (
    BACKLASH_PITCH,
    BACKLASH_ROLL,
    HEAD_ONCE,
    HEAD_TWICE,
    ISOLATION_PADS,
    ROLL_HEAD_ONCE,
    ROLL_HEAD_TWICE,
)
from fitter.effects.pressure import GROWING_NOISE, PRESSURE_CATALOGUE
from fitter.effects.pressure_scene import PressureEffect, PressureScene, PressureTerm
from fitter.effects.pressure_separation import separate_pressure
from fitter.effects.sensor import (
    CROSS_AXIS,
    OFFSET_DRIFT,
    OFFSET_STEP,
    OFFSET_TEMPERATURE,
    SECOND_ORDER,
    SENSITIVITY_DRIFT,
    SENSITIVITY_TEMPERATURE,
    THIRD_ORDER,
)
from fitter.effects.separation import separate

CATALOGUE: tuple[Effect, ...] = (
    ISOLATION_PADS,
    OFFSET_TEMPERATURE,
    SENSITIVITY_TEMPERATURE,
    OFFSET_STEP,
    OFFSET_DRIFT,
    SENSITIVITY_DRIFT,
    BACKLASH_PITCH,
    BACKLASH_ROLL,
    SECOND_ORDER,
    THIRD_ORDER,
    HEAD_ONCE,
    HEAD_TWICE,
    ROLL_HEAD_ONCE,
    ROLL_HEAD_TWICE,
    CROSS_AXIS,
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
    "Stratum",
    "Term",
    "separate",
    "separate_pressure",
]
