"""docs/own_bench.md: what it shows is in the files of examples/flow-lab, and its commands give what it says."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from command import rig

PAGE = Path(__file__).parents[2] / "docs" / "own_bench.md"
LAB = Path(__file__).parents[2] / "examples" / "flow-lab"


def test_every_part_of_a_file_that_it_shows_is_in_the_example():
    shown = re.findall(r"```toml (\S+)\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(shown) >= 6
    for name, part in shown:
        assert part in (LAB / name).read_text(), (name, part)


def test_a_new_user_reads_few_words():
    """README and this page are all that has to be read before the first certificate of a dry run."""
    words = sum(len(path.read_text().split()) for path in (PAGE, PAGE.parents[1] / "README.md"))
    assert words < 2500


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "my-lab"
    shutil.copytree(LAB, folder)
    for line in re.findall(r"```sh run\n(.*?)```", PAGE.read_text(), re.DOTALL)[0].splitlines():
        done = rig(*line.split()[1:], cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def test_the_trace_names_what_the_world_hides(lab):
    (run,) = (lab / "runs").glob("*.sqlite")
    for sensor in json.loads(rig("trace", run, "--json", cwd=lab).stdout)["sensors"].values():
        (effect,) = sensor["effects"]
        assert effect["effect"].startswith("sensitivity-temperature")
        assert sensor["before"]["sigma_E"] > 8 * sensor["after"]["sigma_E"]


def test_a_certificate_of_the_confirmed_effect_has_the_outputs_of_the_world(lab):
    (run,) = (lab / "runs").glob("*.sqlite")
    assert rig("confirm", run, "--dry", cwd=lab).returncode == 0
    (further,) = {*(lab / "runs").glob("*.sqlite")} - {run}
    done = rig("certificate", run, "--confirmed-by", further, "--out", "certificates", cwd=lab)
    assert done.returncode == 0, done.stderr
    (path,) = (lab / "certificates").glob("*.json")
    rows = {one["name"]: one for table in json.loads(path.read_text())["tables"] for one in table["results"]}
    for flow, output in ((1, 227.0), (3, 563.0)):
        one = next(row for name, row in rows.items() if name.startswith(f"sensor_1 output at flow {flow} kg/min"))
        assert abs(float(one["value"]) - output) < float(one["expanded"])


def test_plan_takes_due_dates_from_the_register(lab):
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=lab)
    assert "has no due date" not in told.stdout
    assert "every calibration whose date is stated is valid until then" in told.stdout
