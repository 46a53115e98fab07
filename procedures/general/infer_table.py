"""The variable of a fitted curve from its response, for calibrations of any table."""

from __future__ import annotations

from typing import Any

import numpy as np

from fitter.errors import FitError
from procedures.errors import DataError
from procedures.general.infer import CurveCalibration, infer_curve
from procedures.inference import Inference
from procedures.missing import empty_rows, incomplete_rows
from procedures.table import Reader
from procedures.unused import Unused, other_unit, why_unused


def infer_general(calibration: CurveCalibration, data: Reader) -> Inference:
    """Infer the variable of a calibration's curve from every row of a CSV table.

    Args:
        calibration: with a formula of one column, monotonic over the calibrated range.
        data: the table, with a column for the response.

    Raises:
        DataError: the curve cannot be inverted, or the column is missing.
    """
    response = calibration.response
    table = data([response])
    if response not in table.columns:
        like = next((name for name in table.names if other_unit(name, [response])), None)
        hint = f"; {like}: {why_unused(like, [response])}" if like else ""
        raise DataError(f"{table.source}: there is no column {response!r}; it has {', '.join(table.names)}{hint}")
    inputs = {response: table.columns[response]}
    flag = empty_rows(inputs)
    complete = flag == ""
    try:
        found, variable = infer_curve(calibration, inputs[response][complete]), calibration.variable
    except FitError as error:
        raise DataError(f"this calibration of {response} cannot be inverted: {error}") from error
    columns: dict[str, Any] = {**table.columns, **table.text}
    name = f"inferred_{variable}" if variable in columns else variable
    flag[complete] = found.flag
    added: dict[str, Any] = {}
    for end, values in (("", found.value), ("_sd", found.sd), ("_lo95", found.lo95), ("_hi95", found.hi95)):
        added[name + end] = np.full(len(table), np.nan)
        added[name + end][complete] = values
    added["flag" if "flag" not in columns else "inferred_flag"] = flag
    spare = {n: why_unused(n, [response]) for n in table.names if n not in (response, "simulated")}
    return Inference(
        {**columns, **added},
        tuple(added),
        calibration.notes,
        int(np.sum(flag != "")),
        quantities=(name,),
        unused=Unused(
            spare, [(row, n, "no value: the result of the row is empty") for row, n in incomplete_rows(table, inputs)]
        ),
    )
