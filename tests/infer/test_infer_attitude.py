"""`rig fit` keeps a calibration of a package, and `rig infer` turns outputs into angles with it."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from command import rig
from dry import SHORT, dry

from rig.tables import write_csv
from rig.tables.table_of_run import run_table


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return dry(tmp_path_factory.mktemp("attitude"))


def rows_of(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture(scope="module")
def calibration(run):
    path = run.with_name("package.json")
    done = rig("fit", run, "--out", path)
    assert done.returncode == 0, done.stderr
    return path


def test_angles_of_the_run_itself_come_back_with_intervals(tmp_path, run, calibration):
    table, data, out = run_table(run), tmp_path / "outputs.csv", tmp_path / "angles.csv"
    write_csv({name: table.columns[name] for name in ("x_V", "y_V", "z_V")}, data)
    done = rig("infer", calibration, data, "--out", out)
    assert done.returncode == 0, done.stderr
    rows = rows_of(out)
    pitch, roll = table.columns["pitch_deg"], table.columns["roll_deg"]
    upright = np.abs(pitch) < 80
    for name, truth in (("pitch_deg", pitch), ("roll_deg", roll)):
        found = np.array([float(r[name]) if r[name] else np.nan for r in rows])
        assert np.abs(found - truth)[upright].max() < 0.005
        low, high = (np.array([float(r[f"{name}_{side}"] or "nan") for r in rows]) for side in ("lo95", "hi95"))
        inside = (low <= truth) & (truth <= high)
        assert inside[upright].mean() > 0.8
    open_roll = [r for r, a in zip(rows, pitch, strict=True) if abs(a) == 90]
    assert all(r["roll_deg"] == "" and "roll is undetermined" in r["flag"] for r in open_roll)
    assert all(r["pitch_deg"] != "" for r in open_roll), "pitch is not"


def test_the_declared_model_is_the_procedures_unless_told_otherwise(tmp_path):
    run = dry(tmp_path, text=f"{SHORT}\n[model]\ntemperature = true\n")
    kept = tmp_path / "package.json"
    assert "dS/dT / (ppm/degC)" in rig("fit", run, "--out", kept).stdout
    sensor = json.loads(kept.read_text())["sensors"]["x_V"]
    assert sensor["model"] == "attitude-x with temperature"
    hidden = 45.0  # examples/attitude-lab/world.toml
    low, high = sensor["parameters"]["dSdT_ppm_per_degC"]["interval95"]
    # twice the interval: the night's temperature moves by 0.01 degC, and one draw in twenty lies outside 95 %
    assert abs((low + high) / 2 - hidden) < high - low
    assert {t["effect"] for t in json.loads(kept.read_text())["calibration"]["sensors"][0]["terms"]} == {
        "offset-temperature",
        "sensitivity-temperature",
    }
    without = json.loads(rig("fit", run, "--no-temperature", "--json").stdout)["sensors"]["x_V"]
    assert without["model"] == "attitude-x"
    assert without["reference_degC"] is None
    traced = json.loads(rig("trace", run, "--json").stdout)["sensors"]["x_V"]
    assert traced["declared"] == "attitude-x with temperature"


def test_two_of_three_sensors_have_two_attitudes_and_say_on_which_side_they_are(tmp_path, run, calibration):
    table, data, out = run_table(run), tmp_path / "outputs.csv", tmp_path / "angles.csv"
    pitch, roll = table.columns["pitch_deg"], table.columns["roll_deg"]
    write_csv({name: table.columns[name] for name in ("x_V", "y_V")}, data)
    missing = rig("infer", calibration, data, "--out", out)
    assert missing.returncode == 2
    assert "no column 'z_V'" in missing.stderr
    assert "--sensors" in missing.stderr
    for near, side in (((), "level"), (("--near", 0, 180), "pitch 0, roll 180 deg")):
        done = rig("infer", calibration, data, "--sensors", "x_V,y_V", "--out", out, *near)
        assert done.returncode == 0, done.stderr
        assert f"on the side of {side}" in done.stderr
        rows = rows_of(out)
        assert {r["assumed"] for r in rows} == {"1"}
        turned = 180.0 if near else 0.0
        there = (np.abs(pitch) < 60) & (np.cos(np.radians(roll - turned)) > 0.2)
        found = np.array([[float(r["pitch_deg"] or "nan"), float(r["roll_deg"] or "nan")] for r in rows])[there]
        truth = np.column_stack([pitch, roll])[there]
        assert np.abs((found - truth + 180) % 360 - 180).max() < 0.01
    none = rig("infer", calibration, data, "--sensors", "x_V,q_V", "--out", out)
    assert "has no sensor q_V, only x_V, y_V, z_V" in none.stderr


def test_a_run_file_is_no_calibration_yet(tmp_path, run):
    done = rig("infer", run, run, "--out", tmp_path / "angles.csv")
    assert done.returncode == 2
    assert "make a calibration from it first: rig fit" in done.stderr


def test_nothing_of_the_input_is_overwritten(tmp_path, run, calibration):
    data, out = tmp_path / "run.csv", tmp_path / "angles.csv"
    assert rig("export", run, "--out", data).returncode == 0
    assert rig("infer", calibration, data, "--out", out).returncode == 0
    before, after = rows_of(data)[0], rows_of(out)[0]
    assert all(after[name] == value for name, value in before.items())
    assert "inferred_pitch_deg" in after


def test_a_calibration_with_temperature_needs_it_in_use(tmp_path, run):
    package, data = tmp_path / "package.json", tmp_path / "outputs.csv"
    assert rig("fit", run, "--temperature", "--out", package).returncode == 0
    table = run_table(run)
    write_csv({name: table.columns[name] for name in ("x_V", "y_V", "z_V")}, data)
    done = rig("infer", package, data, "--out", tmp_path / "angles.csv")
    assert done.returncode == 2
    assert "sensor_temperature_degC" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [(("--zero", "x.csv"), "--zero is for pressure"), (("--roll", "nothing"), "there is no column 'nothing'")],
)
def test_options_that_do_not_go_with_a_package_are_refused(tmp_path, run, calibration, options, message):
    data = tmp_path / "run.csv"
    assert rig("export", run, "--out", data).returncode == 0
    done = rig("infer", calibration, data, *options, "--out", tmp_path / "angles.csv")
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "angles.csv").exists()


def test_the_file_says_what_kind_it_is(calibration):
    found = json.loads(calibration.read_text())
    assert found["data"]["kind"] == "pitch-roll"
    assert [s["name"] for s in found["calibration"]["sensors"]] == ["x_V", "y_V", "z_V"]


def test_a_blank_output_empties_its_row_and_no_other(tmp_path, run, calibration):
    columns = run_table(run).columns
    rows = [i for i in range(len(columns["x_V"])) if abs(columns["pitch_deg"][i]) < 60][:3]
    lines = [[repr(float(columns[name][i])) for name in ("x_V", "y_V", "z_V")] for i in rows]
    lines[1][2] = ""
    data, out = tmp_path / "outputs.csv", tmp_path / "angles.csv"
    data.write_text("x_V,y_V,z_V,note\n" + "".join(f"{','.join(line)},{i or ''}\n" for i, line in enumerate(lines)))
    done = rig("infer", calibration, data, "--out", out, "--json")
    assert done.returncode == 0, done.stderr
    found = rows_of(out)
    assert [row["flag"] for row in found] == ["", "no value of z_V", ""]
    assert [row["assumed"] for row in found if "assumed" in row] in ([], ["0", "0", "0"])
    assert found[1]["pitch_deg"] == found[1]["pitch_deg_lo95"] == found[1]["roll_deg"] == ""
    truth = columns["pitch_deg"][rows]
    assert [float(found[i]["pitch_deg"]) for i in (0, 2)] == pytest.approx([truth[0], truth[2]], abs=0.005)
    unused = json.loads(done.stdout)["unused"]
    assert unused["columns"] == [{"column": "note", "why": "plays no part"}]
    assert [row["row"] for row in unused["rows"]] == [3]


def test_an_output_in_another_unit_is_told_from_one_that_is_missing(tmp_path, calibration):
    data = tmp_path / "outputs.csv"
    data.write_text("x_mV,y_V,z_V\n100,0.1,0.9\n")
    done = rig("infer", calibration, data, "--out", tmp_path / "angles.csv")
    assert done.returncode == 2
    said = " ".join(done.stderr.split())
    assert "there is no column 'x_V'" in said
    assert "x_mV: calibrated as x_V: rename it, and convert its values" in said
