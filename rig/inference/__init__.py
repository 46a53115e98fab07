"""Calibrations in use: measured quantities inferred from outputs, with standard deviations and 95 % intervals."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from procedures.inference import Inference
from procedures.results import Options
from procedures.table import Reader, Table
from rig.inference.calibration_file import CalibrationFile, calibration_in, read_calibration
from rig.tables import read_gappy_csv

__all__ = ["CalibrationFile", "Inference", "calibration_in", "csv_reader", "infer", "read_calibration"]


def infer(file: CalibrationFile, read: Reader, options: Options) -> Inference:
    """Infer the measured quantities of a calibration from a table.

    Args:
        file: the calibration.
        read: reads the table, in which values may be missing.
        options: as the calibration's kind declares them.

    Raises:
        UsageError: the table cannot be read.
        procedures.errors.DataError: a column is missing, or a value cannot be used.
    """
    found = file.kind.infer(file.calibration, read, options, csv_reader)
    if file.incomplete:
        found = replace(found, notes=(f"the calibration is of an incomplete run: {file.incomplete}", *found.notes))
    found = replace(found, notes=(*file.notes, *found.notes))
    if file.simulated and "simulated" not in found.columns:
        rows = len(next(iter(found.columns.values())))
        found = replace(found, columns={**found.columns, "simulated": np.ones(rows)})
    return found


def csv_reader(path: Path) -> Reader:
    """Reads a CSV file in which values may be missing."""

    def read(needed: Collection[str]) -> Table:
        return read_gappy_csv(path, needed)

    return read
