"""The readings of one transducer and its model, as every method of the paper takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.split_plot import SplitPlotFit
from rig.procedures.pressure.data import WholePlotData
from rig.procedures.pressure.fit.errors import Errors, Layout

NO_PRESSURE = 1e-4
"""Readbacks below this part of the highest pressure count as zero: with weights 1/P they would dominate all others."""

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Problem:
    """Readings of one transducer and the model.

    Attributes:
        data: the observations.
        output: name of the transducer's output.
        formula: the model, one column per term (no categories).
        names: of its k columns.
        columns: (n, k).
        reml: its split-plot fit.
        errors: of the readings.
        layout: of the readings.
        power: rows are weighted by 1 / P^power.
        exclude_zero: whether weighted methods leave out readings at P = 0.
    """

    data: WholePlotData
    output: str
    formula: Formula
    names: tuple[str, ...]
    columns: FloatArray
    reml: SplitPlotFit
    errors: Errors
    layout: Layout
    power: float = 1.0
    exclude_zero: bool = False

    @property
    def weight(self) -> FloatArray:
        """(n,) 1 / P^power (eq. 3); zero at P = 0 if such readings are left out.

        Raises:
            FitError: there are readings at zero pressure that are not left out.
        """
        used = ~self.without_pressure
        rows = np.flatnonzero(~used)
        if rows.size and not self.exclude_zero:
            some = ", ".join(str(row) for row in rows[:5]) + (", ..." if rows.size > 5 else "")
            raise FitError(
                f"weights 1/P^{self.power:g} have no value at P = 0 (rows {some}): leave these readings out "
                "(exclude_zero), or use a method without weights"
            )
        weight = np.zeros(len(used))
        weight[used] = self.data.pressure_psia[used] ** -self.power
        return weight

    @property
    def without_pressure(self) -> BoolArray:
        """(n,) readings at P = 0: by the set pressure, if recorded, otherwise by readbacks that do not differ
        from it.
        """
        read, told = self.data.pressure_psia, self.data.pressure_set_psia
        at_zero = read <= NO_PRESSURE * float(read.max())
        return np.asarray(at_zero if told is None else at_zero | (told <= 0), np.bool_)
