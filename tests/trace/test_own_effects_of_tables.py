"""A laboratory's own effects in tables of any kind, through RIG_EFFECTS and the command."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from command import rig

from proving.truth.table import Lab, simulate

FUNNEL = """
[[effect]]
name = "funnel"
cause = "a draught through the funnel, by the supply"
scope = "sensor"
stratum = "row"
unit = "V"
columns = ["sin(3*x)*humidity"]
separate_by = "close the funnel"
usual_size = "a few readings"
"""


def traced(folder, columns, effects=FUNNEL):
    (folder / "effects.toml").write_text(effects)
    names = list(columns)
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    words = ("trace", "table.csv", "--response", "y", "--formula", "1 + x", "--json")
    return rig(*words, cwd=folder, env={**os.environ, "RIG_EFFECTS": str(folder / "effects.toml")})


def test_it_is_found_by_its_name(tmp_path):
    columns = simulate(Lab(60, 2), 4)
    columns["y"] = columns["y"] + 0.05 * np.sin(3 * columns["x"]) * columns["humidity"]
    done = traced(tmp_path, columns)
    assert done.returncode == 0, done.stderr
    (effect,) = json.loads(done.stdout)["sensors"]["y"]["effects"]
    assert effect["effect"] == "funnel"
    assert effect["coefficients"][0] == pytest.approx(0.05, abs=4 * effect["stderr"][0])
    assert effect["separate_by"].startswith("close the funnel")


def test_a_table_without_its_column_says_that_it_was_not_tested(tmp_path):
    done = traced(tmp_path, simulate(Lab(40, 1), 4))
    assert done.returncode == 0, done.stderr
    assert "funnel was not tested: humidity is no setting, covariate or time of this table" in done.stdout


def test_a_column_that_is_no_formula_is_one_message(tmp_path):
    done = traced(tmp_path, simulate(Lab(40, 1), 4), FUNNEL.replace("sin(3*x)", "sin(3*"))
    assert done.returncode == 78
    assert "effect funnel: a column is not understood" in done.stderr
