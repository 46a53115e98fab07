"""Calibrations in use: measured quantities inferred from outputs, with standard deviations and 95 % intervals."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import UsageError
from rig.procedures.evaluate.agreement import compared
from rig.procedures.evaluate.inference import Inference
from rig.procedures.evaluate.readings import in_use
from rig.procedures.evaluate.results import Options
from rig.procedures.tables.table import Reader, Table
from rig.tables import FileForm, read_gappy_csv
from rig.tables.of_others.file_form import NOTHING
from rig.verbs.infer.calibration_file import CalibrationFile, calibration_in, read_calibration
from rig.verbs.infer.total import REPEATABILITY, REPEATABILITY_ONLY, saying, with_total

__all__ = ["CalibrationFile", "CsvReader", "Inference", "calibration_in", "csv_reader", "infer", "read_calibration"]


def infer(
    file: CalibrationFile, read: Reader, options: Options, *, same_meter: bool = False, mean_of: int | None = None
) -> Inference:
    """Infer the measured quantities of a calibration from a table.

    Args:
        file: the calibration.
        read: reads the table, in which values may be missing.
        options: as the calibration's kind declares them.
        same_meter: whether the meter of the calibration's run reads the sensors, with the same errors.
        mean_of: number of readings of which one in use is the mean; None for that of the calibration's run.

    Raises:
        UsageError: the table cannot be read, or the calibration does not know the errors of that meter.
        rig.procedures.errors.DataError: a column is missing, or a value cannot be used.
    """
    if file.budget is None and same_meter:
        raise UsageError("--same-meter needs a calibration with influences: rig fit RUN --equipment FILE --out ...")

    calibration = file.calibration
    if mean_of is not None:
        if getattr(options, "u_reading", None) is not None:
            raise UsageError("--readings and --u-reading both say how a reading in use scatters: give one of them")
        if mean_of < 1:
            raise UsageError(f"--readings {mean_of}: a reading in use is the mean of one reading, or of more")
        calibration = file.kind.for_readings(calibration, file.within, mean_of)

    files: dict[Path, Reader] = {}

    def kept(path: Path) -> Reader:
        return files.setdefault(path, once(csv_reader(path)))

    def by(calibration: Any, table: Reader, other: Callable[[Path], Reader]) -> Inference:
        return file.kind.infer(calibration, table, options, other)

    read = once(read)
    found = in_use(by(calibration, read, kept), file.within, mean_of)
    if file.budget is None:
        found = saying(replace(found, notes=(file.why or REPEATABILITY_ONLY, *found.notes)), REPEATABILITY)
    else:
        found = with_total(found, file.budget, file.kind, calibration, by, read, kept, same_meter=same_meter)
    found = compared(found)
    if file.incomplete:
        found = replace(found, notes=(f"the calibration is of an incomplete run: {file.incomplete}", *found.notes))
    found = replace(found, notes=(*file.notes, *found.notes))
    if file.simulated and "simulated" not in found.columns:
        rows = len(next(iter(found.columns.values())))
        found = replace(found, columns={**found.columns, "simulated": np.ones(rows)})
    return found


def once(read: Reader) -> Reader:
    """Reader that reads a table for the same columns once: a calibration with influences infers from it many times."""
    tables: dict[tuple[str, ...], Table] = {}

    def kept(needed: Collection[str]) -> Table:
        asked = tuple(needed)
        if asked not in tables:
            tables[asked] = read(needed)
        return tables[asked]

    return kept


@dataclass
class CsvReader:
    """Reads a CSV file in which values may be missing.

    Attributes:
        path: the file.
        asked: declarations of the user about it.
        understood: how a table of others was read; {} for our own, and before it is read.
    """

    path: Path
    asked: FileForm = NOTHING
    understood: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, needed: Collection[str]) -> Table:
        """The table. Raises `UsageError`."""
        table = read_gappy_csv(self.path, needed, self.asked)
        self.understood = table.understood
        return table


def csv_reader(path: Path) -> Reader:
    """Reads a CSV file in which values may be missing."""
    return CsvReader(path)
