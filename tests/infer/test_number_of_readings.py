"""Inferred values hold for a stated number of readings: coverage against plain numpy, and words in every output."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
from command import rig as command

import rig

POINTS, READINGS = 24, 5
BETWEEN, INSIDE = 0.02, 0.1
"""Standard deviations that the readings of a point share, and of a single one, in Hz."""


def exported(rng, path=None):
    """A table as `rig export` writes it, of a sensor with output 50 + 180 x - 3 x^2."""
    x = np.repeat(np.linspace(0.5, 4.0, POINTS // 2), 2)
    every = truth(x)[:, None] + rng.normal(0, BETWEEN, POINTS)[:, None] + rng.normal(0, INSIDE, (POINTS, READINGS))
    columns = {
        "order": np.arange(POINTS) + 1.0,
        "x_kg": x,
        "s_Hz": every.mean(axis=1),
        "block": np.ones(POINTS),
        "run_index": np.arange(POINTS) * 1.0,
        "s_sd_Hz": every.std(axis=1, ddof=1),
        "readings": np.full(POINTS, READINGS * 1.0),
    }
    rows = zip(*columns.values(), strict=True)
    path.write_text("".join(",".join(map(repr, map(float, row))) + "\n" for row in rows))
    path.write_text(",".join(columns) + "\n" + path.read_text())
    return path


def truth(x):
    return 50.0 + 180.0 * x - 3.0 * x**2


def fitted(path):
    return rig.open(path).fit(response="s_Hz", formula="1 + x_kg + x_kg^2")


@pytest.mark.parametrize("count", [1, 2, 20])
def test_95_of_100_intervals_hold_the_truth_whatever_the_number_of_readings_in_use(tmp_path, count):
    rng, inside, total = np.random.default_rng(count), 0, 0
    for _ in range(20):
        calibration = fitted(exported(rng, tmp_path / "t.csv"))
        x = rng.uniform(0.6, 3.9, 200)
        read = truth(x) + rng.normal(0, BETWEEN, 200) + rng.normal(0, INSIDE, (count, 200)).mean(axis=0)
        found = calibration.infer({"s_Hz": read}, mean_of=count)
        inside += np.sum((found["x_kg_lo95"] <= x) & (x <= found["x_kg_hi95"]))
        total += 200
    assert inside / total > 0.935
    # of more readings than at a point the error is a difference of two estimates: intervals are too wide, not too short
    assert count > READINGS or inside / total < 0.965


def test_an_interval_for_more_readings_than_in_the_run_is_no_wider(tmp_path):
    """For 100 in place of 5 it was a hundred times as wide: what two estimates left had no degree of freedom."""
    read = {"s_Hz": truth(np.array([1.0, 2.0, 3.0]))}
    rng = np.random.default_rng(3)
    for _ in range(5):
        calibration = fitted(exported(rng, tmp_path / "t.csv"))
        widths = []
        for count in (READINGS, 20, 100, 1000):
            found = calibration.infer(read, mean_of=count)
            widths.append(found["x_kg_hi95"] - found["x_kg_lo95"])
        assert all((one <= widths[0] * (1.0 + 1e-9)).all() for one in widths)


def test_every_output_says_for_how_many_readings_it_holds(tmp_path):
    fitted(exported(np.random.default_rng(1), tmp_path / "t.csv")).save(tmp_path / "c.json")
    (tmp_path / "r.csv").write_text("s_Hz\n230\n590\n")
    sds = []
    for count, asked in ((5, ()), (1, ("--readings", "1"))):
        done = command("infer", "c.json", "r.csv", "--out", "o.csv", "--json", *asked, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        rows = list(csv.DictReader((tmp_path / "o.csv").read_text().splitlines()))
        told = json.loads(done.stdout)
        assert {row["mean_of_readings"] for row in rows} == {str(count)}
        assert {row["uncertainty"] for row in rows} == {"repeatability only"}
        assert told["mean_of_readings"] == {"x_kg": count}
        assert told["uncertainty"] == "repeatability only"
        assert ("the mean of 5" if count == 5 else "that is one") in done.stderr.splitlines()[-1]
        (said,) = re.findall(r"A single one scatters inside a point by ([0-9.]+) Hz", " ".join(told["notes"]))
        assert float(said) == pytest.approx(INSIDE, abs=0.02)
        assert told["notes"][1].startswith("inferred values hold for " + ("the mean" if count == 5 else "one reading"))
        sds.append(float(rows[0]["x_kg_sd"]))
    assert sds[1] / sds[0] == pytest.approx(2.1, abs=0.35)  # sqrt(0.02^2 + 0.1^2) over sqrt(0.02^2 + 0.1^2 / 5)


def test_where_the_scatter_inside_points_is_not_recorded_it_says_so(tmp_path):
    (tmp_path / "t.csv").write_text("x_kg,s_Hz\n1,10.1\n2,19.9\n3,30.2\n4,39.9\n5,50.1\n")
    (tmp_path / "r.csv").write_text("s_Hz\n25\n")
    line = ("--response", "s_Hz", "--formula", "1 + x_kg", "--out", "c.json")
    assert command("fit", "t.csv", *line, cwd=tmp_path).returncode == 0
    done = command("infer", "c.json", "r.csv", "--out", "o.csv", "--json", cwd=tmp_path)
    (row,) = csv.DictReader((tmp_path / "o.csv").read_text().splitlines())
    assert row["mean_of_readings"] == "as the rows of the calibration"
    assert any("is not recorded" in note for note in json.loads(done.stdout)["notes"])
    refused = command("infer", "c.json", "r.csv", "--out", "o.csv", "--readings", "1", cwd=tmp_path)
    assert refused.returncode == 2
    assert "--u-reading" in refused.stderr
    stated = command("infer", "c.json", "r.csv", "--out", "o.csv", "--u-reading", "0.2", cwd=tmp_path)
    assert stated.returncode == 0, stated.stderr
    (row,) = csv.DictReader((tmp_path / "o.csv").read_text().splitlines())
    assert row["mean_of_readings"] == "as stated"
    both = command("infer", "c.json", "r.csv", "--out", "o.csv", "--u-reading", "1", "--readings", "1", cwd=tmp_path)
    assert both.returncode == 2
