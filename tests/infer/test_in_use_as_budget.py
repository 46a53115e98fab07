"""`rig infer` has the uncertainties of `rig budget` and certificates, with effects beside the model and with confirmed
ones; where it has not, its outputs say so.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from certificate_lab import stand
from command import rig
from general_lab import WORLD

ROOT = Path(__file__).parents[2]
LAB = ROOT / "examples" / "load-cell-lab"
AT = ("2", "3", "4.5")
SQUARE = WORLD.replace("noise = 1e-5", 'hidden = "0.0004*force_kN^2"\nnoise = 1e-5')


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Path:
    """A stand with a register, whose cell has a square that the declared straight line has not."""
    return stand(tmp_path_factory.mktemp("stand"), world=SQUARE)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("cell")
    files = [LAB / name for name in ("procedure.toml", "bench.toml", "world.toml")]
    rig("run", files[0], "--bench", files[1], "--world", files[2], "--dry", "--out", folder)
    (found,) = folder.glob("*.sqlite")
    return found


def in_use(folder, run, values, *options):
    """Rows and JSON of `rig infer` by a calibration with these options, from these outputs."""
    done = rig("fit", run, *options, "--out", folder / "c.json")
    assert done.returncode == 0, done.stderr
    (folder / "r.csv").write_text("cell_V\n" + "".join(f"{value!r}\n" for value in values))
    done = rig("infer", folder / "c.json", folder / "r.csv", "--out", folder / "o.csv", "--json")
    assert done.returncode == 0, done.stderr
    return list(csv.DictReader((folder / "o.csv").read_text().splitlines())), json.loads(done.stdout)


def budget(run, *options):
    """Outputs, and standard and expanded uncertainties of inferred values, at the points."""
    points = [word for F in AT for word in ("--at", f"force_kN={F}")]
    told = json.loads(rig("budget", run, *points, *options, "--json").stdout)["results"]
    every = {word: [one for one in told if f" {word} " in one["name"]] for word in ("output", "inferred")}
    return [one["value"] for one in every["output"]], every["inferred"]


def compare(rows, inferred):
    for row, one in zip(rows, inferred, strict=True):
        assert row["uncertainty"] == "total"
        assert float(row["force_kN_sd"]) == pytest.approx(one["standard_uncertainty"], rel=0.01)
        half = (float(row["force_kN_hi95"]) - float(row["force_kN_lo95"])) / 2.0
        # a calibration file has Student's factors, a budget that of the shape where limits dominate
        assert half >= one["expanded_uncertainty"] * 0.99
        assert half <= 1.2 * one["expanded_uncertainty"]


def test_a_plain_calibration_has_the_line_of_an_effect_that_the_trace_finds(run, tmp_path):
    outputs, inferred = budget(run)
    assert any(line["name"].startswith("effects beside") for one in inferred for line in one["contributions"])
    rows, told = in_use(tmp_path, run, outputs)
    compare(rows, inferred)
    assert any("lacks creep:force_kN. Results hold: of creep:force_kN, at rest, when" in note for note in told["notes"])


def test_the_line_of_a_square_that_the_trace_finds_is_in_plain_intervals(small, tmp_path):
    equipment = ("--equipment", small.parent / "equipment.toml")
    outputs, inferred = budget(small, *equipment)
    assert any(line["name"].startswith("effects beside") for one in inferred for line in one["contributions"])
    rows, told = in_use(tmp_path, small, outputs, *equipment)
    compare(rows, inferred)
    assert any("second-order:force_kN" in note and "is in the intervals" in note for note in told["notes"])


def test_a_confirmed_square_comes_with_the_influences_of_the_register(small, tmp_path):
    equipment = ("--equipment", small.parent / "equipment.toml")
    done = rig("confirm", small, "--dry", "--world", small.parent / "world.toml", "--out", tmp_path / "further")
    (further,) = (tmp_path / "further").glob("*.sqlite")
    assert ": confirmed" in done.stdout, done.stdout + done.stderr
    outputs, inferred = budget(small, "--traced", *equipment)
    rows, _ = in_use(tmp_path, small, outputs, "--confirmed-by", further, *equipment)
    compare(rows, inferred)


def test_a_confirmed_calibration_has_the_influences_of_the_register(run, tmp_path):
    done = rig("confirm", run, "--dry", "--out", tmp_path / "further", cwd=run.parent)
    (further,) = (tmp_path / "further").glob("*.sqlite")
    assert "creep:force_kN: confirmed" in done.stdout, done.stdout
    outputs, inferred = budget(run, "--traced")
    rows, told = in_use(tmp_path, run, outputs, "--confirmed-by", further)
    compare(rows, inferred)
    assert told["uncertainty"] == "total"


def test_where_effects_are_not_looked_for_every_output_says_so(tmp_path):
    run = ROOT / "tests" / "data" / "attitude-20261121.sqlite"
    register = ROOT / "examples" / "attitude-lab" / "equipment.toml"
    done = rig("fit", run, "--equipment", register, "--out", tmp_path / "c.json")
    assert done.returncode == 0, done.stderr
    (tmp_path / "r.csv").write_text("x_V,y_V,z_V\n0.0,0.0,-5.0\n")
    done = rig("infer", tmp_path / "c.json", tmp_path / "r.csv", "--out", tmp_path / "o.csv", "--json")
    (row,) = csv.DictReader((tmp_path / "o.csv").read_text().splitlines())
    told = json.loads(done.stdout)
    assert row["uncertainty"] == told["uncertainty"] == "total by the model, without effects beside it"
    assert any("rig budget and certificates trace the run" in note for note in told["notes"])
    assert "effects that the declared model lacks are in no interval here" in done.stderr.replace("\n", " ")


def test_a_calibration_says_which_errors_the_register_does_not_state(small, tmp_path):
    """A chamber without an error was in the notes of the budget alone, and intervals in use were called total."""
    register = tmp_path / "equipment.toml"
    register.write_text((small.parent / "equipment.toml").read_text().replace('"force_kN"', '"air_degC"'))
    rows, told = in_use(tmp_path, small, (1.0, 2.0), "--equipment", register)
    said = "total, but for errors that the register does not state"
    assert {row["uncertainty"] for row in rows} == {told["uncertainty"]} == {said}
    assert any("the register states no errors of force_kN" in note for note in told["notes"])


def test_an_effect_that_is_nothing_at_the_mean_of_another_quantity_is_in_intervals_at_its_ends(tmp_path):
    for path in (ROOT / "examples" / "flow-lab").glob("*.toml"):
        text = path.read_text().replace('flow_kg_per_min^2"\na', 'flow_kg_per_min^2 + chamber_degC"\na')
        (tmp_path / path.name).write_text(text)
    assert "chamber_degC" in (tmp_path / "procedure.toml").read_text().partition("[model]")[2]
    ran = rig("run", "procedure.toml", "--bench", "bench.toml", "--world", "world.toml", "--dry", cwd=tmp_path)
    file = tmp_path / ran.stdout.splitlines()[0]
    at = ("--at", "flow_kg_per_min=0.6,chamber_degC=10")
    told = json.loads(rig("budget", file, *at, "--json").stdout)["results"]
    value = {
        word: next(one for one in told if one["name"].startswith(f"sensor_1 {word} "))
        for word in ("output", "inferred")
    }
    assert rig("fit", file, "--out", tmp_path / "c.json").returncode == 0
    (tmp_path / "r.csv").write_text(f"sensor_1_Hz,chamber_degC\n{value['output']['value']!r},10\n")
    done = rig("infer", tmp_path / "c.json", tmp_path / "r.csv", "--out", tmp_path / "o.csv", "--json")
    assert done.returncode == 0, done.stderr
    (row,) = csv.DictReader((tmp_path / "o.csv").read_text().splitlines())
    assert row["uncertainty"] == "total"
    (sd,) = (float(text) for name, text in row.items() if name.endswith("flow_kg_per_min_sd"))
    assert sd >= 0.97 * value["inferred"]["standard_uncertainty"]
    assert any("at its largest over chamber_degC" in note for note in json.loads(done.stdout)["notes"])
