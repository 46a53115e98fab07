"""Whether a finished general calibration is fit for use."""

from __future__ import annotations

from rig.procedures.column_names import spelled, unit_of
from rig.procedures.errors import DataError
from rig.procedures.evaluate.acceptance import Verdict
from rig.procedures.general.of_runs import RunModels, fit_run, models_of, results_of
from rig.procedures.general.settings import GeneralProcedure
from rig.procedures.tables.table import Table


def judge(procedure: GeneralProcedure, table: Table) -> list[Verdict]:
    """Every sensor with a limit: the standard deviation of one observation about the declared model; [] without one.

    Raises:
        DataError: a limit is of a sensor that the run does not have, or has no error to compare.
    """
    limits = procedure.acceptance.sigma_E or {}
    columns = {sensor: column for column, sensor in table.outputs.items()}
    unknown = sorted(limits.keys() - columns.keys())
    if unknown:
        raise DataError(f"acceptance.sigma_E.{unknown[0]}: the bench has no such sensor ({', '.join(columns)})")
    if not limits:
        return []
    results, verdicts = results_of(fit_run(RunModels(table, models_of(table))).result), []
    for sensor, limit in limits.items():
        column = columns[sensor]
        result, unit = results[column], spelled(unit_of(column))
        found = result.get("sigma_E") if "sigma_E" in result else result.get("sigma_subplot")
        if found is None:
            raise DataError(f"{column}: no error can be estimated, so acceptance.sigma_E cannot be judged")
        words = f"standard error of one observation up to {limit:g} {unit}"
        said = f"standard error of one observation {found:.3g} {unit}, limit {limit:g} {unit}"
        verdicts.append(Verdict(column, said, words, found <= limit))
    return verdicts
