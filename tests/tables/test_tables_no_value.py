"""Numbers that loggers write for no value are gaps, which is said; the same numbers as values stay."""

from __future__ import annotations

import numpy as np
import pytest
from command import rig

from rig.errors import UsageError
from rig.tables import FileSource, read_any_csv, read_gappy_csv, read_table


def written(tmp_path, y, x=None, sign=","):
    """A table of x and y, with x = 0 to 4 again and again."""
    x = [i % 5 for i in range(len(y))] if x is None else x
    path = tmp_path / "t.csv"
    path.write_text("".join(f"{a}{sign}{b}\n" for a, b in [("x", "y"), *zip(x, y, strict=True)]))
    return path


GOOD = [f"{2 * (i % 5) + 0.01 * i:.2f}" for i in range(10)]


@pytest.mark.parametrize("sign", [",", ";", "\t"])
@pytest.mark.parametrize(
    "gap",
    ["-9999", "-999", "-9999.0", "-999.9", "9999", "99999", "7999", "-6999", "1E38", "1.0E+38", "-1e38",
     "3.4028235E+38", "9.9E37", "9.91E+37"],
)  # fmt: skip
def test_a_number_for_no_value_is_a_gap(tmp_path, gap, sign):
    path = written(tmp_path, [*GOOD[:4], gap, *GOOD[4:], gap], sign=sign)
    table = read_any_csv(path, ["x", "y"])
    assert table.columns["y"].tolist() == list(map(float, GOOD))
    count = "2 cells with 9.9E37" if gap.endswith("37") else f"2 cells with {gap}"
    assert count in table.understood["sentence"]
    assert "2 rows left out without a value in y (rows 6, 13)" in table.understood["sentence"]
    gappy = read_gappy_csv(path, ["y"])
    assert np.isnan(gappy.columns["y"]).sum() == 2
    assert np.isnan(FileSource(path).all_columns().columns["y"]).sum() == 2
    with pytest.raises(UsageError, match="the value is missing"):
        read_table(path)


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ([-9999, 0, 5000, 9999] * 3, list(range(12))),  # a design of both signs
        ([9000 + 111 * i for i in range(10)], list(range(10))),  # 9999 among its neighbours
        ([0, 1, 2, -9999, -9999, -9999], list(range(6))),  # half of the rows
        ([-9999 - i for i in range(8)], list(range(8))),
        ([9999], [1]),  # one reading alone
        ([1e3, 1e10, 1e20, 1e30], [1, 2, 3, 4]),
        ([1e3, 1e36, 1e39, 1e38], [1, 2, 3, 4]),
        ([0, 100, 999, 0, 100, 999], list(range(6))),
    ],
)
def test_the_same_numbers_as_values_stay(tmp_path, x, y):
    path = written(tmp_path, y, x)
    for table in (read_table(path), read_any_csv(path, ["x", "y"]), FileSource(path).all_columns()):
        assert table.columns["x"].tolist() == [float(one) for one in x]
        assert table.understood == {}


def test_a_fit_says_what_it_left_out(tmp_path):
    path = written(tmp_path, [*GOOD, "-9999"])
    done = rig("fit", path, "--response", "y", "--formula", "1 + x")
    assert done.returncode == 0, done.stderr
    assert "1 cell with -9999: no reading, so no value" in " ".join(done.stderr.split())
    assert "t.csv: 10 rows" in done.stdout
