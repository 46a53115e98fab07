"""Designs of a procedure of kind "general": the points of one replication, in standard order."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.procedures.general.factors import AS_WRITTEN, FactorSettings
from rig.procedures.plan.settings import Strict

MOST_POINTS = 100_000
"""Maximum length of a run list."""
PLOT = "whole_plot"
"""Column of a file of points with the whole plot of each, if factors are hard to change."""

Setting = tuple[float, ...]


@dataclass(frozen=True)
class Points:
    """Points of one replication.

    Attributes:
        settings: one value per factor.
        plots: whole plot of each; None if points with the same hard settings share one.
    """

    settings: tuple[Setting, ...]
    plots: tuple[int, ...] | None = None


class DesignSettings(Strict):
    """Points of one replication.

    grid: all combinations of the factors' levels. central-composite: between the extremes of their levels. file: a
    table of points. optimal: the most precise choice of points among all combinations, for the declared models.
    """

    type: Literal["grid", "central-composite", "file", "optimal"] = "grid"
    points: str | int | None = Field(
        None,
        description="file: a CSV file beside the procedure, with a column for each factor, a row for each point, and "
        "perhaps a column whole_plot (without it, points with the same hard settings share one; if these are as "
        "written, only neighbours do); optimal: number of points",
    )
    criterion: Literal["D", "I"] = Field("D", description="optimal: D, precise coefficients; I, precise predictions")
    whole_plots: int | None = Field(
        None, ge=1, le=10_000, description="optimal, with factors that are hard to change: number of whole plots"
    )
    centre: int = Field(4, ge=0, le=100, description="central-composite: number of points at the centre")
    form: Literal["inscribed", "face-centred"] = Field(
        "inscribed",
        description="central-composite: axial points at the extremes and the cube inside; or both at the extremes",
    )
    rows: Annotated[list[list[float]], Field(min_length=1, max_length=MOST_POINTS)] | None = Field(
        None, description="file and optimal: the points, one value for each factor; rig writes them when a run begins"
    )
    plots: Annotated[list[int], Field(min_length=1, max_length=MOST_POINTS)] | None = Field(
        None, description="file and optimal: the whole plot of each row; rig writes them when a run begins"
    )

    @model_validator(mode="after")
    def _keys_fit_the_type(self) -> Self:
        keys = {
            "grid": set[str](),
            "central-composite": {"centre", "form"},
            "file": {"points", "rows", "plots"},
            "optimal": {"points", "criterion", "whole_plots", "rows", "plots"},
        }[self.type]
        extra = sorted(self.model_fields_set - keys - {"type"})
        if extra:
            raise ValueError(f'design "{self.type}" does not use {", ".join(extra)}')
        wanted = {"file": str, "optimal": int}.get(self.type)
        if wanted is not None and not isinstance(self.points, wanted):
            what = 'points = "FILE.csv"' if self.type == "file" else "points, a whole number"
            raise ValueError(f'design "{self.type}" needs {what}')
        if self.plots is not None and len(self.plots) != len(self.rows or ()):
            raise ValueError("design.plots needs one number for each of design.rows")
        return self

    @property
    def known(self) -> bool:
        """Whether its points are known; those of a file or a search are written into the procedure."""
        return self.type not in ("file", "optimal") or self.rows is not None

    def settings(self, factors: Mapping[str, FactorSettings]) -> Points:
        """Points of one replication, one value per factor. Raises ValueError if the factors do not say them."""
        if self.rows is not None:
            width = len(factors)
            odd = next((at for at, row in enumerate(self.rows) if len(row) != width), None)
            if odd is not None:
                raise ValueError(f"design.rows: row {odd + 1} does not have {width} values, one for each factor")
            plots = None if self.plots is None else tuple(self.plots)
            return Points(tuple(tuple(row) for row in self.rows), plots)
        check_levels(self.type, factors)
        levels = [factor.levels or [] for factor in factors.values()]
        if self.type == "central-composite":
            return Points(self._central(levels))
        count = math.prod(len(each) for each in levels)
        if count > MOST_POINTS:
            raise ValueError(f"the grid has {count:,} points, more than {MOST_POINTS:,}")
        return Points(tuple(itertools.product(*levels)))

    def _central(self, levels: Sequence[Sequence[float]]) -> tuple[Setting, ...]:
        from rig.fitter.designs import central_composite, to_range  # noqa: PLC0415 - scipy's sparse graphs take a while

        try:
            coded = central_composite(len(levels), kind=self.form, centre=self.centre).points
        except FitError as error:
            raise ValueError(str(error)) from None
        low, high = [min(each) for each in levels], [max(each) for each in levels]
        found = np.round(to_range(coded, low, high), 12)
        return tuple(tuple(row) for row in found.tolist())


def check_levels(design: str, factors: Mapping[str, FactorSettings]) -> None:
    """Refuse factors whose levels do not go with the type of design. Raises ValueError."""
    for name, factor in factors.items():
        if design == "file" and factor.levels:
            raise ValueError(f"factors.{name}.levels is not used: the points are in a file")
        if design != "file" and not factor.levels:
            raise ValueError(f'factors.{name}: design "{design}" needs its levels')
        if design in ("central-composite", "optimal") and len(factor.levels or ()) < 2:
            raise ValueError(f'factors.{name}: design "{design}" needs two levels or more')


def check_whole_plots(points: Points, factors: Mapping[str, FactorSettings], *, steps: bool) -> None:
    """Refuse whole plots that do not go with the factors.

    Args:
        points: of one replication.
        factors: by name, in the order of the settings.
        steps: whether the points are steps in their order, as the rows of a file.

    Raises:
        ValueError: with the defect and what would mend it.
    """
    if points.plots is None:
        return
    hard = [factor.hard for factor in factors.values()]
    if not any(hard):
        raise ValueError("the points have a column whole_plot, and no factor is hard to change: hard = true")
    stood: dict[int, Setting] = {}
    for setting, plot in zip(points.settings, points.plots, strict=True):
        stands = tuple(value for value, stiff in zip(setting, hard, strict=True) if stiff)
        if stood.setdefault(plot, stands) != stands:
            raise ValueError(f"whole plot {plot} of the points has two settings of a factor that is hard to change")
    if steps and all(factor.order == AS_WRITTEN for factor in factors.values() if factor.hard):
        begun = [plot for plot, _ in itertools.groupby(points.plots)]
        again = next((plot for at, plot in enumerate(begun) if plot in begun[:at]), None)
        if again is not None:
            raise ValueError(
                f"the rows of whole plot {again} of the points are not together, and are measured as written: give the "
                "later ones a number of their own"
            )


def model_matrix(formulas: Sequence[Formula], factors: Sequence[str]) -> tuple[Formula, tuple[str, ...]]:
    """All terms of some formulas as one, and its names for settings of these factors. Raises `FitError`."""
    terms = dict.fromkeys(term for one in formulas for term in one.terms)
    model = Formula(tuple(sorted(terms, key=len)))
    unknown = [name for name in model.names if name not in factors]
    if unknown:
        raise FitError(f"its terms have {unknown[0]}, which is not a factor ({', '.join(factors)})")
    if model.has_categories:
        raise FitError("a term is a category, C(); a search compares numbers only")
    names, _ = model.columns({name: np.zeros(1) + 0.5 for name in factors})
    return model, names


def optimal_rows(
    settings: DesignSettings, factors: Mapping[str, FactorSettings], formulas: Sequence[str], ratio: float, seed: int
) -> tuple[list[list[float]], list[int] | None]:
    """Points of an optimal design for all terms of the formulas, and their whole plots.

    Args:
        settings: of the design.
        factors: by name.
        formulas: the declared models.
        ratio: standard deviation between whole plots over that of a point.
        seed: of its starts.

    Raises:
        ValueError: with the defect and what would mend it.
    """
    from rig.fitter.designs import Factor, optimal  # noqa: PLC0415 - scipy's sparse graphs take a while

    check_levels("optimal", factors)
    hard = tuple(at for at, factor in enumerate(factors.values()) if factor.hard)
    if bool(hard) != (settings.whole_plots is not None):
        says = "say their number, design.whole_plots" if hard else "leave out design.whole_plots"
        raise ValueError(f"{'hard factors are in whole plots' if hard else 'no factor is hard to change'}: {says}")
    try:
        model, names = model_matrix([Formula.parse(text) for text in formulas], tuple(factors))

        def columns(points: FloatArray) -> FloatArray:
            return model.columns(dict(zip(factors, points.T, strict=True)))[1]

        found = optimal(
            [Factor.at(factor.levels or ()) for factor in factors.values()],
            columns,
            int(settings.points or 0),
            names=names,
            hard=hard,
            whole_plots=settings.whole_plots,
            eta=ratio**2,
            criterion=settings.criterion,
            seed=seed % 2**32,
        )
    except FitError as error:
        raise ValueError(f"design: {error}") from None
    plots = None if found.whole_plot is None else [int(plot) + 1 for plot in found.whole_plot]
    return found.points.tolist(), plots


def rows_of(text: str, file: str, factors: Sequence[str]) -> tuple[list[list[float]], list[int] | None]:
    """Values of the factors in a table of points, and the whole plot of each row if it has such a column.

    Args:
        text: the file, CSV with a header; lines that begin with # are comments.
        file: its name, for messages.
        factors: names of its columns; others but `whole_plot` are refused.

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
        if name not in (*factors, PLOT):
            raise ValueError(f"{file} has the column {name}, which is not a factor ({', '.join(factors)})")
    if not body:
        raise ValueError(f"{file} has no points")
    rows, plots = [], []
    for (n, _), row in zip(lines[1:], body, strict=True):
        if len(row) != len(header):
            raise ValueError(f"{file}, line {n}: {len(row)} values under {len(header)} columns")
        rows.append([_number(row[header.index(name)], f"{file}, line {n}, {name}") for name in factors])
        if PLOT in header:
            plots.append(_number(row[header.index(PLOT)], f"{file}, line {n}, {PLOT}"))
            if plots[-1] != int(plots[-1]) or plots[-1] < 1:
                raise ValueError(f"{file}, line {n}, {PLOT}: {plots[-1]:g} is not a whole number from 1 on")
    return rows, [int(plot) for plot in plots] or None


def _number(text: str, where: str) -> float:
    try:
        value = float(text.replace("_", " _"))
    except ValueError:
        raise ValueError(f"{where}: {text!r:.40} is not a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{where}: {text} is not a finite number")
    return value
