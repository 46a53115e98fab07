"""Gross errors of a whole-plot calibration.

Readings of one whole plot, and of one pressure, are compared. The common part of a whole plot is its whole-plot error.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from fitter.gross import GrossErrors, gross_errors
from fitter.resolution import resolution
from procedures.pressure.fit.models import of_whole_plot

if TYPE_CHECKING:
    from fitter.formula import Formula
    from procedures.pressure.data import WholePlotData

REPEATS = 3
"""Minimum readings of one pressure for a level of its own."""


def of_whole_plots(data: WholePlotData, formula: Formula) -> Mapping[str, GrossErrors]:
    """By transducer of a whole-plot calibration with this model."""
    _, every = formula.columns(data.table)
    alone = np.array([of_whole_plot(term) for term in formula.terms])
    columns, level = every[:, ~alone], data.pressure_levels[1]
    if np.bincount(level).min() >= REPEATS:  # otherwise a wrong pressure value would be a level of its own, and fit
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
