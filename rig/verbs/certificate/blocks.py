"""Blocks of which the parts of a certificate consist, and how numbers and days stand in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Literal

from rig.verbs.certificate.typeset import padding, raised, typeset

Align = Literal["left", "right", "bar"]


@dataclass(frozen=True)
class Facts:
    """Names and values; `mono` for values to be compared character by character."""

    rows: tuple[tuple[str, tuple[str, ...]], ...]
    mono: bool = False
    type: Literal["facts"] = "facts"


@dataclass(frozen=True)
class Sentences:
    """Paragraphs."""

    texts: tuple[str, ...]
    small: bool = False
    type: Literal["sentences"] = "sentences"


@dataclass(frozen=True)
class Head:
    """Head of a column: a label, its unit on the second line, and how its cells stand."""

    label: str
    unit: str = ""
    align: Align = "left"


@dataclass(frozen=True)
class Cell:
    """A cell: its text, invisible text behind it, and the length of a bar, 0 to 1."""

    text: str
    pad: str = ""
    bar: float = 0.0


@dataclass(frozen=True)
class Grid:
    """A table with a title and notes; it may be broken between pages, and its heads are repeated there."""

    title: str
    heads: tuple[Head, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()
    foot: tuple[tuple[str, str], ...] = ()
    type: Literal["grid"] = "grid"


@dataclass(frozen=True)
class Signatures:
    """Places to sign: task, name, role."""

    rows: tuple[tuple[str, str, str], ...]
    type: Literal["signatures"] = "signatures"


Block = Facts | Sentences | Grid | Signatures


@dataclass(frozen=True)
class Section:
    """A part with a heading; `annex` begins a new page."""

    title: str
    blocks: tuple[Block, ...]
    annex: bool = False


def grid(title: str, heads: Sequence[Head], texts: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> Grid:
    """A table of texts, in which numbers are printed as numbers and stand below each other."""
    heads = [replace(head, unit=raised(head.unit)) for head in heads]
    shown = [
        [typeset(text) if head.align == "right" else raised(text) for head, text in zip(heads, row, strict=True)]
        for row in texts
    ]
    pads = [
        padding([row[i] for row in shown]) if head.align == "right" else [""] * len(shown)
        for i, head in enumerate(heads)
    ]
    rows = tuple(tuple(Cell(text, pads[i][n]) for i, text in enumerate(row)) for n, row in enumerate(shown))
    return Grid(title, tuple(heads), rows, tuple(notes))


def text_grid(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> Grid:
    """A table of texts alone."""
    return grid(title, [Head(name) for name in heads], rows, notes)


def day(when: date) -> str:
    """A date that nobody reads as another: 2026-11-24."""
    return when.isoformat()


def percent(probability: str) -> str:
    """A probability in percent, with its digits: `0.9545` is `95.45 %`. Any other text is unchanged."""
    if probability[:2] in ("> ", "< "):
        return probability[:2] + percent(probability[2:])
    whole, point, digits = probability.partition(".")
    if not (whole.isdigit() and digits.isdigit() and point):
        return probability
    moved = f"{whole}{digits:0<2}"
    shown = f"{moved[: len(whole) + 2]}.{moved[len(whole) + 2 :]}".lstrip("0").rstrip(".")
    return f"{'0' if shown.startswith('.') or not shown else ''}{shown} %"
