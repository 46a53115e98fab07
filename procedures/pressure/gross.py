"""Gross errors of a whole-plot calibration.

Readings are compared with the declared model where that holds, otherwise with those of the same pressure, in each case
beside a level of their whole plot. The common part of a whole plot is its whole-plot error.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rig.fitter.gross import GrossErrors, gross_errors, with_repeats
from rig.fitter.gross.rows import Rows
from rig.fitter.resolution import resolution
from rig.procedures.pressure.fit.models import of_whole_plot

if TYPE_CHECKING:
    from rig.fitter.formula import Formula
    from rig.procedures.pressure.data import WholePlotData

REPEATS = 3
"""Minimum readings of one pressure for a level of its own."""


def of_whole_plots(data: WholePlotData, formula: Formula) -> Mapping[str, GrossErrors]:
    """By transducer of a whole-plot calibration with this model."""
    _, every = formula.columns(data.table)
    alone = np.array([of_whole_plot(term) for term in formula.terms])
    columns, level = every[:, ~alone], data.pressure_levels[1]
    n, plots = len(level), data.whole_plot_index
    zero, one = np.zeros(n), np.ones(n)
    declared, found = Rows(columns, zero, one, plots), {}
    own = np.column_stack([columns, np.eye(level.max() + 1)[level]])
    repeated = np.bincount(level).min() >= REPEATS  # otherwise a wrong pressure would be a level of its own, and fit
    levels = Rows(own, zero, one, plots) if repeated else declared
    for name, y in data.outputs.items():
        model, step, drivers = declared.of(y), resolution(y), {"P": data.pressure_psia}
        if repeated:
            found[name] = with_repeats(
                model, levels.of(y), level, step=step, responses=len(data.outputs), drivers=drivers
            )
        else:
            found[name] = gross_errors(y, columns, rows=model, step=step, responses=len(data.outputs), drivers=drivers)
    return found
