"""Kinds of effects of the settings that the declared model lacks."""

from __future__ import annotations

from rig.procedures.general.effects import columns
from rig.procedures.general.effects.kind import TableKind

_AT_TWO = "measure the whole range of {1} at two values of {0}"

OFFSET = TableKind(
    "offset",
    "nonlinearity",
    "constant",
    "{y} is not zero where the declared model says so",
    "between-point",
    "{y}",
    "read zero: short the input, take the load off, close the valve",
    "a few times the resolution",
    columns.constant,
)

FIRST_ORDER = TableKind(
    "first-order",
    "nonlinearity",
    "setting",
    "the response has a part proportional to {0}, which the declared model has not",
    "between-point",
    "{y} per unit of {0}",
    "declare {0} in the formula; hold everything else and change {0} alone, up and down",
    "a term of the model, or an offset that follows {0}",
    columns.first_order,
)

SECOND_ORDER = TableKind(
    "second-order",
    "nonlinearity",
    "setting",
    "the response is curved over {0}",
    "between-point",
    "{y} per squared unit of {0}",
    "add points between those at hand and at both ends of {0}, in random order",
    "0.01 to 1 % of range",
    columns.power(2),
)

PRODUCT = TableKind(
    "product",
    "nonlinearity",
    "pair of settings",
    "the response to {0} depends on {1}",
    "between-point",
    "{y} per unit of {0} and of {1}",
    _AT_TWO,
    "0.01 to 1 % of range",
    columns.product,
)

THIRD_ORDER = TableKind(
    "third-order",
    "nonlinearity",
    "setting",
    "the response has a cubic part over {0}",
    "between-point",
    "{y} per cubed unit of {0}",
    "add points towards both ends of {0}: a cube grows fastest there",
    "0.01 to 0.5 % of range",
    columns.power(3),
)

LOGARITHM = TableKind(
    "logarithm",
    "nonlinearity",
    "setting",
    "the response follows the logarithm of {0}",
    "between-point",
    "{y}",
    "add points at the low end of {0}",
    "0.1 to 1 % of range",
    columns.logarithm,
)

SQUARE_ROOT = TableKind(
    "square-root",
    "nonlinearity",
    "setting",
    "the response has a part that goes with the root of {0}: flow through an orifice, heat carried off a wire",
    "between-point",
    "{y} per root of the unit of {0}",
    "add points at the low end of {0}",
    "0.1 to 1 % of range",
    columns.square_root,
)

RECIPROCAL = TableKind(
    "reciprocal",
    "nonlinearity",
    "setting",
    "the response has a part that falls as 1/{0}",
    "between-point",
    "{y} times unit of {0}",
    "add points at the low end of {0}",
    "0.1 to 1 % of range",
    columns.reciprocal,
)

FOURTH_ORDER = TableKind(
    "fourth-order",
    "nonlinearity",
    "setting",
    "the response has a part of fourth order over {0}",
    "between-point",
    "{y} per fourth power of {0}",
    "add points towards both ends of {0}",
    "0.01 to 0.1 % of range",
    columns.power(4),
)

FIFTH_ORDER = TableKind(
    "fifth-order",
    "nonlinearity",
    "setting",
    "the response has a part of fifth order over {0}",
    "between-point",
    "{y} per fifth power of {0}",
    "add points towards both ends of {0}",
    "0.01 to 0.1 % of range",
    columns.power(5),
)

KINK = TableKind(
    "kink",
    "nonlinearity",
    "setting",
    "the slope over {0} changes at a knot: a range limit, a stop, an internal part",
    "between-point",
    "{y} per unit of {0}",
    "add points close to the knot on both sides",
    "0.1 to 10 % of slope",
    columns.kink,
)

DEAD_ZONE = TableKind(
    "dead-zone",
    "nonlinearity",
    "setting",
    "the response does not follow {0} about zero: a dead zone, stiction, a crossover",
    "between-point",
    "{y}",
    "add points close to zero on both sides",
    "a few times the resolution",
    columns.dead_zone,
)

CLIP = TableKind(
    "clip",
    "nonlinearity",
    "setting",
    "the response does not follow {0} at either end: a dead zone at the low one, a limit at the high one",
    "between-point",
    "{y} per unit of {0}",
    "add points close to both corners, on both sides of each",
    "a few per cent of range at each end",
    columns.clip,
)

SATURATION = TableKind(
    "saturation",
    "nonlinearity",
    "setting",
    "an exponential approach at one end of {0}: a dead zone or saturation",
    "between-point",
    "{y}",
    "add points at that end of {0}",
    "0.1 to 1 % of range",
    columns.saturation,
)

HARMONIC = TableKind(
    "harmonic",
    "periodic",
    "setting",
    "an error that is periodic in {0}: eccentricity, or amplitudes and phases of a resolver's windings",
    "between-point",
    "{y}",
    "remount the scale turned by a known angle: its error turns with it, the error of the artefact does not",
    "arc seconds to degrees",
    columns.harmonic,
)

PERIODIC = TableKind(
    "periodic",
    "periodic",
    "setting",
    "an error that repeats itself over {0}: the pitch of a screw, a converter's steps, interference",
    "between-point",
    "{y}",
    "add points a fraction of the period apart",
    "0.01 to 1 % of range",
    columns.wave,
)
