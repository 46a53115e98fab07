"""Gross errors of any table.

Rows are compared with the declared model, with whole plots, and with settings that are repeated often enough.
"""

from __future__ import annotations

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.gross import GrossErrors, gross_errors
from fitter.resolution import resolution

SETTINGS, OFTEN = 50, 4
"""Maximum number of settings with a level of their own, and minimum number of repeats of each."""


def of_table(y: FloatArray, columns: FloatArray, whole_plot: IntArray | None = None) -> GrossErrors:
    """Search in a response (n,) with model columns (n, k) and, if there are whole plots, their numbers (n,) from 0."""
    settings = np.unique(columns, axis=0, return_inverse=True)[1].reshape(-1)
    visits = np.bincount(settings)
    if visits.size <= SETTINGS and visits.min() >= OFTEN:
        levels = np.eye(visits.size)[settings]
        columns = levels if whole_plot is None else np.column_stack([columns, levels])
    drivers = {str(i): np.abs(column) for i, column in enumerate(columns.T)}
    return gross_errors(y, columns, group=whole_plot, step=resolution(y), drivers=drivers)
