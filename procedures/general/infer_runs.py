"""The factor from outputs of sensors that were calibrated together in a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rig.procedures.column_names import stem_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.inference import INFERRED, Inference
from rig.procedures.general.infer import CurveCalibration
from rig.procedures.general.infer_table import infer_general
from rig.procedures.tables.table import Reader
from rig.procedures.tables.unused import Unused


def infer_sensors(
    calibrations: Mapping[str, CurveCalibration],
    read: Reader,
    u_reading: float | None = None,
    quantity: str | None = None,
    between: tuple[float, float] | None = None,
) -> Inference:
    """Infer the variable of the curve of every calibrated output in a table, each by itself.

    Args:
        calibrations: by output.
        read: the table, with a column for one or more of the outputs.
        u_reading: standard uncertainty of one reading, in place of those of the calibrations.
        quantity: the variable to infer, for calibrations with several; others have only their own.
        between: the range in which it is known to be; None for all that was calibrated.

    Returns:
        With one output as for a calibration of one sensor. With several, columns begin with the sensor's name:
        `prt_1_bath_degC` from `prt_1_V`. Sensors of one variable are `alike`.

    Raises:
        DataError: none of the columns is there, the table has an output without the other quantities that its curve
            needs, or no curve can be inverted.
    """
    table = read(())
    present = [name for name in calibrations if name in table.columns]
    if not present:
        raise DataError(
            f"{table.source} has no output of a calibrated sensor; these are calibrated: {', '.join(calibrations)}"
        )
    found, refused = {}, {}
    for name in present:
        own = quantity if quantity in calibrations[name].formula.names else None
        try:
            found[name] = infer_general(calibrations[name], read, u_reading, own, between)
        except DataError as error:
            refused[name] = error
    if not found:
        raise next(iter(refused.values()))
    for name, why in refused.items():
        if sum(one not in table.columns for one in calibrations[name].formula.names) > 1:  # so the table lacks a column
            raise DataError(f"{why}. To infer by {', '.join(found)} alone, leave the column {name} out of the table")
    told = tuple(f"{name} was not used: {why}" for name, why in refused.items())
    if len(found) == 1:
        ((_, only),) = found.items()
        return replace(only, notes=(*only.notes, *told))
    columns: dict[str, Any] = {**table.columns, **table.text}
    quantities, flagged = [], np.zeros(len(table), np.bool_)
    alike: dict[str, dict[str, str]] = {}
    flags: dict[str, str] = {}
    for output, one in found.items():
        stem, (variable,) = stem_of(output), one.quantities
        named = f"{stem}_{variable.removeprefix(INFERRED)}"
        flag = one.added[-1]
        flags[named] = f"{stem}_{flag}"
        columns |= {f"{named}{name.removeprefix(variable)}": one.columns[name] for name in one.added if name != flag}
        columns[flags[named]] = one.columns[flag]
        quantities.append(named)
        alike.setdefault(variable.removeprefix(INFERRED), {})[named] = stem
        flagged |= np.asarray(one.columns[flag]) != ""
    added = tuple(name for name in columns if name not in table.columns and name not in table.text)
    notes = tuple(dict.fromkeys(f"{name}: {note}" for name, one in found.items() for note in one.notes))
    df = {name: one.df[one.quantities[0]] for name, one in zip(quantities, found.values(), strict=True)}
    outputs = {name: one.outputs[one.quantities[0]] for name, one in zip(quantities, found.values(), strict=True)}
    stated = frozenset(q for q, one in zip(quantities, found.values(), strict=True) if one.stated)
    several = {name: sensors for name, sensors in alike.items() if len(sensors) > 1}
    spare = {name: why for name, why in next(iter(found.values())).unused.columns.items() if name not in calibrations}
    spare = {name: why for name, why in spare.items() if all(name in one.unused.columns for one in found.values())}
    lacking = tuple(dict.fromkeys(row for one in found.values() for row in one.unused.rows))
    unused = Unused(spare, lacking)
    return Inference(
        columns,
        added,
        (*notes, *told),
        int(flagged.sum()),
        tuple(quantities),
        unused,
        df=df,
        alike=several,
        flags=flags,
        outputs=outputs,
        stated=stated,
    )
