"""Kinds of effects in time: drift, steps, cycles, lags behind earlier settings."""

from __future__ import annotations

from dataclasses import replace

from rig.procedures.general.effects import columns
from rig.procedures.general.effects import time_columns as in_time
from rig.procedures.general.effects.kind import TableKind

_REPEAT_LATER = "repeat some settings much later and in another order: an effect of the setting stays with it"

DRIFT = TableKind(
    "drift",
    "drift",
    "time",
    "the offset drifts with {0}",
    "point-by-replication",
    "{y} per unit of {0}",
    "go on for as long again, and come back to the first setting from time to time",
    "1 to 50 ppm of range an hour; ppm a year",
    columns.drift,
)

SENSITIVITY_DRIFT = TableKind(
    "sensitivity-drift",
    "drift",
    "clock of setting",
    "the sensitivity to {1} drifts with {0}",
    "point-by-replication",
    "{y} per unit of {0} and of {1}",
    _REPEAT_LATER,
    "1 to 50 ppm of reading an hour",
    columns.product,
)

CREEP = TableKind(
    "creep",
    "creep",
    "setting by the clock",
    "{y} still moves minutes after a change of {0}: the material creeps under load, and recovers",
    "point-by-replication",
    "{y} per unit of {0}",
    "keep the largest {0} for half an hour, then none, and read all the time: creep and its recovery are alike",
    "0.01 to 0.05 % of the load in 30 minutes",
    in_time.lag,
    dynamic=True,
)

CREEP_OF_ONE_STEP = replace(CREEP, terms=in_time.previous)
"""Creep that is over before the row after the next."""

CARRY_OVER = TableKind(
    "carry-over",
    "carry-over",
    "setting by the clock",
    "part of the previous {0} is still there: creep, outgassing, memory",
    "point-by-replication",
    "{y} per unit of {0}",
    "read one setting twice after a large step, and wait longer before the second reading",
    "0.01 to 0.1 % of the step",
    in_time.previous,
    called={"load": CREEP_OF_ONE_STEP},
    dynamic=True,
)

DRIFT_SECOND_ORDER = TableKind(
    "drift-second-order",
    "drift",
    "time",
    "the offset's drift slows down or speeds up with {0}",
    "point-by-replication",
    "{y} per squared unit of {0}",
    "go on for as long again",
    "part of the linear drift, over a warm-up",
    columns.power(2),
)

WARM_UP = TableKind(
    "warm-up",
    "drift",
    "clock",
    "the offset settles after the start, by one time constant",
    "point-by-replication",
    "{y}",
    "switch off, wait and start again: a warm-up comes back, a drift goes on",
    "ppm to percent, over minutes to hours",
    in_time.warm_up,
)

AGEING = TableKind(
    "ageing",
    "drift",
    "clock",
    "the offset drifts with the logarithm of {0}: ageing, creep, stress that relaxes",
    "point-by-replication",
    "{y} per factor of e in {0}",
    "go on for several times as long: a logarithm gains as much with every doubling of {0}",
    "1e-9 to 1e-7 of an oscillator's frequency, ppm of a resistor",
    in_time.ageing,
)

STEP = TableKind(
    "step",
    "step",
    "clock",
    "the offset jumps at a certain {0}: a part was exchanged, a knock, a new zero",
    "point-by-replication",
    "{y}",
    "look in the log for what was done at that time; go on: a step stays, a drift goes on",
    "several times the repeatability",
    in_time.step,
)

LAG = TableKind(
    "lag",
    "lag",
    "covariate",
    "{y} follows {0} late: the place that matters takes time to get there",
    "point-by-replication",
    "{y} per unit of {0}",
    "change {0} by a step and keep it there: a lag fades with its time constant",
    "minutes for instruments, hours for enclosures",
    in_time.lag,
    warm="thermal-lag",
    dynamic=True,
)

SETTING_LAG = TableKind(
    "setting-lag",
    "lag",
    "setting by the clock",
    "{y} follows {0} late",
    "point-by-replication",
    "{y} per unit of {0}",
    "wait longer at some settings: a lag fades with its time constant",
    "seconds to minutes",
    in_time.lag,
    warm="thermal-lag",
    called={"load": CREEP},
    dynamic=True,
)

ANNUAL_CYCLE = TableKind(
    "annual-cycle",
    "periodic",
    "time",
    "a cycle of a year: the season's temperature or humidity",
    "point-by-replication",
    "{y}",
    "record temperature and humidity, and hold them for one season",
    "ppm",
    in_time.cycle("annual"),
)

DAILY_CYCLE = TableKind(
    "daily-cycle",
    "periodic",
    "time",
    "a cycle of a day: the room's temperature, or people",
    "point-by-replication",
    "{y}",
    "record the room's temperature, and go on for some days",
    "ppm",
    in_time.cycle("daily"),
)

OSCILLATION = TableKind(
    "oscillation",
    "periodic",
    "clock",
    "an oscillation in time: a controller that cycles, an air conditioner, pick-up",
    "point-by-replication",
    "{y}",
    "read faster for some periods and record what is near",
    "the repeatability",
    columns.wave,
)

SENSITIVITY_STEP = TableKind(
    "sensitivity-step",
    "step",
    "clock of setting",
    "the sensitivity to {1} jumps at a certain {0}: a range was switched, an excitation, a part was exchanged",
    "point-by-replication",
    "{y} per unit of {1}",
    "look in the log for what was done at that time; measure the whole range of {1} once more",
    "several times the repeatability at full range",
    in_time.step_times,
)

SENSITIVITY_OSCILLATION = TableKind(
    "sensitivity-oscillation",
    "periodic",
    "clock of setting",
    "the sensitivity to {1} goes up and down with {0}: a controller that cycles, an air conditioner, a supply",
    "point-by-replication",
    "{y} per unit of {1}",
    "read one large {1} faster for some periods and record what is near",
    "the repeatability at full range",
    in_time.wave_times,
)
