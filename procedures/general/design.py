"""Designs of a procedure of kind "general": the points of one replication, in standard order."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from procedures.general.factors import FactorSettings
from procedures.settings import Strict

MOST_POINTS = 100_000
"""Maximum length of a run list."""

Setting = tuple[float, ...]


class DesignSettings(Strict):
    """Points of one replication. grid: all combinations of the factors' levels. file: a table of points."""

    type: Literal["grid", "file", "central-composite", "optimal"] = "grid"
    points: str | int | None = Field(
        None,
        description="file: a CSV file beside the procedure, with a column for each factor and a row for each point; "
        "optimal: number of points",
    )
    rows: Annotated[list[list[float]], Field(min_length=1, max_length=MOST_POINTS)] | None = Field(
        None, description="file: its rows, one value for each factor; rig writes them when a run begins"
    )

    @model_validator(mode="after")
    def _keys_fit_the_type(self) -> Self:
        wanted = {"file": str, "optimal": int}.get(self.type)
        if wanted is None and self.points is not None:
            raise ValueError(f'design "{self.type}" does not use points')
        if wanted is not None and not isinstance(self.points, wanted):
            what = 'points = "FILE.csv"' if self.type == "file" else "points, a whole number"
            raise ValueError(f'design "{self.type}" needs {what}')
        if self.type != "file" and self.rows is not None:
            raise ValueError(f'design "{self.type}" does not use rows')
        if self.type in ("optimal", "central-composite"):
            raise ValueError(f'design "{self.type}" is not available yet: write its points to a file, type = "file"')
        return self

    def settings(self, factors: Mapping[str, FactorSettings]) -> list[Setting]:
        """Points of one replication, one value per factor. Raises ValueError if the factors do not say them."""
        if self.type == "file":
            return self._of_file(factors)
        missing = [name for name, factor in factors.items() if not factor.levels]
        if missing:
            raise ValueError(f"factors.{missing[0]}: a grid needs its levels")
        count = math.prod(len(factor.levels or ()) for factor in factors.values())
        if count > MOST_POINTS:
            raise ValueError(f"the grid has {count:,} points, more than {MOST_POINTS:,}")
        return list(itertools.product(*(factor.levels or () for factor in factors.values())))

    def _of_file(self, factors: Mapping[str, FactorSettings]) -> list[Setting]:
        given = [name for name, factor in factors.items() if factor.levels]
        if given:
            raise ValueError(f'factors.{given[0]}.levels is not used: the points are in "{self.points}"')
        width = len(factors)
        odd = next((at for at, row in enumerate(self.rows or ()) if len(row) != width), None)
        if odd is not None:
            raise ValueError(f"design.rows: row {odd + 1} does not have {width} values, one for each factor")
        return [tuple(row) for row in self.rows or ()]


def rows_of(text: str, file: str, factors: Sequence[str]) -> list[list[float]]:
    """Values of the factors in a table of points.

    Args:
        text: the file, CSV with a header; lines that begin with # are comments.
        file: its name, for messages.
        factors: names of its columns; others are refused.

    Raises:
        ValueError: with line and column of what cannot be used.
    """
    lines = [(n, line) for n, line in enumerate(text.lstrip("\ufeff").splitlines(), 1) if line.strip()]
    lines = [(n, line) for n, line in lines if not line.startswith("#")]
    if not lines:
        raise ValueError(f"{file} is empty; it needs a header with {', '.join(factors)}, and a row for each point")
    header, *body = [[cell.strip() for cell in row] for row in csv.reader([line for _, line in lines])]
    for name in factors:
        if header.count(name) != 1:
            raise ValueError(f"{file} has no column {name} (columns: {', '.join(header)})")
    for name in header:
        if name not in factors:
            raise ValueError(f"{file} has the column {name}, which is not a factor ({', '.join(factors)})")
    if not body:
        raise ValueError(f"{file} has no points")
    rows = []
    for (n, _), row in zip(lines[1:], body, strict=True):
        if len(row) != len(header):
            raise ValueError(f"{file}, line {n}: {len(row)} values under {len(header)} columns")
        rows.append([_number(row[header.index(name)], f"{file}, line {n}, {name}") for name in factors])
    return rows


def _number(text: str, where: str) -> float:
    try:
        value = float(text.replace("_", " _"))
    except ValueError:
        raise ValueError(f"{where}: {text!r:.40} is not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{where}: {text} is not a finite number")
    return value
