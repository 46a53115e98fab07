"""Description of an unknown table: its columns, and options to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class SeenColumn:
    """A column.

    Attributes:
        name: as in the file.
        role: likely role: "response", "setting", "covariate", "time", "order", "direction", "group", "replicate",
            "constant", "uncertainty", "weight", "other output", "the same quantity", "text".
        values: its values in words.
        missing: number of missing values.
    """

    name: str
    role: str
    values: str
    missing: int


@dataclass(frozen=True)
class UnknownTable:
    """A table.

    Attributes:
        columns: in the order of the file.
        fit: options of `rig fit`, by name; {} if nothing can be fitted.
        trace: options of `rig trace`, by name.
        why_not: why there are no options, or why those of a trace have no time; "" if there is no reason to tell.
        curve: why the formula is no straight line; "" if it is one.
        responses: outputs of the same sort as that of the options, with it.
        notes: what to know about the proposal, as sentences.
    """

    columns: tuple[SeenColumn, ...]
    fit: Mapping[str, str]
    trace: Mapping[str, str]
    why_not: str = ""
    curve: str = ""
    responses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
