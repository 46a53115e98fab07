"""Gross errors of any table.

Rows are compared with the declared model, with whole plots, and with settings that are repeated often enough.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.gross import GrossErrors, gross_errors
from fitter.linear import orthonormal
from fitter.resolution import resolution
from procedures.general.read_settings import settings_of

CLEARLY = 0.5
"""Ratio of standard deviations below which one set of rows explains the scatter clearly better than another."""
AS_MANY = 1.5
"""Maximum ratio of the number of rows in these two sets."""
SETTINGS, OFTEN = 50, 4
"""Maximum number of settings with a level of their own, and minimum number of repeats of each."""


def of_table(
    y: FloatArray,
    columns: FloatArray,
    whole_plot: IntArray | None = None,
    *,
    measured: FloatArray | None = None,
    scale: FloatArray | None = None,
) -> GrossErrors:
    """Search in a response.

    Args:
        y: (n,) response of a linear model.
        columns: (n, k) of it.
        whole_plot: (n,) numbers of whole plots from 0, if there are any.
        measured: (n,) the response as it was measured, if that is not `y`.
        scale: (n,) by which `y` and `columns` are multiplied for rows of unequal standard deviations; the result is in
            units of the measured response.
    """
    step = resolution(y if measured is None else measured)
    if scale is not None:
        found = gross_errors(y, columns, group=whole_plot, step=step * float(np.median(scale)))
        return replace(found, off=found.off / scale[found.rows], sd=found.sd / scale)
    drivers = {str(i): np.abs(column) for i, column in enumerate(columns.T)}
    settings = settings_of(columns)
    visits = np.bincount(settings)
    if visits.size > SETTINGS or visits.min() < OFTEN:
        return gross_errors(y, columns, group=whole_plot, step=step, drivers=drivers)
    if whole_plot is not None:
        columns = np.column_stack([columns, np.eye(visits.size)[settings]])
        return gross_errors(y, columns, group=whole_plot, step=step, drivers=drivers)
    # As groups, of which at most half can be left out: as columns, one bad row could stand for a setting alone, with a
    # residual of zero, and its good repeats were named in its place.
    found = gross_errors(y, columns, group=settings, step=step, drivers=drivers)
    if not found.rows.size:
        return found
    # If most rows of a setting are bad, its good ones differ from the others. The declared model shows which are which,
    # unless it names many more: then it lacks something, and whole settings are far from it.
    declared = gross_errors(y, columns, step=step, drivers=drivers)
    as_many = declared.rows.size <= AS_MANY * found.rows.size + 1
    better = as_many and _sigma(y, columns, declared) < CLEARLY * _sigma(y, columns, found)
    return declared if better else found


def _sigma(y: FloatArray, columns: FloatArray, found: GrossErrors) -> float:
    """Standard deviation of the residuals of the declared model without the named rows."""
    kept = np.delete(np.arange(len(y)), found.rows)
    basis = orthonormal(columns[kept])
    left = y[kept] - basis @ (basis.T @ y[kept])
    return float(np.sqrt(left @ left / max(kept.size - basis.shape[1], 1)))
