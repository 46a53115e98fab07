"""A calibration of many sensors on one screen: a row a sensor, and each remark once."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape

from rig.procedures.present.blocks import Block, Grid, Paragraph

MANY = 3
"""Up to so many sensors, everything is shown at once."""


def sensors_in_short(
    sensors: Mapping[str, Mapping[str, Any]], columns: Sequence[str], cells: Mapping[str, Sequence[str]]
) -> Iterator[Block]:
    """A row a sensor with these cells and its number of gross errors, then all remarks.

    Args:
        sensors: as in the JSON of `rig fit`: each has "gross_errors" and "notes", if there are any.
        columns: headings of the cells.
        cells: by sensor.
    """
    grid = Grid(("sensor", *columns, "gross errors"), frame="plain", apart=2)
    for name, sensor in sensors.items():
        rows = len(sensor["gross_errors"]["rows"])
        grid.add_row(escape(name), *map(escape, cells[name]), f"[yellow]{rows}[/]" if rows else "none")
    yield grid
    yield from remarks({name: list(_notes(sensor)) for name, sensor in sensors.items()})


def _notes(sensor: Mapping[str, Any]) -> Iterator[str]:
    """Notes of a sensor, and of the methods by which it was fitted."""
    yield from sensor.get("notes", ())
    for method, fitted in sensor.get("methods", {}).items():
        if fitted["note"]:
            yield f"{method}: {fitted['note']}"


def remarks(of: Mapping[str, Iterable[str]]) -> Iterator[Block]:
    """Remarks of sensors; those that differ in numbers alone stand once, and say of which sensor the numbers are.

    Example:
        >>> [one.text for one in remarks({"a": ["low by 3 V"], "b": ["low by 4 V"], "c": []})]
        ['[yellow]a, b: low by 3 V (numbers of a)[/]']
    """
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, every in of.items():
        for note in every:
            alike.setdefault(_shape(note, name), []).append((name, note))
    for same in alike.values():
        names, (first, note) = [name for name, _ in same], same[0]
        who = "all" if len(names) == len(of) and len(of) > 1 else ", ".join(names)
        whose = f" (numbers of {first})" if len({text for _, text in same}) > 1 else ""
        yield Paragraph(f"[yellow]{escape(who)}: {escape(note)}{escape(whose)}[/]", 2)


def _shape(note: str, sensor: str) -> str:
    """A note without its numbers and sensor."""
    return re.sub(r"[\d.]+", "#", re.sub(rf"\b{re.escape(sensor)}\b", "#", note))
