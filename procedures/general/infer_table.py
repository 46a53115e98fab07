"""The variable of a fitted curve from its response, for calibrations of any table."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitter.errors import FitError
from procedures.errors import DataError
from procedures.general.infer import CurveCalibration, infer_curve
from procedures.inference import Inference, empty_rows, free_name, no_column, unused_beside
from procedures.table import Reader


def infer_general(calibration: CurveCalibration, data: Reader, u_reading: float | None = None) -> Inference:
    """Infer the variable of a calibration's curve from every row of a CSV table.

    Args:
        calibration: with a formula of one column, monotonic over the calibrated range.
        data: the table, with a column for the response.
        u_reading: standard uncertainty of one reading, in place of the calibration's.

    Raises:
        DataError: the curve cannot be inverted, or the column is missing.
    """
    response = calibration.response
    notes = calibration.notes
    if u_reading is not None:
        if not 0.0 <= u_reading < np.inf:
            raise DataError(f"--u-reading {u_reading:g}: it has to be a number at or above zero")
        calibration = calibration.with_reading(u_reading)
        notes = (*notes, f"the standard uncertainty of a reading is {u_reading:g}, as given by --u-reading")
    table = data([response])
    if response not in table.columns:
        raise no_column(table, response)
    inputs = {response: table.columns[response]}
    flag = empty_rows(inputs)
    complete = flag == ""
    try:
        found, variable = infer_curve(calibration, inputs[response][complete]), calibration.variable
    except FitError as error:
        raise DataError(f"this calibration of {response} cannot be inverted: {error}") from error
    name = free_name(variable, table)
    flag[complete] = found.flag
    added: dict[str, Any] = {}
    for end, values in (("", found.value), ("_sd", found.sd), ("_lo95", found.lo95), ("_hi95", found.hi95)):
        added[name + end] = np.full(len(table), np.nan)
        added[name + end][complete] = values
    added[free_name("flag", table)] = flag
    df = np.full(len(table), np.nan)
    df[complete] = found.df
    return Inference(
        {**table.columns, **table.text, **added},
        tuple(added),
        notes,
        int(np.sum(flag != "")),
        quantities=(name,),
        unused=unused_beside(table, [response], inputs),
        df={name: df},
    )
