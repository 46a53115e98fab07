"""Writing Parquet: the columns of an export with their types, units, and the run that they are from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import IO, Any

import numpy as np

from rig.extras import needed
from rig.files.atomic import write_whole_bytes
from rig.procedures.tables.table import Table
from rig.procedures.tables.unused import known_unit_of
from rig.tables.behind_rows import COUNT, FLAG, meaning_of

_BLOCK = 65536
"""Rows of a row group: what readers load at a time, and what is converted at a time."""


def check_parquet() -> None:
    """Refuse before the work what cannot be written. Raises `UsageError` if pyarrow is not installed."""
    _parquet()


def write_parquet(table: Table, path: Any, *, verified: bool) -> None:
    """Write the numbers of a run completely or not at all.

    Measured values are doubles, counts and places in the run int64, flags boolean; a missing value is null. Metadata of
    the schema have the run's identity and all of its provenance, those of a column its unit.

    Args:
        table: of `rig.tables.table_of_run`.
        path: the file.
        verified: whether the hash chain of the run file was checked.

    Raises:
        UsageError: pyarrow is not installed, or the disk refuses.
    """
    arrow, types = needed("pyarrow", "parquet"), {}
    for name, values in table.columns.items():
        types[name] = _type(arrow, name, values)
    fields = [arrow.field(name, of, metadata=_unit(name)) for name, of in types.items()]
    schema = arrow.schema(fields, metadata=_identity(table, verified=verified))

    def rows(file: IO[bytes]) -> None:
        with _parquet().ParquetWriter(file, schema) as writer:
            for start in range(0, len(table), _BLOCK):
                part = {name: values[start : start + _BLOCK] for name, values in table.columns.items()}
                columns = [_column(arrow, part[name], of) for name, of in types.items()]
                writer.write_batch(arrow.record_batch(columns, schema=schema), row_group_size=_BLOCK)

    write_whole_bytes(path, rows)


def _parquet() -> Any:
    return needed("pyarrow.parquet", "parquet")


def _type(arrow: Any, name: str, values: np.ndarray[Any, Any]) -> Any:
    """The type of a column by what it means; a double where a value does not fit."""
    known, meaning = values[~np.isnan(values)], meaning_of(name)
    if meaning == FLAG and np.isin(known, (0.0, 1.0)).all():
        return arrow.bool_()
    if meaning == COUNT and (np.trunc(known) == known).all():
        return arrow.int64()
    return arrow.float64()


def _column(arrow: Any, values: np.ndarray[Any, Any], of: Any) -> Any:
    missing = np.isnan(values)
    whole = values if of == arrow.float64() else np.where(missing, 0.0, values).astype(of.to_pandas_dtype())
    return arrow.array(whole, type=of, mask=missing)


def _unit(name: str) -> dict[str, str]:
    unit = known_unit_of(name)
    return {"unit": unit} if unit else {}


def _identity(table: Table, *, verified: bool) -> Mapping[str, str]:
    """The run's identity by names of their own, and the whole provenance as JSON."""
    known = table.provenance
    software = ", ".join(f"{name} {version}" for name, version in known.get("software", {}).items())
    return {
        "run_id": str(known["run_id"]),
        "head": str(known["head"]),
        "software": software,
        "began_utc": str(known["began_utc"]),
        "simulated": json.dumps(table.simulated),
        "verified": json.dumps(verified),
        "provenance": json.dumps(known, ensure_ascii=False),
    }
