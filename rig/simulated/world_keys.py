"""Keys of world files, and faults of simulated benches."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields
from importlib.metadata import entry_points
from inspect import getdoc
from typing import Any

from rig.procedures.present.markdown import table
from rig.sims.faults import COMMON, Kind, kinds_of
from rig.sims.physics.fields import Number, NumberBySensor, Several, Word, kind_of
from rig.sims.physics.laboratory_truth import AnySensorTruth, DrawTruth, LagTruth, SourceTruth, StandardTruth
from rig.sims.physics.pressure_truth import TransducerTruth
from rig.sims.physics.truth import SensorTruth, Truth
from rig.sims.physics.undeclared import AttitudeEffects, Effects
from rig.sims.twin import TwinClass
from rig.simulated.dry_run import twin_class

_NAMED: dict[str, tuple[type, ...]] = {
    "sensors": (SensorTruth, TransducerTruth, AnySensorTruth),
    "sources": (SourceTruth,),
    "lags": (LagTruth,),
    "draws": (DrawTruth,),
    "references": (StandardTruth,),
}
"""Tables with names of their own: the classes that they may be."""


def world() -> str:
    """Every key of a world file."""
    return "\n".join(_world())


def _world() -> Iterator[str]:
    yield "`seed`: whole number, default 1; key of all noise. `epoch`: when the world begins, a date and time, UTC.\n"
    for found in fields(Truth):
        if found.name in _NAMED:
            for one in _NAMED[found.name]:
                yield f"## `[{found.name}.NAME]`\n"
                yield from _keys(one)
        elif found.name == "effects":
            yield from _effects()
        elif kind_of(found) is None:
            same = found.name.replace("sse_", "sensor_")
            yield f"## `[{found.name}]`\n"
            yield from [f"As `[{same}]`.\n"] if same != found.name else _keys(found.default_factory)  # type: ignore[arg-type]  # a table of its own
    yield "## `[[faults]]`\n\nWhat goes wrong, and when: `rig explain faults`.\n"


def _keys(one: type) -> Iterator[str]:
    """Description and keys of a table."""
    said, _, about = (getdoc(one) or "").partition("\nAttributes:\n")
    meanings = {
        name: " ".join(meaning.split()).rstrip(".")
        for name, meaning in re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", about, re.MULTILINE)
    }
    yield said.strip() + "\n"
    rows = [(f"`{f.name}`", _values(f), _default(f), meanings.get(f.name, "")) for f in fields(one)]
    yield table(("key", "value", "default", "meaning"), rows)


def _effects() -> Iterator[str]:
    """Every table of effects, with its keys."""
    yield "## `[effects.NAME]`\n"
    yield (
        'All off unless given. A key "by sensor" is one number for all sensors or a table, `{ x = 40, z = -15 }`, in '
        "which sensors that are not named have none of it. The first ones are of attitude sensors and their head, "
        "those from `third_order_pressure` on of pressure transducers. An effect of sensors that "
        "the bench does not have is an error.\n"
    )
    of_attitude = {f.name for f in fields(AttitudeEffects)}
    rows = []
    for found in sorted(fields(Effects), key=lambda f: f.name not in of_attitude):
        kind = kind_of(found)
        one: Any = kind.table if isinstance(kind, Several) else found.default_factory
        name = f"`[[effects.{found.name}]]`" if isinstance(kind, Several) else f"`[effects.{found.name}]`"
        keys = ", ".join(f"`{f.name}` ({_values(f)}; {_default(f)})" for f in fields(one))
        rows.append((name, keys, " ".join((getdoc(one) or "").split())))
    yield table(("table", "keys (values; default)", "what happens"), rows)


def _values(found: Field[Any]) -> str:
    """Permitted values of a key."""
    kind = kind_of(found)
    if isinstance(kind, Number):
        return f"number{_range(kind.low, kind.high)}"
    if isinstance(kind, NumberBySensor):
        return "number, by sensor"
    if isinstance(kind, Word):
        return " or ".join(f'`"{word}"`' for word in kind.words)
    return {"Switch": "true or false", "Text": "formula", "Name": "factor"}[type(kind).__name__]


def _range(low: float, high: float) -> str:
    if high == float("inf"):
        return "" if low == -high else f" from {low:g}"
    return f" {low:g} to {high:g}"


def _default(found: Field[Any]) -> str:
    value = found.default
    if value is MISSING or value is None or value == "":
        return ""
    return (
        "true"
        if value is True
        else "false"
        if value is False
        else f"{value:g}"
        if isinstance(value, float)
        else str(value)
    )


def faults() -> str:
    """Every kind of fault, with its target and keys."""
    twins = {point.name: twin_class(point.name) for point in entry_points(group="rig.twins")}
    own = {kind.name: kind for twin in twins.values() for kind in twin.faults}
    kinds = {kind.name: kind for kind in (*COMMON, *own.values())}.values()
    rows = [(f"`{kind.name}`", _whom(kind, twins), kind.sentence, _fault_keys(kind)) for kind in kinds]
    return table(("kind", "hits", "what happens", "keys and defaults"), rows)


def _fault_keys(kind: Kind) -> str:
    options = (
        f"`{key}` {f'{one.default:g}' if isinstance(one.default, float) else one.default or '(none)'}: {one.meaning}"
        + (f" ({', '.join(one.words)})" if one.words else "")
        for key, one in kind.options.items()
    )
    counts = f"`times` 1 ({kind.counts})" if kind.counts else ""
    lasts = f"`for_s` {kind.lasts_s:g}" if kind.lasts_s else ""
    return "; ".join(filter(None, (counts, lasts, *options)))


def _whom(kind: Kind, twins: Mapping[str, TwinClass]) -> str:
    """Targets of a kind of fault: wires, or drivers."""
    if kind.of_bench or kind.wires:
        return "the bench" if kind.of_bench else ", ".join(kind.wires)
    names = sorted(name for name, twin in twins.items() if kind.name in kinds_of(twin))
    return "any instrument" if len(names) == len(twins) else ", ".join(names)
