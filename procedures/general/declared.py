"""The declared model of a column of any table: a formula, arithmetic with named parameters, or a standard model.

With weights or stated standard uncertainties of its rows, and errors in the abscissa.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.fitter.arithmetic_text import column_name
from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula, RowError, check_sizes
from rig.fitter.nonlinear import Curve, Distance, Weighted, WrittenCurve
from rig.procedures.errors import DataError
from rig.procedures.general.order import identities
from rig.procedures.general.rows import CurveRows, LinearRows, Rows
from rig.procedures.general.series import Series
from rig.procedures.tables.table import Table

if TYPE_CHECKING:
    from rig.procedures.general.models import NamedCurve


@dataclass(frozen=True)
class Declared:
    """Declarations of the user about the model and of the errors of a response.

    Attributes:
        formula: terms of a linear model; arithmetic if there are `start` values and no `model`; None with `model`.
        model: name of a standard model; None with `formula`.
        abscissa: column of it; None where the table leaves no choice.
        start: `name=value` of parameters.
        weight: column of relative weights, 1 over the variance up to a factor.
        u_y: column or value of the standard uncertainty of the response.
        u_x: the same of the abscissa.
        series: series of rising and falling forces, whose figures are wanted; None for none.
    """

    formula: str | None = None
    model: str | None = None
    abscissa: str | None = None
    start: Sequence[str] = ()
    weight: str | None = None
    u_y: str | None = None
    u_x: str | None = None
    series: Series | None = None

    def __post_init__(self) -> None:
        if self.model is not None and self.formula is not None:
            raise DataError("--model and --formula declare one model each: give one of them")
        if self.model is None and self.formula is None:
            raise DataError(
                "--response needs --formula, such as --formula '1 + x', or --model, such as --model callendar"
            )
        if self.weight is not None and (self.u_y is not None or self.u_x is not None):
            raise DataError("--weight is relative and --u-y absolute: give one of them")
        if self.u_x is not None and self.u_y is None:
            raise DataError("--u-x needs --u-y, the standard uncertainty of the response: 0 is not possible")

    @property
    def stated(self) -> bool:
        """Whether the standard uncertainties of the rows are stated, not estimated from their scatter."""
        return self.u_y is not None

    @property
    def starts(self) -> dict[str, float]:
        """Start values by name. Raises `DataError`."""
        found: dict[str, float] = {}
        for text in (part for given in self.start for part in given.split(",")):
            name, mark, number = (each.strip() for each in text.partition("="))
            try:
                found[column_name(name)] = float(number)
            except ValueError:
                mark = ""
            if not mark or not name or not np.isfinite(found.get(column_name(name), np.nan)):
                raise DataError(f"--start {text.strip()}: say NAME=VALUE, such as --start a=1.5")
        return found

    def curve(self) -> Curve | None:
        """The curve, if no table is needed to know it: a formula or arithmetic. Raises `DataError`."""
        if self.formula is None:
            return None
        try:
            if self.start:
                return WrittenCurve.parse(self.formula, tuple(self.starts))
            return Formula.parse(self.formula)
        except FitError as error:
            raise DataError(f"--formula: {error}") from error

    def columns(self) -> list[str]:
        """Columns of the table that are known to be needed beside the response."""
        curve = self.curve()
        named = [one for one in (self.weight, self.u_y, self.u_x) if one is not None and _number(one) is None]
        series = self.series.columns if self.series else ()
        abscissa = [column_name(self.abscissa)] if self.abscissa else []
        return [*(curve.names if curve else ()), *abscissa, *map(column_name, named), *series]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


@dataclass(frozen=True, eq=False)
class Model:
    """A declared model over a table.

    Attributes:
        rows: of the table.
        curve: of a calibration.
        stated: (n,) standard uncertainty of each response, if stated.
        weight: (n,) relative weights, if given.
        names: of the columns it used.
        notes: for readers.
    """

    rows: Rows
    curve: Curve
    stated: FloatArray | None
    weight: FloatArray | None
    names: tuple[str, ...]
    notes: tuple[str, ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)


def model_of(declared: Declared, table: Table, response: str, plots: Sequence[str], replicate: str | None) -> Model:
    """The model over a table.

    Args:
        declared: by the user.
        table: with the columns it names.
        response: column.
        plots: columns that identify whole plots.
        replicate: column of replications of whole plots.

    Raises:
        FitError: the table lacks a column or value for it.
    """
    every: Mapping[str, Any] = {**table.columns, **table.text}
    y = table.columns[response]
    identity = identities(every, [*plots, *([replicate] if replicate else [])]) if plots else None
    blocks = identities(every, [replicate]) if plots and replicate else None
    u_y, u_x, weight = (_given(declared, each, table) for each in ("u_y", "u_x", "weight"))
    if identity is not None and (u_y is not None or weight is not None):
        raise FitError("--weight and --u-y are for independent rows: leave --whole-plot out, or the weights")
    curve: Curve | None = declared.curve()
    notes: list[str] = []
    start: FloatArray | None = None
    if curve is None:
        named = _named(declared, table, response)
        curve, start = named, _start_of(named, declared, table, y)
        from rig.procedures.general.models.units import unit_in  # noqa: PLC0415

        for name, quantity in ((named.variable, named.model.abscissa), (response, named.model.response)):
            if quantity.unit and not unit_in(name, table.units.get(name, "")):
                notes.append(f"the unit of {name} is not known from its name: it is taken for {quantity.unit}")
        if (beyond := named.outside(table.columns[named.variable])) > 0:
            low, high = named.model.valid
            notes.append(
                f"{beyond} rows are outside {low:g} to {high:g} {named.model.abscissa.unit}, where {named.model.name} "
                f"is valid: the curve is extrapolated there"
            )
    scale = _scale(weight if weight is not None else (None if u_y is None else u_y**-2.0))
    used = tuple(dict.fromkeys([*curve.names, *declared.columns()]))
    if isinstance(curve, Formula) and u_x is None:
        names, exact = curve.exact_columns(every)
        if not names:
            raise FitError(f"the formula {declared.formula!r} has no terms: there is nothing to fit")
        check_sizes(names, exact.hi)
        rows: Rows = LinearRows(names, exact.hi, exact.lo, y, identity, blocks, scale)
        return Model(rows, curve, u_y, weight, used, tuple(notes))
    if isinstance(curve, Formula):
        start = _linear_start(curve, table, y)
    elif start is None:
        start = np.array(list(declared.starts.values()))
    problem = _problem(curve, declared, table, y, scale, u_x, u_y)
    return Model(CurveRows(problem, start, identity, blocks), curve, u_y, weight, used, tuple(notes))


def _problem(
    curve: Curve,
    declared: Declared,
    table: Table,
    y: FloatArray,
    scale: FloatArray | None,
    u_x: FloatArray | None,
    u_y: FloatArray | None,
) -> Weighted | Distance:
    columns = {name: _numbers(table, name) for name in curve.names}
    if u_x is None or u_y is None:
        return Weighted(curve, columns, y, np.ones(len(y)) if scale is None else scale)
    if declared.abscissa is None and len(curve.names) != 1:
        raise FitError(f"--u-x: say which column has the errors, --abscissa {curve.names[0]}")
    name = curve.names[0] if declared.abscissa is None else column_name(declared.abscissa)
    if name not in curve.names:
        raise FitError(f"--abscissa: the model has no column {name}")
    return Distance(curve, columns, name, y, u_x, u_y)


def _linear_start(formula: Formula, table: Table, y: FloatArray) -> FloatArray:
    if formula.has_categories:
        raise FitError("--u-x is for formulas without categories")
    columns = formula.columns({**table.columns, **table.text})[1]
    return np.asarray(np.linalg.lstsq(columns, y, rcond=None)[0])


def _named(declared: Declared, table: Table, response: str) -> NamedCurve:
    """The standard model over its column."""
    from rig.procedures.general.models.named import NamedCurve, standard_model  # noqa: PLC0415
    from rig.procedures.general.models.units import to_model, unit_in  # noqa: PLC0415

    model = standard_model(declared.model or "")
    units = {name: unit_in(name, table.units.get(name, "")) for name in table.columns}
    if declared.abscissa is not None:
        name = column_name(declared.abscissa)
    else:
        named = [one for one in (declared.weight, declared.u_y, declared.u_x) if one is not None]
        aside = {*map(column_name, named), *(declared.series.columns if declared.series else ())}
        free = [one for one in table.columns if one not in {response, *aside, "order", "replicate", "simulated"}]
        fit = [one for one in free if units[one] == model.abscissa.unit and model.abscissa.unit]
        found = fit or free
        if len(found) != 1:
            told = ", ".join(found) or "no other column of numbers"
            raise FitError(f"--model {model.name}: which column is the {model.abscissa.name}? --abscissa says; {told}")
        name = found[0]
    if name not in table.columns:
        raise FitError(f"--abscissa: there is no column {name} of numbers")
    abscissa = to_model(units[name], model.abscissa.unit, name)
    return NamedCurve(model, name, abscissa, to_model(units[response], model.response.unit, response))


def _start_of(curve: NamedCurve, declared: Declared, table: Table, y: FloatArray) -> FloatArray:
    given = declared.starts
    strange = [name for name in given if name not in curve.parameters]
    if strange:
        raise FitError(f"--start: {curve.model.name} has no {strange[0]}; it has {', '.join(curve.parameters)}")
    if len(given) == len(curve.parameters):
        return np.array([given[name] for name in curve.parameters])
    found = curve.start(_numbers(table, curve.variable), y)
    return np.array([given.get(name, value) for name, value in zip(curve.parameters, found.tolist(), strict=True)])


def _numbers(table: Table, name: str) -> FloatArray:
    if name not in table.columns:
        raise FitError(f"{name} holds text, and a curve needs numbers")
    return table.columns[name]


def _given(declared: Declared, option: str, table: Table) -> FloatArray | None:
    """(n,) values of a weight or uncertainty: a column, or one number."""
    text = getattr(declared, option)
    if text is None:
        return None
    flag, name = f"--{option.replace('_', '-')}", column_name(text)
    number = _number(text)
    if name not in table.columns and number is None:
        raise FitError(f"{flag}: there is no column {name} of numbers, and it is no number")
    values = table.columns[name] if name in table.columns else np.full(len(table), number)
    least = 0.0 if option == "u_x" else np.finfo(float).tiny
    bad = np.flatnonzero(~(values >= least) | ~np.isfinite(values))
    if bad.size:
        limit = "at or above zero" if option == "u_x" else "above zero"
        raise RowError(f"{flag} is {values[bad[0]]:g} in", int(bad[0]), f"; it has to be {limit}")
    return values


def _scale(weight: FloatArray | None) -> FloatArray | None:
    return None if weight is None else np.asarray(np.sqrt(weight))
