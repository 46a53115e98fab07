"""`rig export --out x.parquet`: the same values as the CSV, with types, units, and the run they are from."""

from __future__ import annotations

import csv
import json
import sys
from unittest.mock import patch

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from command import rig

from proving.crashes.damages import small_finished
from rig.errors import UsageError
from rig.procedures.tables.table import Table
from rig.tables.behind_rows import COUNT, FLAG, meaning_of
from rig.tables.parquet_files import write_parquet
from rig.tables.table_of_run import run_table

ABOUT = {"run_id": "r", "head": "ab", "began_utc": "2026-01-01T00:00+00:00", "software": {"calibration-rig": "1"}}


@pytest.fixture(scope="module", params=["attitude", "pressure"])
def run(request, tmp_path_factory):
    return small_finished(request.param, tmp_path_factory.mktemp(request.param))


@pytest.mark.parametrize("options", [(), ("--all",), ("--salvage",)])
def test_values_are_those_of_the_csv_to_the_bit(run, tmp_path, options):
    for ending in ("csv", "parquet"):
        done = rig("export", run, "--out", tmp_path / f"x.{ending}", *options)
        assert done.returncode == 0, done.stderr
    with (tmp_path / "x.csv").open() as file:
        names, *rows = csv.reader(file)
    table = pq.read_table(tmp_path / "x.parquet")
    assert table.column_names == names
    assert table.num_rows == len(rows)
    for i, name in enumerate(names):
        cells = [None if row[i] == "" else float(row[i]) for row in rows]
        assert [None if one is None else float(one) for one in table[name].to_pylist()] == cells
    frame = pd.read_parquet(tmp_path / "x.parquet")
    for i, name in enumerate(names):
        np.testing.assert_array_equal(frame[name].astype(float), [float(row[i] or "nan") for row in rows])


def test_columns_have_types_and_units_and_the_file_knows_its_run(run, tmp_path):
    assert rig("export", run, "--out", tmp_path / "x.PARQUET", "--all").returncode == 0
    schema = pq.read_schema(tmp_path / "x.PARQUET")
    of_type = {"": "double", COUNT: "int64", FLAG: "bool"}
    assert {field.name: str(field.type) for field in schema} == {
        field.name: of_type[meaning_of(field.name)] for field in schema
    }
    assert {str(field.type) for field in schema} == {"double", "int64", "bool"}
    assert schema.field("elapsed_s").metadata == {b"unit": b"s"}
    assert schema.field("order").metadata is None
    told = {key.decode(): value.decode() for key, value in schema.metadata.items() if key != b"ARROW:schema"}
    provenance = run_table(run).provenance
    assert (told["run_id"], told["head"]) == (provenance["run_id"], provenance["head"])
    assert told["software"].startswith("calibration-rig ")
    assert (told["simulated"], told["verified"]) == ("true", "true")
    assert json.loads(told["provenance"])["points_planned"] == provenance["points_planned"]
    assert (tmp_path / "x.faults.csv").exists()


def test_what_was_salvaged_is_not_verified(run, tmp_path):
    assert rig("export", run, "--out", tmp_path / "x.parquet", "--salvage").returncode == 0
    assert pq.read_schema(tmp_path / "x.parquet").metadata[b"verified"] == b"false"


def of(**columns):
    return Table("run", {name: np.asarray(values, float) for name, values in columns.items()}, False, ABOUT)


def test_a_missing_value_is_null_and_a_count_that_is_none_is_a_double(tmp_path):
    odd = {"readings": [5.0, np.nan], "order": [1.0, 1.5], "flag_noisy": [1.0, np.nan], "x_V": [np.nan, -0.0]}
    write_parquet(of(**odd), tmp_path / "x.parquet", verified=True)
    table = pq.read_table(tmp_path / "x.parquet")
    assert [str(field.type) for field in table.schema] == ["int64", "double", "bool", "double"]
    assert table.to_pydict() == {"readings": [5, None], "order": [1, 1.5], "flag_noisy": [True, None], "x_V": [None, 0]}
    assert np.signbit(table["x_V"].to_pylist()[1])


def test_a_long_table_is_written_in_row_groups(tmp_path):
    n = 150_000
    write_parquet(of(order=np.arange(n), x_V=np.arange(n) / 7), tmp_path / "x.parquet", verified=True)
    file = pq.ParquetFile(tmp_path / "x.parquet")
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [65536, 65536, n - 2 * 65536]
    assert file.read()["x_V"].to_numpy().tolist() == (np.arange(n) / 7).tolist()


def test_a_disk_that_is_full_leaves_the_old_file_and_nothing_else(tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"old")
    with patch("os.replace", side_effect=OSError(28, "No space left on device")), pytest.raises(UsageError):
        write_parquet(of(x_V=[1.0]), tmp_path / "x.parquet", verified=True)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("x.parquet", b"old")]


def test_without_pyarrow_it_is_refused_before_the_work_with_what_installs_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    done = rig("export", tmp_path / "no.sqlite", "--out", tmp_path / "x.parquet")
    assert (done.returncode, list(tmp_path.iterdir())) == (2, [])
    assert "pip install 'calibration-rig[parquet]'" in done.stderr
