"""The parts that columns of any table play in a trace: response, settings, covariates, groups, time, direction."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.effects.tables_scene import Grouping, TableScene, Timeline, seconds_per_unit
from fitter.formula import Formula
from fitter.formula_text import Expression
from fitter.trace.tables import TableData
from rig.errors import UsageError
from rig.tables import Table, read_any_csv

_CLOCKS = re.compile(
    r"time|elapsed|date|^years?$|^t$|^t_?(s|sec|min|h|hours|days)$|^t_start|^hours?$|^days?$", re.IGNORECASE
)
_COUNTERS = re.compile(r"^(seq|sequence|order|block|index|row|reading|n|no|nr|number|run_order)$", re.IGNORECASE)
"""Names of columns taken for the time if nobody names one."""
_MORE = "steps, oscillations, carry-over and drifting sensitivity are looked for then too"
_MAYBE = ", and effects had to stand out from errors that are alike along the rows, as they are if taken in this order"
_SAME = 0.9999


@dataclass(frozen=True)
class Roles:
    """What the user says of the columns.

    Attributes:
        response: a column, or arithmetic of columns.
        formula: the declared model.
        group: columns whose levels may have offsets or gains of their own.
        whole_plot: columns that together say which rows share an error the declared model has.
        replicate: column of repeats, whose offsets are declared too.
        time: column of the time.
        direction: column of +-1, of a velocity, or a setting whose changes give the side it was approached from.
        candidates: the only other columns to be looked at; None for all.
        ignore: columns not to be looked at.
        wrap: turn that the response is brought back to, half on either side; None where it is no angle.

    """

    response: str
    formula: str
    group: tuple[str, ...] = ()
    whole_plot: tuple[str, ...] = ()
    replicate: str | None = None
    time: str | None = None
    direction: str | None = None
    candidates: tuple[str, ...] | None = None
    ignore: tuple[str, ...] = ()
    wrap: float | None = None

    @property
    def named(self) -> tuple[str, ...]:
        """Columns that play a part of their own and are no covariates."""
        given = (self.replicate, self.time, self.direction)
        return (*self.group, *self.whole_plot, *(name for name in given if name is not None))


def read_roles(path: Path, roles: Roles) -> tuple[Table, TableData, tuple[str, ...]]:
    """A CSV table, the same ready to be traced, and sentences about what was taken for what.

    Raises:
        UsageError: a column is missing, the formula cannot be read, or values do not fit their part.

    """
    formula = _parse("--formula", roles.formula)
    response = _parse("--response", f"0 + I({roles.response})")
    needed = dict.fromkeys([*response.names, *formula.names, *roles.named, *(roles.candidates or ())])
    table = read_any_csv(path, needed)
    return (table, *roles_of(table, roles))


def roles_of(table: Table, roles: Roles) -> tuple[TableData, tuple[str, ...]]:
    """`read_roles` of a table that was read; errors as there."""
    formula = _parse("--formula", roles.formula)
    response = _parse("--response", f"0 + I({roles.response})")
    try:
        return _roles(table, roles, formula, response)
    except (ValueError, KeyError) as error:
        raise UsageError(f"{table.source}: {error.args[0] if error.args else error}") from error


def _roles(table: Table, roles: Roles, formula: Formula, response: Formula) -> tuple[TableData, tuple[str, ...]]:
    missing = [name for name in roles.ignore if name not in {**table.columns, **table.text}]
    if missing:
        raise ValueError(f"--ignore: there is no column {missing[0]!r} without gaps; leave it away")
    notes: list[str] = []
    free = _free(table, roles, (*formula.names, *response.names))
    given = _subtracted(response)
    time, along = _time(table, roles, formula, (*formula.names, *given), free, notes)
    order = np.arange(len(table)) if time is None else np.argsort(time.values, kind="stable")
    columns: dict[str, Any] = {name: v[order] for name, v in {**table.columns, **table.text}.items()}
    if time is not None:
        time = replace(time, values=time.values[order])
        free = [name for name in free if name != time.name and not _alike(columns[name], time, notes, name)]
    y = response.columns(columns)[1][:, 0]
    if roles.wrap is not None:
        y = (y + 0.5 * roles.wrap) % roles.wrap - 0.5 * roles.wrap
    names, exact = formula.exact_columns(columns)
    if not names:
        raise ValueError(f"the formula {roles.formula!r} has no terms: there is nothing to compare with")
    if len(y) <= len(names):
        raise ValueError(f"{len(y)} rows are not enough for {len(names)} coefficients and an error")
    scene = TableScene(
        settings={
            **_settings(formula, columns),
            **{name: np.asarray(columns[name], np.float64) for name in given if np.ptp(columns[name]) > 0},
        },
        covariates={name: columns[name] for name in free if np.ptp(columns[name]) > 0},
        groups={
            **{name: _grouping(columns[name], declared=False) for name in roles.group},
            **{c.name: _grouping(columns[c.name], declared=True) for term in formula.terms for c in term.categories},
        },
        time=time,
        direction=_direction(roles, (*formula.names, *given), columns),
        speed=_speed(roles, (*formula.names, *given), columns),
    )
    shared = roles.whole_plot or ((roles.replicate,) if roles.replicate else ())
    hi, lo = exact.hi, exact.lo
    if roles.whole_plot and roles.replicate:
        extra = _grouping(columns[roles.replicate], declared=True).indicators[:, 1:]
        names = (*names, *(f"C({roles.replicate})[{i + 1}]" for i in range(extra.shape[1])))
        hi, lo = np.hstack([hi, extra]), np.hstack([lo, np.zeros_like(extra)])
    data = TableData(
        response=roles.response,
        y=np.asarray(y, np.float64),
        formula=str(formula),
        names=names,
        columns=hi,
        tails=lo,
        scene=scene,
        shared=_identities(columns, shared) if shared else None,
        points=_points(formula, columns, roles.group),
        order_unknown=along,
        numbers=order + 2,
    )
    return data, tuple(notes)


def _parse(option: str, text: str) -> Formula:
    try:
        return Formula.parse(text)
    except ValueError as error:
        raise UsageError(f"{option}: {error}") from error


def _free(table: Table, roles: Roles, used: Sequence[str]) -> list[str]:
    """Columns of numbers that play no other part: the covariates."""
    if roles.candidates is not None:
        text = [name for name in roles.candidates if name not in table.columns]
        if text:
            raise ValueError(f"--candidates: {text[0]} is text; as a grouping it goes with --group")
        return [name for name in roles.candidates if name not in used]
    taken = {*used, *roles.named, *roles.ignore}
    return [name for name in table.columns if name not in taken]


def _time(
    table: Table, roles: Roles, formula: Formula, settings: Sequence[str], free: Sequence[str], notes: list[str]
) -> tuple[Timeline | None, bool]:
    """The column of time, and whether rows may stand in the order of taking though nobody knows.

    The column is as told, else by its name if its values go up, else the order of rows if that can be it.
    """
    if roles.time is not None:
        if roles.time not in table.columns:
            raise ValueError(
                f"--time: {roles.time} is text; give a column of numbers, such as seconds or decimal years"
            )
        return Timeline(roles.time, table.columns[roles.time], seconds_per_unit(roles.time)), False
    for pattern in (_CLOCKS, _COUNTERS):
        for name in free:
            v = table.columns[name]
            if pattern.search(name) and len(np.unique(v)) > 0.5 * len(v) and np.mean(np.diff(v) >= 0) > 0.95:
                counts = pattern is _COUNTERS
                more = f"; --time {name} vouches for it: {_MORE}" if counts else ""
                what = "the order of taking" if counts else "the time"
                notes.append(f"{name} was taken for {what}; --ignore {name} leaves it out{more}")
                return Timeline(name, v, seconds_per_unit(name), presumed=pattern is _COUNTERS), False
    by = _sorted_by(table, roles, formula, settings, free)
    if by is not None and roles.direction not in settings:
        along = by in {*settings, *free} and _rises(table.columns[by])
        notes.append(
            f"rows are sorted by {by} and no column of time was given, so nobody knows in what order they were taken: "
            f"drift, steps, carry-over and lags were not looked for{_MAYBE if along else ''}; --time names the column"
        )
        return None, along
    notes.append(f"rows were taken to stand in the order of taking; --time names a column that tells: {_MORE}")
    return Timeline("row", np.arange(1.0, len(table) + 1.0), presumed=True), False


def _sorted_by(
    table: Table, roles: Roles, formula: Formula, settings: Sequence[str], free: Sequence[str]
) -> str | None:
    """What the rows are sorted by, if by anything that is not the time."""
    categories = [c.name for term in formula.terms for c in term.categories]
    for name in settings:
        if name in table.columns and name not in categories and _rises(table.columns[name]):
            return name
    for name in free:
        if _rises(table.columns[name]) and len(np.unique(np.sign(np.diff(table.columns[name])))) == 1:
            return name
    every = {**table.columns, **table.text}
    for name in dict.fromkeys((*roles.group, *roles.whole_plot, *categories)):
        codes = _codes(every[name])
        if np.count_nonzero(np.diff(codes)) == codes.max():
            return name
    for name in free:
        v = table.columns[name]
        if np.all(v == np.round(v)) and 1 < len(np.unique(v)) <= len(v) // 3 and np.all(np.diff(v) >= 0):
            return name
    return None


def _rises(v: FloatArray) -> bool:
    """Whether values go up or down all along, but for a few that scatter."""
    rank = np.argsort(np.argsort(v, kind="stable"), kind="stable").astype(np.float64)
    if np.ptp(v) == 0:
        return False
    return bool(abs(np.corrcoef(rank, np.arange(len(v)))[0, 1]) > 0.99)


def _alike(v: FloatArray, time: Timeline, notes: list[str], name: str) -> bool:
    """Whether a column says the same as the time."""
    if np.ptp(v) == 0 or np.ptp(time.values) == 0 or abs(np.corrcoef(v, time.values)[0, 1]) < _SAME:
        return False
    notes.append(f"{name} runs with {time.name} and was not looked at by itself")
    return True


def _settings(formula: Formula, columns: Mapping[str, Any]) -> dict[str, FloatArray]:
    """Variables of the declared model, and whatever stands in it in their place, such as log(R)."""
    found: dict[str, FloatArray] = {}
    for term in formula.terms:
        for factor in term.numeric:
            expression = _base(factor.expression)
            v = np.asarray(expression.value(columns), np.float64)
            if np.ptp(v) > 0:
                found[str(expression)] = v
    return found


def _subtracted(response: Formula) -> tuple[str, ...]:
    """What a response is the difference to: a setting whose coefficient is declared to be one."""
    expression = response.terms[0].numeric[0].expression
    right = expression.of[1] if expression.operation == "-" else None
    return right.of if right is not None and right.operation == "name" else ()


def _base(expression: Expression) -> Expression:
    """What is raised to a power; everything else as it is."""
    if expression.operation == "^" and expression.of[1].operation == "number":
        return _base(expression.of[0])
    return expression


def _direction(roles: Roles, settings: Sequence[str], columns: Mapping[str, Any]) -> tuple[str, FloatArray] | None:
    if roles.direction is None:
        return None
    v = columns[roles.direction]
    if v.dtype.kind not in "fiu":
        raise ValueError(f"--direction: {roles.direction} is text; give +1 and -1, a velocity or a setting")
    if roles.direction not in settings:
        side = np.sign(v)
        if len(np.unique(side)) < 2:
            raise ValueError(f"--direction: {roles.direction} has one sign only; there is nothing to compare")
        return f"sign({roles.direction})", side
    change = np.sign(np.diff(v, prepend=v[:1]))
    for i in range(1, len(change)):
        if change[i] == 0:
            change[i] = change[i - 1]
    return f"side({roles.direction})", change


def _speed(roles: Roles, settings: Sequence[str], columns: Mapping[str, Any]) -> tuple[str, FloatArray] | None:
    """The column of direction, where it is a velocity and not only a sign."""
    name = roles.direction
    if name is None or name in settings or len(np.unique(np.abs(columns[name]))) < 3:
        return None
    return name, np.asarray(columns[name], np.float64)


def _grouping(values: Any, *, declared: bool) -> Grouping:
    levels, index = np.unique(values, return_inverse=True)
    return Grouping(
        tuple(f"{v:g}" if levels.dtype.kind == "f" else str(v) for v in levels), index.astype(np.int64), declared
    )


def _codes(values: Any) -> IntArray:
    return np.asarray(np.unique(values, return_inverse=True)[1], np.int64)


def _identities(columns: Mapping[str, Any], names: Sequence[str]) -> IntArray:
    keys = np.column_stack([_codes(columns[name]) for name in names])
    return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1], np.int64).reshape(-1)


def _points(formula: Formula, columns: Mapping[str, Any], group: Sequence[str]) -> IntArray | None:
    """(n,) which rows repeat one setting; None where nothing is set."""
    names = tuple(dict.fromkeys((*formula.names, *group)))
    return _identities(columns, names) if formula.names else None
