"""Gross errors: published tables, planted errors, clean tables, and what `rig fit` says of them."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import robust_examples
from command import rig

from proving.truth import attitude as attitude_truth
from proving.truth import whole_plot as whole_plot_truth
from rig.fitter.formula import Formula
from rig.fitter.gross import gross_errors
from rig.fitter.gross.rows import Rows
from rig.fitter.sums_of_squares import own_parameters
from rig.fitter.trace.growing_noise import noise_of
from rig.procedures.attitude.gross import of_attitude
from rig.procedures.general.column_roles import Roles, read_roles
from rig.procedures.general.gross import of_table
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.gross import of_whole_plots
from rig.tables import FileSource, write_csv

FULL = named_formula("full", ())


def with_constant(columns):
    return np.column_stack([np.ones(len(columns)), columns])


def named(found):
    return sorted((found.rows + 1).tolist())


def test_hawkins_bradu_kass_ten_rows_that_hide_one_another():
    table = robust_examples.HAWKINS
    found = gross_errors(table[:, 3], with_constant(table[:, :3]))
    assert named(found) == list(range(1, 11))
    # least squares of rows 11 to 75, by R's lm: sigma 0.557
    assert found.sd[0] == pytest.approx(0.557, abs=0.001)


def test_calls_from_belgium_recorded_in_another_way_at_five_percent():
    years = np.arange(50.0, 74.0)
    found = gross_errors(robust_examples.CALLS, with_constant(years[:, None]), level=0.05)
    assert [1949 + row for row in named(found)] == list(range(1963, 1971))


def test_stack_loss_at_five_percent():
    table = robust_examples.STACK_LOSS
    found = gross_errors(table[:, 3], with_constant(table[:, :3]), level=0.05)
    assert named(found) == [1, 3, 4, 21]


def test_clean_tables_have_none():
    """Of 40 tables 0.4 are expected to have a row named at most; three or more come with a probability of 1 %."""
    alarms = 0
    for seed in range(40):
        n, k = ((12, 2), (21, 4))[seed % 2]
        rng = np.random.default_rng([n, seed])
        columns = with_constant(rng.standard_normal((n, k - 1)))
        alarms += bool(gross_errors(rng.standard_normal(n), columns).rows.size)
    assert alarms < 3


@pytest.mark.parametrize(
    "bench",
    [
        whole_plot_truth.Bench(),
        whole_plot_truth.Bench(
            (whole_plot_truth.Transducer(cubic=whole_plot_truth.CUBIC),), subplot=whole_plot_truth.GROWING
        ),
        whole_plot_truth.Bench(apart_mV=0.3),
    ],
    ids=["clean", "undeclared cubic and noise that grows", "one whole plot apart"],
)
def test_effects_and_whole_plots_are_no_gross_errors(bench):
    for seed in range(4):
        data = whole_plot_truth.simulate(bench, seed=seed)
        for found in of_whole_plots(data, FULL).values():
            assert not found.rows.size
            assert not found.not_looked


def test_several_in_one_whole_plot_and_one_of_the_smallest_pressures():
    data = whole_plot_truth.simulate(seed=3)
    name, y = next(iter(data.outputs.items()))
    lowest = int(np.flatnonzero(data.pressure_psia < 0.02)[4])
    planted = [44, 45, 46, lowest]
    off = y.copy()
    off[planted] += np.array([0.08, -0.1, 0.09, 0.06])
    found = of_whole_plots(replace(data, outputs={name: off}), FULL)[name]
    assert sorted(found.rows.tolist()) == sorted(planted)
    by_row = dict(zip(found.rows.tolist(), found.off.tolist(), strict=True))
    assert by_row[45] == pytest.approx(-0.1, abs=0.025)


def test_a_pressure_written_ten_times_too_large():
    data = whole_plot_truth.simulate(seed=5)
    row = int(np.flatnonzero(data.pressure_psia > 4.5)[0])
    pressure = data.pressure_psia.copy()
    pressure[row] *= 10.0
    for found in of_whole_plots(replace(data, pressure_psia=pressure, pressure_set_psia=None), FULL).values():
        assert found.rows.tolist() == [row]


def attitude(seed, **bench):
    """Six replications of 9 x 9 points, with pads that nobody declared unless told otherwise."""
    given = {"compliance": {("y", "x"): 4e-3}} | bench
    return attitude_truth.simulate(attitude_truth.Bench(**given), attitude_truth.D1(180, 9, 9), seed)[0]


def test_a_pad_is_no_gross_error_and_two_bad_readings_are():
    data = attitude(1, offset_sd=2.0)
    assert not any(found.rows.size for found in of_attitude(data).values())
    name, y = next(iter(data.outputs.items()))
    off = y.copy()
    sd = np.radians(1.5e-4) * 5.0
    off[[17, 300]] += np.array([12.0, -9.0]) * sd
    found = of_attitude(replace(data, outputs={**data.outputs, name: off}))
    assert sorted(found[name].rows.tolist()) == [17, 300]
    assert not any(other.rows.size for sensor, other in found.items() if sensor != name)


def test_responses_that_share_their_rows_have_the_errors_of_each_alone():
    data = attitude(7)
    columns = own_parameters(data.rows.columns, data.replicate_index)
    n = len(data)
    shared = Rows(data.rows.columns, np.zeros(n), np.ones(n), data.point, data.replicate_index)
    for output in data.outputs.values():
        y = output.copy()
        y[31] += 30.0 * np.radians(1.5e-4) * 5.0
        alone = gross_errors(y, columns, group=data.point, designed=True)
        together = gross_errors(y, shared.columns, group=data.point, designed=True, rows=shared)
        assert together.rows.tolist() == alone.rows.tolist() == [31]
        assert together.distance_sd == pytest.approx(alone.distance_sd, rel=1e-10)
        assert together.off == pytest.approx(alone.off, rel=1e-10)
        assert together.sd == pytest.approx(alone.sd, rel=1e-10)


def test_noise_of_angles_that_grows_with_the_slope_is_no_gross_error():
    data = attitude(0, sigma_deg=2e-5, jitter_deg=1e-3)
    found = of_attitude(data)
    assert not any(one.rows.size for one in found.values())
    assert all(one.sd.max() > 5.0 * one.sd.min() for one in found.values())


def test_a_table_with_noise_that_grows_keeps_its_rows():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        x = rng.uniform(0.0, 10.0, 120)
        y = 1.0 + 2.0 * x + (0.05 + x) * rng.standard_normal(120)
        _, columns = Formula.parse("1 + x").columns({"x": x})
        assert not of_table(y, columns).rows.size


def test_rows_that_decide_a_coefficient_alone_are_said():
    x = np.array([0.0] * 9 + [1.0])
    y = np.r_[np.random.default_rng(1).standard_normal(9), 50.0]
    found = gross_errors(y, with_constant(x[:, None]))
    assert found.alone.tolist() == [9]
    assert not found.rows.size


# what `rig fit` says


@pytest.fixture(scope="module")
def ten_times(tmp_path_factory):
    """The trial: one reading of a whole-plot calibration ten times too large."""
    data = whole_plot_truth.simulate(seed=7)
    folder = tmp_path_factory.mktemp("gross")
    row = int(np.flatnonzero(data.pressure_psia > 2.4)[2])
    bridge = next(iter(data.outputs.values())).copy()
    columns = {
        "whole_plot": data.whole_plot,
        "order": data.order,
        "elapsed_s": data.elapsed_s,
        "pressure_psia": data.pressure_psia,
        "sensor_temperature_degC": data.sensor_temperature_degC,
        "sse_temperature_degC": data.sse_temperature_degC,
        "bridge_mV": bridge,
    }
    write_csv(columns, folder / "clean.csv")
    bridge[row] *= 10.0
    write_csv(columns, folder / "table.csv")
    return folder, row + 2


def fitted(*arguments):
    done = rig("fit", *arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_reading_ten_times_too_large_is_said(ten_times):
    folder, row = ten_times
    result = fitted(folder / "table.csv")
    sensor = result["sensors"]["bridge_mV"]
    gross = sensor["gross_errors"]
    assert gross["rows"] == [row]
    assert gross["distance_sd"][0] > 100
    assert gross["kept"] is True
    assert gross["with"]["sigma_subplot"] == sensor["sigma_subplot"] > 0.2
    assert gross["without"]["sigma_subplot"] < 0.01
    assert max(abs(moved) for moved in gross["moved_stderr"].values()) > 3
    assert sensor["calibration"]["gross_errors"] == {"rows": [row], "kept": True}
    assert f"gross errors IN this calibration: row {row}" in gross["sentence"]
    shown = rig("fit", folder / "table.csv")
    assert f"row {row} (order" in shown.stdout


def test_leaving_it_out_is_the_fit_of_a_table_without_it(ten_times):
    folder, row = ten_times
    out = folder / "calibration.json"
    result = fitted(folder / "table.csv", "--leave-out", "gross", "--out", out)
    with (folder / "table.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    shorter = folder / "shorter.csv"
    shorter.write_text("\n".join(",".join(cells) for i, cells in enumerate(rows, 1) if i != row) + "\n")
    other = fitted(shorter)
    assert result["sensors"]["bridge_mV"]["coefficients"] == other["sensors"]["bridge_mV"]["coefficients"]
    kept = json.loads(out.read_text())["sensors"]["bridge_mV"]["calibration"]
    assert kept["gross_errors"] == {"rows": [row], "kept": False}
    assert kept["rows_left_out"] == [row] == result["data"]["rows_left_out"]
    assert fitted(folder / "table.csv", "--leave-out", str(row))["data"]["rows_left_out"] == [row]


def test_a_clean_calibration_says_so(ten_times):
    gross = fitted(ten_times[0] / "clean.csv")["sensors"]["bridge_mV"]["gross_errors"]
    assert gross["rows"] == []
    assert gross["kept"] is None
    assert gross["sentence"] == "bridge_mV: no gross errors found"


def test_rows_that_are_not_there_are_refused(ten_times):
    for asked, said in (("500", "has observations in rows 2 to 221"), ("some", "say gross, or row numbers")):
        done = rig("fit", ten_times[0] / "table.csv", "--leave-out", asked)
        assert done.returncode == 2
        assert said in done.stderr


def test_any_table_and_a_table_of_whole_plots(tmp_path):
    rng = np.random.default_rng(4)
    x = np.tile(np.arange(6.0), 8)
    batch = np.repeat(np.arange(8.0), 6)
    y = 1.0 + 2.0 * x + np.repeat(rng.standard_normal(8), 6) + 0.1 * rng.standard_normal(48)
    y[[20, 33]] += 5.0
    write_csv({"x": x, "batch": batch, "y": y}, tmp_path / "t.csv")
    for more in ((), ("--whole-plot", "batch")):
        options = ("--response", "y", "--formula", "1 + x", *more)
        found = fitted(tmp_path / "t.csv", *options)
        if more:
            assert sorted(found["gross_errors"]["rows"]) == [22, 35]
        without = fitted(tmp_path / "t.csv", *options, "--leave-out", "22,35")
        assert without["data"]["points"] == 46
        assert without["data"]["rows_left_out"] == without["calibration"]["rows_left_out"] == [22, 35]
    assert without["sigma_subplot"] == pytest.approx(0.1, rel=0.25)


@pytest.mark.parametrize("more", ["", ",a"], ids=["numbers alone", "and a column of text"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_rows_are_those_of_the_file_where_lines_are_blank(tmp_path, more, end):
    rng = np.random.default_rng(31)
    y = [1 + 2 * x + rng.normal(0, 0.002) for x in range(14)]
    y[8] += 5.0
    rows = [f"{x},{value:.5f}{more}" for x, value in enumerate(y)]
    path = tmp_path / "table.csv"
    path.write_bytes(end.join([f"x,y{more and ',batch'}", *rows[:3], "", "", *rows[3:], "", ""]).encode())
    fit = ("fit", path, "--response", "y", "--formula", "1 + x", "--json")
    line = 1 + path.read_text().splitlines().index(rows[8])
    assert json.loads(rig(*fit).stdout)["gross_errors"]["rows"] == [line] == [12]
    without = json.loads(rig(*fit, "--leave-out", line).stdout)
    assert without["gross_errors"]["rows"] == []
    assert without["data"]["rows_left_out"] == without["calibration"]["rows_left_out"] == [line]
    assert read_roles(FileSource(path).read, Roles("y", "1 + x"))[1].numbers.tolist()[8] == line
    refused = rig(*fit, "--leave-out", "5")
    assert (refused.returncode, "rows 2 to 17, but for blank lines" in refused.stderr) == (2, True)


@pytest.mark.parametrize(
    "number", ["9223372036854775808", "99999999999999999999", "9" * 5000, "0", "16", "-1", "999999999999999999"]
)
def test_a_row_number_that_no_file_has_is_refused_in_one_line(tmp_path, number):
    path = tmp_path / "table.csv"
    path.write_text("x,y\n" + "".join(f"{x},{2 * x + (-1) ** x / 1000}\n" for x in range(14)))
    done = rig("fit", path, "--response", "y", "--formula", "1 + x", f"--leave-out={number}")
    assert done.returncode == 2
    assert done.stderr.startswith(f"rig: --leave-out {number[:40]}: ")
    assert len(done.stderr.splitlines()) == 1


def test_growth_of_noise_that_rows_cannot_tell_has_no_error():
    """The one row with another value of the driver is gone through by the fit: nothing is left of it."""
    driver = np.array([1.0, *[0.0] * 29])
    left = 1.0 - driver
    residual = 0.1 * np.random.default_rng(0).standard_normal(30) * left
    found = noise_of(residual, left, driver)
    assert np.isnan(found.stderr).all()
    assert found.at_zero == pytest.approx(0.083, abs=0.001)


@pytest.mark.parametrize("size", [7.0, 100.0, 1e4, 1e6, 1e9])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.2])
def test_bad_rows_of_any_size_are_named_and_no_good_ones_in_their_place(size, share):
    """Ten settings, six repeats: a bad row of 1e4 sd stood alone for its setting, and its good repeats were named."""
    missed = wrong = bad = 0
    for seed in range(6):
        rng = np.random.default_rng([seed, int(1000 * share), int(size)])
        x = np.repeat(np.arange(10.0), 6)
        columns = np.column_stack([np.ones(60), x])
        y = columns @ [1.0, 2.0] + rng.normal(0.0, 1e-3, 60)
        rows = rng.choice(60, max(1, int(share * 60)), replace=False)
        y[rows] += 1e-3 * size * rng.choice([-1, 1], rows.size) * rng.uniform(1.0, 2.0, rows.size)
        named = set(of_table(y, columns).rows.tolist())
        missed, wrong = missed + len(set(rows.tolist()) - named), wrong + len(named - set(rows.tolist()))
        bad += rows.size
    assert wrong <= 1, f"{wrong} good rows named of 360, beside {bad} bad ones"
    assert missed <= (0.1 * bad if size < 10.0 else 0), f"{missed} of {bad} bad rows not named"


def test_one_bad_row_is_told_from_its_good_repeats_and_leaving_it_out_gives_the_slope():
    """Reported: five settings, six repeats, noise 0.1 mV, row 15 ten times too large; slope 4.0 for 1."""
    for seed in range(5):
        x = np.repeat([1.0, 2.0, 3.0, 4.0, 5.0], 6)
        y = x + np.random.default_rng(seed).normal(0.0, 1e-4, 30)
        y[14] *= 10.0
        found = of_table(y, np.column_stack([np.ones(30), x]))
        assert found.rows.tolist() == [14], f"seed {seed}"
        assert found.off[0] == pytest.approx(27.0, abs=5e-3), f"seed {seed}"  # 5 sd of the noise, ten times as large
