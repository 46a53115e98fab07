"""`rig trace TABLE --response`: JSON with the keys of every trace, text, report, refusals."""

from __future__ import annotations

import csv
import json
import subprocess
import sys

import pytest
from table_truth import MISSING, simulate

EFFECT_KEYS = {
    "effect", "cause", "stratum", "term", "terms", "coefficients", "stderr", "unit", "size", "p_adjusted",
    "p_adjusted_is_bound", "share", "aliases", "separation_sigmas", "separate_by",
}  # fmt: skip
SIDE_KEYS = {
    "sigma_E", "sigma_bias", "sigma_prec", "T_bias", "F_bias_95", "T_b", "T_S", "F_bS_95", "cv_rms",
    "sigma_subplot", "sigma_wholeplot", "reading_error_pct",
}  # fmt: skip


@pytest.fixture
def table(tmp_path):
    missing = MISSING["drift"]
    columns = simulate(missing.lab, 1, missing.at(2.0))
    path = tmp_path / "cells.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def rig(*arguments):
    command = [sys.executable, "-m", "rig", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_json_report_and_keys(table, tmp_path):
    page = tmp_path / "cells.html"
    done = rig("trace", table, "--response", "y", "--formula", "1 + x", "--time", "t_s", "--report", page, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["data"] == {"file": "cells.csv", "points": 120, "kind": "general"}
    found = result["sensors"]["y"]
    assert {"declared", "verdict", "before", "effects", "after", "unnamed", "notes", "fitted", "sentence"} <= set(found)
    assert found["verdict"] == "explained"
    assert set(found["before"]) == set(found["after"]) >= SIDE_KEYS
    effect = found["effects"][0]
    assert set(effect) >= EFFECT_KEYS
    assert effect["effect"] == "drift:t_s"
    assert effect["family"] == "drift"
    assert found["fitted"]["coefficients"]["x"]["estimate"] == pytest.approx(2.0, abs=0.2)
    assert "drift:t_s" in found["sentence"]
    text = page.read_text()
    assert text.count("data:image/png;base64,") == 1
    assert "drift:t_s" in text


def test_text_tells_what_was_taken_for_what(table):
    done = rig("trace", table, "--response", "y", "--formula", "1 + x", "--ignore", "temp_c")
    assert done.returncode == 0, done.stderr
    assert "drift:t_s" in done.stdout
    assert "t_s was taken for the time" in done.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--response", "y"), "--formula"),
        (("--group", "unit"), "--response"),
        (("--response", "y", "--formula", "1 + x", "--time", "nothing"), "nothing"),
    ],
)
def test_refusals_say_what_to_do(table, options, words):
    done = rig("trace", table, *options)
    assert done.returncode == 2
    assert words in done.stderr
