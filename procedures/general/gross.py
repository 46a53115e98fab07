"""Gross errors of any table.

Rows are compared with the declared model, with whole plots, and with settings that are repeated often enough.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.gross import GrossErrors, gross_errors
from fitter.resolution import resolution
from procedures.general.read_settings import settings_of

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
    settings = settings_of(columns)
    visits = np.bincount(settings)
    if visits.size <= SETTINGS and visits.min() >= OFTEN:
        columns = np.column_stack([columns, np.eye(visits.size)[settings]])
    drivers = {str(i): np.abs(column) for i, column in enumerate(columns.T)}
    return gross_errors(y, columns, group=whole_plot, step=step, drivers=drivers)
