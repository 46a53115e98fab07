"""Tables that others wrote are read right, or asked about: one message, exit code 2, the option that settles it.

All tables here are written by hand, after what instruments and spreadsheets write.
"""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from command import rig

from rig.errors import UsageError
from rig.fitter.errors import FitError
from rig.procedures.attitude.table import attitude_data
from rig.procedures.errors import DataError
from rig.procedures.general.clock_texts import seconds_of
from rig.procedures.general.directions import are_directions, likely_words, sides_of
from rig.procedures.general.fit import fit_general
from rig.procedures.general.rows import LinearRows
from rig.tables import FileForm, FileSource, read_any_csv, read_gappy_csv, read_table
from rig.tables.of_others import footers
from rig.tables.of_others.cells_of_lines import Line
from rig.tables.of_others.where_the_table_is import is_value
from rig.verbs.data.unknown_table import look_at

X = np.array([0.0, 1.0, 2.0, 5.0, 10.0, 5.0, 2.0, 1.0])
Y = 0.125 + 2.0 * X + np.array([0.01, -0.02, 0.03, -0.01, 0.02, 0.01, -0.03, -0.01])


def rows(separator, form=str, ends="\n", extra=lambda i: ()):
    return ends.join(
        separator.join([form(f"{x:.2f}"), form(f"{y:.4f}"), *extra(i)])
        for i, (x, y) in enumerate(zip(X, Y, strict=True))
    )


def comma(text):
    return text.replace(".", ",")


SEMICOLON = "x;y\n" + rows(";", comma)
NAMED = "Load (kN);Output (mV/V)\n" + rows(";", comma)
PREAMBLE = "Logger 7, serial 1234\nStart: 2026-01-15 09:30\nChannels: 2\n\n"
LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n\t\n"
    "Channels\t1\t\t\nSamples\t8\t\t\nDate\t2026/01/15\t\t\nX0\t0,0000E+0\t\t\n***End_of_Header***\t\t\t\n"
    "x\ty\tComment\n" + rows("\t", comma)
)
MESSY = {
    "semicolon and decimal comma": SEMICOLON,
    "tabs": "x\ty\n" + rows("\t"),
    "tabs and decimal comma": "x\ty\n" + rows("\t", comma),
    "pipes": "x|y\n" + rows("|"),
    "runs of blanks": "   x      y\n" + rows("    "),
    "latin-1": ("x;y;T °C\n" + rows(";", comma, extra=lambda i: ["21,5 µ"])).encode("latin-1"),
    "utf-16": ("x\ty\n" + rows("\t")).encode("utf-16"),
    "byte-order mark": ("\ufeff" + SEMICOLON).encode(),
    "crlf": SEMICOLON.replace("\n", "\r\n").encode(),
    "cr": SEMICOLON.replace("\n", "\r").encode(),
    "a row of units": "x;y\nkN;mV/V\n" + rows(";", comma),
    "units in brackets": "x,y\n[kN],(mV)\n" + rows(","),
    "comment lines": "# a table\n# of others\nx,y\n" + rows(","),
    "names in a comment": "# x y\n" + rows(" "),
    "a preamble": PREAMBLE + "x;y\n" + rows(";", comma),
    "a labview file": LVM,
    "quoted numbers": '"x";"y"\n' + rows(";", lambda t: f'"{comma(t)}"'),
    "decimal comma in quotes": '"x","y"\n' + rows(",", lambda t: f'"{comma(t)}"'),
    "separators at the ends of rows": "x;y;\n" + rows(";", comma, extra=lambda i: [""]),
    "constants above the table": "Cal file\na0, a1, a2\n-9.5, 1.5, 2.5\n\nx, y\n" + rows(", "),
    "a footer": "x;y\n" + rows(";", comma) + "\nEND OF DATA\n",
    "a ruled line": "x    y\n-------\n" + rows("  "),
    "a name over columns, as NIST writes it": "Description here\n1 Factor\n\nData:   x      y\n" + rows("   "),
}  # fmt: skip


def written(tmp_path, text, name="data.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("text", MESSY.values(), ids=MESSY)
def test_messy_tables_are_read_to_the_last_digit(tmp_path, text):
    table = read_any_csv(written(tmp_path, text), ("x", "y"))
    np.testing.assert_array_equal(table.columns["x"], X)
    np.testing.assert_array_equal(table.columns["y"], np.round(Y, 4))
    assert len(table.rows) == 8
    assert table.understood or text == MESSY["comment lines"]


def test_units_of_a_row_are_kept(tmp_path):
    assert read_any_csv(written(tmp_path, MESSY["a row of units"]), ("x",)).units == {"x": "kN", "y": "mV/V"}


@pytest.mark.parametrize("word", ["", "NA", "n/a", "NaN", "nan", "-", "#N/A"])
@pytest.mark.parametrize("separator", [",", ";"])
def test_rows_without_a_value_are_left_out_and_named(tmp_path, word, separator):
    lines = ["x,y", "1,2.5", "2,?", "3,4.5", "4,5.5"]
    path = written(tmp_path, "\n".join(lines).replace(",", separator).replace("?", word))
    table = read_any_csv(path, ("x", "y"))
    assert table.columns["x"].tolist() == [1, 3, 4]
    assert list(table.rows) == [2, 4, 5]
    assert "1 row left out without a value in y (row 3)" in table.understood["sentence"]


def test_a_row_with_text_and_a_gap_at_its_end_belongs_to_the_table(tmp_path):
    table = read_any_csv(written(tmp_path, "x;side;y;z\n1;up;5;7\n2;up;;\n3;up;6;9\n4;up;7;8\n"), ("x", "side"))
    assert table.columns["x"].tolist() == [1, 2, 3, 4]
    assert table.gaps == {"y": 3, "z": 3}


def test_another_table_before_it_is_told(tmp_path):
    first = "t;v;i;z\n" + "1;2;3;up\n" * 9
    table = read_any_csv(written(tmp_path, first + "CURVE 2\nx;y\n" + "1,5;2\n" * 9), ("x", "y"))
    assert len(table) == 9
    assert "another table before it, up to row 10, was not read" in table.understood["sentence"]


def test_constants_in_the_first_row_alone(tmp_path):
    table = read_any_csv(written(tmp_path, "x;y;T\n1;2;20\n" + "2;3;\n" * 30), ("x", "y"))
    assert len(table) == 31


def test_a_row_that_is_a_remark_is_named(tmp_path):
    table = read_any_csv(written(tmp_path, "x;y\n1;2\n# 2;9\n3;4\n"), ("x", "y"))
    assert table.columns["x"].tolist() == [1, 3]
    assert "row 3 left out as a remark" in table.understood["sentence"]


def test_a_column_that_nobody_needs_may_have_gaps(tmp_path):
    table = read_any_csv(written(tmp_path, "x;y;z\n1;2;\n3;4;5\n"), ("x", "y"))
    assert len(table) == 2
    assert table.gaps == {"z": 2}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('x,y\n1,"1,234.5"\n2,"12,345.25"\n', [1234.5, 12345.25]),
        ("x;y\n1;1.234,5\n2;12.345,25\n", [1234.5, 12345.25]),
        ("x;y\n1;1'234.5\n2;12'345.25\n", [1234.5, 12345.25]),
        ("x;y\n1;1 234,5\n2;12 345,25\n", [1234.5, 12345.25]),
        ("x;y\n1;1,234,567\n2;2,345,678\n", [1234567, 2345678]),
        ("x;y\n1;0,123\n2;1,234\n", [0.123, 1.234]),
        ("x;y\n1;0.123\n2;1.234\n", [0.123, 1.234]),
        ("x;y\n1;−1,5\n2;2,5e-3\n", [-1.5, 0.0025]),
        ("x\ty\n1\t1.234\n2\t2.345\n", [1.234, 2.345]),
    ],
)
def test_groups_of_digits_where_they_are_clear(tmp_path, text, expected):
    assert read_any_csv(written(tmp_path, text), ("y",)).columns["y"].tolist() == expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x;y\n1;1,234\n2;5,678\n", "may be 1.234 or 1234; say --decimal"),
        ("x;y\n1;1.234\n2;5.678\n", "may be 1.234 or 1234; say --decimal"),
        ("x;y\n1;1.5\n2;5,6\n", "1.5 in row 2 has a decimal point, 5,6 in row 3 a decimal comma; say --decimal"),
        ('x,y\n1,"1,234"\n2,"5,678"\n', "say --decimal"),
        ("a;b\nc;d\n1;2\n3;4\n", "rows 1 and 2 may both hold the names of the columns; say --header"),
        ("a;b\n1;2;3\n4;5;6\n", "2 names, and 3 values in the rows after it"),
        ("x;y\n1;2\n3;4;5\n6;7\n8;9\n", "3 values, and 2 in the rows after it; correct the row"),
        ("x;side;y\n1;up;2;7\n2;up;3\n3;up;4\n", "row 2: 4 values, and 3 in the rows after it"),
        ("x;y\n1;2\n2;3\n3;4\nnew\nx;y\n1;2\n2;3\n", "holds several tables"),
        ("температура;y\n1,5;2\n2,5;3\n".encode("cp1251"), "say it with --encoding"),
        ("x;y\n1,5;2\n2,5;3\n".encode("utf-16-le"), "say --encoding utf-16-le"),
        ("x;x;y\n1;2;3\n2;3;5\n", "'x' is the name of several columns: say x (column 1) or x (column 2)"),
    ],
)  # fmt: skip
def test_what_is_ambiguous_is_asked_in_one_line(tmp_path, text, says):
    path = written(tmp_path, text)
    done = rig("fit", path, "--response", "y", "--formula", "1 + x")
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_the_option_that_is_asked_for_settles_it(tmp_path):
    path = written(tmp_path, "x;y\n1;1,234\n2;5,678\n")
    assert read_any_csv(path, ("y",), FileForm.of(None, "comma", None, None)).columns["y"].tolist() == [1.234, 5.678]
    assert read_any_csv(path, ("y",), FileForm.of("semicolon", "point", None, None)).columns["y"].tolist() == [
        1234,
        5678,
    ]
    cyrillic = written(tmp_path, "сила;y\n1,5;2\n2,5;3\n".encode("cp1251"), "cyrillic.csv")
    table = read_any_csv(cyrillic, ("сила",), FileForm.of(None, None, "cp1251", None))
    assert table.columns["сила"].tolist() == [1.5, 2.5]
    two = written(tmp_path, "a;b\nc;d\n1;2\n3;4\n", "two.csv")
    assert list(read_any_csv(two, ("c",), FileForm.of(None, None, None, 2)).columns) == ["c", "d"]
    none = written(tmp_path, "1;2\n3;4\n", "none.csv")
    assert read_any_csv(none, ("column_2",), FileForm.of(None, None, None, 0)).columns["column_2"].tolist() == [2, 4]


@pytest.mark.parametrize(
    "wrong",
    [("xx", None, None, None), (None, ";", None, None), (None, None, "klingon", None), ("comma", "comma", None, None)],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(UsageError, match="--"):
        FileForm.of(*wrong)


def test_what_was_understood_is_said_once_and_in_json(tmp_path):
    path = written(tmp_path, PREAMBLE + NAMED.replace("1,00;", ";", 1))
    done = rig("fit", path, "--response", "Output (mV/V)", "--formula", "1 + `Load (kN)`", "--json")
    assert done.returncode == 0, done.stderr
    said = "semicolons; decimal comma; names in row 5; 1 row left out without a value in Load (kN) (row 7)"
    assert done.stderr.count(said) == 1
    told = json.loads(done.stdout)["data"]
    assert told["points"] == 7
    assert told["understood"]["separator"] == ";"
    assert told["understood"]["decimal"] == ","
    assert told["understood"]["header_row"] == 5
    assert told["understood"]["rows_without_value"] == {"Load (kN)": [7]}


def test_tables_like_ours_are_read_as_before_and_nothing_is_said(tmp_path):
    path = written(tmp_path, "x,y,note\n" + rows(",", extra=lambda i: ["NA" if i else "a"]))
    table = read_any_csv(path, ("x", "y"))
    assert table.understood == {}
    assert table.text["note"].tolist() == ["a", *["NA"] * 7]
    done = rig("fit", path, "--response", "y", "--formula", "1 + x", "--json")
    assert "understood" not in json.loads(done.stdout)["data"]


def test_our_own_tables_are_read_from_a_german_spreadsheet_but_never_with_gaps(tmp_path):
    head = "replicate;order;elapsed_s;pitch_deg;roll_deg;sensor_temperature_degC;x_V"
    body = [
        f"{1 + i // 4};{i + 1};{30 * i};{(-30, -10, 10, 30)[i % 4]};{90 * (i % 3)};23,1;{0.1 * i:.2f}" for i in range(8)
    ]
    path = written(tmp_path, "\n".join([head, *body]).replace(".", ","))
    assert attitude_data(read_table(path)).sensors == ("x_V",)
    gappy = written(tmp_path, "\n".join([head, *body]).replace(".", ",").replace("23,1", "NA", 1), "gappy.csv")
    with pytest.raises(UsageError, match="row 2, column sensor_temperature_degC: the value is missing"):
        read_table(gappy)


def test_order_may_begin_anew_in_each_replication(tmp_path):
    head = "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V"
    body = [
        f"{1 + i // 4},{1 + i % 4},{30 * i},{(-30, -10, 10, 30)[i % 4]},{90 * (i % 3)},23.1,{0.1 * i}" for i in range(8)
    ]
    assert attitude_data(read_table(written(tmp_path, "\n".join([head, *body])))).order.tolist() == list(range(1, 9))
    with pytest.raises(DataError, match="order 1 is there twice"):
        attitude_data(read_table(written(tmp_path, "\n".join([head, *body, body[0]]), "twice.csv")))


def trace_lines(time, sides=None, n=48, names="x,y,t,side"):
    rng = np.random.default_rng(3)
    side = [1 if i % 12 < 6 else -1 for i in range(n)]
    words = sides or ("up", "down")
    lines = [names]
    for i in range(n):
        x = (i % 12 if i % 12 < 6 else 11 - i % 12) + 0.0
        y = 1 + 2 * x + 0.3 * side[i] + 0.02 * rng.standard_normal()
        lines.append(f"{x},{y:.4f},{time(i)},{words[side[i] < 0]}")
    return "\n".join(lines) + "\n"


def roles_of(path, *more):
    done = rig("trace", path, "--response", "y", "--formula", "1 + x", "--json", *more)
    return done, json.loads(done.stdout)["sensors"]["y"]["roles"] if done.returncode == 0 else None


@pytest.mark.parametrize(
    "words",
    [("up", "down"), ("Increasing", "Decreasing"), ("ascending", "descending"), ("loading", "unloading"), ("+", "-")],
)
def test_words_for_a_direction(tmp_path, words):
    path = written(tmp_path, trace_lines(lambda i: 10 * i, words))
    done, roles = roles_of(path, "--time", "t", "--direction", "side")
    assert done.returncode == 0, done.stderr
    assert roles["direction"] == "sign(side)"
    found = json.loads(done.stdout)["sensors"]["y"]["effects"]
    assert found[0]["effect"].startswith("direction")


def test_another_word_for_a_direction_is_asked_about(tmp_path):
    done, _ = roles_of(written(tmp_path, trace_lines(lambda i: i, ("hin", "her"))), "--direction", "side")
    assert done.returncode == 2
    assert "side has 'her'; give +1 and -1, up and down" in done.stderr
    assert "--direction 'side=hin,her', the upward one first" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    "words",
    [("auf", "ab"), ("hin", "zurueck"), ("rise", "fall"), ("Mont\u00e9e", "descente"), ("monte\u0301e", "descente"),
     ("steigend", "fallend"), ("loading", "unloading")],
)  # fmt: skip
def test_words_of_other_languages_for_a_direction(words):
    assert are_directions(words)
    assert sides_of(words).tolist() == [1.0, -1.0]


def test_two_words_of_their_own_are_said_with_the_upward_one_first(tmp_path):
    lines = trace_lines(lambda i: 10 * i, ("zu", "von"))
    told = rig("fit", written(tmp_path, lines))
    assert "--direction side=zu,von" in " ".join(told.stdout.split()), "side is no group here"
    done, roles = roles_of(written(tmp_path, lines), "--time", "t", "--direction", "side=zu,von")
    assert done.returncode == 0, done.stderr
    assert roles["direction"] == "sign(side)"
    found = json.loads(done.stdout)["sensors"]["y"]["effects"]
    assert found[0]["effect"].startswith("direction")
    for given, says in (
        ("side=zu", "side=zu"),
        ("side=zu,", "its two words"),
        ("side=zu,ab", "side has 'von' too"),
        ("none=a,b", "none"),
    ):
        done, _ = roles_of(written(tmp_path, lines), "--time", "t", "--direction", given)
        assert done.returncode == 2
        assert says in " ".join(done.stderr.split())


def test_two_operators_are_no_direction():
    turns = np.arange(48) % 12
    x = np.where(turns < 6, turns, 11 - turns).astype(float)
    assert likely_words(["her" if one < 6 else "hin" for one in turns], [x]) == ("her", "hin")
    assert likely_words(["Ann" if i % 24 < 12 else "Bob" for i in range(48)], [x]) is None
    assert likely_words(["a", "b", "a", "b"], [np.array([1.0, 2, 1, 2])]) is None, "too few"


@pytest.mark.parametrize(
    "stamp",
    [
        lambda i: f"2026-01-15T09:{i:02d}:30",
        lambda i: f"2026-01-15 09:{i:02d}:30.250",
        lambda i: f"2026-01-15T09:{i:02d}:30Z",
        lambda i: f"15/01/2026 09:{i:02d}",
        lambda i: f"15.01.2026 09:{i:02d}:00",
        lambda i: f"09:{i:02d}:30",
    ],
)
def test_dates_and_times_are_a_time(tmp_path, stamp):
    done, roles = roles_of(written(tmp_path, trace_lines(stamp)), "--time", "t")
    assert done.returncode == 0, done.stderr
    assert roles["time"] == "t"


def test_a_date_and_a_time_of_day_across_midnight(tmp_path):
    lines = trace_lines(
        lambda i: f"2026-01-{15 + (i > 20)},{(23 + (i > 20)) % 24:02d}:{i:02d}:00", names="x,y,date,t,side"
    )
    path = written(tmp_path, lines)
    done, _ = roles_of(path, "--time", "t")
    assert "name the date with --date" in done.stderr
    done, roles = roles_of(path, "--time", "t", "--date", "date")
    assert done.returncode == 0, done.stderr
    assert roles["time"] == "t"


def test_a_date_that_can_be_read_in_two_ways_is_asked_about(tmp_path):
    path = written(tmp_path, trace_lines(lambda i: f"03/0{4 + i // 24}/2026 09:{i % 24:02d}"))
    done, _ = roles_of(path, "--time", "t")
    assert done.returncode == 2
    assert "--date-order dmy or --date-order mdy" in done.stderr
    done, _ = roles_of(path, "--time", "t", "--date-order", "dmy")
    assert done.returncode == 0, done.stderr


def test_dates_that_need_no_question():
    """With dots the day is first; within one day the order does not matter."""
    dots = [f"0{1 + i}.11.2026 09:00" for i in range(3)]
    assert seconds_of("t", dots).tolist() == [0, 86400, 172800]
    assert seconds_of("t", [f"02/11/2026 09:{i:02d}" for i in range(3)]).tolist() == [0, 60, 120]
    assert seconds_of("t", ["05/13/2026 10:11:12:500", "05/13/2026 10:11:13:000"]).tolist() == [0, 0.5]
    assert seconds_of("t", ["09:00", "10:00"], ["02/11/2026"] * 2).tolist() == [0, 3600]
    assert seconds_of("t", ["02/13/2026 09:00", "02/13/2026 09:01"]).tolist() == [0, 60]
    with pytest.raises(FitError, match="--date-order"):
        seconds_of("t", [text.replace(".", "/") for text in dots])


def test_an_ambiguous_date_does_not_hide_the_proposal(tmp_path):
    path = written(tmp_path, trace_lines(lambda i: f"03/0{1 + i // 6}/2026"))
    told = rig("trace", path)
    assert "--response y --formula '1 + x' --direction side" in told.stdout
    assert "say --date-order dmy" in " ".join(told.stdout.split())


@pytest.mark.parametrize(
    ("text", "more", "expected"),
    [
        ('y\n"1,234.5"\n"2,345.0"\n', (), [1234.5, 2345]),
        ("y\n1'234.5\nn/a\n2'345.0\n", (), [1234.5, np.nan, 2345]),
        ("y\n1,234\n2,345\n", ("point",), [1234, 2345]),
        ("y\n1,234\n2,345\n", ("comma",), [1.234, 2.345]),
        ("1.5\n2.5\n", (), [1.5, 2.5]),
        ("y\n1,5\n2,5\n", (), "row 2: 1,5 may be one value, or 2 columns; say --decimal"),
        ('y\n"1,234"\n"2,345"\n', (), "1,234 may be 1.234 or 1234; say --decimal"),
        ("y\n1.5\n2.5\nMean 2.0\n", (), [1.5, 2.5]),
        ("y\n1.5\n2.5\nread by A. Smith, room 2\n1 of 1\n", (), "row 4: 2 values for 1 columns"),
        ("y\n1.5\n2.5\n\n1 of 1, by A. Smith\n", (), [1.5, 2.5]),
        ("y\n1.5\n2,5x\n", (), "row 3"),
    ],
)
def test_a_file_of_one_column(tmp_path, text, more, expected):
    path = written(tmp_path, text)
    asked = FileForm.of(None, *(more or (None,)), None, None)
    if isinstance(expected, str):
        with pytest.raises(UsageError, match=expected):
            read_gappy_csv(path, ("y",), asked)
        return
    np.testing.assert_array_equal(next(iter(read_gappy_csv(path, ("y",), asked).columns.values())), expected)


def test_a_footer_of_one_column_is_said(tmp_path):
    table = FileSource(written(tmp_path, "y\n1.5\n2.5\nend of data\n")).all_columns()
    assert "what follows the table from row 4 on was not read" in table.understood["sentence"]


def test_a_first_row_with_a_word_beside_numbers_is_no_second_row_of_names(tmp_path):
    """A table of books, whose column `course` has numbers in all rows but the first."""
    lines = [f"Econ,{9 + i},{10 + i}.5,{9 + i}.25" for i in range(12)]
    table = FileSource(written(tmp_path, "\n".join(["subject,course,new,used", "Am Ind,C170,27.67,27.95", *lines])))
    read = table.all_columns()
    assert (len(read), read.text["course"][0], read.columns["new"][0]) == (13, "C170", 27.67)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_curve_is_proposed_where_a_test_finds_it_and_what_it_is_for_is_said(tmp_path, degree):
    x = np.tile(np.arange(8.0), 3)
    y = 0.1 + sum(c * x**k for k, c in zip(range(1, degree + 1), (0.5, -0.02, 0.003), strict=False))
    path = written(tmp_path, a_table(load_kN=x, cell_V=y + 1e-3 * NOISE))
    done = rig("fit", path)
    powers = " + ".join(["load_kN", "load_kN^2", "load_kN^3"][:degree])
    assert f"--formula '1 + {powers}'" in done.stdout
    assert ("a straight line is not enough" in done.stdout) == (degree > 1)


def test_a_line_is_left_a_line_in_nearly_all_tables_of_noise(tmp_path):
    rng = np.random.default_rng(11)
    curved = 0
    for i in range(60):
        x = np.tile(np.arange(8.0), 3)
        text = a_table(load_kN=x, cell_V=0.1 + 0.5 * x + rng.normal(0, 1e-2, 24))
        curved += bool(look_at(FileSource(written(tmp_path, text, f"{i}.csv")), "fit", {}).seen.curve)
    assert curved <= 1


def test_a_first_look_does_not_search_for_gross_errors(tmp_path, monkeypatch):
    """It took most of the time of a look, and nothing of it was shown."""
    searched = []
    monkeypatch.setattr(LinearRows, "gross", searched.append)
    x = np.tile(np.arange(8.0), 3)
    path = written(tmp_path, a_table(load_kN=x, cell_V=0.1 + 0.5 * x + 0.01 * x**2))
    assert look_at(FileSource(path), "fit", {}).seen.curve
    assert not searched
    told = fit_general(FileSource(path).read, "cell_V", "1 + load_kN", first_look=True)["gross_errors"]
    assert told["sentence"] == "cell_V: not looked for gross errors: not asked for"


def test_a_column_for_each_sensor(tmp_path):
    x = np.tile(np.arange(8.0), 3)
    sensors = {f"prt_{i}_ohm": 100 + (0.3 + 0.1 * i) * x + NOISE * i for i in (1, 2, 3)}
    path = written(tmp_path, a_table(bath_degC=x, **sensors, room_degC=23 + NOISE))
    told = json.loads(rig("trace", path, "--json").stdout)
    roles = {each["column"]: each["role"] for each in told["columns"]}
    assert roles == {"bath_degC": "setting", **dict.fromkeys(sensors, "response"), "room_degC": "covariate"}
    assert told["responses"] == [*sensors]
    assert told["next"].endswith("--response prt_1_ohm --formula '1 + bath_degC' --ignore prt_2_ohm,prt_3_ohm")
    assert "Other outputs of this sort: prt_2_ohm, prt_3_ohm. For each, the same" in rig("fit", path).stdout


def test_an_order_that_begins_anew_in_a_trace(tmp_path):
    lines = trace_lines(lambda i: f"{1 + i % 12},{1 + i // 12}", names="x,y,order,rep,side")
    _, roles = roles_of(written(tmp_path, lines), "--replicate", "rep")
    assert roles["time"] == "order"
    assert "order" not in roles["covariates"]


SEEN = {
    "plain": "x,y\n" + rows(","),
    "named": PREAMBLE + NAMED,
    "labview": LVM,
    "directions": trace_lines(lambda i: f"2026-01-15T09:{i:02d}:30"),
    "semicolon": trace_lines(lambda i: f"2026-01-15T09:{i:02d}:30").replace(",", ";"),
    "no names": "\n".join(rows("\t").splitlines()),
    "a dash in front": "-x;y\n" + rows(";", comma),
}


@pytest.mark.parametrize("command", ["fit", "trace"])
@pytest.mark.parametrize("text", SEEN.values(), ids=SEEN)
def test_an_unknown_table_is_described_and_the_next_command_works_when_pasted(tmp_path, command, text):
    path = written(tmp_path, text, "a table.csv")
    done = rig(command, path)
    assert done.returncode == 2
    assert "Nothing was fitted" in done.stdout
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("  rig ")]
    words = shlex.split(line)
    assert words[:2] == ["rig", command]
    again = rig(*words[1:])
    assert again.returncode == 0, again.stderr
    told = json.loads(rig(command, path, "--json").stdout)
    assert told["next"] == line.strip()
    assert {each["role"] for each in told["columns"]} >= {"response", "setting"}


def test_the_likely_roles_of_a_table(tmp_path):
    path = written(
        tmp_path,
        trace_lines(lambda i: f"2026-01-15T09:{i:02d}:30").replace(
            "x,y,t,side", "Load (kN),Output (mV),Time,direction"
        ),
    )
    told = json.loads(rig("trace", path, "--json").stdout)
    roles = {each["column"]: each["role"] for each in told["columns"]}
    assert roles == {"Load (kN)": "setting", "Output (mV)": "response", "Time": "time", "direction": "direction"}
    assert {each["column"]: each["unit"] for each in told["columns"]}["Load (kN)"] == "kN"
    assert "--time Time --direction direction" in told["next"]


FORCES = "1 + `Drehmoment (Nm)`"
GERMAN = "Drehmoment (Nm);Signal A (mV/V);Signal B (V)\n" + "".join(
    f"{x};{0.01 * x + e:.5f};{0.05 * x - e:.5f}\n".replace(".", ",")
    for x, e in zip(
        np.tile([0, 50, 100, 150, 200], 4).tolist(), np.random.default_rng(3).normal(0, 2e-4, 20).tolist(), strict=True
    )
)


def test_a_second_output_in_another_unit_is_no_covariate(tmp_path):
    path = written(tmp_path, GERMAN)
    told = json.loads(rig("trace", path, "--json").stdout)
    roles = {each["column"]: each["role"] for each in told["columns"]}
    assert roles == {"Drehmoment (Nm)": "setting", "Signal A (mV/V)": "other output", "Signal B (V)": "response"}
    assert "--ignore 'Signal A (mV/V)'" in told["next"]


def test_a_response_of_several_words_is_traced_with_and_without_back_ticks(tmp_path):
    path = written(tmp_path, GERMAN)
    plain, ticked = (
        rig("trace", path, "--response", name, "--formula", FORCES, "--ignore", "Signal B (V)", "--json")
        for name in ("Signal A (mV/V)", "`Signal A (mV/V)`")
    )
    assert plain.returncode == 0, plain.stderr
    assert json.loads(plain.stdout) == json.loads(ticked.stdout)
    missing = rig("trace", path, "--response", "Signal C (mV/V)", "--formula", FORCES)
    assert "a name of several words needs back-ticks" in missing.stderr


def a_table(**columns):
    return (
        "\n".join([",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]) + "\n"
    )


NOISE = np.random.default_rng(5).normal(0, 0.01, 24)
EVEN = np.linspace(54, 59, 24)
SHAPES = {
    "row names, as R writes them": (
        a_table(rownames=range(1, 25), conc=np.repeat([0.02, 0.06, 0.11, 0.22, 0.56, 1.1], 4), rate=100 * NOISE),
        "--response rate --formula '1 + conc'", {"rownames": "row number"},
    ),
    "an index without a name": (
        a_table(**{"": range(24), "speed": np.sort(NOISE), "way": np.sort(NOISE) * 2 + NOISE**2}),
        "--response way --formula '1 + speed'", {"column_1": "row number"},
    ),
    "subjects and classes are numbered": (
        a_table(weight=100 + NOISE, Days=np.tile([0, 2, 4, 6.5], 6), Chick=np.repeat(range(1, 7), 4), Diet=[1, 2] * 12),
        "--response weight --formula '1 + Days'", {"Diet": "covariate"},
    ),
    "categories alone": (
        a_table(rownames=range(1, 25), breaks=26 + NOISE, wool=["A", "B"] * 12, tension=["L", "M", "H"] * 8),
        "--response breaks --formula '1 + C(wool) + C(tension)'", {"wool": "setting"},
    ),
    "uncertainties beside values": (
        a_table(**{"voltage[V]": EVEN, "gain[e]": EVEN**2 + NOISE, "err_gain[e]": NOISE**2}),
        "--response 'gain[e]' --formula '1 + `voltage[V]` + `voltage[V]`^2' --u-y 'err_gain[e]'",
        {"err_gain[e]": "uncertainty"},
    ),
    "sensors over a temperature T": (
        a_table(T=range(-50, 190, 10), **{"102GT": np.exp(54 - EVEN) + NOISE, "202GT": 3 * np.exp(54 - EVEN) + NOISE}),
        "--response 102GT --formula '1 + T + T^2 + T^3'", {"T": "setting", "202GT": "response"},
    ),
    "a level set, and what was measured at it": (
        a_table(V=np.repeat([0.1, 0.2, 0.4, 0.8], 6), V_in=np.repeat([0.1, 0.2, 0.4, 0.8], 6) + 1e-3 * NOISE),
        "--response V_in --formula '1 + V'", {"V": "setting"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_roles_in_tables_shaped_like_those_that_others_publish(tmp_path, shape):
    text, command, roles = SHAPES[shape]
    told = look_at(FileSource(written(tmp_path, text)), "fit", {})
    assert told.command.endswith(command)
    assert roles.items() <= {each.name: each.role for each in told.seen.columns}.items()
    assert not {"time", "group"} & told.seen.trace.keys(), "nothing shows the order of these rows"


@pytest.mark.parametrize("seed", range(200))
def test_a_table_in_any_notation_is_read_right_or_asked_about_never_otherwise(tmp_path, seed):
    """Numbers, text and gaps, written with any separator, sign, end of line, encoding, preamble, units and footer."""
    rng = np.random.default_rng(seed)
    count, columns = int(rng.integers(2, 40)), int(rng.integers(2, 6))
    separator, decimal = str(rng.choice([",", ";", "\t", "|", " "])), str(rng.choice([".", ","]))
    if separator == decimal:
        decimal = "."
    values = rng.normal(0, 10 ** rng.uniform(-2, 4), (count, columns)).round(int(rng.integers(0, 5)))
    text = rng.choice(["up", "down"], count)
    gaps = (rng.random((count, columns)) < 0.05) & (np.arange(count) > 0)[:, None]
    word = str(rng.choice(["NA", "n/a", "NaN"] if separator == " " else ["", "NA", "n/a", "NaN", "-"]))
    names = [f"c{i}" for i in range(columns)] + ["side"]
    lines = ["Logger 7", "made by hand"] * int(rng.integers(0, 2)) + [separator.join(names)]
    if rng.random() < 0.3:
        lines += [separator.join(["mV"] * columns + ["-"])]
    for row, gap, side in zip(values, gaps, text, strict=True):
        cells = [word if g else repr(float(v)).replace(".", decimal) for v, g in zip(row, gap, strict=True)]
        lines.append(separator.join([*cells, str(side)]))
    lines += ["", "END"] if rng.random() < 0.2 else []
    ends = str(rng.choice(["\n", "\r\n", "\r"]))
    path = written(
        tmp_path, (ends.join(lines) + ends).encode(str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "cp1252"])))
    )
    needed = [f"c{i}" for i in range(columns)]
    kept = ~gaps.any(axis=1)
    try:
        table = read_any_csv(path, [*needed, "side"])
    except UsageError as asked:
        assert "--" in str(asked) or not kept.any(), asked
        return
    np.testing.assert_array_equal(np.column_stack([table.columns[name] for name in needed]), values[kept])
    assert table.text["side"].tolist() == text[kept].tolist()


FIVE = "run,x,y,who\n1,1,2.1,a\n2,2,4.0,a\n3,3,6.2,b\n4,4,8.1,b\n5,5,10.0,b\n"
FOOTERS = {
    "Mean,3,6.08,\n": {7: "Mean"},
    "Mean,3,6.08,\nStd. dev.,1.58,3.13,\n": {7: "Mean", 8: "Std. dev."},
    ",,,\nAverage (n=5),3,6.1,\n": {8: "Average (n=5)"},
    "Mittelwert:,,6.08,\nStandardabweichung,,3.13,\n": {7: "Mittelwert:", 8: "Standardabweichung"},
    ",15,30.4,Total\n": {7: "Total"},
    ",,6.08,\n": {7: "a mean without a name"},
    ",15,30.4,\n": {7: "a sum without a name"},
    "Calibrated by,J. Smith,,\nDate,2024-01-05,,\n": {7: "Calibrated by", 8: "Date"},
    "\nSlope,1.99,,\nIntercept,0.11,,\nR2,0.9998,,\n": {8: "Slope", 9: "Intercept", 10: "R2"},
    "Total,15,30.4,\n,,,\nSigned:,____,,\n": {7: "Total", 9: "Signed:"},
    "6,6,Total,a\n": None,  # an observation, without a value
}


@pytest.mark.parametrize("footer", FOOTERS)
@pytest.mark.parametrize("german", [False, True])
def test_rows_under_a_table_that_are_no_observations_are_left_out_and_named(tmp_path, footer, german):
    text = FIVE + footer
    if german:
        text = text.replace(",", ";").replace(".", ",").replace("Std, dev,", "Std. dev.").replace("J, S", "J. S")
    path = written(tmp_path, text)
    if FOOTERS[footer] is None:
        assert read_any_csv(path, ("x", "y")).text["y"].tolist()[-1] == "Total"
        return
    table = read_any_csv(path, ("x", "y"))
    assert table.columns["x"].tolist() == [1, 2, 3, 4, 5]
    assert table.understood["rows_of_summaries"] == FOOTERS[footer]
    for row, cell in FOOTERS[footer].items():
        assert f"row {row} ({cell})" in table.understood["sentence"]


@pytest.mark.parametrize(("footer", "kept"), [("3,6.08", 5), ("15,30.4", 5), ("6,11.9", 6), ("3,6.1\n1.58,3.15", 5)])
def test_numbers_alone_after_a_blank_line(tmp_path, footer, kept):
    """Means, sums and deviations are no observations; a point is one."""
    rows = "x,y\n1,2.1\n2,4.0\n3,6.2\n4,8.1\n5,10.0\n"
    table = read_any_csv(written(tmp_path, rows + "\n" + footer + "\n"), ("x", "y"))
    assert len(table) == kept
    assert bool(table.understood) == (kept == 5)
    assert len(read_any_csv(written(tmp_path, rows + footer.partition("\n")[0] + "\n"), ("x", "y"))) == 6


def test_rows_of_another_number_of_cells_under_a_table(tmp_path):
    table = read_any_csv(written(tmp_path, FIVE + "\nSlope,1.99\nIntercept,0.11\n"), ("x", "y"))
    assert table.columns["x"].tolist() == [1, 2, 3, 4, 5]
    assert "what follows the table from row 8 on was not read" in table.understood["sentence"]


@pytest.mark.parametrize("separator", [",", ";"])
def test_names_that_are_written_again(tmp_path, separator):
    """Loggers that are started again append to their file."""
    text = "x,y\n1,2.5\n2,3.5\nx,y\n3,4.5\n".replace(",", separator)
    table = read_any_csv(written(tmp_path, text), ("x", "y"))
    assert table.columns["x"].tolist() == [1, 2, 3]
    assert "row 4 (the names again) left out" in table.understood["sentence"]
    twice = read_any_csv(written(tmp_path, f"x{separator}y\n" + text), ("x", "y"))
    assert twice.columns["y"].tolist() == [2.5, 3.5, 4.5]


@pytest.mark.parametrize("word", ["9.90000000E+37", "-9.9e37", "+9.91000000E+37"])
@pytest.mark.parametrize("note", ["", ",a"])
def test_the_overload_of_a_meter_is_no_reading(tmp_path, word, note):
    """SCPI-99: 9.9E37 for a reading beyond the range, 9.91E37 for none. It was fitted as a number."""
    path = written(tmp_path, f"x,y{note}\n1,2.5{note}\n2,3.5{note}\n3,{word}{note}\n4,5.5{note}\n")
    table = read_any_csv(path, ("x", "y"))
    assert table.columns["y"].tolist() == [2.5, 3.5, 5.5]
    assert "1 cell with 9.9E37, the overload of a meter: no value" in table.understood["sentence"]
    assert "1 row left out without a value in y (row 4)" in table.understood["sentence"]
    assert np.isnan(read_gappy_csv(path, ("y",)).columns["y"][2])
    with pytest.raises(UsageError, match="row 4"):
        read_table(path)


def test_a_column_without_a_name_has_the_same_name_everywhere(tmp_path):
    path = written(tmp_path, ",x,y\n0,1,2.5\n1,2,3.5\n2,3,4.75\n")
    table = read_any_csv(path, ("x", "y"))
    assert "column_1" in table.columns
    assert "without a name: column_1" in table.understood["sentence"]
    assert read_any_csv(path, ("column_1",)).columns["column_1"].tolist() == [0, 1, 2]


def test_averages_within_a_table(tmp_path):
    """Of each group: left out. A level of a category that has such a name: kept."""
    groups = "g,x,y\na,1,2.1\na,2,4.0\na,3,6.2\nMean,2,4.1\nb,4,8.1\nb,5,10.0\nb,6,12\nMean,5,10.03\n"
    table = read_any_csv(written(tmp_path, groups), ("x", "y"))
    assert table.columns["x"].tolist() == [1, 2, 3, 4, 5, 6]
    assert "row 5 (Mean), row 9 (Mean) left out" in table.understood["sentence"]
    head = "head,x,y\nStatic,1,2.1\nDynamic,2,4.0\nTotal,3,6.2\nStatic,4,8.1\nDynamic,5,10.0\nTotal,6,11.9\n"
    assert len(read_any_csv(written(tmp_path, head), ("x", "y", "head"))) == 6
    stops = "stop,x,y\nMin,0,0.1\nHalf,5,5.2\nMax,10,9.9\n"
    assert len(read_any_csv(written(tmp_path, stops), ("x", "y", "stop"))) == 3


def test_a_row_that_is_called_an_average_and_is_none_is_asked_about(tmp_path):
    path = written(tmp_path, "id,x,y\na,1,2.1\nb,2,4.0\nc,3,6.2\nd,4,8.1\nMean,3.3,7.08\n")
    done = rig("fit", path, "--response", "y", "--formula", "1 + x")
    assert done.returncode == 2
    assert "row 6: it is called 'Mean', and its numbers are no such summary of the rows above" in done.stderr


def test_a_footer_at_the_other_doors(tmp_path):
    """A fit, a trace, inferred values, a description, and a table of attitude sensors."""
    path = written(tmp_path, FIVE + "Mean,3,6.08,\n")
    for door in ("fit", "trace"):
        done = rig(door, path, "--response", "y", "--formula", "1 + x", "--json")
        assert json.loads(done.stdout)["data"]["understood"]["rows_of_summaries"] == {"7": "Mean"}
        assert "row 7 (Mean) left out" in done.stderr
    done = rig("fit", written(tmp_path, FIVE + "6,6,Total,a\n"), "--response", "y", "--formula", "1 + x")
    assert done.returncode == 2
    assert "y is 'Total' in row 7, which is not a number" in done.stderr
    line = written(tmp_path, "run,x,y\n" + "".join(f"{i},{i},{2 * i + 0.01 * (i % 3)}\n" for i in range(1, 9)), "c.csv")
    out = tmp_path / "c.json"
    assert rig("fit", line, "--response", "y", "--formula", "1 + x", "--out", out).returncode == 0
    readings = written(tmp_path, "no,y\n1,2.5\n2,3.5\n3,4.5\nMean,3.5\n", "readings.csv")
    done = rig("infer", out, readings, "--out", tmp_path / "inferred.csv", "--json")
    assert done.returncode == 0, done.stderr
    assert "row 5 (Mean) left out" in json.dumps(json.loads(done.stdout)["understood"])
    assert len((tmp_path / "inferred.csv").read_text().splitlines()) == 4
    seen = rig("fit", readings, "--json")
    assert json.loads(seen.stdout)["data"]["understood"]["rows_of_summaries"] == {"5": "Mean"}
    head = "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V\n"
    body = "".join(
        f"{1 + i // 4},{i + 1},{30 * i},{(-30, -10, 10, 30)[i % 4]},{90 * (i % 3)},23.1,{0.1 * i:.2f}\n"
        for i in range(8)
    )
    table = read_table(written(tmp_path, head + body + "Mean,,,,,,0.35\n", "attitude.csv"))
    assert len(table) == 8
    assert "row 10 (Mean) left out" in table.understood["sentence"]


def test_an_empty_row_of_a_spreadsheet_is_no_row(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text("My lab,,\n,,\nflow_Lpm,f_Hz,remark\n5,50,a\n10,100,b\n,,\n15,151,c\n20,200,d\n,,\n")
    said = rig("fit", path)
    assert said.returncode == 2, "nothing was fitted: it says what it sees"
    assert "--response f_Hz --formula '1 + flow_Lpm'" in said.stdout


def test_words_in_every_row_are_looked_at_once(tmp_path, monkeypatch):
    """A table with a column of words took 200 s for 20,000 rows: each was judged anew for 50 rows and columns."""
    rows, looked = 300, []
    path = tmp_path / "oats.csv"
    path.write_text("block,variety,yield\n" + "".join(f"b{i % 6},v{i % 3},{i}.5\n" for i in range(rows)))
    monkeypatch.setattr(footers, "is_value", lambda cell: looked.append(cell) or is_value(cell))
    assert len(read_any_csv(path, ("yield",))) == rows
    assert len(looked) <= 2 * 3 * rows


def test_numbers_of_rows_are_asked_of_each_line_a_few_times(tmp_path, monkeypatch):
    """A foreign table of numbers was read in the square of its rows: their numbers were listed anew for each cell."""
    rows, asked = 300, []
    path = tmp_path / "load.csv"
    path.write_text("load;output\n" + "".join(f"{i % 6},5;{i},25\n" for i in range(rows)))
    plain = Line.__getattribute__
    monkeypatch.setattr(Line, "__getattribute__", lambda line, name: asked.append(name) or plain(line, name))
    assert len(read_any_csv(path, ("output",))) == rows
    assert asked.count("row") <= 10 * rows


def test_a_file_of_nist_as_it_is_published():
    """Norris.dat of NIST StRD, which SciPy's own tests bring: preamble, certified values, and data in one file."""
    path = Path(scipy.stats.__file__).parent / "tests" / "data" / "nist_linregress" / "Norris.dat"
    if not path.is_file():
        pytest.skip("this SciPy has no tests")
    certified = dict(re.findall(r"^ +(B0|B1|Standard Deviation) +(\S+)", path.read_text(), re.MULTILINE))
    told = look_at(FileSource(path), "fit", {})
    assert told.command.endswith("--response y --formula '1 + x'")
    assert len(told.table) == 36
    found = fit_general(FileSource(path).read, "y", "1 + x")
    assert found["coefficients"]["1"]["estimate"] == pytest.approx(float(certified["B0"]), rel=1e-11)
    assert found["coefficients"]["x"]["estimate"] == pytest.approx(float(certified["B1"]), rel=1e-13)
    assert found["sigma_E"] == pytest.approx(float(certified["Standard Deviation"]), rel=1e-11)


@pytest.mark.parametrize("cells", [("12.5 g", "14.1 g", "16.2 g"), ("12.5(1)", "14.1(1)", "16.2(1)")])
def test_a_response_with_its_unit_or_uncertainty_in_each_cell_is_one_of_numbers(tmp_path, cells):
    path = tmp_path / "t.csv"
    path.write_text("x,y\n" + "".join(f"{k},{cell}\n" for k, cell in enumerate(cells)))
    assert read_any_csv(path, ["x", "y"]).columns["y"].tolist() == [12.5, 14.1, 16.2]


@pytest.mark.parametrize("cell", ["<{}", "{}*", "({})", "~{}", "warm-up"])
@pytest.mark.parametrize("many", [1, 3])
def test_strange_cells_in_the_first_rows_take_no_names_away(tmp_path, cell, many):
    path = tmp_path / "t.csv"
    cells = [cell.format(f"{2.5 + k:.2f}") if k < many else f"{2.5 + k:.2f}" for k in range(12)]
    path.write_text("x,y\n" + "".join(f"{k},{one}\n" for k, one in enumerate(cells)))
    seen = look_at(FileSource(path), "fit", {}).seen
    assert [one.name for one in seen.columns] == ["x", "y"]
    assert f"y is {cells[0]!r} in row 2, which is not a number" in seen.why_not
