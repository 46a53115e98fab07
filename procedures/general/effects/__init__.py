"""All effects that can be tested in a table: the kinds of the catalogue in the table's columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

from rig.fitter.effects.entry import Source
from rig.fitter.effects.manual_changes import ByHand, Change, resized_by
from rig.fitter.effects.sizes import Size
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.general.effects.catalogue import TABLE_CATALOGUE
from rig.procedures.general.effects.kind import Of, TableEffect, TableKind
from rig.procedures.general.effects.scene import TableScene, is_temperature

OTHER_METER = Change("meter-swapped", "read the sensors with another meter, if possible of another type")
OTHER_REFERENCE = Change("reference-swapped", "use another reference standard, if possible of another type")
OTHER_CHANNEL = Change("channel-swapped", "connect the sensors to other channels, not beside each other", anew=False)
REMOUNTED = Change("remount", "take the sensors out, and mount them again as they were")

MANUAL_CHANGES: Mapping[str, tuple[ByHand, ...]] = {
    "range-step": (resized_by(OTHER_METER),),
    "range-gain": (resized_by(OTHER_METER),),
    "reference-nonlinearity": (resized_by(OTHER_REFERENCE),),
    "cross-talk": (resized_by(OTHER_CHANNEL),),
    "direction": (resized_by(REMOUNTED),),
    "direction-gain": (resized_by(REMOUNTED),),
    "direction-by-covariate": (resized_by(REMOUNTED),),
}
"""By kind of effect: what a change of a part does to an error of this part."""


__all__ = ["TABLE_CATALOGUE", "TableEffect", "TableKind", "effects_of"]


def effects_of(scene: TableScene, response: str) -> Iterator[TableEffect]:
    """All effects that can be tested in a table, in catalogue order, then the laboratory's own."""
    for kind in TABLE_CATALOGUE:
        for names in _columns_for(kind.of, scene):
            yield _effect(kind.of_columns(names, response), names, response)
    yield from (effect for effect in scene.own if isinstance(effect, TableEffect))


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
        size=Size(lambda _term: (1.0, kind.unit.format(*names, y=spelled(unit_of(response)))), named=False),
        against=names[-1] if kind.of in ("direction of setting", "direction by covariate") else names[0],
        separate_by=kind.separate_by.format(*names, **words),
        usual_size=kind.usual_size,
        dynamic=kind.dynamic,
        manual_changes=MANUAL_CHANGES.get(kind.name),
        kind=kind,
        columns=names,
        family="temperature" if warm else kind.family,
    )


def _columns_for(of: Of, scene: TableScene) -> Iterator[tuple[str, ...]]:
    """The columns, or pairs of them, for effects of a kind."""
    settings, covariates = tuple(scene.settings), tuple(scene.covariates)
    groups = tuple(scene.groups)
    time = () if scene.time is None else (scene.time.name,)
    clock = () if scene.time is None or scene.time.presumed else time
    side = () if scene.direction is None else (scene.direction[0],)
    speed = () if scene.speed is None else (scene.speed[0],)
    bits = (",".join(scene.bits),) if scene.bits else ()
    pairs: dict[Of, Any] = {
        "constant": (("1",) for _ in settings[:1]),
        "group": ((g,) for g in groups),
        "group of variable": ((g, v) for g in groups for v in (settings or covariates)),
        "pair of groups": combinations(groups, 2),
        "setting": ((s,) for s in settings),
        "pair of settings": combinations(settings, 2),
        "covariate": ((c,) for c in covariates),
        "covariate of setting": ((c, s) for c in covariates for s in settings),
        "time": ((t,) for t in time),
        "clock": ((t,) for t in clock),
        "setting by the clock": ((s,) for s in settings if clock),
        "clock of setting": ((t, s) for t in clock for s in settings),
        "direction": ((d,) for d in side),
        "speed": ((v,) for v in speed),
        "direction of setting": ((d, s) for d in side for s in settings),
        "direction by covariate": ((d, c) for d in side for c in covariates),
        "bits": ((b,) for b in bits),
        "bits of group": ((b, g) for b in bits for g in groups),
    }
    return iter(pairs[of])


_SOURCES: dict[Of, Source] = {
    "constant": "setting",
    "group": "group",
    "group of variable": "group",
    "pair of groups": "group",
    "setting": "setting",
    "pair of settings": "setting",
    "covariate": "covariate",
    "covariate of setting": "covariate",
    "time": "time",
    "clock": "time",
    "setting by the clock": "time",
    "clock of setting": "time",
    "direction": "direction",
    "speed": "direction",
    "direction of setting": "direction",
    "direction by covariate": "direction",
    "bits": "setting",
    "bits of group": "group",
}
