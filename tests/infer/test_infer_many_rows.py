"""Inference from long tables: every row as if it were alone, by work that does not grow with the values of others."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from rig.procedures.general.fit import fit_general
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.tables import FileSource
from rig.tables.csv_files import write_csv

CASES = {
    "product": ("1 + p*t + p^2", lambda p, t: 0.1 + 0.02 * p + 1e-4 * p**2 + 0.003 * t + 2e-4 * p * t, 2e-3),
    "turns at some temperatures": ("1 + p*t", lambda p, t: 0.1 + 0.02 * p - 1e-3 * p * t, 2e-3),
    "quotient": ("1 + t + I(p/(t+273.15))", lambda p, t: 1 + 300 * p / (t + 273.15) + 1e-3 * t, 1e-3),
    "kink": ("1 + p + max(p-5,0) + t:max(p-5,0)", lambda p, t: p + 0.02 * np.maximum(p - 5, 0) * (8 - t), 1e-2),
    "wide intervals": ("1 + p + t", lambda p, t: 0.2 * p + 0.03 * t, 0.3),
    "period": ("1 + p + I(sin(t)*p)", lambda p, t: p * (1 + 1.02 * np.sin(t)), 1e-2),
    "far from zero": ("1 + t + I(p+2000) + I((p+2000)^2)", lambda p, t: 0.1 * p + 1e-3 * p**2 + 0.02 * t, 1e-3),
    "undefined": ("1 + p + log(t)", lambda p, t: p + np.log(np.maximum(t, 1e-3)), 1e-2),
}


def calibration(folder: Path, formula: str, truth, noise: float) -> CurveCalibration:
    """A calibration of y over p from 0 to 10 and t from 1 to 40."""
    rng = np.random.default_rng(4)
    p, t = (np.repeat(axis.ravel(), 2) for axis in np.meshgrid(np.linspace(0, 10, 11), np.linspace(1, 40, 6)))
    y = truth(p, t) + rng.normal(0, noise, len(p))
    write_csv({"p": p, "t": t, "y": y}, folder / "table.csv")
    return CurveCalibration.from_dict(fit_general(FileSource(folder / "table.csv").read, "y", formula)["calibration"])


def readings(truth, noise: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Temperatures and readings, some outside what was calibrated, one far outside, one that is not a number."""
    rng = np.random.default_rng(9)
    p, t = rng.uniform(-0.6, 10.6, n), rng.uniform(-5.0, 50.0, n)
    t[7] = 4e5
    y = truth(p, t) + rng.normal(0, noise, n)
    y[3] = np.inf
    return t, y


@pytest.mark.parametrize("case", CASES)
def test_every_row_is_inferred_as_if_it_were_alone(tmp_path, case):
    formula, truth, noise = CASES[case]
    made = calibration(tmp_path, formula, truth, noise)
    t, y = readings(truth, noise, 400)
    together = infer_curve(made.at({"t": t}), y)
    for i in range(0, len(y), 5):
        try:
            alone = infer_curve(made.at({"t": t[i]}), y[i : i + 1])
        except ValueError as refusal:
            assert np.isnan(together.value[i])
            assert "does not rise or fall all the way" in str(refusal)
            assert "does not rise or fall all the way" in together.flag[i]
            continue
        assert together.flag[i] == alone.flag[0]
        for name in ("value", "sd", "lo95", "hi95", "df"):
            got, right = getattr(together, name)[i], getattr(alone, name)[0]
            np.testing.assert_allclose(got, right, rtol=1e-10, atol=1e-12, err_msg=f"{name}, row {i}")


@pytest.mark.parametrize("case", CASES)
def test_what_is_inferred_lies_on_the_curve_and_on_the_ends_of_its_interval(tmp_path, case):
    """By the definition, without the search: the curve at the value, and the interval's ends, are the reading."""
    formula, truth, noise = CASES[case]
    made = calibration(tmp_path, formula, truth, noise)
    t, y = readings(truth, noise, 2000)
    found = infer_curve(made.at({"t": t}), y)
    for ends, side in ((found.value, 0.0), (found.lo95, 1.0), (found.hi95, -1.0)):
        known = np.isfinite(ends)
        assert known.sum() > 300
        at, x = made.at({"t": t[known]}), ends[known]
        direction = np.sign(at.slope(found.value[known]))
        met = at.curve(x) + side * direction * at.half_width(at.rows(x))
        np.testing.assert_allclose(met, y[known], rtol=1e-11, atol=1e-11)
    assert (np.isnan(found.value) <= (found.flag != "")).all()
    inside = np.isfinite(found.lo95) & np.isfinite(found.hi95)
    assert ((found.lo95 <= found.value) & (found.value <= found.hi95))[inside].all()


def test_the_work_does_not_grow_with_the_number_of_temperatures(tmp_path, monkeypatch):
    """A band for each of 20,000 temperatures took 8 ms each. Counted in calls, not in seconds."""
    formula, truth, noise = CASES["product"]
    made = calibration(tmp_path, formula, truth, noise)
    rng = np.random.default_rng(2)
    t, p = rng.uniform(1, 40, 20_000), rng.uniform(0, 10, 20_000)
    calls = 0
    rows = CurveCalibration.rows

    def counted(self, x):
        nonlocal calls
        calls += 1
        return rows(self, x)

    monkeypatch.setattr(CurveCalibration, "rows", counted)
    from rig.procedures.general.infer_table import infer_general  # noqa: PLC0415
    from rig.tables.given import table_given  # noqa: PLC0415

    table = table_given({"t": t, "y": truth(p, t)})
    found = infer_general(made, lambda needed: table)
    assert found.flagged == 0
    np.testing.assert_allclose(found.columns["p"], p, atol=0.2)
    assert calls < 500


def test_a_long_table_is_written_as_a_short_one(tmp_path):
    """Whole numbers, text that needs quotes, gaps and numbers in full, on both sides of a block's end."""
    n = 70_000
    numbers = np.arange(n) / 4.0
    numbers[[1, n - 1]] = np.nan, 1e300
    words = np.full(n, "", dtype=object)
    words[[5, n - 2]] = 'a "word", and more', "two\nlines"
    write_csv({"x": numbers, "whole": np.arange(n), "flag": words, "mixed": ["a", 1.5] * (n // 2)}, tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["x", "whole", "flag", "mixed"]
    assert len(rows) == n
    assert rows[:3] == [["0", "0", "", "a"], ["", "1", "", "1.5"], ["0.5", "2", "", "a"]]
    assert rows[5] == ["1.25", "5", 'a "word", and more', "1.5"]
    assert rows[-2:] == [[repr((n - 2) / 4.0), str(n - 2), "two\nlines", "a"], ["1e+300", str(n - 1), "", "1.5"]]
