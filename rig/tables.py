"""Tables in and out: CSV with units in the column names, and the observations of a run file.

What is wrong with a table is said in one line: file, row, column, what to do.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from fitter import AttitudeData
from procedures import RunList
from rig.atomic import write_whole
from rig.config import parse_toml
from rig.engine.chain import Record
from rig.engine.run_file import RunReader
from rig.errors import RunFileError, UsageError

PITCH_ROLL = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
"""Columns every pitch-roll table has, besides one `NAME_V` for each sensor."""

_STEMS = {"elapsed": "s", "pitch": "deg", "roll": "deg", "sensor_temperature": "degC"}
_OPTIONAL = ("pitch_side", "roll_side", "block")


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Attributes:
        source: where it came from, for messages and reports.
        columns: name to values, all of one length.
        simulated: no real instrument involved, as far as is known.
        provenance: what is known of where the numbers come from, for reports and calibration files.
        axes: nominal axis of each output, where the source says so; elsewhere a name's first letter does.

    """

    source: str
    columns: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]]
    simulated: bool
    provenance: Mapping[str, Any]
    axes: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def read_table(path: Path) -> Table:
    """A CSV file or the accepted observations of a run file. Raises `UsageError` or `RunFileError`."""
    if not path.exists():
        raise UsageError(f"there is no file {path}")
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name a CSV file or a run file")
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}") from error
    if start.startswith(b"SQLite format 3"):
        return run_table(path)
    return _read_csv(path)


def _read_csv(path: Path) -> Table:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is neither a run file nor UTF-8 text (byte {error.start})") from error
    try:
        rows = list(csv.reader(io.StringIO(text), strict=True))
    except csv.Error as error:
        raise UsageError(f"{path} is not a CSV table: {error}") from error
    if not rows or not any(cell.strip() for cell in rows[0]):
        raise UsageError(f"{path} is empty: the first line must name the columns ({','.join(PITCH_ROLL)},x_V)")
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


def attitude_data(table: Table) -> AttitudeData:
    """A table as pitch-roll data. Raises `UsageError` naming what is missing or of another unit."""
    _check_units(table)
    optional = {"sensor_temperature_degC"} if "run_id" in table.provenance else set()
    missing = [name for name in PITCH_ROLL if name not in table.columns and name not in optional]
    if missing:
        raise UsageError(
            f"{table.source}: column {missing[0]} is missing; a pitch-roll table has {','.join(PITCH_ROLL)} and one "
            f"NAME_V for each sensor"
        )
    outputs = {name: values for name, values in table.columns.items() if name.endswith("_V")}
    if not outputs:
        raise UsageError(f"{table.source}: there is no sensor output; name the columns x_V, y_V, z_V")
    integers = {name: _integers(table, name) for name in ("replicate", "order")}
    integers |= {name: _integers(table, name) for name in _OPTIONAL if name in table.columns}
    order = integers["order"]
    seen, counts = np.unique(order, return_counts=True)
    if (counts > 1).any():
        twice = int(seen[counts > 1][0])
        rows = [int(r) + 2 for r in np.flatnonzero(order == twice)[:2]]
        raise UsageError(
            f"{table.source}, rows {rows[0]} and {rows[1]}: order {twice} stands there twice; a point copied?"
        )
    known: dict[str, Any] = {name: integers[name] for name in _OPTIONAL if name in integers}
    known["axes"] = {name: axis for name, axis in table.axes.items() if name in outputs} or None
    try:
        return AttitudeData(
            replicate=integers["replicate"],
            order=order,
            elapsed_s=table.columns["elapsed_s"],
            pitch_deg=table.columns["pitch_deg"],
            roll_deg=table.columns["roll_deg"],
            sensor_temperature_degC=table.columns.get("sensor_temperature_degC"),
            outputs=outputs,
            **known,
        )
    except ValueError as error:
        raise UsageError(f"{table.source}: {error}") from error


def _integers(table: Table, name: str) -> np.ndarray[Any, np.dtype[np.int64]]:
    values = table.columns[name]
    whole = values.astype(np.int64)
    if (whole != values).any():
        row = int(np.flatnonzero(whole != values)[0])
        raise UsageError(f"{table.source}, row {row + 2}, column {name}: {values[row]:g} is not a whole number")
    return whole


def _check_units(table: Table) -> None:
    for name in table.columns:
        stem, _, unit = name.rpartition("_")
        wanted = _STEMS.get(stem)
        if stem in ("x", "y", "z"):
            wanted = "V"
        if wanted is not None and unit != wanted and not name.endswith("_side"):
            raise UsageError(f"{table.source}: column {name} is in {unit!r}; convert it and name it {stem}_{wanted}")


def run_table(path: Path, *, everything: bool = False, salvage: bool = False) -> Table:
    """Observations of a run file, in the order they were made.

    Args:
        path: the run file.
        everything: rejected observations too (their missing values are NaN), with a column `accepted`.
        salvage: take what can still be read of a file that does not verify.

    Raises:
        RunFileError: the file was damaged or edited (unless salvaged), or holds no observations.

    """
    with RunReader.open(path) as reader:
        if not salvage:
            reader.verify()
        genesis = reader.genesis()
        run_list = reader.run_list()
        bench = parse_toml(reader.documents().get("bench.toml", ""), str(path))
        factors: Mapping[str, str] = bench.get("factors", {})
        rows: list[dict[str, float]] = []
        records = reader.salvage() if salvage else reader.records("observation")
        for record in records:
            if record.kind != "observation" or (record.status != "accepted" and not everything):
                continue
            try:
                row = _row(record, run_list, len(rows) + 1, factors)
            except (ValueError, LookupError, TypeError, AttributeError):
                if not salvage:
                    raise
                continue  # this record's contents are not what a controller writes
            if everything:
                row["accepted"] = float(record.status == "accepted")
            if genesis.data["simulated"]:
                row["simulated"] = 1.0
            rows.append(row)
        _, head = reader.head()
        ended = not salvage and any(True for _ in reader.records("end"))
    if not rows:
        raise RunFileError(f"{path} holds no observations yet; `rig resume {path}` makes some")
    columns = {name: np.array([row.get(name, math.nan) for row in rows], float) for name in _all_names(rows)}
    provenance = {
        "file": path.name,
        "run_id": genesis.data["run_id"],
        "simulated": genesis.data["simulated"],
        "head": head.hex(),
        "bench": genesis.data["bench"],
        "procedure": genesis.data["procedure"],
        "software": genesis.data["software"],
        "complete": ended,
        "points_planned": len(run_list),
        "points_observed": len(rows),
    }
    if "sensor_temperature_degC" not in columns:  # a bench may call the package's temperature by another name
        for name, entry in bench.get("temperatures", {}).items():
            if entry.get("place", "package") == "package" and name in columns:
                columns = {"sensor_temperature_degC": columns[name], **columns}
                break
    sensors = bench.get("sensors", {})
    axes_of = {f"{name}_{s.get('unit', 'V')}": s["axis"] for name, s in sensors.items() if "axis" in s}
    return Table(str(path), columns, bool(genesis.data["simulated"]), provenance, axes_of)


def _row(record: Record, run_list: RunList, order: int, factors: Mapping[str, str]) -> dict[str, float]:
    """One observation as a row: where, when, how approached, what was read.

    A factor whose value was measured is a column with that value, and one with its setpoint ("pressure_set_psia").

    Args:
        record: the observation.
        run_list: what its point means.
        order: executed position, from 1.
        factors: which instrument sets which factor.

    """
    point, data = run_list.points[int(record.run_index or 0)], record.data
    row: dict[str, float] = {} if record.whole_plot is None else {"whole_plot": record.whole_plot}
    row |= {"replicate": point.replication, "order": order, "elapsed_s": _moment(record)}
    measured = _means(data, "references") | _means(data, "temperatures")
    setpoints: dict[str, float] = {}
    for factor, value in run_list.setting(point).items():
        chamber = data.get("environment", {}).get(factors.get(factor, ""))
        if factor not in measured and chamber is not None:
            measured[factor] = chamber["temperature_degC"]
        row[factor] = measured.get(factor, value)
        if factor in measured:
            setpoints[run_list.factor(factor).set_name] = value
    row |= measured | _means(data, "outputs") | setpoints
    row |= {f"{f.axis}_side": side for f, side in zip(run_list.factors, point.sides, strict=True) if not f.hard}
    readback = {name: value for name, value in data.get("readback", {}).items() if name not in measured}
    row |= {_readback_name(name): float(value) for name, value in readback.items()}
    return row | {"block": record.session, "run_index": point.index}


def _readback_name(quantity: str) -> str:
    stem, _, unit = quantity.rpartition("_")
    return f"{stem}_readback_{unit}"


def _moment(record: Record) -> float:
    began, ended = record.data.get("measured_s", (record.elapsed_s, record.elapsed_s))
    return float(round((began + ended) / 2, 3))


def _means(data: Mapping[str, Any], group: str) -> dict[str, float]:
    return {name: float(channel["mean"]) for name, channel in data.get(group, {}).items()}


def _all_names(rows: Iterable[Mapping[str, float]]) -> list[str]:
    """Column names in order of first appearance."""
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row)
    return list(names)


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
