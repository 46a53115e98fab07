"""What residuals are residuals of where there is no previous calibration: the declared model's columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fitter.arrays import FloatArray
from procedures.attitude.model import attitude_columns
from procedures.pressure.fit.models import named_formula
from rig.quantities import PITCH, PRESSURE, ROLL, SENSOR, SSE
from rig.watch.reading import Seen


def columns_of(seen: Sequence[Seen]) -> dict[str, FloatArray]:
    """(n,) of every quantity that was set or read, by name; NaN where it was not."""
    names = {name for s in seen for group in (s.setpoints, s.references, s.temperatures) for name in group}
    return {
        name: np.array([np.nan if (value := s.mean(name)) is None else value for s in seen], np.float64)
        for name in names
    }


def model_columns(seen: Sequence[Seen], *, temperature: bool) -> FloatArray | None:
    """(n, k) columns of the declared model at these observations; None for a run of no kind we know a model of.

    A turned mounting changes the coefficients, not what the columns span, so residuals need not know of it. With
    `temperature` offset and sensitivity follow the sensors' temperature: every column stands once more, times it.
    """
    given = columns_of(seen)
    if PITCH in given and ROLL in given:
        columns = attitude_columns(given[PITCH], given[ROLL])
        if temperature and SENSOR in given:
            columns = np.column_stack([columns, columns * (given[SENSOR] - np.nanmean(given[SENSOR]))[:, None]])
        return columns
    if all(name in given for name in (PRESSURE, SENSOR, SSE)):
        variables = {"P": given[PRESSURE], "T_sensor": given[SENSOR], "T_SSE": given[SSE]}
        return named_formula("full").columns(variables)[1]
    return None
