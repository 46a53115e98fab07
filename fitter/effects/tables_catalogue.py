"""The catalogue of effects that a table of any kind may lack.

Its order is that in which equally good explanations with as many columns are named: the most usual cause first.
"""

from __future__ import annotations

from fitter.effects.tables_kind import TableKind
from fitter.effects.tables_of_others import (
    BIT_INTERACTION,
    BIT_WEIGHTS,
    BIT_WEIGHTS_BY_GROUP,
    COVARIATE,
    COVARIATE_SECOND_ORDER,
    DELAY,
    DIRECTION,
    DIRECTION_GAIN,
    GROUP_BY_GROUP,
    GROUP_GAIN,
    GROUP_OFFSET,
    HARMONIC_OF_COVARIATE,
    HYSTERESIS,
    SENSITIVITY,
)
from fitter.effects.tables_of_settings import (
    FIFTH_ORDER,
    FOURTH_ORDER,
    HARMONIC,
    KINK,
    LOGARITHM,
    OFFSET,
    PERIODIC,
    PRODUCT,
    RECIPROCAL,
    SATURATION,
    SECOND_ORDER,
    THIRD_ORDER,
)
from fitter.effects.tables_of_time import (
    ANNUAL_CYCLE,
    CARRY_OVER,
    DAILY_CYCLE,
    DRIFT,
    DRIFT_SECOND_ORDER,
    LAG,
    OSCILLATION,
    SENSITIVITY_DRIFT,
    SETTING_LAG,
    STEP,
)

TABLE_CATALOGUE: tuple[TableKind, ...] = (
    OFFSET,
    GROUP_OFFSET,
    COVARIATE,
    SECOND_ORDER,
    PRODUCT,
    SENSITIVITY,
    DIRECTION,
    DELAY,
    DRIFT,
    THIRD_ORDER,
    DIRECTION_GAIN,
    HYSTERESIS,
    SENSITIVITY_DRIFT,
    LOGARITHM,
    RECIPROCAL,
    CARRY_OVER,
    COVARIATE_SECOND_ORDER,
    DRIFT_SECOND_ORDER,
    FOURTH_ORDER,
    FIFTH_ORDER,
    STEP,
    LAG,
    SETTING_LAG,
    KINK,
    SATURATION,
    HARMONIC,
    HARMONIC_OF_COVARIATE,
    ANNUAL_CYCLE,
    DAILY_CYCLE,
    PERIODIC,
    OSCILLATION,
    BIT_WEIGHTS,
    BIT_INTERACTION,
    GROUP_GAIN,
    GROUP_BY_GROUP,
    BIT_WEIGHTS_BY_GROUP,
)
