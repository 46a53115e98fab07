"""From a table to what it says: fit, trace, error before and after, in JSON and in words.

What is fitted and traced depends on the kind of run a table holds.
"""

from __future__ import annotations

from typing import Any

from procedures.attitude.evaluate import AttitudeTraced, fit_attitude_table, trace_attitude_table
from procedures.attitude.table import PITCH_ROLL
from procedures.pressure.evaluate import WholePlotFitted, WholePlotTraced, fit_whole_plots, trace_whole_plot_table
from procedures.pressure.table import WHOLE_PLOT
from procedures.table import Table
from rig.errors import UsageError

__all__ = [
    "AttitudeTraced",
    "Traced",
    "WholePlotFitted",
    "WholePlotTraced",
    "fit_table",
    "fit_whole_plots",
    "trace_table",
]

Traced = AttitudeTraced | WholePlotTraced
"""A table of either kind and what was traced in it."""


def fit_table(
    table: Table, model: str | None = None, *, traced: bool = False, temperature: bool | None = None
) -> dict[str, Any]:
    """Fit the declared model to every sensor of a table; JSON-ready.

    Args:
        table: of either kind.
        model: of a whole-plot calibration, a named set of terms or a formula; if None as its procedure declares
            it, else the full second order.
        traced: attitude: have the effects that a trace finds in the calibration that is kept.
        temperature: attitude: whether offset and sensitivity follow the sensor temperature in the declared model; as
            the table's procedure has it if None.

    Raises:
        UsageError: the table lacks something, or its rows do not determine the model.

    """
    _check(table, model)
    if table.kind == "whole-plot":
        return fit_whole_plots(table, model).to_json()
    return fit_attitude_table(table, traced=traced, temperature=temperature)


def trace_table(
    table: Table, model: str | None = None, *, temperature: bool | None = None, unnamed: bool = False
) -> Traced:
    """Trace what the declared model lacks in every sensor of a table; arguments and errors as for `fit_table`.

    With `unnamed` smooth terms without a cause may take up what no effect of attitude sensors explains.
    """
    _check(table, model)
    if table.kind == "whole-plot":
        return trace_whole_plot_table(table, model)
    return trace_attitude_table(table, temperature=temperature, unnamed=unnamed)


def _check(table: Table, model: str | None) -> None:
    if table.kind == "other":
        raise UsageError(
            f"{table.source} is no calibration: a pitch-roll table has {','.join(PITCH_ROLL)} and NAME_V, a whole-plot "
            f"table {','.join(WHOLE_PLOT)} and NAME_mV; `rig fit` fits any table with --response and --formula"
        )
    if model is not None and table.kind == "pitch-roll":
        raise UsageError(
            f"{table.source} holds a pitch-roll calibration, whose model is its geometry; --formula is for whole plots"
        )
