"""Display of an effect on the command line, for any kind of run."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.present.blocks import Block, Line, Paragraph
from rig.procedures.present.numbers import interval_text
from rig.procedures.present.text_picture import picture
from rig.procedures.present.words import chance, constants_of, instead, share, units, unnamed

_SHOWN = 6
"""Maximum number of displayed coefficients of an effect; the others are in the JSON and the report."""


def show_effect(effect: Mapping[str, Any]) -> Iterator[Block]:
    """Name, size and coefficients with intervals, confounded effects, and the measurement that would separate them."""
    stratum = "" if effect["stratum"] == "noise" else f" ({effect['stratum']})"
    yield Paragraph(f"[green]{escape(effect['effect'])}[/]{stratum}: {share(effect)}, p {chance(effect)}", 2)
    interval = "" if not effect["size_95"] else f" (95 %: {escape(effect['size_95'])}, conditional on the selection)"
    yield Paragraph(f"{escape(effect['size'])}{interval}", 4)
    yield from (Paragraph(escape(words), 4) for words in constants_of(effect))
    yield from _show_coefficients(effect)
    if formulas := effect.get("formulas"):
        options = " ".join(f"--add {shlex.quote(text)}" for text in formulas)
        yield Paragraph(f"to calibrate with it: rig fit ... {escape(options)}", 4)
    if effect["doubtful"]:
        yield Paragraph(f"doubtful: {escape(effect['doubtful'])}", 4)
    if effect["aliases"]:
        yield Paragraph(f"these data cannot distinguish it from: {escape(', '.join(effect['aliases']))}", 4)
        yield Paragraph(f"would separate them: {escape(effect['separate_by'])}", 4)
    elif effect["stratum"] != "noise":
        yield Paragraph(f"would confirm it: {escape(effect['separate_by'])}", 4)


def show_unnamed(found: Mapping[str, Any]) -> Iterator[Block]:
    """The remainder without a name: where, how much, a picture, the nearest names, and what would show more."""
    for rest, text in zip(found["unnamed"], unnamed(found), strict=True):
        yield Paragraph(f"[yellow]{escape(text)}[/]", 2)
        if (shape := rest.get("shape")) is not None:
            yield from _show_shape(shape)
    if text := instead(found):
        yield Paragraph(f"[yellow]{escape(text)}[/]", 2)
        yield from _show_shape(found["instead"]["shape"])


def _show_shape(shape: Mapping[str, Any]) -> Iterator[Block]:
    yield from (Line(f"    {escape(line)}") for line in picture(shape))
    if shape["measure"]:
        yield Paragraph(f"would show more: {escape(shape['measure'])}", 4)


def show_certificate(found: Mapping[str, Any]) -> Iterator[Block]:
    """The paragraph for a certificate, last of a sensor's output."""
    yield Line()
    yield Paragraph(f"[bold]for the certificate:[/] {escape(found['certificate'])}", 2)


def _show_coefficients(effect: Mapping[str, Any]) -> Iterator[Block]:
    columns = (effect["terms"], effect["coefficients"], effect["stderr"], effect["interval_95"], units(effect))
    rows: Sequence[tuple[Any, ...]] = list(zip(*columns, strict=True))
    for term, value, error, interval, unit in rows[:_SHOWN]:
        shown = " +- ".join(with_error(value, error)).removesuffix(" +- -")
        ends = "" if interval is None else f"  ({interval_text(interval, error)})"
        yield Paragraph(f"{shown} {escape(unit)}  {escape(term)}{ends}", 4)
    if len(rows) > _SHOWN:
        yield Paragraph(f"and {len(rows) - _SHOWN} more coefficients (--json)", 4)


def show_confirmed(record: Mapping[str, Any]) -> Iterator[Block]:
    """The run that judged a calibration's effects, and the used explanation of each."""
    yield Line(f"\njudged by {escape(record['by_run_id'])}")
    for effect in record["effects"]:
        yield Line(escape(f"  {effect['used']}. {effect['evidence']}"))
