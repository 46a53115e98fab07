"""The evaluation of a run for its budgets, by the declared model or with the effects that a trace finds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.pressure.budget import NAMES, PRESSURE, SENSOR, SSE, Point, PressureEvaluation
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.declared import Declared
from rig.procedures.pressure.table import usable
from rig.procedures.tables.table import Table


def pressure_evaluation(
    table: Table,
    formula: str | None,
    at: Sequence[Mapping[str, float]],
    *,
    traced: bool = False,
    extra: Sequence[str] = (),
) -> PressureEvaluation:
    """The evaluation of a table; arguments and errors as for `Kind.evaluation`.

    Args:
        formula: the model; None for the declared one.
        traced: with the effects that a trace finds.
        extra: further terms, without `traced`.
    """
    data, _ = usable(table)
    model = Declared.of(table, formula, data).model
    try:
        if not traced:
            return PressureEvaluation(data, model, _points(data, at), extra)
        from rig.procedures.pressure.budget_traced import TracedEvaluation  # noqa: PLC0415 - few budgets are traced
        from rig.procedures.pressure.evaluate import trace_whole_plot_table  # noqa: PLC0415 - few budgets need it

        found = trace_whole_plot_table(table, formula, validate=False).trace
        return TracedEvaluation(data, model, _points(data, at), found)
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def _points(data: WholePlotData, at: Sequence[Mapping[str, float]]) -> list[Point]:
    """Points, with the mean temperatures of the run where none are given; three pressures if no point is given."""
    middle = {SENSOR: float(np.mean(data.nominal["T_sensor"])), SSE: float(np.mean(data.nominal["T_SSE"]))}
    if not at:
        low, high = float(data.pressure_psia.min()), float(data.pressure_psia.max())
        given: Sequence[Mapping[str, float]] = [
            {PRESSURE: P} for P in (low + 0.1 * (high - low), (low + high) / 2, high)
        ]
        given = [{PRESSURE: float(f"{one[PRESSURE]:.3g}")} for one in given]
        middle = {name: float(f"{value:.3g}") if abs(value) > 1e-6 else 0.0 for name, value in middle.items()}
    else:
        given = at
    for one in given:
        unknown = [name for name in one if name not in NAMES.values()]
        if unknown or PRESSURE not in one:
            raise DataError(f"--at: a point has {PRESSURE}, and perhaps {SENSOR} and {SSE}: --at {PRESSURE}=2.5")
    return [(one[PRESSURE], one.get(SENSOR, middle[SENSOR]), one.get(SSE, middle[SSE])) for one in given]
