"""docs/tutorials/own_bench.md: its files are those of examples/flow-lab, and its commands give what it says."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path

import pytest
from command import rig

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "own_bench.md"
LAB = Path(__file__).parents[2] / "examples" / "flow-lab"


def test_every_part_of_a_file_that_it_shows_is_in_the_example():
    shown = re.findall(r"```toml (\S+)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(shown) >= 6
    for name, part in shown:
        assert part in (LAB / name).read_text(), (name, part)


def test_a_new_user_reads_few_words():
    """README and this page are all that has to be read before the first certificate of a dry run."""
    words = sum(len(path.read_text().split()) for path in (PAGE, PAGE.parents[2] / "README.md"))
    assert words < 2100


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "my-lab"
    shutil.copytree(LAB, folder)
    for line in re.findall(r"```sh run\n(.*?)```", PAGE.read_text(), re.DOTALL)[0].splitlines():
        done = rig(*line.split()[1:], cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_the_trace_names_what_the_world_hides(lab):
    run = min((lab / "runs").glob("*.sqlite"))  # the first: other tests make further ones
    for sensor in json.loads(rig("trace", run, "--json", cwd=lab).stdout)["sensors"].values():
        (effect,) = sensor["effects"]
        assert effect["effect"].startswith("sensitivity-temperature")
        assert sensor["before"]["sigma_E"] > 8 * sensor["after"]["sigma_E"]


def test_a_certificate_of_the_confirmed_effect_has_the_outputs_of_the_world(lab):
    run = min((lab / "runs").glob("*.sqlite"))  # the first: other tests make further ones
    assert rig("confirm", run, "--dry", cwd=lab).returncode == 0
    (further,) = {*(lab / "runs").glob("*.sqlite")} - {run}
    done = rig("certificate", run, "--confirmed-by", further, "--out", "certificates", cwd=lab)
    assert done.returncode == 0, done.stderr
    (path,) = (lab / "certificates").glob("*.json")
    rows = {one["name"]: one for table in json.loads(path.read_text())["tables"] for one in table["results"]}
    for flow, output in ((1, 227.0), (3, 563.0)):
        one = next(row for name, row in rows.items() if name.startswith(f"sensor_1 output at flow {flow} kg/min"))
        assert abs(float(one["value"]) - output) < float(one["expanded"])


def test_new_readings_give_flows(lab, tmp_path):
    """The readings that the page shows are those of the world at 1 kg/min and 40 degC, and at 3 kg/min and 25 degC."""
    run = min((lab / "runs").glob("*.sqlite"))
    later = {*(lab / "runs").glob("*.sqlite")} - {run}
    if not later:
        assert rig("confirm", run, "--dry", cwd=lab).returncode == 0
    (further,) = {*(lab / "runs").glob("*.sqlite")} - {run}
    (shown,) = re.findall(r"```csv readings.csv\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "readings.csv").write_text(shown)
    file, out = tmp_path / "calibration.json", tmp_path / "flows.csv"
    assert rig("fit", run, "--confirmed-by", further, "--out", file, cwd=lab).returncode == 0
    done = rig("infer", file, tmp_path / "readings.csv", "--out", out, cwd=lab)
    assert done.returncode == 0, done.stderr
    assert "no inferred value" not in done.stderr + done.stdout
    rows = list(csv.DictReader(out.read_text().splitlines()))
    columns = [name for name in rows[0] if name.endswith("_lo95")]
    assert len(columns) == 2, rows[0]
    for row, flow in zip(rows, (1.0, 3.0), strict=True):
        for low in columns:
            assert float(row[low]) <= flow <= float(row[low.replace("_lo95", "_hi95")])


def test_plan_takes_due_dates_from_the_register(lab):
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab)
    assert "has no due date" not in told.stdout
    assert "every calibration whose date is stated is valid until then" in told.stdout


def test_results_of_the_declared_model_hold_at_all_conditions_that_they_are_said_to_hold_at(lab, tmp_path):
    """A point at the mean temperature had U of the noise alone: at the chamber's ends the truth was 2 U away."""
    folder = tmp_path / "lab"
    shutil.copytree(lab, folder, ignore=shutil.ignore_patterns("certificates", "issued.json"))
    run = min((folder / "runs").glob("*.sqlite"))
    done = rig("certificate", run, "--out", "declared", cwd=folder)
    assert done.returncode == 0, done.stderr
    (path,) = (folder / "declared").glob("*.json")
    rows = [one for table in json.loads(path.read_text())["tables"] for one in table["results"]]
    for flow, output in ((1.0, 227.0), (3.0, 563.0)):
        one = next(row for row in rows if row["name"].startswith(f"sensor_1 output at flow {flow:g} kg/min"))
        for chamber_degC in (10.0, 40.0):
            truth = output + 0.02 * flow * (chamber_degC - 25.0)
            assert abs(float(one["value"]) - truth) < float(one["expanded"]), (flow, chamber_degC)


def test_a_reference_without_an_asset_number_has_the_due_date_of_the_standard_that_reads_it(lab):
    """The standard was due on a day, and the reference standard that it is had no due date."""
    told = rig("doctor", "--bench", "bench.toml", "--dry", cwd=lab, env={"COLUMNS": "200"}).stdout
    assert "calibration of coriolis" in told
    assert "reference standard of flow" not in told
