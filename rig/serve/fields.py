"""Inputs of an act's form, from the fields of its class."""

from __future__ import annotations

import typing
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rig.acts import Act, Places
from rig.acts.act import KEPT, LINES, SECRET, of_field
from rig.errors import RigError
from rig.run_file.live import asked_by_hand, live_path, read_json


@dataclass(frozen=True)
class Input:
    """An input.

    Attributes:
        name: of the field.
        label: for people.
        value: as given.
        kind: "number", "text", "choice", "lines", "secret", "kept" for a value that is only carried along.
        choices: permitted values; () for any.
        needed: whether it has to be given.
    """

    name: str
    label: str
    value: str
    kind: str
    choices: tuple[str, ...]
    needed: bool


def inputs_of(act: type[Act], given: Mapping[str, str], places: Places) -> list[Input]:
    """Inputs of an act, with the values that are given."""
    given, found = {**act.proposed_values(given, places), **given}, []
    for name, field in act.model_fields.items():
        marks = of_field(act, name)
        choices = (
            ("no", "yes") if field.annotation is bool else tuple(_choices(str(marks.get("of", "")), given, places))
        )
        number = int in (field.annotation, *typing.get_args(field.annotation))
        default = "" if field.is_required() or field.default is None else str(field.default)
        default = "no" if field.default is False else default
        label = field.description or name
        asks = _asks(given.get("run", ""), places) if name == "value" else ""
        kind = "choice" if choices else "number" if number else "text"
        found.append(
            Input(
                name,
                f"{label} ({asks})" if asks else label,
                given.get(name, default)[: None if LINES in marks else 1000],
                next((mark for mark in (LINES, KEPT, SECRET) if mark in marks), kind),
                choices,
                field.is_required() or bool(asks),
            )
        )
    return found


def _choices(of: str, given: Mapping[str, str], places: Places) -> Iterable[str]:
    """Names that a field may have; of procedures those beside the bench, if that is given."""
    if of == "procedures":
        return places.procedures(places.benches().get(given.get("bench", "")))
    return getattr(places, of)() if of else ()


def _asks(run: str, places: Places) -> str:
    """Name with unit of the number that a run waits for; "" for none."""
    try:
        asked = asked_by_hand(read_json(live_path(places.run(run))) or {})
    except RigError:
        return ""
    return "" if asked is None else asked.value
