"""Kinds of effects of instruments: what measuring does to the artefact, ranges, a reference's own curve."""

from __future__ import annotations

from dataclasses import replace

from rig.procedures.general.effects import instrument_columns as columns
from rig.procedures.general.effects.kind import TableKind

SELF_HEATING = TableKind(
    "self-heating",
    "self-heating",
    "setting",
    "the current {0} heats the element it measures: {y} goes with the power",
    "point-by-replication",
    "{y} per power of {0}",
    "measure at two currents in a ratio of 1.4, which doubles the power, and extrapolate to none; or stir faster",
    "1 to 100 mK at 1 mA in 100 ohms",
    columns.self_heating,
)
SELF_HEATING_OF_COVARIATE = replace(SELF_HEATING, of="covariate")

RANGE_STEP = TableKind(
    "range-step",
    "range",
    "setting",
    "a part has an offset that is in the path above a certain {0} only: a range, a divider, an amplifier is switched",
    "between-point",
    "{y}",
    "fix the range, and measure one {0} near its end in both ranges that hold it",
    "a few digits of the higher range",
    columns.range_step,
)

RANGE_GAIN = TableKind(
    "range-gain",
    "range",
    "setting",
    "the sensitivity to {0} is another one above a certain {0}: ranges have their own gains",
    "between-point",
    "{y} per unit of {0}",
    "fix the range, and measure one {0} near its end in both ranges that hold it",
    "10 to 100 ppm of reading",
    columns.range_gain,
)

REFERENCE_NONLINEARITY = TableKind(
    "reference-nonlinearity",
    "nonlinearity",
    "setting",
    "{y} follows the setpoint of {0} and not the curve of the reference's reading: the reference is not straight",
    "between-point",
    "{y} per unit of {0}",
    "read {0} with another reference beside this one over the whole range",
    "the reference's uncertainty",
    columns.set_less_read,
)
