"""Budgets with traced effects: what the class of a cause leaves open is a line of the budget."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command import rig

ROOT = Path(__file__).parent.parent
RUN, REGISTER = (
    ROOT / "tests" / "data" / "attitude-20261121.sqlite",
    ROOT / "examples" / "attitude-lab" / "equipment.toml",
)


def test_causes_that_cannot_be_separated_have_a_line_and_a_calibration_keeps_influences_beside_them(tmp_path):
    file = tmp_path / "c.json"
    done = rig("fit", RUN, "--equipment", REGISTER, "--traced", "--out", file)
    assert done.returncode == 0, done.stderr
    kept = json.loads(file.read_text())
    done = rig("budget", RUN, "--equipment", REGISTER, "--traced", "--at", "pitch_deg=20,roll_deg=30", "--json")
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
