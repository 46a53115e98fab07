"""Tables: what is wrong with one is said in one line, and nothing is written."""

from __future__ import annotations

import math

import numpy as np
import pytest
from command import rig
from ideal_bench import new_run, run_session

from rig.errors import RunFileError, UsageError
from rig.procedures.attitude.kind import KIND as ATTITUDE
from rig.procedures.attitude.table import attitude_data
from rig.procedures.errors import DataError
from rig.tables import read_table, write_csv
from rig.tables.table_of_run import run_table

HEAD = "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V"
ROWS = [f"{1 + i // 4},{i + 1},{30 * i},{(-30, -10, 10, 30)[i % 4]},{90 * (i % 3)},23.1,{0.1 * i}" for i in range(8)]


def written(tmp_path, *lines):
    path = tmp_path / "data.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_good_table_is_read(tmp_path):
    data = attitude_data(read_table(written(tmp_path, HEAD, *ROWS)))
    assert len(data) == 8
    assert data.sensors == ("x_V",)


def test_a_run_says_from_where_the_head_came_to_the_first_point(tmp_path):
    """The first point was taken for one without a move, which effects of the last move were judged with."""
    lines = [f"{HEAD},pitch_from_deg", *(f"{row},{7 + n}" for n, row in enumerate(ROWS))]
    data = attitude_data(read_table(written(tmp_path, *lines)))
    assert data.previous_pitch_deg.tolist() == [7, -30, -10, 10, 30, -30, -10, 10]
    assert data.previous_roll_deg[0] == data.roll_deg[0]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ([HEAD, *ROWS[:3], ROWS[3].replace("23.1", "warm")], "row 5, column sensor_temperature_degC: 'warm' is not"),
        ([HEAD, *ROWS[:3], ROWS[3].replace("23.1", "nan")], "row 5, column sensor_temperature_degC: nan is not"),
        ([HEAD, *ROWS[:3], ROWS[3].replace("23.1", "")], "row 5, column sensor_temperature_degC: the value is missing"),
        ([HEAD, ROWS[0], ROWS[1] + ",7"], "row 3: 8 values for 7 columns"),
        ([HEAD.replace("pitch_deg", "pitch_rad"), *ROWS], "pitch_rad is in 'rad'; convert it and name it pitch_deg"),
        ([HEAD.replace("x_V", "x_mV"), *ROWS], "column x_mV is in 'mV'; convert it and name it x_V"),
        ([HEAD.replace("elapsed_s", "elapsed_h"), *ROWS], "name it elapsed_s"),
        ([HEAD.replace("sensor_temperature_degC", "t"), *ROWS], "column sensor_temperature_degC is missing"),
        ([HEAD.replace("x_V", "x"), *ROWS], "there is no sensor output"),
        ([HEAD, *ROWS, ROWS[2]], "rows 4 and 10: order 3 is there twice"),
        ([HEAD, *ROWS[:2], ROWS[2].replace("1,3,", "1,3.5,")], "row 4, column order: 3.5 is not a whole number"),
        ([HEAD.replace("x_V", "elapsed_s"), *ROWS], "column 'elapsed_s' occurs twice"),
        ([HEAD], "column names and no rows"),
        ([""], "is empty"),
        ([HEAD, '1,2,"unterminated'], "not a CSV table"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_explained_in_one_line(tmp_path, lines, says):
    with pytest.raises((UsageError, DataError)) as caught:
        attitude_data(read_table(written(tmp_path, *lines)))
    message = str(caught.value)
    assert says in message
    assert "data.csv" in message
    assert "\n" not in message


def test_tables_of_numbers_alone_are_read_to_the_last_bit(tmp_path):
    cells = [
        "0.1",
        "-1e-310",
        "4.9406564584124654e-324",
        "1.7976931348623157e308",
        "9007199254740993",
        ".5",
        "+7.",
        "1E3",
    ]
    cells += [repr(float(v)) for v in np.random.default_rng(1).normal(size=200) * 10.0 ** np.arange(-100, 100)]
    table = read_table(written(tmp_path, "a, b ", *(f"{cell}, {i}" for i, cell in enumerate(cells))))
    assert list(table.columns) == ["a", "b"]
    np.testing.assert_array_equal(table.columns["a"], [float(cell) for cell in cells])


@pytest.mark.parametrize("row", ['"3",4', "", " ", ",", " +1e3 ,4"])
def test_cells_that_take_a_second_look_are_read_all_the_same(tmp_path, row):
    table = read_table(written(tmp_path, "a,b", "1,2", row, "5,6"))
    assert list(table.columns["b"]) == ([2, 4, 6] if "4" in row else [2, 6])


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "data.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UsageError, match="neither a run file nor UTF-8 text"):
        read_table(path)


def test_what_a_run_observed_is_what_its_table_says(tmp_path):
    path = new_run(tmp_path)
    run_session(path)
    table = run_table(path)
    assert len(table) == 18
    truth = np.sin(np.radians(table.columns["pitch_deg"]))
    np.testing.assert_allclose(table.columns["x_V"], truth, atol=1e-7)  # the ideal meter counts in its last digit
    assert list(table.columns["order"]) == list(range(1, 19))
    assert (np.diff(table.columns["elapsed_s"]) > 0).all()
    assert table.simulated
    copy = tmp_path / "copy.csv"
    write_csv(table.columns, copy)
    again = read_table(copy)
    assert list(again.columns) == list(table.columns)
    for name, values in table.columns.items():
        np.testing.assert_array_equal(again.columns[name], values)


def test_everything_includes_rejected_observations_with_gaps(tmp_path):
    path = new_run(tmp_path)

    def overload_once(_bench, _head, reader):
        reader.overloads = {5}

    run_session(path, spoil=overload_once)
    table = run_table(path, everything=True)
    assert len(table) == 19
    (rejected,) = np.flatnonzero(table.columns["accepted"] == 0)
    assert math.isnan(table.columns["x_V"][rejected])
    accepted = run_table(path)
    assert len(accepted) == 18
    (row,) = ATTITUDE.unused(accepted).to_json()["rows"]
    assert row["why"].startswith("1 observations were rejected")
    done = rig("export", path, "--out", tmp_path / "run.csv")
    assert "1 rejected observations are omitted; --all" in done.stderr


def test_a_run_without_observations_says_so(tmp_path):
    with pytest.raises(RunFileError, match="holds no observations yet"):
        read_table(new_run(tmp_path))


def test_a_table_that_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(UsageError, match="cannot be written"):
        write_csv({"a": [1.0]}, tmp_path / "missing" / "a.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (ROWS[2], "rows 6 and 7: order 3 is there twice"),
        (ROWS[3].replace("1,4,", "1,4.5,"), "row 7, column order: 4.5 is not a whole number"),
    ],
)
def test_rows_in_messages_are_those_of_the_file_where_lines_are_blank(tmp_path, wrong, says):
    with pytest.raises((UsageError, DataError), match=says):
        attitude_data(read_table(written(tmp_path, HEAD, "", ROWS[0], "", ROWS[1], ROWS[2], wrong, "", *ROWS[4:])))
