"""Standard models against printed tables: IEC 60751, ITS-90, NIST's thermocouple tables; and as commands use them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import rig

from rig.fitter.errors import FitError
from rig.fitter.nonlinear import Weighted, solve
from rig.procedures.errors import DataError
from rig.procedures.general.declared import Declared
from rig.procedures.general.fit import fit_general
from rig.procedures.general.infer import CurveCalibration, infer_curve
from rig.procedures.general.models import NamedCurve, standard_models
from rig.procedures.general.models.its90 import reference as reference_ratio
from rig.procedures.general.models.thermocouples import REFERENCE
from rig.procedures.general.models.thermocouples import reference as emf
from rig.tables import FileSource

MODELS = standard_models()
IEC = [100.0, 3.9083e-3, -5.775e-7, -4.183e-12]
FIXED_POINTS = {
    13.8033: 0.00119007,
    24.5561: 0.00844974,
    54.3584: 0.09171804,
    83.8058: 0.21585975,
    234.3156: 0.84414211,
    273.16: 1.00000000,
    302.9146: 1.11813889,
    429.7485: 1.60980185,
    505.078: 1.89279768,
    692.677: 2.56891730,
    933.473: 3.37600860,
    1234.93: 4.28642053,
}
"""ITS-90, table 1: temperature in kelvin of the fixed points and Wr."""
EMF_MV = {  # NIST Monograph 175 / IEC 60584-1, tables to 0.001 mV
    "K": {-200: -5.891, 0: 0.0, 100: 4.096, 500: 20.644, 1000: 41.276, 1372: 54.886},
    "J": {-210: -8.095, 0: 0.0, 100: 5.269, 760: 42.919, 1200: 69.553},
    "T": {-200: -5.603, 0: 0.0, 100: 4.279, 400: 20.872},
    "E": {-200: -8.825, 100: 6.319, 1000: 76.373},
    "N": {-200: -3.990, 600: 20.613, 1300: 47.513},
    "S": {-50: -0.236, 1000: 9.587, 1768: 18.693},
    "R": {-50: -0.226, 250: 1.923, 1000: 10.506, 1768: 21.101},
    "B": {0: 0.0, 250: 0.291, 700: 2.431, 1820: 13.820},
}


def test_platinum_of_iec_60751():
    """Table 1 of the standard, ohm at degC, to its printed digits."""
    curve = MODELS["callendar-van-dusen"].curve
    for t, printed in {-200: 18.52, -100: 60.26, 0: 100.0, 100: 138.51, 200: 175.86, 500: 280.98, 850: 390.48}.items():
        assert round(float(curve(IEC, np.array([float(t)]))[0]), 2) == printed
    assert round(float(curve(IEC, np.array([100.0]))[0]), 4) == 138.5055
    told = {one.name: one.of(IEC) for one in MODELS["callendar-van-dusen"].derived}
    assert round(told["alpha"], 8) == 3.85055e-3
    assert round(told["delta"], 3) == 1.500
    assert round(told["beta"], 4) == 0.1086


def test_reference_function_of_its_90():
    """Every digit that the scale's table of fixed points prints."""
    found = reference_ratio(np.array(list(FIXED_POINTS)) - 273.15)
    np.testing.assert_allclose(found, list(FIXED_POINTS.values()), atol=1.1e-8)
    assert np.isnan(reference_ratio(np.array([-260.0, 962.0]))).all()


CERTIFICATE = {
    "its90-al": (
        [-2.982376094442697e-4, -2.347216136920800e-5, 5.058518332814592e-6],
        {231.927: 1.8925127, 419.527: 2.5684113, 660.32: 3.3752260},
    ),
    "its90-hg-ga": ([-2.796694757957740e-4, -3.199472366290438e-4], {-38.8344: 0.8441779, 29.7646: 1.1181014}),
}
"""Sample certificate of a 25 ohm thermometer (Isothermal Technology, 2004): coefficients, and W as measured at degC."""


@pytest.mark.parametrize("name", CERTIFICATE)
def test_deviations_are_those_of_a_certificate_of_others(name):
    """Every digit of W from the coefficients, and the coefficients from W as far as its digits determine them."""
    coefficients, measured = CERTIFICATE[name]
    t = np.array(list(measured))
    W = MODELS[name].curve([1.0, *coefficients], t)
    assert [round(each, 7) for each in W.tolist()] == list(measured.values())
    rows = Weighted(
        NamedCurve(MODELS[name], "t"),
        {"t": np.append(t, 0.01)},
        np.append(list(measured.values()), 1.0),
        np.ones(len(t) + 1),
    )
    found = solve(rows, [1.0, *np.zeros(len(coefficients))]).fit.coefficients
    np.testing.assert_allclose(found[1:], coefficients, atol=1.5e-6)


@pytest.mark.parametrize("letter", EMF_MV)
def test_emf_of_thermocouples(letter):
    for t, printed in EMF_MV[letter].items():
        assert float(emf(letter, np.array([float(t)]))[0]) == pytest.approx(printed, abs=5.1e-4), t
    low, high = MODELS[f"thermocouple-{letter.lower()}"].valid
    assert np.isnan(emf(letter, np.array([low - 1.0, high + 1.0]))).all()


@pytest.mark.parametrize("letter", EMF_MV)
def test_pieces_of_thermocouples_meet(letter):
    """As far as the printed coefficients meet: NIST's functions are continuous to some nanovolts."""
    for join, _ in REFERENCE[letter][1][:-1]:
        below, above = emf(letter, np.array([join, np.nextafter(join, 1e4)]))
        assert below == pytest.approx(above, abs=2e-5)


def test_steinhart_and_hart_is_its_own_inverse():
    """1/T from the model's R, by the published equation, for the coefficients of a common 10 kohm thermistor."""
    a, b, c = 1.129241e-3, 2.341077e-4, 8.775468e-8
    t = np.linspace(-40.0, 120.0, 33)
    L = np.log(MODELS["steinhart-hart"].curve([a, b, c], t))
    np.testing.assert_allclose(1.0 / (a + b * L + c * L**3) - 273.15, t, atol=1e-9)
    at_25 = MODELS["steinhart-hart"].curve([a, b, c], np.array([25.0]))[0]
    assert at_25 == pytest.approx(1e4, rel=1e-5)


def test_water_boils_by_antoine():
    """lg p = 8.07131 - 1730.63 / (233.426 + t), p in mmHg: 760 mmHg at 100 degC."""
    A = 8.07131 + np.log10(101325.0 / 760.0)
    p = MODELS["antoine"].curve([A, 1730.63, 233.426], np.array([100.0]))
    assert float(p[0]) == pytest.approx(101325.0, rel=2e-4)


TRUTH = {
    "callendar": (IEC[:3], (0.0, 300.0)),
    "callendar-van-dusen": (IEC, (-150.0, 300.0)),
    "steinhart-hart": ([1.129241e-3, 2.341077e-4, 8.775468e-8], (0.0, 70.0)),
    "antoine": ([10.19621, 1730.63, 233.426], (20.0, 100.0)),
    "its90-ar": ([25.5, -1.2e-4, 2.3e-5], (-189.0, 0.01)),
    "its90-hg-ga": ([25.5, -1.2e-4, 2.3e-5], (-38.8, 29.7)),
    "its90-ga": ([25.5, -1.2e-4], (0.0, 29.7)),
    "its90-in": ([25.5, -1.2e-4], (0.0, 156.0)),
    "its90-sn": ([25.5, -1.2e-4, 3e-6], (0.0, 231.0)),
    "its90-zn": ([25.5, -1.2e-4, 3e-6], (0.0, 419.0)),
    "its90-al": ([25.5, -1.2e-4, 3e-6, 1e-6], (0.0, 660.0)),
    "load-cell-line": ([0.2], (1.0, 10.0)),
    "load-cell-square": ([0.2, 1e-5], (1.0, 10.0)),
    "load-cell-cubic": ([0.2, 1e-5, -2e-7], (1.0, 10.0)),
    "load-cell-cubic-zero": ([0.01, 0.2, 1e-5, -2e-7], (0.0, 10.0)),
}


def truth_of(name):
    if name in TRUTH:
        return TRUTH[name]
    low, high = MODELS[name].valid
    return [2e-3, 1e-5, -2e-8, 3e-12][: len(MODELS[name].parameters)], (max(low, 100.0), high * 0.9)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_finds_its_own_parameters_and_inverts(name):
    """From exact readings, without start values; slopes against differences; a word for everything."""
    model = MODELS[name]
    b, (low, high) = truth_of(name)
    x = np.linspace(low, high, 3 * len(b) + 4)
    curve = NamedCurve(model, "x")
    y = curve.value(np.array(b), {"x": x})
    fit = solve(Weighted(curve, {"x": x}, y, np.full(len(x), 1.0 / np.ptp(y))), curve.start(x, y)).fit
    np.testing.assert_allclose(fit.coefficients, b, rtol=2e-4)
    step = 1e-4 * (high - low)
    middle = x[1:-1]
    differences = [curve.value(np.array(b), {"x": middle + s * step}) for s in (1, -1)]
    slope = curve.slope(np.array(b), {"x": middle}, "x")
    np.testing.assert_allclose(slope, (differences[0] - differences[1]) / (2 * step), rtol=3e-3)
    assert model.title
    assert model.source
    assert all(one.meaning for one in (*model.parameters, *model.derived))


def prt(folder, unit="degC", ohm="ohm", noise=1e-4):
    rng = np.random.default_rng(7)
    t = np.repeat([-80.0, -40.0, 0.0, 60.0, 120.0, 200.0], 3)
    R = MODELS["callendar-van-dusen"].curve([100.02, 3.909e-3, -5.78e-7, -4.2e-12], t) + rng.normal(0, noise, len(t))
    x = t + 273.15 if unit == "K" else t
    y = R / 1000.0 if ohm == "kohm" else R
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    (folder / "prt.csv").write_text(f"t_{unit},R_{ohm}\n{rows}")
    return folder / "prt.csv"


@pytest.mark.parametrize(("unit", "ohm"), [("degC", "ohm"), ("K", "ohm"), ("degC", "kohm")])
def test_a_platinum_thermometer_from_its_table_to_its_temperature(tmp_path, unit, ohm):
    path = prt(tmp_path, unit, ohm)
    options = ("--response", f"R_{ohm}", "--model", "callendar-van-dusen", "--abscissa", f"t_{unit}")
    done = rig("fit", path, *options, "--out", "c.json", "--json", "--tolerance", "0.01", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    for name, value in zip(("R0", "A", "B", "C"), (100.02, 3.909e-3, -5.78e-7, -4.2e-12), strict=True):
        one = found["coefficients"][name]
        assert one["estimate"] == pytest.approx(value, abs=4 * one["stderr"])
    assert found["derived"]["alpha"]["estimate"] == pytest.approx(
        3.909e-3 - 5.78e-5, abs=4 * found["derived"]["alpha"]["stderr"]
    )
    assert found["acceptance"]["inside"] is True
    assert found["model"]["source"].startswith("IEC 60751")
    factor = 1e-3 if ohm == "kohm" else 1.0
    read = MODELS["callendar-van-dusen"].curve([100.02, 3.909e-3, -5.78e-7, -4.2e-12], np.array([85.0]))[0] * factor
    (tmp_path / "use.csv").write_text(f"R_{ohm}\n{read}\n")
    done = rig("infer", "c.json", "use.csv", "--out", "o.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    cells = (tmp_path / "o.csv").read_text().splitlines()[1].split(",")
    assert float(cells[1]) == pytest.approx(85.0 + 273.15 * (unit == "K"), abs=1e-3)


def test_a_tolerance_that_is_not_kept_ends_with_three(tmp_path):
    options = ("--response", "R_ohm", "--model", "callendar-van-dusen", "--tolerance", "1e-4")
    done = rig("fit", prt(tmp_path), *options, cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert "OUTSIDE" in done.stdout


@pytest.mark.parametrize(
    ("rows", "options", "message"),
    [
        (
            "t_degC,R_ohm\n0,100\n50,119.4\n100,138.5\n150,157.3\n200,175.8\n",
            ("callendar-van-dusen",),
            "--model callendar",
        ),
        ("t_degC,z_degC,R_ohm\n0,1,100\n50,2,119\n", ("callendar",), "--abscissa says"),
        (
            "t_degC,R_mV\n0,100\n50,119.4\n100,138.5\n150,157.3\n",
            ("callendar",),
            "R_mV is in mV, and this model needs ohm",
        ),
        ("t_degC,R_ohm\n0,100\n50,119\n", ("callendar", "--start", "Z=1"), "callendar has no Z; it has R0, A, B"),
        ("t_degC,R_ohm\n0,100\n50,119\n", ("callendar",), "2 rows cannot determine 3 parameters"),
        ("t_degC,E_mV\n0,0\n500,20.6\n2000,60\n1500,50\n", ("thermocouple-k",), "no start values|not a finite"),
    ],
)
def test_what_does_not_go_with_a_model_is_refused(tmp_path, rows, options, message):
    (tmp_path / "t.csv").write_text(rows)
    response = rows.splitlines()[0].split(",")[-1]
    done = rig("fit", "t.csv", "--response", response, "--model", *options, "--out", "c.json", cwd=tmp_path)
    assert done.returncode == 2, done.stdout
    assert any(part in " ".join(done.stderr.split()) for part in message.split("|")), done.stderr
    assert not (tmp_path / "c.json").exists()


def test_rows_beyond_the_validity_of_an_equation_are_counted(tmp_path):
    rows = "".join(
        f"{t},{100.0 * (1 + 3.9083e-3 * t - 5.775e-7 * t * t) + 1e-3 * (-1) ** i}\n"
        for i, t in enumerate(range(0, 960, 80))
    )
    (tmp_path / "t.csv").write_text(f"t_degC,R_ohm\n{rows}")
    found = fit_general(FileSource(tmp_path / "t.csv").read, "R_ohm", declared=Declared(model="callendar"))
    assert any("1 rows are outside 0 to 850 degC" in note for note in found["notes"])


def test_a_calibration_of_an_unknown_model_is_refused(tmp_path):
    kept = fit_general(FileSource(prt(tmp_path)).read, "R_ohm", declared=Declared(model="callendar-van-dusen"))[
        "calibration"
    ]
    again = CurveCalibration.from_dict(json.loads(json.dumps(kept)))
    assert infer_curve(again, np.array([100.02])).value[0] == pytest.approx(0.0, abs=1e-3)
    with pytest.raises(FitError, match="parameters of callendar-van-dusen"):
        CurveCalibration.from_dict({**kept, "parameters": ["R0"]})


def test_two_models_are_not_declared_at_once():
    with pytest.raises(DataError, match="one model each"):
        Declared("1 + x", model="callendar")


def test_a_thermocouple_of_another_unit_and_its_deviation(tmp_path):
    """Volts in the file; a deviation of a tenth of a percent is found again."""
    t = np.linspace(50.0, 900.0, 18)
    volts = (emf("K", t) + 1e-3 + 4e-5 * t) * 1e-3 + 1e-8 * np.cos(9 * t)
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(t.tolist(), volts.tolist(), strict=True))
    (tmp_path / "t.csv").write_text(f"t_degC,E_V\n{rows}")
    found = fit_general(FileSource(tmp_path / "t.csv").read, "E_V", declared=Declared(model="thermocouple-k-1"))
    assert found["coefficients"]["d1"]["estimate"] == pytest.approx(4e-5, rel=1e-3)
    answer = infer_curve(CurveCalibration.from_dict(found["calibration"]), volts[3:5])
    np.testing.assert_allclose(answer.value, t[3:5], atol=1e-3)


def test_calibrations_of_a_standard_model_are_charted(tmp_path):
    for year in (2023, 2024, 2025, 2026):
        rng = np.random.default_rng(year)
        t = np.repeat([0.0, 50.0, 100.0, 150.0], 3)
        R = MODELS["callendar"].curve([100.0 + 2e-3 * (year - 2023), *IEC[1:3]], t) + rng.normal(0, 1e-4, len(t))
        rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(t.tolist(), R.tolist(), strict=True))
        (tmp_path / "t.csv").write_text(f"t_degC,R_ohm\n{rows}")
        options = ("--response", "R_ohm", "--model", "callendar", "--out", f"{year}.json")
        assert rig("fit", "t.csv", *options, cwd=tmp_path).returncode == 0
        # a run of two sensors keeps its calibrations by sensor
        one = json.loads((tmp_path / f"{year}.json").read_text())
        two = {**one, "response": "S_ohm", "calibration": {**one["calibration"], "response": "S_ohm"}}
        kept = {"data": one["data"], "unused": one["unused"], "sensors": {"R_ohm": one, "S_ohm": two}}
        (tmp_path / f"{year}.json").write_text(json.dumps(kept))
    files = [f"{year}.json@{year}-06-01" for year in (2023, 2024, 2025, 2026)]
    done = rig("chart", *files, "--json", "--today", "2026-07-01", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    sensors = json.loads(done.stdout)["sensors"]
    assert set(sensors) == {"R_ohm", "S_ohm"}
    sensor = sensors["R_ohm"]
    assert len(sensor["quantities"]) == 3
    for t, one in zip((25.0, 75.0, 125.0), sensor["quantities"].values(), strict=True):
        per_year = MODELS["callendar"].curve([2e-3, *IEC[1:3]], np.array([t]))[0]
        assert one["trend"]["per_year"] == pytest.approx(per_year, rel=0.1)
    assert set(sensor["calibrations"][0]["parameters"]) == {"R0", "A", "B"}


def test_a_unit_that_a_name_does_not_tell_is_said_to_be_assumed(tmp_path):
    path = prt(tmp_path)
    path.write_text(path.read_text().replace("t_degC,R_ohm", "set,read"))
    declared = Declared(model="callendar-van-dusen")
    found = fit_general(FileSource(path).read, "read", declared=declared)
    assert "the unit of set is not known from its name: it is taken for degC" in found["notes"]
    assert "the unit of read is not known from its name: it is taken for ohm" in found["calibration"]["notes"]
