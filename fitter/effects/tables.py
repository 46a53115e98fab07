"""The catalogue of effects that a table of any kind may lack: kinds, each made an effect for every column it can be of.

The order is that in which equally good explanations with as many columns are named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

from fitter.effects import tables_columns as columns
from fitter.effects.effect import Entry, Source, Stratum
from fitter.effects.tables_scene import TableScene, TableTerm, is_temperature

Of = Literal[
    "group",
    "group of variable",
    "pair of groups",
    "setting",
    "pair of settings",
    "covariate",
    "covariate of setting",
    "time",
    "time of setting",
    "direction",
    "direction of setting",
    "bits",
    "bits of group",
]
"""What a kind of effect needs a column, or a pair of columns, of."""


@dataclass(frozen=True)
class TableKind:
    """A kind of effect.

    Attributes:
        name: of the kind; an effect's name adds its columns.
        family: coarser word for reports: "nonlinearity", "periodic", "temperature", "drift", "group" and so on.
        of: what columns it is looked for in.
        cause: what happens physically, {0} and {1} for the columns.
        stratum: where it varies in a balanced order.
        unit: of the coefficients, {y} for the response and {0}, {1} for the columns.
        separate_by: the measurement that confirms it.
        usual_size: what instruments show.
        terms: its columns.
        warm: the same kind's name where the column is a temperature.

    """

    name: str
    family: str
    of: Of
    cause: str
    stratum: Stratum
    unit: str
    separate_by: str
    usual_size: str
    terms: Callable[..., Sequence[TableTerm]]
    warm: str = ""


@dataclass(frozen=True)
class TableEffect(Entry):
    """A kind of effect in certain columns.

    Attributes:
        kind: of effect.
        columns: that it is looked for in.
        family: coarser word for reports.

    """

    kind: TableKind
    columns: tuple[str, ...]
    family: str

    def terms(self, scene: TableScene) -> Sequence[TableTerm]:
        """Its blocks of columns, one for each value of a constant that is searched."""
        return self.kind.terms(scene, *self.columns)


def effects_of(scene: TableScene, response: str) -> Iterator[TableEffect]:
    """Every effect that can be looked for in a table, in catalogue order."""
    for kind in TABLE_CATALOGUE:
        for names in _columns_for(kind.of, scene):
            yield _effect(kind, names, response)


def _effect(kind: TableKind, names: tuple[str, ...], response: str) -> TableEffect:
    warm = bool(kind.warm) and is_temperature(names[0])
    words: dict[str, Any] = {"y": response}
    return TableEffect(
        name=f"{kind.warm if warm else kind.name}:{','.join(names)}",
        cause=kind.cause.format(*names, **words),
        source=_SOURCES[kind.of],
        scope="sensor",
        stratum=kind.stratum,
        unit=kind.unit.format(*names, **words),
        size=lambda _values, _scale: "",
        against=names[-1] if kind.of == "direction of setting" else names[0],
        separate_by=kind.separate_by.format(*names, **words),
        usual_size=kind.usual_size,
        known_aliases={},
        kind=kind,
        columns=names,
        family="temperature" if warm else kind.family,
    )


def _columns_for(of: Of, scene: TableScene) -> Iterator[tuple[str, ...]]:
    """The columns, or pairs of them, that effects of a kind are looked for in."""
    settings, covariates = tuple(scene.settings), tuple(scene.covariates)
    groups = tuple(scene.groups)
    time = () if scene.time is None else (scene.time.name,)
    side = () if scene.direction is None else (scene.direction[0],)
    bits = (",".join(scene.bits),) if scene.bits else ()
    pairs: dict[Of, Any] = {
        "group": ((g,) for g in groups),
        "group of variable": ((g, v) for g in groups for v in scene.variables),
        "pair of groups": combinations(groups, 2),
        "setting": ((s,) for s in settings),
        "pair of settings": combinations(settings, 2),
        "covariate": ((c,) for c in covariates),
        "covariate of setting": ((c, s) for c in covariates for s in settings),
        "time": ((t,) for t in time),
        "time of setting": ((t, s) for t in time for s in settings),
        "direction": ((d,) for d in side),
        "direction of setting": ((d, s) for d in side for s in settings),
        "bits": ((b,) for b in bits),
        "bits of group": ((b, g) for b in bits for g in groups),
    }
    return iter(pairs[of])


_SOURCES: dict[Of, Source] = {
    "group": "group",
    "group of variable": "group",
    "pair of groups": "group",
    "setting": "setting",
    "pair of settings": "setting",
    "covariate": "covariate",
    "covariate of setting": "covariate",
    "time": "time",
    "time of setting": "time",
    "direction": "direction",
    "direction of setting": "direction",
    "bits": "setting",
    "bits of group": "group",
}

_REPEAT_LATER = "repeat some settings much later and in another order: what is of the setting stays with it"
_HOLD = "hold everything else and change {0} alone, up and down"
_AT_TWO = "measure the whole range of {1} at two values of {0}"

TABLE_CATALOGUE: tuple[TableKind, ...] = (
    TableKind(
        "group-offset",
        "group",
        "group",
        "each level of {0} has an offset of its own",
        "between-point",
        "{y}",
        "measure one artefact with every level of {0} in one sitting, in random order",
        "a few times the repeatability",
        columns.offsets,
    ),
    TableKind(
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
    ),
    TableKind(
        "second-order",
        "nonlinearity",
        "setting",
        "the response is curved over {0}",
        "between-point",
        "{y} per squared unit of {0}",
        "add points between those at hand and at both ends of {0}, in random order",
        "0.01 to 1 % of range",
        columns.power(2),
    ),
    TableKind(
        "product",
        "nonlinearity",
        "pair of settings",
        "the response to {0} depends on {1}",
        "between-point",
        "{y} per unit of {0} and of {1}",
        _AT_TWO,
        "0.01 to 1 % of range",
        columns.product,
    ),
    TableKind(
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
    ),
    TableKind(
        "direction",
        "direction",
        "direction",
        "readings depend on the side a setting is approached from: backlash, friction or a lag in time",
        "point-by-replication",
        "{y}",
        "visit some settings from both sides, and at two speeds: backlash keeps its size, a lag grows with speed",
        "the backlash of a gear, or speed times lag",
        columns.side,
    ),
    TableKind(
        "drift",
        "drift",
        "time",
        "the offset drifts with {0}",
        "point-by-replication",
        "{y} per unit of {0}",
        "go on for as long again, and come back to the first setting from time to time",
        "1 to 50 ppm of range an hour; ppm a year",
        columns.linear,
    ),
    TableKind(
        "third-order",
        "nonlinearity",
        "setting",
        "the response has a cubic part over {0}",
        "between-point",
        "{y} per cubed unit of {0}",
        "add points towards both ends of {0}: a cube grows fastest there",
        "0.01 to 0.5 % of range",
        columns.power(3),
    ),
    TableKind(
        "direction-gain",
        "direction",
        "direction of setting",
        "the sensitivity to {1} depends on the side it is approached from",
        "point-by-replication",
        "{y} per unit of {1}",
        "visit some settings from both sides",
        "0.01 to 0.1 % of reading",
        columns.side_times,
    ),
    TableKind(
        "hysteresis",
        "direction",
        "direction of setting",
        "a loop over {1} that is closed at both ends: the material or the magnet remembers",
        "point-by-replication",
        "{y}",
        "go up and down over half the range too: the loop shrinks, backlash does not",
        "0.01 to 0.1 % of range",
        columns.loop,
    ),
    TableKind(
        "sensitivity-drift",
        "drift",
        "time of setting",
        "the sensitivity to {1} drifts with {0}",
        "point-by-replication",
        "{y} per unit of {0} and of {1}",
        _REPEAT_LATER,
        "1 to 50 ppm of reading an hour",
        columns.product,
    ),
    TableKind(
        "logarithm",
        "nonlinearity",
        "setting",
        "the response follows the logarithm of {0}",
        "between-point",
        "{y}",
        "add points at the low end of {0}",
        "0.1 to 1 % of range",
        columns.logarithm,
    ),
    TableKind(
        "reciprocal",
        "nonlinearity",
        "setting",
        "the response has a part that falls as 1/{0}",
        "between-point",
        "{y} times unit of {0}",
        "add points at the low end of {0}",
        "0.1 to 1 % of range",
        columns.reciprocal,
    ),
    TableKind(
        "carry-over",
        "carry-over",
        "setting",
        "part of the previous {0} is still there: creep, outgassing, memory",
        "point-by-replication",
        "{y} per unit of {0}",
        "read one setting twice after a large step, and wait longer before the second reading",
        "0.01 to 0.1 % of the step",
        columns.previous,
    ),
    TableKind(
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
    ),
    TableKind(
        "drift-second-order",
        "drift",
        "time",
        "the offset's drift slows down or speeds up with {0}",
        "point-by-replication",
        "{y} per squared unit of {0}",
        "go on for as long again",
        "part of the linear drift, over a warm-up",
        columns.power(2),
    ),
    TableKind(
        "fourth-order",
        "nonlinearity",
        "setting",
        "the response has a part of fourth order over {0}",
        "between-point",
        "{y} per fourth power of {0}",
        "add points towards both ends of {0}",
        "0.01 to 0.1 % of range",
        columns.power(4),
    ),
    TableKind(
        "fifth-order",
        "nonlinearity",
        "setting",
        "the response has a part of fifth order over {0}",
        "between-point",
        "{y} per fifth power of {0}",
        "add points towards both ends of {0}",
        "0.01 to 0.1 % of range",
        columns.power(5),
    ),
    TableKind(
        "step",
        "step",
        "time",
        "the offset jumps at a certain {0}: a part was exchanged, a knock, a new zero",
        "point-by-replication",
        "{y}",
        "look in the log for what was done at that time; go on: a step stays, a drift goes on",
        "several times the repeatability",
        columns.step,
    ),
    TableKind(
        "lag",
        "lag",
        "covariate",
        "{y} follows {0} late: the place that matters takes time to get there",
        "point-by-replication",
        "{y} per unit of {0}",
        "change {0} by a step and keep it there: a lag fades with its time constant",
        "minutes for instruments, hours for enclosures",
        columns.lag,
        warm="thermal-lag",
    ),
    TableKind(
        "setting-lag",
        "lag",
        "setting",
        "{y} follows {0} late",
        "point-by-replication",
        "{y} per unit of {0}",
        "wait longer at some settings: a lag fades with its time constant",
        "seconds to minutes",
        columns.lag,
        warm="thermal-lag",
    ),
    TableKind(
        "kink",
        "nonlinearity",
        "setting",
        "the slope over {0} changes at a knot: a range limit, a stop, an internal part",
        "between-point",
        "{y} per unit of {0}",
        "add points close to the knot on both sides",
        "0.1 to 10 % of slope",
        columns.kink,
    ),
    TableKind(
        "saturation",
        "nonlinearity",
        "setting",
        "an exponential approach at one end of {0}: a dead zone or saturation",
        "between-point",
        "{y}",
        "add points at that end of {0}",
        "0.1 to 1 % of range",
        columns.saturation,
    ),
    TableKind(
        "harmonic",
        "periodic",
        "setting",
        "an error that goes round with {0}: eccentricity, or amplitudes and phases of a resolver's windings",
        "between-point",
        "{y}",
        "remount the scale turned by a known angle: its error turns along, that of the artefact does not",
        "arc seconds to degrees",
        columns.harmonic,
    ),
    TableKind(
        "harmonic",
        "periodic",
        "covariate",
        "an error that goes round with {0}: eccentricity, or amplitudes and phases of a resolver's windings",
        "between-point",
        "{y}",
        "remount the scale turned by a known angle: its error turns along, that of the artefact does not",
        "arc seconds to degrees",
        columns.harmonic,
    ),
    TableKind(
        "annual-cycle",
        "periodic",
        "time",
        "a cycle of a year: the season's temperature or humidity",
        "point-by-replication",
        "{y}",
        "record temperature and humidity, and hold them for one season",
        "ppm",
        columns.cycle("annual"),
    ),
    TableKind(
        "daily-cycle",
        "periodic",
        "time",
        "a cycle of a day: the room's temperature, or people",
        "point-by-replication",
        "{y}",
        "record the room's temperature, and go on for some days",
        "ppm",
        columns.cycle("daily"),
    ),
    TableKind(
        "periodic",
        "periodic",
        "setting",
        "an error that repeats itself over {0}: the pitch of a screw, a converter's steps, interference",
        "between-point",
        "{y}",
        "add points a fraction of the period apart",
        "0.01 to 1 % of range",
        columns.wave,
    ),
    TableKind(
        "oscillation",
        "periodic",
        "time",
        "an oscillation in time: a controller that cycles, an air conditioner, pick-up",
        "point-by-replication",
        "{y}",
        "read faster for some periods and record what is near",
        "the repeatability",
        columns.wave,
    ),
    TableKind(
        "bit-weights",
        "bits",
        "bits",
        "the bits' weights are in error",
        "between-point",
        "{y}",
        "switch one bit at a time beside a code that is held",
        "a fraction of the smallest bit",
        columns.bit_weights,
    ),
    TableKind(
        "bit-interaction",
        "bits",
        "bits",
        "bits do not add up: two together make another error than one and one",
        "between-point",
        "{y}",
        "switch pairs of bits",
        "a fraction of the smallest bit",
        columns.bit_pairs,
    ),
    TableKind(
        "group-gain",
        "group",
        "group of variable",
        "each level of {0} has a slope over {1} of its own",
        "between-point",
        "{y} per unit of {1}",
        "measure the range of {1} with every level of {0} in one sitting",
        "0.01 to 1 % of slope",
        columns.gains,
    ),
    TableKind(
        "group-by-group",
        "group",
        "pair of groups",
        "levels of {0} and {1} do not add up: each pair has an offset of its own",
        "between-point",
        "{y}",
        "repeat some pairs of {0} and {1} in random order",
        "the repeatability",
        columns.combined,
    ),
    TableKind(
        "bit-weights-by-group",
        "bits",
        "bits of group",
        "each level of {1} has errors of its own in the weights of its bits",
        "between-point",
        "{y}",
        "measure all codes with every level of {1} in one sitting",
        "a fraction of the smallest bit",
        columns.bit_weights_by,
    ),
)
