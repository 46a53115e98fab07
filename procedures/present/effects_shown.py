"""Display of an effect on the command line, for any kind of run."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.markup import escape

from rig.fitter.rounding import with_error
from rig.procedures.present.blocks import Block, Line, Paragraph
from rig.procedures.present.numbers import interval_text
from rig.procedures.present.words import chance, constants_of, instead, share, units, unnamed

_STEPS = "▁▂▃▄▅▆▇█"
_NOTHING = "·"
"""Where the 95 % band holds zero."""
_WIDE, _LINES = 26, 7
"""Characters of a line at least, as far as whole ones for each value go; lines at most."""
_Z = 1.96


def picture(shape: Mapping[str, Any]) -> Iterator[str]:
    """One line for a curve, one for each value of the second variable of a surface, and one that explains them.

    Heights go from the lowest to the highest estimate; a dot stands where the shape may be zero.

    Args:
        shape: its JSON.

    """
    over, beside, estimate, stderr = shape["over"], shape["beside"], shape["estimate"], shape["stderr"]
    low, high = min(estimate), max(estimate)
    x = sorted(set(over["x"]))
    seconds = [None] if beside is None else sorted(set(beside["x"]), reverse=True)
    cells = {
        (over["x"][k], None if beside is None else beside["x"][k]): (estimate[k], stderr[k])
        for k in range(len(estimate))
    }
    each = max(_WIDE // len(x), 1)
    every = -(-len(seconds) // _LINES)
    shown = seconds[::every]
    labels = ["" if one is None or beside is None else _titled(beside, f"{one:.3g}") for one in shown]
    left = max(map(len, labels))
    for label, second in zip(labels, shown, strict=True):
        drawn = "".join(_cell(cells.get((one, second)), low, high) * each for one in x)
        yield f"{label:>{left}}  {drawn}".lstrip() if not left else f"{label:>{left}}  {drawn}"
    unit = f" {shape['unit']}" if shape["unit"] else ""
    band = _Z * sorted(stderr)[len(stderr) // 2]
    (lowest, _), (highest, half) = (with_error(end, band, sign=True) for end in (low, high))
    yield (
        f"{' ' * (left + 2) if left else ''}{over['label']} from {x[0]:.4g} to {_with_unit(over, f'{x[-1]:.4g}')}; "
        f"{_STEPS[0]} {lowest}, {_STEPS[-1]} {highest}{unit}, 95 % band +-{half}; {_NOTHING} may be zero"
    )


def _cell(value: tuple[float, float] | None, low: float, high: float) -> str:
    if value is None:
        return " "
    estimate, stderr = value
    if abs(estimate) <= _Z * stderr:
        return _NOTHING
    return _STEPS[min(int((estimate - low) / (high - low) * len(_STEPS)), len(_STEPS) - 1)] if high > low else _STEPS[0]


def _titled(axis: Mapping[str, Any], value: str) -> str:
    return f"{axis['label']} {_with_unit(axis, value)}"


def _with_unit(axis: Mapping[str, Any], value: str) -> str:
    return f"{value} {axis['unit']}" if axis["unit"] else value


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
