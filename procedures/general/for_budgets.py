"""The evaluation of a run for its budgets, by the declared model or with the effects that a trace finds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.general.budget import _AT, GeneralEvaluation
from rig.procedures.general.of_runs import without_readings
from rig.procedures.present.meant import meant
from rig.procedures.tables.table import Table

if TYPE_CHECKING:
    from rig.procedures.general.traced import WithEffects


def general_evaluation(
    table: Table,
    at: Sequence[Mapping[str, float]],
    *,
    traced: bool = False,
    found: WithEffects | None = None,
    ignore: Sequence[str] = (),
) -> GeneralEvaluation:
    """The evaluation of a table; arguments and errors as for `Kind.evaluation`.

    Args:
        traced: with the effects that a trace finds.
        found: with these effects.
        ignore: columns that the trace does not look at.
    """
    made: Callable[[Table, Sequence[Mapping[str, float]]], GeneralEvaluation] = GeneralEvaluation
    if traced or found is not None:
        from rig.procedures.general.budget_traced import TracedEvaluation  # noqa: PLC0415 - few budgets are traced

        made = partial(TracedEvaluation, found=found, ignore=ignore)

    if not table.outputs:
        raise DataError(f"{table.source}: budgets are made of runs, whose bench says what reads what")
    if lacks := without_readings(table):
        raise DataError(
            f"{table.source}: {', '.join(lacks.values())}, since a channel failed: a budget needs a "
            "reading of every output in every row; `rig fit` evaluates each output by the rows that it has"
        )
    _check_names(table, at)
    try:
        every = made(table, at or _points(table))
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error
    for name in table.factors if at else ():
        if name not in at[0] and (by := [one.name for one in every.each if name in one.plain.formula.names]):
            raise DataError(f"{_AT}: they lack {name}, on which results of {', '.join(by)} depend; add it")
    return every


def _check_names(table: Table, at: Sequence[Mapping[str, float]]) -> None:
    """Refuse points of unknown quantities, or of different ones."""
    for one in at:
        if unknown := [name for name in one if name not in table.columns]:
            there = f"its factors are {', '.join(table.factors)}{meant(unknown[0], table.factors)}"
            raise DataError(f"{_AT}: the run has no {unknown[0]}; {there}")
        if set(one) != set(at[0]):
            raise DataError(f"{_AT}: they have different quantities, {', '.join(at[0])} and {', '.join(one)}")


def _points(table: Table) -> list[Mapping[str, float]]:
    """Three values of the only factor of a run; the middle of all factors if there are several."""
    ends = {name: (float(table.columns[name].min()), float(table.columns[name].max())) for name in table.factors}
    middle = {name: float(f"{(low + high) / 2:.3g}") for name, (low, high) in ends.items()}
    if len(ends) != 1:
        return [middle]
    ((name, (low, high)),) = ends.items()
    return [{name: float(f"{value:.3g}")} for value in (low + 0.1 * (high - low), middle[name], high)]
