"""A trace in full on the terminal, of any kind of calibration: a block for each sensor, and what is so of all once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.evaluate.before_after import compared
from rig.procedures.present.blocks import Block, Grid, Line, Paragraph, headline
from rig.procedures.present.effects_shown import show_certificate, show_effect, show_unnamed
from rig.procedures.present.words import verdict_of

if TYPE_CHECKING:
    from rig.fitter.trace.outcome import Outcome
    from rig.procedures.evaluate.results import Traced
    from rig.procedures.tables.table import Table

_SETTINGS = 3
"""Rows of one error at several settings: those of the lowest; the others are in the JSON and the report."""


def in_full(traced: Traced, warning: Callable[[Mapping[str, Any]], str] = lambda sensor: "") -> Iterator[Block]:
    """Error before and after, parameters, effects, what remains, notes, and the paragraph for a certificate.

    Args:
        traced: of any kind.
        warning: a sentence of the kind about a sensor, from its JSON; "" for none.
    """
    told = traced.to_json()
    yield from opening(told, traced.table)
    notes = [sensor["notes"] for sensor in told["sensors"].values()]
    of_all = [note for note in notes[0] if len(notes) > 1 and all(note in own for own in notes)]
    for outcome in traced.outcomes:
        sensor = told["sensors"][outcome.sensor]
        yield from _sensor(outcome, sensor, of_all, warning(sensor))
    for note in of_all:
        yield Paragraph(f"[dim]all sensors: {escape(note)}[/]", 2)
    yield from closing(told)


def opening(told: Mapping[str, Any], table: Table) -> Iterator[Block]:
    """File, declared model, and sensors that are left out."""
    yield headline(told["data"]["file"], table)
    if isinstance(model := told["data"].get("model"), Mapping):
        yield Line(escape(model["sentence"]))
    yield from left_out(told)


def left_out(told: Mapping[str, Any]) -> Iterator[Block]:
    """Sensors that are left out, of a fit or a trace, with the reason."""
    for name, why in told.get("left_out", {}).items():
        yield Line(f"[red]{escape(name)} is left out:[/] it {escape(why)}")


def closing(told: Mapping[str, Any]) -> Iterator[Block]:
    """Effects that several sensors share, and sensors that could not be traced."""
    for shared in told.get("common", ()):
        yield Paragraph(escape(shared["sentence"]), 2)
    if missing := told.get("not_traced"):
        yield Paragraph(
            f"not traced: {escape(', '.join(missing))}; a trace needs a model that is linear in its coefficients", 2
        )


def _sensor(outcome: Outcome, sensor: Mapping[str, Any], of_all: Collection[str], warning: str) -> Iterator[Block]:
    name, declared = escape(outcome.sensor), escape(sensor["declared"])
    yield Line(f"\n[bold]{name}[/] (declared {declared}): [bold]{escape(verdict_of(sensor))}[/]", wrapped=True)
    yield from _errors(outcome)
    if outcome.parameters:
        yield from _parameters(outcome)
    yield from (Line(f"  [yellow]{escape(sentence)}[/]") for sentence in sensor.get("depends_on", ()))
    for effect in sensor["effects"]:
        yield from show_effect(effect)
    yield from show_unnamed(sensor)
    for text in (*(one["sentence"] for one in sensor.get("refused") or ()), warning):
        if text:
            yield Paragraph(f"[yellow]{escape(text)}[/]", 2)
    for note in sensor["notes"]:
        if note not in of_all:
            yield Paragraph(f"[dim]{escape(note)}[/]", 2)
    yield from show_certificate(sensor)


def _errors(outcome: Outcome) -> Iterator[Block]:
    rows = [row for row in compared(outcome) if not row.in_reports]
    rows = [*(row for row in rows if not row.setting), *[row for row in rows if row.setting][:_SETTINGS]]
    grid = Grid(("", "before", "after"))
    for row in rows:
        cells = zip((row.before, row.after), row.above, strict=True)
        grid.add_row(row.label, *(f"[yellow]{text} *[/]" if above else text for text, above in cells))
    yield grid
    if any(any(row.above) for row in rows):
        yield Line("  * above its 95 % limit", wrapped=True)


def _parameters(outcome: Outcome) -> Iterator[Block]:
    table = Grid(("parameter", "before", "standard error", "after", "standard error"))
    for one in outcome.parameters:
        sides = (one.before or one.after, one.after)
        table.add_row(one.label, *(text for side in sides for text in with_error(side.value, side.stderr)))
    yield table
    yield Line(f"  {outcome.more['at_degC_sentence']}")
