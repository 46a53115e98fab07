"""Gross errors in each kind of data: what rows are compared with, so that a missing effect does not pass for one.

- Pitch-roll: readings of one point, over replications, with a model for each replication. What a point has in common
  (pads, head errors) and what a replication has (drift) is no gross error.
- Whole plots: readings of one whole plot, and of one pressure. What a whole plot has in common is its own draw.
- Any table: the declared model; beside it whole plots, and settings that are repeated often enough.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fitter.arrays import FloatArray, IntArray
from fitter.attitude import attitude_columns, fit_columns
from fitter.data import AttitudeData
from fitter.formula import Formula
from fitter.gross.rows import NO_GROUP
from fitter.gross.search import GrossErrors, gross_errors
from fitter.pressure.models import of_whole_plot
from fitter.resolution import resolution
from fitter.whole_plot_data import WholePlotData

REPEATS = 3
"""Readings of one point from which they are compared with one another rather than with the model."""
SETTINGS, OFTEN = 50, 4
"""Settings of a table at most that get a level of their own, and how often each is repeated at least."""
STEP_DEG = 0.1


def of_attitude(data: AttitudeData) -> Mapping[str, GrossErrors]:
    """By sensor of a pitch-roll calibration."""
    columns = attitude_columns(data.pitch_deg, data.roll_deg, roll=data.has_roll)
    by_replication = [columns * (data.replicate_index == r)[:, None] for r in range(data.replicates.size)]
    visits = np.bincount(data.point)[data.point]
    own = visits >= REPEATS
    group = np.full(len(data), NO_GROUP, np.int64)
    group[own] = np.unique(data.point[own], return_inverse=True)[1]
    found = {}
    for name, y in data.outputs.items():
        fit = fit_columns(columns, y)
        ahead = attitude_columns(data.pitch_deg + STEP_DEG, data.roll_deg, roll=data.has_roll)
        aside = attitude_columns(data.pitch_deg, data.roll_deg + STEP_DEG, roll=data.has_roll)
        slope = np.hypot(*(fit.predict(moved) - fit.predict(columns) for moved in (ahead, aside)))
        found[name] = gross_errors(
            y,
            np.column_stack(by_replication),
            group=group,
            step=resolution(y),
            responses=len(data.outputs),
            drivers={"slope": slope, "output": np.abs(fit.predict(columns))},
            designed=True,
        )
    return found


def of_whole_plots(data: WholePlotData, formula: Formula) -> Mapping[str, GrossErrors]:
    """By transducer of a whole-plot calibration with this model."""
    _, every = formula.columns(data.table)
    alone = np.array([of_whole_plot(term) for term in formula.terms])
    columns, level = every[:, ~alone], data.pressure_levels[1]
    if np.bincount(level).min() >= REPEATS:  # else a pressure written wrong would be a level of its own, and fit
        columns = np.column_stack([columns, np.eye(level.max() + 1)[level]])
    return {
        name: gross_errors(
            y,
            columns,
            group=data.whole_plot_index,
            step=resolution(y),
            responses=len(data.outputs),
            drivers={"P": data.pressure_psia},
        )
        for name, y in data.outputs.items()
    }


def of_table(y: FloatArray, columns: FloatArray, whole_plot: IntArray | None = None) -> GrossErrors:
    """Of a response (n,) with model columns (n, k) and, where there are, (n,) whole plots from 0."""
    settings = np.unique(columns, axis=0, return_inverse=True)[1].reshape(-1)
    visits = np.bincount(settings)
    if visits.size <= SETTINGS and visits.min() >= OFTEN:
        levels = np.eye(visits.size)[settings]
        columns = levels if whole_plot is None else np.column_stack([columns, levels])
    drivers = {str(i): np.abs(column) for i, column in enumerate(columns.T)}
    return gross_errors(y, columns, group=whole_plot, step=resolution(y), drivers=drivers)
