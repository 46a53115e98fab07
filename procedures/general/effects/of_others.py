"""Kinds of effects of other recorded quantities: covariates, groups, directions, bits."""

from __future__ import annotations

from rig.procedures.general.effects import columns
from rig.procedures.general.effects import group_columns as groups
from rig.procedures.general.effects.kind import TableKind

_HOLD = "hold everything else and change {0} alone, up and down"
_AT_TWO = "measure the whole range of {1} at two values of {0}"

GROUP_OFFSET = TableKind(
    "group-offset",
    "group",
    "group",
    "each level of {0} has an offset of its own",
    "between-point",
    "{y}",
    "measure one artefact with every level of {0} in one sitting, in random order",
    "a few times the repeatability",
    groups.offsets,
)

CROSS_TALK = TableKind(
    "cross-talk",
    "covariate",
    "covariate",
    "{y} takes up a part of {0}, which is read beside it on one scanner, or both follow what was not recorded",
    "point-by-replication",
    "{y} per unit of {0}",
    "short the input of {0} and read {y} again; exchange the channels; wait longer after the scanner has switched",
    "1 to 100 ppm of the other channel",
    columns.linear,
)

COVARIATE = TableKind(
    "covariate",
    "covariate",
    "covariate",
    "{y} follows {0}",
    "point-by-replication",
    "{y} per unit of {0}",
    _HOLD,
    "1 to 100 ppm of range per unit",
    columns.linear,
    warm="temperature",
    beside=CROSS_TALK,
)

LOADING = TableKind(
    "loading",
    "covariate",
    "covariate of setting",
    "what reads {1} draws a current through {0}: the sensitivity falls with it",
    "point-by-replication",
    "{y} per unit of {0} and of {1}",
    "put a resistor of a tenth of the input resistance in series: the change is a tenth; or read through a buffer",
    "{0} over the input resistance",
    columns.product,
)

SENSITIVITY = TableKind(
    "sensitivity",
    "covariate",
    "covariate of setting",
    "the sensitivity to {1} follows {0}",
    "point-by-replication",
    "{y} per unit of {0} and of {1}",
    _AT_TWO,
    "10 to 500 ppm of reading per unit",
    columns.product,
    warm="sensitivity-temperature",
    called={"resistance": LOADING},
)

DIRECTION = TableKind(
    "direction",
    "direction",
    "direction",
    "readings depend on the side a setting is approached from: backlash, friction or a lag in time",
    "point-by-replication",
    "{y}",
    "visit some settings from both sides, and at two speeds: backlash keeps its size, a lag grows with speed",
    "the backlash of a gear, or speed times lag",
    columns.side,
)

DELAY = TableKind(
    "delay",
    "direction",
    "speed",
    "readings come late, or friction grows with speed: the error goes with {0} and changes sign with it",
    "point-by-replication",
    "{y} per unit of {0}",
    "go at two speeds: a delay's error grows with speed, backlash keeps its size",
    "milliseconds",
    columns.speed,
)

DIRECTION_GAIN = TableKind(
    "direction-gain",
    "direction",
    "direction of setting",
    "the sensitivity to {1} depends on the side it is approached from",
    "point-by-replication",
    "{y} per unit of {1}",
    "visit some settings from both sides",
    "0.01 to 0.1 % of reading",
    columns.side_times,
)

DIRECTION_BY_COVARIATE = TableKind(
    "direction-by-covariate",
    "direction",
    "direction by covariate",
    "what depends on the side a setting is approached from follows {1}: friction or a clamp that changes with it",
    "point-by-replication",
    "{y} per unit of {1}",
    "visit some settings from both sides at two values of {1}",
    "a part of the backlash",
    columns.side_times,
)

HYSTERESIS = TableKind(
    "hysteresis",
    "direction",
    "direction of setting",
    "a loop over {1} that is closed at both ends: the material or the magnet remembers",
    "point-by-replication",
    "{y}",
    "go up and down over half the range too: the loop shrinks, backlash does not",
    "0.01 to 0.1 % of range",
    columns.loop,
)

COVARIATE_SECOND_ORDER = TableKind(
    "covariate-second-order",
    "covariate",
    "covariate",
    "{y} is curved over {0}",
    "point-by-replication",
    "{y} per squared unit of {0}",
    _HOLD,
    "a tenth of the linear part",
    columns.power(2),
    warm="temperature-second-order",
)

HARMONIC_OF_COVARIATE = TableKind(
    "harmonic",
    "periodic",
    "covariate",
    "an error that is periodic in {0}: eccentricity, or amplitudes and phases of a resolver's windings",
    "between-point",
    "{y}",
    "remount the scale turned by a known angle: its error turns with it, the error of the artefact does not",
    "arc seconds to degrees",
    columns.harmonic,
)

BIT_WEIGHTS = TableKind(
    "bit-weights",
    "bits",
    "bits",
    "the bits' weights are in error",
    "between-point",
    "{y}",
    "switch one bit at a time beside a code that is held",
    "a fraction of the smallest bit",
    groups.bit_weights,
)

BIT_INTERACTION = TableKind(
    "bit-interaction",
    "bits",
    "bits",
    "bits do not add up: two together make another error than one and one",
    "between-point",
    "{y}",
    "switch pairs of bits",
    "a fraction of the smallest bit",
    groups.bit_pairs,
)

GROUP_GAIN = TableKind(
    "group-gain",
    "group",
    "group of variable",
    "each level of {0} has a slope over {1} of its own",
    "between-point",
    "{y} per unit of {1}",
    "measure the range of {1} with every level of {0} in one sitting",
    "0.01 to 1 % of slope",
    groups.gains,
)

GROUP_BY_GROUP = TableKind(
    "group-by-group",
    "group",
    "pair of groups",
    "levels of {0} and {1} do not add up: each pair has an offset of its own",
    "between-point",
    "{y}",
    "repeat some pairs of {0} and {1} in random order",
    "the repeatability",
    groups.combined,
)

BIT_WEIGHTS_BY_GROUP = TableKind(
    "bit-weights-by-group",
    "bits",
    "bits of group",
    "each level of {1} has errors of its own in the weights of its bits",
    "between-point",
    "{y}",
    "measure all codes with every level of {1} in one sitting",
    "a fraction of the smallest bit",
    groups.bit_weights_by,
)
