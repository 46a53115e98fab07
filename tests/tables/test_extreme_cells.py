"""Cells of extreme size in tables: an error that names the cell, or a result; no warning of NumPy, no traceback."""

from __future__ import annotations

import pytest
from command import rig

EXTREME = ["-1e308", "1e308", "1.7976931348623157e308", "1e200", "-1e61", "inf", "-inf"]
HARMLESS = ["1e-320", "-1e-200", "1e30", "0", "nan", ""]


def told(folder, command, rows, *more):
    (folder / "t.csv").write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in rows))
    done = rig(command, "t.csv", "--response", "y", *more, cwd=folder)
    assert "Warning" not in done.stderr
    return done.returncode, done.stderr


def rows_with(column, cell):
    rows = [[str(i), f"{2 + 3 * i + 0.1 * (i * 7 % 5 - 2):.3f}", f"{i * i % 7}"] for i in range(12)]
    rows[5]["xyz".index(column)] = cell
    return rows


@pytest.mark.parametrize("command", ["fit", "trace"])
@pytest.mark.parametrize("column", ["x", "y"])
@pytest.mark.parametrize("cell", EXTREME)
def test_a_cell_that_is_too_large_is_named(tmp_path, command, column, cell):
    code, said = told(tmp_path, command, rows_with(column, cell), "--formula", "1 + x")
    assert code == 2
    assert f"row 7, column {column}" in said
    assert "correct the cell" in said or "remove the row" in said


@pytest.mark.parametrize("command", ["fit", "trace"])
@pytest.mark.parametrize("cell", [*EXTREME, *HARMLESS])
def test_a_column_that_is_not_needed_stops_nothing(tmp_path, command, cell):
    assert told(tmp_path, command, rows_with("z", cell), "--formula", "1 + x")[0] == 0


@pytest.mark.parametrize("column", ["x", "y"])
@pytest.mark.parametrize("cell", HARMLESS)
def test_other_cells_have_a_result(tmp_path, column, cell):
    for command in ("fit", "trace"):
        assert told(tmp_path, command, rows_with(column, cell), "--formula", "1 + x")[0] == 0


@pytest.mark.parametrize("command", ["fit", "trace"])
def test_a_power_that_is_too_large_names_its_row(tmp_path, command):
    code, said = told(tmp_path, command, rows_with("x", "1e50"), "--formula", "1 + x + x^3")
    assert code == 2
    assert "x^3 is 1e+150, too large to compute with" in said
    assert "row 7" in said


@pytest.mark.parametrize("command", ["fit", "trace"])
def test_a_column_that_is_too_small_is_named(tmp_path, command):
    rows = [[f"{i}e-310", f"{3 * i + i % 2}", "1"] for i in range(12)]
    code, said = told(tmp_path, command, rows, "--formula", "1 + x")
    assert code == 2
    assert "column x: its values are too small" in said
