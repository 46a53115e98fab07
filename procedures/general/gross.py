"""Gross errors of any table.

Rows are compared with the declared model, with whole plots, and with settings that are repeated often enough.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.gross import LEVEL, GrossErrors, gross_errors, with_repeats, without_smooth
from rig.fitter.gross.rows import Rows
from rig.fitter.own_span import NO_GROUP
from rig.fitter.resolution import resolution
from rig.procedures.general.read_settings import settings_of

SETTINGS, OFTEN = 50, 4
"""Maximum number of settings with a level of their own, and minimum number of repeats of each."""


def of_table(
    y: FloatArray,
    columns: FloatArray,
    whole_plot: IntArray | None = None,
    *,
    measured: FloatArray | None = None,
    scale: FloatArray | None = None,
    level: float = LEVEL,
) -> GrossErrors:
    """Search in a response.

    Args:
        y: (n,) response of a linear model.
        columns: (n, k) of it.
        whole_plot: (n,) numbers of whole plots from 0, if there are any.
        measured: (n,) the response as it was measured, if that is not `y`.
        scale: (n,) by which `y` and `columns` are multiplied for rows of unequal standard deviations; the result is in
            units of the measured response.
        level: probability that a clean table has a row named.
    """
    n = len(y)
    step = resolution(y if measured is None else measured)
    weight = np.ones(n) if scale is None else scale
    plain = columns if scale is None else columns / scale[:, None]
    drivers = {str(i): np.abs(column) for i, column in enumerate(columns.T)} if scale is None else None
    step *= float(np.median(weight))
    declared = Rows(columns, y, weight, np.full(n, NO_GROUP, np.int64) if whole_plot is None else whole_plot)
    settings = settings_of(plain)
    visits = np.bincount(settings)
    if visits.size > SETTINGS or visits.min() < OFTEN:
        found = gross_errors(y, columns, rows=declared, step=step, drivers=drivers, level=level)
    elif whole_plot is None:
        levels = Rows(columns, y, weight, settings)
        found = with_repeats(declared, levels, settings, step=step, drivers=drivers, level=level)
    else:
        own = weight[:, None] * np.eye(visits.size)[settings]
        levels = Rows(np.column_stack([columns, own]), y, weight, whole_plot)
        found = with_repeats(declared, levels, settings, step=step, drivers=drivers, level=level)
    found = without_smooth(found, declared, plain)
    return found if scale is None else replace(found, off=found.off / scale[found.rows], sd=found.sd / scale)
