"""A curve with a turning point, inverted over a range that the user states."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from command import rig
from test_infer_general import curve

import rig as rig_of_python
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.procedures.general.infer.calibration import student

TURN = 12.5


def parabola(x):
    return 5 + 2 * x - 0.08 * x**2


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A calibration of a parabola that turns at 12.5, from 0 to 30, and its folder."""
    folder = tmp_path_factory.mktemp("turn")
    x = np.arange(61) / 2
    y = parabola(x) + np.random.default_rng(3).normal(0, 0.05, x.size)
    np.savetxt(folder / "turn.csv", np.column_stack([x, y]), delimiter=",", header="x,y", comments="")
    done = rig("fit", "turn.csv", "--response", "y", "--formula", "1 + x + x^2", "--out", "turn.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def inferred(fitted):
    """Runs `rig infer` for readings, and reads the rows that it wrote."""

    def run(readings, *options):
        (fitted / "r.csv").write_text("y\n" + "".join(f"{y}\n" for y in readings))
        done = rig("infer", "turn.json", "r.csv", "--out", "out.csv", *options, cwd=fitted)
        if done.returncode:
            return " ".join(done.stderr.split()), []
        with (fitted / "out.csv").open() as file:
            return " ".join(done.stderr.split()), list(csv.DictReader(file))

    return run


def test_a_refusal_names_the_ranges_and_they_work(inferred):
    words, rows = inferred([10.28])
    assert not rows
    offers = [part.split()[:2] for part in words.split("--between ")[1:]]
    assert len(offers) == 2
    for (low, high), truth in zip(offers, (3.0, 22.0), strict=True):
        _, rows = inferred([10.28], "--between", low, high)
        assert float(rows[0]["x"]) == pytest.approx(truth, abs=0.1)
        assert rows[0]["flag"] == ""


@pytest.mark.parametrize(("between", "side"), [((0, 12), -1), ((13, 30), 1), ((2, 9.5), -1)])
def test_values_and_intervals_are_those_of_the_stated_branch(fitted, inferred, between, side):
    """The root by the quadratic formula; at both ends the reading leaves the prediction interval."""
    calibration = CurveCalibration.from_dict(json.loads((fitted / "turn.json").read_text())["calibration"])
    c, b, a = calibration.coefficients
    y = parabola(np.linspace(*between, 9)[1:-1])
    words, rows = inferred(y, "--between", *map(str, between))
    x, lo, hi = (np.array([float(row[f"x{end}"]) for row in rows]) for end in ("", "_lo95", "_hi95"))
    assert x == pytest.approx((-b - side * np.sqrt(b**2 - 4 * a * (c - y))) / (2 * a), rel=1e-9)
    for end in (lo, hi):
        at = calibration.rows(end)
        variance, df = calibration.reading_variance(at)
        assert np.abs(y - at @ calibration.coefficients) == pytest.approx(student(df) * np.sqrt(variance), rel=1e-6)
    assert ((lo < x) & (x < hi)).all()
    assert f"x is taken to be from {between[0]:g} to {between[1]:g}, as stated by --between" in words


def test_intervals_hold_the_truth_on_a_stated_branch():
    """95 % of them, over 400 calibrations of 31 rows each."""
    rng, x = np.random.default_rng(8), np.arange(31.0)
    held = []
    for _ in range(400):
        made = curve(x, parabola(x) + rng.normal(0, 0.05, x.size), "1 + x + x^2").within((0, TURN - 0.5))
        at = rng.uniform(1, 10, 20)
        found = infer_curve(made, parabola(at) + rng.normal(0, 0.05, at.size))
        assert (found.flag == "").all()
        held.append((found.lo95 <= at) & (at <= found.hi95))
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)


def test_readings_that_the_branch_does_not_have_are_flagged(inferred):
    """17.9 is above the top of the curve, -4.28 on the other branch; 17.4 has no end before the curve turns."""
    _, rows = inferred([17.9, -4.28, 17.44], "--between", "0", "12.3")
    for row in rows[:2]:
        assert row["x"] == ""
        assert row["flag"] == "the curve does not reach this reading from x = 0 to 12.3 (--between)"
    assert float(rows[2]["x"]) == pytest.approx(11.7, abs=0.3)
    assert rows[2]["x_hi95"] == ""
    assert rows[2]["flag"] == "the 95 % interval has no upper end before the curve turns"


@pytest.mark.parametrize(
    ("between", "words"),
    [
        (("2", "20"), "from x = 2 to 20: a reading has several values of x"),
        (("-2", "10"), "x was calibrated from 0 to 30; state a range in it"),
        (("10", "2"), "it has to be two numbers, the smaller one first"),
    ],
)
def test_a_range_that_does_not_help_is_refused(inferred, between, words):
    told, rows = inferred([10], "--between", *between)
    assert not rows
    assert words in told


def test_a_tolerance_holds_for_the_stated_range(fitted):
    fit = ("fit", "turn.csv", "--response", "y", "--formula", "1 + x + x^2", "--json")
    done = rig(*fit, "--tolerance", "0.5", cwd=fitted)
    assert done.returncode == 2
    assert "--between 0 12.4" in " ".join(done.stderr.split())
    done = rig(*fit, "--tolerance", "0.5", "--between", "0", "8", cwd=fitted)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)["acceptance"]
    assert told["between"] == [0, 8]
    assert told["inside"]
    assert told["at"] == 8  # where the curve is least steep
    done = rig(*fit, "--between", "0", "8", cwd=fitted)
    assert done.returncode == 2
    assert "--between of a fit belongs to --tolerance" in done.stderr


def test_a_branch_of_several_variables_is_stated_too(tmp_path):
    """The turning point moves with the other variable; groups whose curve turns in the range are flagged."""
    x, z = (one.ravel() for one in np.meshgrid(np.linspace(0, 10, 21), [0.0, 1.0, 2.0]))
    y = (x - 4 - z) ** 2 + np.random.default_rng(5).normal(0, 0.01, x.size)
    np.savetxt(tmp_path / "t.csv", np.column_stack([x, z, y]), delimiter=",", header="x,z,y", comments="")
    options = ("--response", "y", "--formula", "1 + x + x^2 + z + z^2 + x:z", "--out", "c.json")
    done = rig("fit", "t.csv", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = rig_of_python.infer(tmp_path / "c.json", {"y": [4.0, 4.0, 4.0], "z": [0.0, 1.0, 2.0]}, between=(4.5, 9))
    flags = found.columns["flag"]
    assert found.columns["x"][0] == pytest.approx(6.0, abs=0.05)
    assert flags[0] == ""
    assert "--between 5.0" in flags[1]
    assert "--between 6.0" in flags[2]
