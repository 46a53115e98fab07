"""`rig plan` puts designs side by side, and says what the paper would do otherwise."""

from __future__ import annotations

import json

import pytest
from command import rig
from dry import LAB, SHORT

WIDE = SHORT.replace("pitch_deg = [-90, -45, 0, 45, 90]", "pitch_deg = [-45, -22.5, 0, 22.5, 45]").replace(
    '"short"', '"narrow"'
)


def plan(folder, *arguments):
    for name, text in (("short.toml", SHORT), ("narrow.toml", WIDE)):
        (folder / name).write_text(text)
    return rig("plan", "short.toml", "--bench", LAB / "bench.toml", *arguments, cwd=folder)


def test_designs_side_by_side_with_hours_precision_and_a_recommendation(tmp_path):
    done = plan(tmp_path, "--compare", "narrow.toml", "--usage", "30", "--plot", "plot.png", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    short, narrow = found["designs"]
    assert (short["procedure"], narrow["procedure"]) == ("short", "narrow")
    assert short["observations"] == narrow["observations"] == 30
    assert short["hours"] > narrow["hours"] > 0
    assert narrow["mean_sd_deg"] < short["mean_sd_deg"], "calibrated nearer to where it is used"
    assert found["recommended"]["name"] == narrow["name"]
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
    shown = plan(tmp_path, "--compare", "narrow.toml", "--usage", "30")
    assert "recommended" in shown.stdout


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--compare", "nothing.toml"), 78, "procedure file nothing.toml does not exist"),
        (("--compare", str(LAB.parent / "pressure-lab" / "procedure.toml")), 78, ""),
    ],
)
def test_what_cannot_be_compared_is_said(tmp_path, arguments, code, message):
    done = plan(tmp_path, *arguments)
    assert done.returncode == code, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_advice_comes_with_numbers_and_refuses_nothing(tmp_path):
    done = plan(tmp_path, "--json")
    assert done.returncode == 0, done.stderr
    advice = {item["number"]: item["sentence"] for item in json.loads(done.stdout)["advice"] if not item["holds"]}
    assert 6 in advice, "two replications where the paper asks for six"
    assert "2" in advice[6]


def test_what_is_wanted_of_the_package_stands_in_the_procedure(tmp_path):
    """Recommendation 9: y and z within ten times x, and roll known everywhere the package is used."""
    told = "\n[usage]\npitch_deg = 60\n[expect]\nsigma_deg = 2e-4\nsigma_y_deg = {0}\nsigma_z_deg = {0}\n"
    for sigma, holds in ((2e-3, True), (3e-3, False)):
        (tmp_path / "told.toml").write_text(SHORT + told.format(sigma))
        done = plan(tmp_path, "--json")
        assert 9 in {item["number"] for item in json.loads(done.stdout)["advice"]}, "the bench has x, y and z"
        done = rig("plan", "told.toml", "--bench", LAB / "bench.toml", "--json", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        (found,) = (item for item in json.loads(done.stdout)["advice"] if item["number"] == 9)
        assert found["holds"] is holds
        assert f"{sigma / 2e-4:.3g} times the uncertainty of x; within +-60 deg" in found["sentence"]


def test_a_design_without_roll_is_not_recommended_for_a_package(tmp_path):
    flat = SHORT.replace("roll_deg = [-120, 0, 120]", "roll_deg = [0]").replace('"short"', '"flat"')
    (tmp_path / "flat.toml").write_text(flat)
    done = plan(tmp_path, "--compare", "flat.toml", "--compare", "narrow.toml", "--usage", "30", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    short, without, _ = found["designs"]
    assert without["undetermined"] == "without roll it does not calibrate the y and z sensors of this bench"
    assert short["undetermined"] == ""
    assert found["recommended"]["name"] == "narrow"
    alone = rig("plan", "flat.toml", "--bench", LAB / "bench.toml", "--json", cwd=tmp_path)
    (nine,) = (item for item in json.loads(alone.stdout)["advice"] if item["number"] == 9)
    assert not nine["holds"]
    assert "calibrated without roll" in nine["sentence"]


def test_procedures_of_one_name_are_told_apart_by_their_files(tmp_path):
    (tmp_path / "again.toml").write_text(WIDE.replace('"narrow"', '"short"'))
    done = plan(tmp_path, "--compare", "again.toml", "--json")
    assert [d["name"] for d in json.loads(done.stdout)["designs"]] == ["short.toml", "again.toml"]
    assert "rehearsing again.toml" in done.stderr
    alone = plan(tmp_path, "--plot", "plot.png")
    assert alone.returncode == 2
    assert "--compare" in alone.stderr


def test_nothing_that_is_read_is_drawn_over(tmp_path):
    for target in ("narrow.toml", "short.toml", "."):
        done = plan(tmp_path, "--compare", "narrow.toml", "--plot", target)
        assert done.returncode == 2
        assert "not overwritten" in done.stderr or "is a folder" in done.stderr
        assert "rehearsing" not in done.stderr
    assert (tmp_path / "narrow.toml").read_text() == WIDE
