"""The catalogue of effects that any table may lack.

Its order is the order of preference among equally good explanations with the same number of columns: the most usual
cause first.
"""

from __future__ import annotations

from rig.procedures.general.effects import of_instruments, of_others, of_settings, of_time
from rig.procedures.general.effects.kind import TableKind

TABLE_CATALOGUE: tuple[TableKind, ...] = (
    of_settings.OFFSET,
    of_settings.FIRST_ORDER,
    of_others.GROUP_OFFSET,
    of_others.COVARIATE,
    of_instruments.SELF_HEATING,
    of_instruments.SELF_HEATING_OF_COVARIATE,
    of_instruments.REFERENCE_NONLINEARITY,
    of_settings.SECOND_ORDER,
    of_settings.PRODUCT,
    of_others.SENSITIVITY,
    of_others.DIRECTION,
    of_others.DELAY,
    of_time.DRIFT,
    of_settings.THIRD_ORDER,
    of_others.DIRECTION_GAIN,
    of_others.DIRECTION_BY_COVARIATE,
    of_others.HYSTERESIS,
    of_time.SENSITIVITY_DRIFT,
    of_settings.LOGARITHM,
    of_settings.SQUARE_ROOT,
    of_settings.RECIPROCAL,
    of_time.CARRY_OVER,
    of_others.COVARIATE_SECOND_ORDER,
    of_time.DRIFT_SECOND_ORDER,
    of_time.WARM_UP,
    of_time.AGEING,
    of_settings.FOURTH_ORDER,
    of_settings.FIFTH_ORDER,
    of_time.STEP,
    of_time.SENSITIVITY_STEP,
    of_instruments.RANGE_STEP,
    of_instruments.RANGE_GAIN,
    of_time.LAG,
    of_time.SETTING_LAG,
    of_settings.KINK,
    of_settings.DEAD_ZONE,
    of_settings.CLIP,
    of_settings.SATURATION,
    of_settings.HARMONIC,
    of_others.HARMONIC_OF_COVARIATE,
    of_time.ANNUAL_CYCLE,
    of_time.DAILY_CYCLE,
    of_settings.PERIODIC,
    of_time.OSCILLATION,
    of_time.SENSITIVITY_OSCILLATION,
    of_others.BIT_WEIGHTS,
    of_others.BIT_INTERACTION,
    of_others.GROUP_GAIN,
    of_others.GROUP_BY_GROUP,
    of_others.BIT_WEIGHTS_BY_GROUP,
)
