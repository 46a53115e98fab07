"""Total uncertainty in use: `rig infer` with a calibration that keeps influences has those of the model's budget."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from command import rig

from rig.errors import UsageError
from rig.procedures.evaluate.points import points
from rig.verbs.budget.evaluation import budget_of, run_with_register
from rig.verbs.infer import csv_reader, infer, read_calibration

ROOT = Path(__file__).parents[2]
DATA, EXAMPLES = ROOT / "tests" / "data", ROOT / "examples"
CASES = {
    "attitude": (
        DATA / "attitude-20261121.sqlite",
        EXAMPLES / "attitude-lab" / "equipment.toml",
        [],
        "pitch_deg=20,roll_deg=30",
        ["x_V output", "y_V output", "z_V output"],
        {},
        {"pitch_deg": "inferred pitch", "roll_deg": "inferred roll"},
    ),
    "pressure": (
        DATA / "pressure-20261121.sqlite",
        EXAMPLES / "pressure-lab" / "equipment.toml",
        ["--formula", "1 + P"],
        "pressure_psia=1.5,sensor_temperature_degC=-90,sse_temperature_degC=0.05",
        ["bridge_1 output"],
        {"sensor_temperature_degC": -90.0, "sse_temperature_degC": 0.05},
        {"pressure_psia": "bridge_1 inferred pressure"},
    ),
}


@pytest.fixture(scope="module", params=CASES)
def kept(request, tmp_path_factory):
    """The case, its calibration file, and its results by name, with another meter and with the same."""
    run, register, options, at, outputs, beside, inferred = CASES[request.param]
    folder = tmp_path_factory.mktemp(request.param)
    file = folder / "calibration.json"
    done = rig("fit", run, "--equipment", register, *options, "--out", file, "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["uncertainty"].startswith("repeatability only here; rig infer adds")
    told = {}
    for same in (False, True):
        asked = {"formula": options[1]} if options else {}  # both are of the declared model
        made = budget_of(run_with_register(run, register), at=points([at]), same_meter=same, options=asked)
        told[same] = {one.name.partition(" at ")[0]: vars(one) for one in made.budgets}
    return file, told, outputs, beside, inferred


@pytest.mark.parametrize("same", [False, True])
def test_intervals_in_use_are_those_of_the_budget(kept, tmp_path, same):
    file, told, outputs, beside, inferred = kept
    columns = {f"{name.split()[0]}{'' if '_V' in name else '_mV'}": told[same][name]["value"] for name in outputs}
    readings, out = tmp_path / "readings.csv", tmp_path / "out.csv"
    columns |= beside
    readings.write_text(",".join(columns) + "\n" + ",".join(map(repr, columns.values())) + "\n")
    near = ["--near", "20", "30"] if "pitch_deg" in inferred else []
    meter = ["--same-meter"] if same else []
    done = rig("infer", file, readings, "--out", out, *near, *meter)
    assert done.returncode == 0, done.stderr
    (row,) = csv.DictReader(out.read_text().splitlines())
    assert row["uncertainty"] == "total by the model, without effects beside it"
    for column, name in inferred.items():
        budget = told[same][name]
        assert float(row[column]) == pytest.approx(budget["value"], rel=1e-9)
        assert float(row[f"{column}_sd"]) == pytest.approx(budget["standard_uncertainty"], rel=1e-9)
        half = (float(row[f"{column}_hi95"]) - float(row[f"{column}_lo95"])) / 2.0
        assert half == pytest.approx(budget["expanded_uncertainty"], rel=1e-7)  # a difference of two large numbers
    words = "the meter of the run reads the sensors, too" if same else "errors of the meter that reads the sensors in"
    assert words in done.stderr.replace("\n", " ")
    assert "example values" in done.stderr


def test_a_calibration_without_a_register_says_repeatability_only(tmp_path):
    run, file, readings = DATA / "attitude-20261121.sqlite", tmp_path / "c.json", tmp_path / "r.csv"
    done = rig("fit", run, "--out", file)
    assert "repeatability only: the run has no register of equipment" in done.stderr
    readings.write_text("x_V,y_V,z_V\n0.0,0.0,-5.0\n")
    done = rig("infer", file, readings, "--out", tmp_path / "o.csv")
    assert "intervals are repeatability only: the run has no register of equipment" in done.stderr.replace("\n", " ")
    (row,) = csv.DictReader((tmp_path / "o.csv").read_text().splitlines())
    assert row["uncertainty"] == "repeatability only"
    done = rig("infer", file, readings, "--out", tmp_path / "o.csv", "--same-meter")
    assert done.returncode == 2
    assert "--same-meter needs a calibration with influences" in done.stderr


def test_a_digital_certificate_is_refused_with_what_it_can_be_used_for(tmp_path):
    certificate = tmp_path / "dcc.xml"
    certificate.write_text("<digitalCalibrationCertificate/>")
    with pytest.raises(UsageError, match=r"is no calibration file.*rig certificate --read "):
        read_calibration(certificate)


def test_influences_are_those_of_the_declared_model_alone(tmp_path):
    run, file = DATA / "attitude-20261121.sqlite", tmp_path / "c.json"
    register = EXAMPLES / "attitude-lab" / "equipment.toml"
    done = rig("fit", run, "--equipment", register, "--leave-out", "5", "--out", file)
    assert done.returncode == 0, done.stderr
    told = json.loads(file.read_text())
    assert told["uncertainty"] == "repeatability only: influences are those of a fit without --leave-out"
    assert "budget" not in told


def test_a_garbled_budget_is_refused(kept, tmp_path):
    file = kept[0]
    told = json.loads(file.read_text())
    told["budget"]["influences"][0].pop("modes")
    garbled = tmp_path / "garbled.json"
    garbled.write_text(json.dumps(told))
    done = rig("infer", garbled, file, "--out", tmp_path / "o.csv")
    assert done.returncode == 2
    assert "is not a calibration file of `rig fit --out`" in done.stderr.replace("\n", " ")


def test_traces_and_their_reports_say_repeatability_only(tmp_path):
    page = tmp_path / "trace.html"
    done = rig("trace", DATA / "attitude-20261121.sqlite", "--report", page, "--json")
    assert json.loads(done.stdout)["uncertainty"] == "repeatability only"
    assert "standard errors and intervals: repeatability only" in done.stderr
    assert "repeatability only: errors of instruments" in page.read_text()


def test_causes_that_cannot_be_separated_have_a_line_and_a_calibration_keeps_influences_beside_them(tmp_path):
    run, register = DATA / "attitude-20261121.sqlite", EXAMPLES / "attitude-lab" / "equipment.toml"
    file = tmp_path / "c.json"
    done = rig("fit", run, "--equipment", register, "--traced", "--out", file)
    assert done.returncode == 0, done.stderr
    kept = json.loads(file.read_text())
    done = rig("budget", run, "--equipment", register, "--traced", "--at", "pitch_deg=20,roll_deg=30", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    offset = next(one for one in told["results"] if one["name"] == "x_V offset")
    (model,) = (one for one in offset["contributions"] if one["name"].startswith("model: "))
    assert model["kind"] == "B"
    calibration = kept["calibration"]
    assert calibration["alternatives"], "the example has pads, which look like others in few points"
    named = calibration["sensors"][0]["coefficients"][0]
    others = [one["calibration"]["sensors"][0]["coefficients"][0] for one in calibration["alternatives"]]
    assert offset["value"] == pytest.approx(named, rel=1e-9)
    expected = np.sqrt(np.sum((np.array(others) - named) ** 2) / (len(others) + 1))
    assert model["standard_uncertainty"] == pytest.approx(expected, rel=1e-9)
    assert any("held at the size that the trace found" in note for note in told["notes"])
    readings = tmp_path / "r.csv"
    outputs = (one["value"] for one in told["results"] if " output at " in one["name"])
    readings.write_text("x_V,y_V,z_V\n" + ",".join(map(repr, outputs)) + "\n")
    done = rig("infer", file, readings, "--near", "20", "30", "--out", tmp_path / "o.csv")
    assert done.returncode == 0, done.stderr
    assert ",total," in (tmp_path / "o.csv").read_text()
    assert kept["budget"]["influences"][0]["name"].startswith("HD-0417")


def test_a_table_is_read_once_however_many_influences_there_are(kept, tmp_path):
    file, told, outputs, beside, _ = kept
    columns = {f"{name.split()[0]}{'' if '_V' in name else '_mV'}": told[False][name]["value"] for name in outputs}
    columns |= beside
    readings = tmp_path / "readings.csv"
    readings.write_text(",".join(columns) + "\n" + ",".join(map(repr, columns.values())) + "\n")
    read, asked = csv_reader(readings), []

    def counted(needed):
        asked.append(tuple(needed))
        return read(needed)

    calibration = read_calibration(file)
    assert calibration.budget is not None
    assert len(calibration.budget.influences) > 3
    found = infer(calibration, counted, calibration.kind.infer_options())
    assert set(found.columns["uncertainty"]) == {"total by the model, without effects beside it"}
    assert len(asked) == 1


@pytest.mark.parametrize("kept", ["attitude"], indirect=True)
@pytest.mark.parametrize("roll", [180.0, 179.99999, -180.0, 0.0])
def test_an_angle_at_its_seam_has_the_total_uncertainty_of_its_neighbours(kept, tmp_path, roll):
    file = kept[0]
    calibration = read_calibration(file)
    sensors = calibration.calibration
    a = np.radians(20.0)
    for near in (roll, roll + 90.0):
        r = np.radians(near)
        g = np.array([np.sin(a), -np.sin(r) * np.cos(a), -np.cos(r) * np.cos(a)])
        volts = sensors.offsets_V + sensors.matrix @ g
        readings, out = tmp_path / "r.csv", tmp_path / "o.csv"
        readings.write_text(",".join(sensors.names) + "\n" + ",".join(map(repr, map(float, volts))) + "\n")
        done = rig("infer", file, readings, "--out", out)
        assert done.returncode == 0, done.stderr
        (row,) = csv.DictReader(out.read_text().splitlines())
        assert 0.0 < float(row["roll_deg_sd"]) < 0.1
        assert not row["flag"]


def test_a_budget_at_the_seam_has_the_uncertainty_of_its_neighbours():
    run, register, *_ = CASES["attitude"]
    sds = []
    for roll in ("179", "180"):
        done = rig("budget", run, "--equipment", register, "--at", f"pitch_deg=20,roll_deg={roll}", "--json")
        assert done.returncode == 0, done.stderr
        (angle,) = (one for one in json.loads(done.stdout)["results"] if one["name"].startswith("inferred roll"))
        assert angle["value"] == pytest.approx(float(roll), abs=0.1)
        sds.append(angle["standard_uncertainty"])
    assert sds[1] == pytest.approx(sds[0], rel=0.2)
