"""Influences on results: what each stated error of recorded columns adds to them, by the whole evaluation.

The recorded columns are changed by one standard uncertainty up and down, and everything is evaluated again. So an error
that several results share keeps its sign in each, and one that cancels cancels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.budget import Influence, TypeA
from rig.procedures.evaluate.budgeting import Evaluation, Reading, Shift, Shifts, no_error

if TYPE_CHECKING:
    from rig.procedures.evaluate.stated import Stated, Statements
    from rig.procedures.tables.table import Columns

IN_SCATTER = (
    "{name}: independent in every observation, so it is in the scatter of the run already, and has no line of its own"
)
UNUSED = "{name}: the model of the results does not use it"
NEGLIGIBLE = 1e-12
Coefficients = Mapping[str, FloatArray]
"""(k,) coefficients by sensor."""


@dataclass(frozen=True, eq=False)
class Found:
    """Influences on m results.

    Attributes:
        influences: one error each.
        shifts: changes of the inputs by these errors.
        grouped: covariances of many independent errors of one source.
        notes: sentences about stated errors without a line.
    """

    influences: tuple[Influence, ...]
    shifts: tuple[Shifts, ...]
    grouped: tuple[TypeA, ...]
    notes: tuple[str, ...]


def corrected(columns: Columns, errors: Sequence[Stated]) -> Columns:
    """The columns with all stated corrections added, each computed from the recorded values."""
    found = dict(columns)
    for one in errors:
        for name in one.columns:
            if name in columns:
                correction = one.correction(one.quantity(name, columns[name]))
                found[name] = found[name] + one.moved(name, columns[name], correction)
    return found


def explain(evaluation: Evaluation, stated: Statements) -> None:
    """Tell an evaluation what lack of fit stated errors make, before its results are asked for."""
    base = evaluation.residuals({})
    expected = dict.fromkeys(base, 0.0)

    def add(shift: Shift) -> None:
        for sensor, left in evaluation.residuals(shift.columns).items():
            expected[sensor] += float(np.sum((left - base[sensor]) ** 2))

    for one in stated.errors if base else ():
        if (one.reads and not one.computed) or not any(name in evaluation.columns for name in one.columns):
            continue
        if one.behaves == "setting":
            for shift in _groups(evaluation, one):
                add(shift)
        elif one.behaves not in ("reading", "replication"):
            for _, shifts in _shifts(one, evaluation.columns, same_meter=False):
                add(shifts(1.0))
    for constant in stated.place.values() if base else ():
        for _, shifts in evaluation.of_place(constant):
            add(shifts(1.0))
    evaluation.explain(expected)


def influences(evaluation: Evaluation, stated: Statements, *, same_meter: bool) -> Found:
    """Influences on the results of an evaluation.

    Args:
        evaluation: of corrected columns.
        stated: what the register states.
        same_meter: whether the meter of the run reads the sensors in use as well, with the same error.
    """
    single: list[Influence] = []
    changes: list[Shifts] = []
    grouped: list[TypeA] = []
    notes: list[str] = []
    scale = np.maximum(np.abs(evaluation.results.values), 1e-300)

    def add(name: str, source: str, df: float, distribution: str, shifts: Shifts) -> bool:
        moved = sensitivity(evaluation, shifts)
        acts = bool(np.any(np.abs(moved) > NEGLIGIBLE * scale))
        if acts:
            single.append(Influence(name, source, "B", moved, df, distribution))  # type: ignore[arg-type]
            changes.append(shifts)
        return acts

    for one in stated.errors:
        if not any(name in evaluation.columns for name in one.columns):
            notes.append(UNUSED.format(name=one.name))
        elif one.behaves == "reading":
            notes.append(IN_SCATTER.format(name=one.name))
        elif one.behaves in ("setting", "replication"):
            covariance = _independent(evaluation, one)
            if np.any(covariance):
                grouped.append(TypeA(covariance, one.df, one.name, one.source, "B"))
            else:
                notes.append(UNUSED.format(name=one.name))
        else:
            parts = dict(_shifts(one, evaluation.columns, same_meter=same_meter))
            did = [add(f"{one.name}{part}", one.source, one.df, one.distribution, s) for part, s in parts.items()]
            if not any(did):
                notes.append(UNUSED.format(name=one.name))
    for constant in stated.place.values():
        did = [
            add(f"{constant.name.replace('_', ' ')}{part}", constant.source, constant.df, constant.distribution, shifts)
            for part, shifts in evaluation.of_place(constant)
        ]
        if constant.standard and not any(did):
            notes.append(UNUSED.format(name=constant.name.replace("_", " ")))
    grouped += evaluation.model_errors()
    grouped += evaluation.reversibility()
    return Found(tuple(single), tuple(changes), tuple(grouped), (*notes, *evaluation.notes()))


def with_more(found: Found, evaluation: Evaluation, more: Iterable[tuple[str, str, Shifts]]) -> Found:
    """Influences with further normal ones: name, source, and the change by one standard uncertainty."""
    given = list(more)
    own = [Influence(name, source, "B", sensitivity(evaluation, shifts)) for name, source, shifts in given]
    changes = (*found.shifts, *(shifts for _, _, shifts in given))
    return replace(found, influences=(*found.influences, *own), shifts=changes)


@dataclass(frozen=True, eq=False)
class StoredInfluence:
    """One influence on the coefficients of a calibration, for its use.

    Attributes:
        name: of the influence.
        source: what it is traced to.
        df: degrees of freedom.
        modes: independent changes by one standard uncertainty each: coefficients by sensor, up and down.
        in_use: error of readings in use by the same meter: by column, its value at zero and its slope.
    """

    name: str
    source: str
    df: float
    modes: tuple[tuple[Coefficients, Coefficients], ...]
    in_use: Mapping[str, tuple[float, float]]


def kept(evaluation: Evaluation, stated: Statements) -> tuple[list[StoredInfluence], list[str]]:
    """Influences on the coefficients of a calibration, and sentences about errors that are not kept for its use."""
    base = evaluation.coefficients({})
    found: list[StoredInfluence] = []
    notes: list[str] = []

    def add(name: str, source: str, df: float, shifts: Shifts, in_use: Mapping[str, tuple[float, float]]) -> None:
        up, down = (evaluation.coefficients(shifts(sign).columns) for sign in (1.0, -1.0))
        if any(np.any(up[sensor] != down[sensor]) for sensor in up) or in_use:
            found.append(StoredInfluence(name, source, df, ((up, down),), in_use))

    for one in stated.errors:
        if one.behaves == "reading" or not any(name in evaluation.columns for name in one.columns):
            continue
        if one.behaves in ("setting", "replication"):
            modes = tuple(_modes(evaluation, one, base))
            found += [StoredInfluence(one.name, one.source, one.df, modes, {})] if modes else []
            continue
        lines = _lines_in_use(one, evaluation.columns) if one.reads else {}
        if lines is None:
            notes.append(f"{one.name}: it is no straight line over the readings, so --same-meter takes it as another's")
        for part, shifts in _shifts(one, evaluation.columns, same_meter=False):
            add(f"{one.name}{part}", one.source, one.df, shifts, lines or {})
    for constant in stated.place.values():
        for part, shifts in evaluation.of_place(constant):
            add(f"{constant.name.replace('_', ' ')}{part}", constant.source, constant.df, shifts, {})
    return found, [*notes, *evaluation.not_kept()]


def _lines_in_use(one: Stated, columns: Columns) -> dict[str, tuple[float, float]] | None:
    """Error of readings, as a straight line by column; None if it is none."""
    found = {}
    for name in (name for name in _used(one, columns) if name not in one.computed):
        values = np.linspace(float(columns[name].min()), float(columns[name].max()), 9)
        error = size(one, name, values)
        slope, start = np.polyfit(values, error, 1) if np.ptp(values) > 0 else (0.0, error[0])
        if np.abs(start + slope * values - error).max() > 1e-9 * np.abs(error).max():
            return None
        found[name] = (float(start), float(slope))
    return found


def _modes(evaluation: Evaluation, one: Stated, base: Coefficients) -> Iterator[tuple[Coefficients, Coefficients]]:
    """Principal changes of all coefficients together by many independent errors."""
    sizes = [len(base[sensor]) for sensor in base]
    rows = []
    for moved in _groups(evaluation, one):
        changed = evaluation.coefficients(moved.columns)
        rows.append(np.concatenate([changed[sensor] - base[sensor] for sensor in base]))
    unit = np.max(np.abs(rows), axis=0, initial=1e-300)
    _, values, vectors = np.linalg.svd(np.array(rows) / unit, full_matrices=False)
    for value, vector in zip(values, vectors, strict=True):
        if value > NEGLIGIBLE * values[0] > 0.0:
            parts = np.split(value * vector * unit, np.cumsum(sizes)[:-1])
            up, down = (
                {sensor: base[sensor] + sign * part for sensor, part in zip(base, parts, strict=True)}
                for sign in (1, -1)
            )
            yield up, down


def sensitivity(evaluation: Evaluation, shifts: Shifts) -> FloatArray:
    """(m,) change of the results for one standard uncertainty: central difference of the whole evaluation."""
    return (evaluation.evaluate(shifts(1.0)) - evaluation.evaluate(shifts(-1.0))) / 2.0


def _shifts(one: Stated, columns: Columns, *, same_meter: bool) -> Iterator[tuple[str, Shifts]]:
    """Errors common to all observations: the added word of the name, and the change."""
    if one.behaves == "turn":
        yield ", in phase", _shift_of(one, columns, np.sin)
        yield ", in quadrature", _shift_of(one, columns, np.cos)
        return
    yield "", _shift_of(one, columns, np.ones_like, _in_use(one) if same_meter and one.reads else no_error)


def _shift_of(one: Stated, columns: Columns, wave: Callable[..., FloatArray], in_use: Reading = no_error) -> Shifts:
    def shifts(times: float) -> Shift:
        moved = {
            name: times * size(one, name, columns[name]) * wave(np.radians(columns[name]))
            for name in _used(one, columns)
        }
        return Shift(moved, lambda name, values: times * in_use(name, values))

    return shifts


def _used(one: Stated, columns: Columns) -> Iterator[str]:
    return (name for name in one.columns if name in columns)


def size(one: Stated, column: str, values: FloatArray) -> FloatArray:
    """(n,) signed error of one standard uncertainty, in the column's unit; that of a gain has the sign of the value."""
    quantity = one.quantity(column, values)
    error = one.standard(quantity)
    return one.moved(column, values, np.asarray(error * np.sign(quantity) if one.behaves == "gain" else error))


def _in_use(one: Stated) -> Reading:
    def reading(column: str, values: FloatArray) -> FloatArray:
        return size(one, column, values) if column in one.columns else np.zeros_like(values)

    return reading


def _independent(evaluation: Evaluation, one: Stated) -> FloatArray:
    """(m, m) covariance from an independent error in every group of observations, in every column."""
    base = evaluation.results.values
    covariance = np.zeros((len(base), len(base)))
    for shift in _groups(evaluation, one):
        moved = evaluation.evaluate(shift) - base
        covariance += np.outer(moved, moved)
    return covariance


def _groups(evaluation: Evaluation, one: Stated) -> Iterator[Shift]:
    """The error of one standard uncertainty in each group of observations with a common one, by column."""
    columns = evaluation.columns
    for name in _used(one, columns):
        error = size(one, name, columns[name])
        groups = evaluation.replication if one.behaves == "replication" else _settings(evaluation.settings, name)
        for group in np.unique(groups):
            yield Shift({name: np.where(groups == group, error, 0.0)})


def _settings(settings: Mapping[str, IntArray], column: str) -> IntArray:
    return settings[column] if column in settings else settings[""]
