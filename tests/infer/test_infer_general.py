"""Calibrations of any table in use: inverse prediction, against published numbers and simulation."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from command import rig
from scipy import optimize, stats

from rig.fitter import least_squares
from rig.fitter.formula import Formula
from rig.fitter.split_plot import fit_split_plot
from rig.procedures.general.charting import curve_charted
from rig.procedures.general.fit import fit_general
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.tables import FileSource

THERMOMETER = "temp,read\n96,95.71\n98,98.16\n100,99.52\n102,102.09\n104,103.79\n106,106.18\n108,108.14\n110,110.21\n"
"""Graybill and Iyer, Regression Analysis (1994), p. 431: a thermometer read at known temperatures."""


@pytest.fixture
def fitted(tmp_path):
    """What fits a table on the command line and infers from another."""

    def fit(table, readings, formula="1 + temp", response="read"):
        (tmp_path / "table.csv").write_text(table)
        (tmp_path / "readings.csv").write_text(readings)
        done = rig("fit", "table.csv", "--response", response, "--formula", formula, "--out", "c.json", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return rig("infer", "c.json", "readings.csv", "--out", "out.csv", "--json", cwd=tmp_path)

    fit.rows = lambda: list(csv.DictReader((tmp_path / "out.csv").read_text().splitlines()))
    return fit


def test_the_thermometer_of_graybill_and_iyer(fitted):
    """They print 103.995 and 103.4 to 104.6 for a reading of 104."""
    done = fitted(THERMOMETER, "read,who\n104,me\n")
    assert done.returncode == 0, done.stderr
    (row,) = fitted.rows()
    assert float(row["temp"]) == pytest.approx(103.995, abs=5e-4)
    assert round(float(row["temp_lo95"]), 1) == 103.4
    assert round(float(row["temp_hi95"]), 1) == 104.6
    assert row["flag"] == ""
    assert json.loads(done.stdout)["unused"]["columns"] == [{"column": "who", "why": "plays no part"}]


def test_columns_of_several_words_and_functions_of_them(fitted):
    """A flow meter with a kink, in names as spreadsheets have them; exact, so what is inferred is what was set."""
    flow = np.linspace(0.5, 10.0, 20)
    read = 1.0 + 2.0 * np.sqrt(flow) + 0.3 * np.maximum(flow - 5.0, 0.0) + 1e-7 * (-1.0) ** np.arange(20)
    table = '"Flow, set (l/min)",Meter `A` (mV)\n' + "".join(
        f"{x:.17g},{y:.17g}\n" for x, y in zip(flow, read, strict=True)
    )
    formula = "1 + sqrt(`Flow, set (l/min)`) + max(`Flow, set (l/min)` - 5, 0)"
    known = f"Meter `A` (mV)\n{1 + 2 * np.sqrt(3.0)}\n{1 + 2 * np.sqrt(8.0) + 0.9}\n"
    done = fitted(table, known, formula, "`Meter ``A`` (mV)`")
    assert done.returncode == 0, done.stderr
    inferred = [float(row["Flow, set (l/min)"]) for row in fitted.rows()]
    np.testing.assert_allclose(inferred, [3.0, 8.0], atol=1e-6)


def test_a_power_that_is_no_whole_number_is_read_back():
    x = np.linspace(1.0, 4.0, 9)
    made = curve(x, x**1.5 + 1e-6 * np.cos(9 * x), "1 + I(x^1.5)")
    again = CurveCalibration.from_dict(json.loads(json.dumps(made.to_dict())))
    np.testing.assert_array_equal(infer_curve(again, np.array([3.0])).value, infer_curve(made, np.array([3.0])).value)


def test_a_straight_line_is_fiellers():
    """Against the closed form, for rising and falling lines."""
    rng = np.random.default_rng(16)
    for slope in (2.0, -0.7):
        x = np.linspace(0.0, 10.0, 12)
        y = 3.0 + slope * x + rng.normal(0, 0.4, 12)
        found = infer_curve(curve(x, y, "1 + x"), np.array([3.0 + slope * 7.0]))
        b, a, *_ = stats.linregress(x, y)
        s2 = np.sum((y - a - b * x) ** 2) / 10
        t2, sxx, d = stats.t.ppf(0.975, 10) ** 2, np.sum((x - 5.0) ** 2), 3.0 + slope * 7.0 - y.mean()
        g = t2 * s2 / (b**2 * sxx)
        half = np.sqrt(t2 * s2 * ((1 - g) * (1 + 1 / 12) + d**2 / (b**2 * sxx))) / abs(b)
        assert found.value[0] == pytest.approx(5.0 + d / b, abs=1e-10)
        ends = 5.0 + (d / b - half) / (1 - g), 5.0 + (d / b + half) / (1 - g)
        assert (found.lo95[0], found.hi95[0]) == pytest.approx(ends, abs=1e-9)


def curve(x, y, formula):
    """A calibration without files, from the fit alone."""
    model = Formula.parse(formula)
    names, columns = model.columns({"x": x})
    fit = least_squares(columns, y, names)
    shape = fit.root @ fit.root.T
    return CurveCalibration(
        "y",
        model,
        fit.coefficients,
        fit.covariance,
        np.array([fit.sigma**2]),
        shape[None],
        np.array([[2 * fit.sigma**4 / fit.df]]),
        {"x": (float(x.min()), float(x.max()))},
    )


@pytest.mark.parametrize("formula", ["1 + x + x^2", "1 + log(x)"])
def test_a_curve_is_inverted_where_its_band_meets_the_reading(formula):
    """Against a bracketing search on the prediction band, and 95 % of intervals hold the truth."""
    rng, x = np.random.default_rng(5), np.linspace(1.0, 9.0, 10)

    def truth(v):
        return 1.0 + 2.0 * v + 0.1 * v**2 if "^" in formula else 1.0 + 4.0 * np.log(v)

    inside = []
    for _ in range(40):
        found = curve(x, truth(x) + rng.normal(0, 0.05, 10), formula)
        at = rng.uniform(1.5, 8.5, 50)
        answer = infer_curve(found, truth(at) + rng.normal(0, 0.05, 50))
        inside += list((answer.lo95 <= at) & (at <= answer.hi95))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)

    def edge(v, side):
        columns = found.formula.columns({"x": np.array([v])})[1]
        half = np.sqrt(found.variances[0] + columns @ found.covariance @ columns.T)[0, 0]
        df = 10 - columns.shape[1]
        return (columns @ found.coefficients)[0] + side * stats.t.ppf(0.975, df) * half - truth(4.0)

    one = infer_curve(found, np.array([truth(4.0)]))
    assert one.lo95[0] == pytest.approx(optimize.brentq(edge, 1.0, 9.0, args=(1,)), abs=1e-9)
    assert one.hi95[0] == pytest.approx(optimize.brentq(edge, 1.0, 9.0, args=(-1,)), abs=1e-9)


def test_whole_plots_are_in_the_interval(tmp_path):
    """The ends are where a reading of a new whole plot leaves the split-plot fit's own interval."""
    rng = np.random.default_rng(8)
    plots, x = np.repeat(np.arange(10), 4), np.tile([0.0, 1.0, 2.0, 3.0], 10)
    y = 1.0 + 5.0 * x + rng.normal(0, 0.3, 10)[plots] + rng.normal(0, 0.1, 40)
    lines = [f"{p},{v},{w}" for p, v, w in zip(plots, x, y.tolist(), strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["plot,x,y", *lines]) + "\n")
    kept = fit_general(FileSource(tmp_path / "t.csv").read, "y", "1 + x", ["plot"])["calibration"]
    found = infer_curve(CurveCalibration.from_dict(json.loads(json.dumps(kept))), np.array([6.0]))
    fit = fit_split_plot(np.column_stack([np.ones(40), x]), y, plots, ("1", "x"))
    ends = np.column_stack([np.ones(2), [found.lo95[0], found.hi95[0]]])
    half = fit.interval(ends, new_whole_plot=True, new_readings=1.0)
    assert fit.predict(ends) + half * [1, -1] == pytest.approx([6.0, 6.0], abs=1e-9)


def test_rows_that_cannot_be_inferred_say_why(fitted):
    done = fitted(THERMOMETER, "read\n104\n\n120\n60\n")
    assert done.returncode == 0, done.stderr
    assert [row["flag"] for row in fitted.rows()] == ["", *["temp is outside the calibrated 96 to 110"] * 2]
    done = fitted(THERMOMETER, "read,temp\n104,1\n,2\n")
    assert [row["flag"] for row in fitted.rows()] == ["", "no value of read"]
    assert [row["inferred_temp"][:3] for row in fitted.rows()] == ["103", ""]


def test_an_interval_without_an_end_is_open_and_flagged():
    """The slope is less than its own standard error: no x is far enough away."""
    x = np.arange(8.0)
    y = 0.02 * x + np.array([0.3, -0.4, 0.2, 0.1, -0.3, 0.4, -0.2, 0.1])
    found = infer_curve(curve(x, y, "1 + x"), np.array([0.1]))
    assert np.isnan(found.lo95[0]) or np.isnan(found.hi95[0])
    assert "the 95 % interval has no" in found.flag[0]


def test_nothing_is_looked_for_where_the_formula_has_no_value():
    """The logarithm ends just below the range; the reading is at its lowest value."""
    x = np.array([0.01, 0.1, 0.5, 1.0, 2.0, 4.0, 9.0])
    found = infer_curve(curve(x, np.log(x) + 0.01 * np.cos(50 * x), "1 + log(x)"), np.log([0.0102, 8.99]))
    assert found.value == pytest.approx([0.0102, 8.99], rel=0.02)
    assert (found.lo95 > 0).all()
    assert list(found.flag) == ["", ""]


@pytest.mark.parametrize(
    ("table", "formula", "message"),
    [
        ("x,y\n-2,4.1\n-1,1\n0,0.1\n1,0.9\n2,4\n", "1 + x + x^2", "does not rise or fall all the way from x = -2 to 2"),
        (
            "x,z,y\n1,1,1\n2,1,2\n3,2,3.1\n4,3,4\n5,1,5\n",
            "1 + x + z",
            "has none of the columns x, z: one reading of y determines",
        ),
        ("x,y\n1,1\n2,2.1\n", "1 + x", "its error is unknown"),
    ],
)
def test_what_cannot_be_inverted_is_refused(fitted, tmp_path, table, formula, message):
    done = fitted(table, "y\n1\n", formula, "y")
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert not (tmp_path / "out.csv").exists()


def test_as_many_rows_as_coefficients_have_no_error_and_say_so(tmp_path):
    (tmp_path / "two.csv").write_text("x,y\n1,1\n2,2.1\n")
    done = rig("fit", "two.csv", "--response", "y", "--formula", "1 + x", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["sigma_E"] is None
    assert [c["stderr"] for c in found["coefficients"].values()] == [None, None]
    assert "no error can be estimated" in found["notes"][0]
    done = rig("fit", "two.csv", "--response", "y", "--formula", "1 + x", cwd=tmp_path)
    assert "nan" not in done.stdout.lower()
    assert "no error can be estimated" in " ".join(done.stdout.split())


@pytest.fixture
def history(tmp_path):
    """Calibration files of four years of one load cell, whose offset rises by `drift` a year."""

    def files(drift, formula="1 + force_kN", years=(2023, 2024, 2025, 2026)):
        rng, force = np.random.default_rng(12), np.repeat([0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 3)
        for year in years:
            bridge = 0.1 + drift * (year - years[0]) + 0.2 * force + rng.normal(0, 0.002, len(force))
            lines = [f"{x},{y}" for x, y in zip(force, bridge.tolist(), strict=True)]
            (tmp_path / "t.csv").write_text("\n".join(["force_kN,bridge_mV", *lines]) + "\n")
            options = ("--response", "bridge_mV", "--formula", formula, "--out", f"{year}.json")
            done = rig("fit", "t.csv", *options, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
        return [f"{year}.json@{year}-06-01" for year in years]

    return files


def test_calibrations_of_a_table_are_charted(tmp_path, history):
    formula = "1 + force_kN + force_kN^2"
    files, options = history(0.02, formula), ("--today", "2026-07-01", "--report", "chart.html")
    done = rig("chart", *files, "--json", "--tolerance", "0.1", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    sensor = found["sensors"]["bridge_mV"]
    trends = [q["trend"] for q in sensor["quantities"].values()]
    assert len(trends) == formula.count("+") + 1
    for trend in trends:
        assert trend["per_year"] == pytest.approx(0.02, abs=4 * trend["stderr"])
        assert trend["stderr"] < 0.002
    first = sensor["calibrations"][0]["parameters"]
    assert first["force_kN"]["estimate"] == pytest.approx(0.2, abs=0.005)
    assert found["data"]["kind"] == "general"
    assert sensor["due"]["status"] == "due"
    assert any("mV/year" in text for text in sensor["sentences"])
    assert "bridge_mV at force_kN = " in (tmp_path / "chart.html").read_text()


def test_what_a_chart_of_tables_lacks_is_said(tmp_path, history):
    files = history(0.0)
    for given, message in (
        ([name.partition("@")[0] for name in files], "2023.json has no date of measurement: write 2023.json@"),
        (["t.csv@2023-01-01", files[0]], "rig fit t.csv --response Y"),
        ([files[0], "2023.json@2024-06-01"], "have the same data"),
    ):
        done = rig("chart", *given, cwd=tmp_path)
        assert done.returncode == 2
        assert message in " ".join(done.stderr.split())


@pytest.mark.parametrize("command", ["fit", "trace"])
def test_attitude_without_an_error_is_refused(tmp_path, command):
    """Three points for offset, sensitivity and misalignment: a trace had called "nan deg" nothing to add."""
    rows = [
        f"0,{i},{60 * i},{pitch},0,25,{2.5 * np.sin(np.radians(pitch)):.6f}" for i, pitch in enumerate((-50, 3, 40))
    ]
    header = "replicate,order,elapsed_s,pitch_deg,roll_deg,sensor_temperature_degC,x_V"
    (tmp_path / "t.csv").write_text("\n".join([header, *rows]) + "\n")
    done = rig(command, "t.csv", "--json", cwd=tmp_path)
    assert done.returncode == 2
    assert "nothing to estimate" in " ".join(done.stderr.split())
    assert "nan" not in done.stdout + done.stderr


def _offset_table(folder, offset, plots):
    """The same readings at an abscissa that is `offset` further on; whole plots of four rows if `plots`."""
    rng, u = np.random.default_rng(3), np.arange(24) / 32.0  # exact in doubles at every offset
    y = 2 + 3 * u + 0.5 * u * u + rng.normal(0, 0.01, 24)
    plot = np.arange(24) % 6
    y = y + (rng.normal(0, 0.03, 6)[plot] if plots else 0.0)
    lines = [f"{p},{x!r},{w!r}" for p, x, w in zip(plot, (u + offset).tolist(), y.tolist(), strict=True)]
    (folder / "t.csv").write_text("\n".join(["plot,x,y", *lines]) + "\n")
    return folder / "t.csv"


@pytest.mark.parametrize("plots", [(), ("plot",)], ids=["rows", "whole plots"])
def test_an_answer_does_not_depend_on_where_the_abscissa_starts(tmp_path, plots):
    """Years, hPa and kelvin lie far from zero for their width: the answer less the offset is that of offset 0."""
    found = {}
    for offset in (0, 100, 150, 2026, 5000):
        kept = fit_general(FileSource(_offset_table(tmp_path, offset, plots)).read, "y", "1 + x + x^2", plots)[
            "calibration"
        ]
        answer = infer_curve(CurveCalibration.from_dict(json.loads(json.dumps(kept))), np.array([2.6, 3.5]))
        assert list(answer.flag) == ["", ""]
        found[offset] = [answer.value - offset, answer.sd, answer.lo95 - offset, answer.hi95 - offset]
    for offset, numbers in found.items():
        np.testing.assert_allclose(numbers, found[0], rtol=1e-3, err_msg=f"offset {offset}")


@pytest.mark.parametrize("plots", [(), ("plot",)], ids=["rows", "whole plots"])
def test_a_chart_does_not_depend_on_where_the_abscissa_starts(tmp_path, plots):
    """The errors of the charted values and of a reading are those of offset 0; where digits are too few, refused."""

    def charted(offset, **change):
        kept = fit_general(FileSource(_offset_table(tmp_path, offset, plots)).read, "y", "1 + x + x^2", plots)[
            "calibration"
        ]
        return curve_charted([replace(CurveCalibration.from_dict(kept), **change)] * 3, np.arange(3.0))

    first, far = charted(0), charted(2026)
    for one, other in zip(first.series, far.series, strict=True):
        np.testing.assert_allclose(other.values, one.values, rtol=1e-6)
        np.testing.assert_allclose(other.variance, one.variance, rtol=1e-3)
        assert other.df == pytest.approx(one.df, rel=1e-3)
    assert far.interval == pytest.approx(first.interval, rel=1e-3)
    np.testing.assert_allclose(far.rows, first.rows, atol=1e-5)
    with pytest.raises(ValueError, match="too few digits"):
        charted(2026, factor=None)


def test_too_few_digits_are_refused_with_what_to_do(tmp_path):
    """A file of before without a factor, and an abscissa too far off for any: never an answer of rounding errors."""
    kept = fit_general(FileSource(_offset_table(tmp_path, 0, ())).read, "y", "1 + x + x^2")["calibration"]
    old = {name: value for name, value in kept.items() if name != "covariance_factor"}
    new, before = (infer_curve(CurveCalibration.from_dict(each), np.array([2.6])) for each in (kept, old))
    assert before.hi95[0] == pytest.approx(new.hi95[0], rel=1e-9)
    kept = fit_general(FileSource(_offset_table(tmp_path, 2026, ())).read, "y", "1 + x + x^2")["calibration"]
    del kept["covariance_factor"]
    with pytest.raises(ValueError, match=r"no covariance_factor rounding leaves too few digits.* subtract about 2026"):
        infer_curve(CurveCalibration.from_dict(kept), np.array([2.6]))
    kept = fit_general(FileSource(_offset_table(tmp_path, 1000000, ())).read, "y", "1 + x + x^2")["calibration"]
    with pytest.raises(ValueError, match="leaves too few digits of its interval; subtract about 1000000 from x"):
        infer_curve(CurveCalibration.from_dict(kept), np.array([2.6]))


@pytest.mark.parametrize("plots", [(), ("plot",)], ids=["rows", "whole plots"])
def test_scatter_that_grows_is_said_where_intervals_assume_one(tmp_path, plots):
    """In fit, calibration and answer; said of even scatter once in a hundred fits, as the level says."""

    def fit(seed, grows):
        rng = np.random.default_rng(seed)
        x, plot = rng.uniform(0.5, 10, 120), np.arange(120) % 10
        y = 2 + 3 * x + rng.normal(0, 0.05, 120) * (1 + grows * x) + rng.normal(0, 0.1, 10)[plot] * len(plots)
        rows = [f"{p},{a!r},{b!r}" for p, a, b in zip(plot, x.tolist(), y.tolist(), strict=True)]
        (tmp_path / "t.csv").write_text("\n".join(["plot,x,y", *rows]) + "\n")
        return fit_general(FileSource(tmp_path / "t.csv").read, "y", "1 + x", plots)

    result = fit(4, 1.0)
    (note,) = [each for each in result["notes"] if "scatter" in each]
    assert "intervals are too wide where x is low and too narrow where it is high" in note
    assert note in result["calibration"]["notes"]
    (tmp_path / "c.json").write_text(json.dumps(result))
    (tmp_path / "new.csv").write_text("y\n29\n")
    done = rig("infer", "c.json", "new.csv", "--out", "out.csv", "--json", cwd=tmp_path)
    assert note in json.loads(done.stdout)["notes"]
    said = sum(any("scatter" in each for each in fit(seed, 0.0)["notes"]) for seed in range(100, 140))
    assert said <= 2
