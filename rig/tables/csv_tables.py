"""CSV in and out. What is wrong with a table is said in one line: file, row, column, what to do."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from rig.atomic import write_whole
from rig.errors import UsageError
from rig.tables.table import PITCH_ROLL, WHOLE_PLOT, Table


def read_csv(path: Path) -> Table:
    """A CSV table. Raises `UsageError`."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is neither a run file nor UTF-8 text (byte {error.start})") from error
    try:
        rows = list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise UsageError(f"{path} is not a CSV table: {error}") from error
    if not rows or not any(cell.strip() for cell in rows[0]):
        raise UsageError(
            f"{path} is empty: the first line must name the columns ({','.join(PITCH_ROLL)},x_V or "
            f"{','.join(WHOLE_PLOT)},bridge_mV)"
        )
    names = [cell.strip() for cell in rows[0]]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{path}, row 1: column {name!r} stands there twice; rename one")
    body = [(number, row) for number, row in enumerate(rows[1:], start=2) if any(cell.strip() for cell in row)]
    if not body:
        raise UsageError(f"{path} has column names and no rows")
    values = np.empty((len(body), len(names)))
    for at, (number, row) in enumerate(body):
        if len(row) != len(names):
            raise UsageError(f"{path}, row {number}: {len(row)} values for {len(names)} columns; mend the row")
        for column, cell in enumerate(row):
            values[at, column] = _number(path, number, names[column], cell)
    columns = {name: values[:, i].copy() for i, name in enumerate(names)}
    simulated = bool(columns.get("simulated", np.zeros(1)).any())
    return Table(str(path), columns, simulated, {"file": path.name, "simulated": simulated})


def _number(path: Path, row: int, column: str, cell: str) -> float:
    what = f"{path}, row {row}, column {column}"
    try:
        value = float(cell)
    except ValueError:
        if not cell.strip():
            raise UsageError(f"{what}: the value is missing; fill it in or remove the row") from None
        raise UsageError(f"{what}: {cell.strip()!r} is not a number") from None
    if not math.isfinite(value):
        raise UsageError(f"{what}: {cell.strip()} is not a finite number; remove the row if there was no reading")
    return value


def write_csv(columns: Mapping[str, Sequence[float] | np.ndarray[Any, Any]], path: Path) -> None:
    """Write a table whole or not at all. Raises `UsageError` if the disk refuses."""

    def rows(file: IO[str]) -> None:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(_cells(columns))

    write_whole(path, rows)


def _cells(columns: Mapping[str, Sequence[float] | np.ndarray[Any, Any]]) -> Iterator[list[str]]:
    for row in zip(*columns.values(), strict=True):
        yield [_cell(float(value)) for value in row]


def _cell(value: float) -> str:
    if math.isnan(value):
        return ""
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
