"""Settings that are not exact: what a fit of a run would be with what the instruments read back of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rig.fitter import ties
from rig.procedures.column_names import with_word
from rig.procedures.errors import DataError
from rig.procedures.tables.table import Table

_OF_ERROR = 0.5
"""Change of a coefficient, in its standard errors, from which on it is said; chosen."""
_BETTER = 0.8
"""Scatter with what was read back, in that with what was set, below which settings are known to differ; chosen: a
readback with noise of its own makes it larger."""


def as_read_back(table: Table, fitted: Mapping[str, Any], fit: Callable[[Table], Mapping[str, Any]]) -> tuple[str, ...]:
    """A sentence where rows fit better with settings as read back, and coefficients then differ; () otherwise.

    A setting has arrived within a band, and an instrument that comes late is off by the same whenever it comes from the
    same side: no scatter of replications shows that, so it is in no standard error.

    Args:
        table: the rows of a run, with a column for what was read back of each setting.
        fitted: result with the settings, as JSON values.
        fit: makes such a result of a table.
    """
    read = {name: table.columns.get(with_word(name, "readback")) for name in table.factors}
    there = {
        name: values
        for name, values in read.items()
        if values is not None and np.all(np.isfinite(values)) and not np.array_equal(values, table.columns[name])
    }
    if not there:
        return ()
    try:
        again = fit(replace(table, columns={**table.columns, **there}))
    except DataError:
        return ()
    if not _scatter(again) < _BETTER * _scatter(fitted):
        return ()
    far = {
        term: abs(again["coefficients"][term]["estimate"] - one["estimate"]) / one["stderr"]
        for term, one in fitted["coefficients"].items()
        if term in again["coefficients"] and one["stderr"]
    }
    most = ties.least(far, key=lambda term: -far[term]) if far else ""
    if not most or far[most] < _OF_ERROR:
        return ()
    return (
        f"{' and '.join(there)} fit better as read back than as set, and {most} is then {far[most]:.1f} standard "
        f"errors off: settings count as exact; an error that every replication repeats is in no standard error: let "
        f"them settle within less (`band` in the procedure), or have a standard read them ([references] in the bench)",
    )


def _scatter(fitted: Mapping[str, Any]) -> float:
    """Standard deviation of one row."""
    return float(fitted.get("sigma_subplot") or fitted.get("sigma_E") or np.nan)
