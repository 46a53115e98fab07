"""Pressure inferred from a transducer's output: inversion, intervals, flags."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from proving.statistics.pressure import coverage
from proving.truth.pressure import GROWING, HOMOSCEDASTIC, simulate
from rig.fitter.formula import Formula
from rig.procedures.pressure.fit import PressureCalibration, fit_pressure
from rig.procedures.pressure.infer import Zero, infer_pressure
from rig.procedures.pressure.infer.in_flight import NO_ROOT

DATA, _ = simulate(HOMOSCEDASTIC, 3)
FIT = fit_pressure(DATA, "bridge_mV", growth=False)
CALIBRATION = FIT.calibration()


def model(pressure, sensor, sse, calibration=CALIBRATION):
    table = {name: np.array([v]) for name, v in zip(("P", "T_sensor", "T_SSE"), (pressure, sensor, sse), strict=True)}
    return float(calibration.formula.columns(table)[1][0] @ calibration.coefficients)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 5.0), st.floats(-130, -50), st.floats(-40, 40))
def test_inversion_is_exact(pressure, sensor, sse):
    found = infer_pressure(CALIBRATION, model(pressure, sensor, sse), sensor, sse)
    assert found.flag[0] == ""
    assert found.pressure_psia[0] == pytest.approx(pressure, abs=1e-9)
    assert found.lo95_psia[0] < pressure < found.hi95_psia[0]


def test_inversion_of_other_shapes():
    """Any formula that has a value at zero pressure; against a bracketing search."""
    fit = fit_pressure(DATA, "bridge_mV", "full", extra=("P^3", "I(P / (P + 0.3))"))
    calibration = fit.calibration("in-flight zero + WLS")
    output = np.linspace(model(0.02, -100, 5, calibration), model(4.9, -100, 5, calibration), 9)
    expected = [optimize.brentq(lambda p, v=v: model(p, -100, 5, calibration) - v, 0.0, 5.05) for v in output]
    found = infer_pressure(calibration, output, -100, 5).pressure_psia
    np.testing.assert_allclose(found, expected, atol=1e-8)


@settings(max_examples=30, deadline=None)
@given(st.floats(-1.0, 1.0), st.sampled_from(["GLS", "in-flight zero", "WLS", "in-flight zero + WLS"]))
def test_the_whole_plots_error_cancels_exactly(error, method):
    calibration = FIT.calibration(method)
    clean = HOMOSCEDASTIC.output_mV(np.array([0.0, 0.12, 1.0, 4.0]), -70.0, 20.0)
    found = [infer_pressure(calibration, v[1:], -70.0, 20.0, Zero(v[0], -70.0, 20.0)) for v in (clean, clean + error)]
    np.testing.assert_allclose(found[1].pressure_psia, found[0].pressure_psia, atol=1e-9)
    np.testing.assert_allclose(found[0].pressure_psia, [0.12, 1.0, 4.0], atol=0.01)


def test_intervals_are_those_of_the_split_plot_fit():
    """The difference of a reading and the mean of r zeros, straight from the REML fit's own intervals."""
    at = {"P": np.array([0.12, 3.0]), "T_sensor": np.full(2, -110.0), "T_SSE": np.full(2, 15.0)}
    output = np.array([model(p, -110.0, 15.0) for p in at["P"]])
    slope = FIT.formula.derivative(at, "P") @ CALIBRATION.coefficients
    row = FIT.formula.columns(at)[1]
    row_0 = FIT.formula.columns(at | {"P": np.zeros(2)})[1]
    for zero, half in [
        (None, FIT.reml.interval(row, new_whole_plot=True, new_readings=1.0)),
        (Zero(model(0, -110, 15), -110, 15), FIT.reml.interval(row - row_0, new_readings=2.0)),
        (Zero(model(0, -110, 15), -110, 15, readings=4), FIT.reml.interval(row - row_0, new_readings=1.25)),
    ]:
        found = infer_pressure(CALIBRATION, output, -110.0, 15.0, zero)
        np.testing.assert_allclose(found.hi95_psia - found.pressure_psia, half / slope, rtol=1e-6)
        np.testing.assert_allclose(found.pressure_psia - found.lo95_psia, half / slope, rtol=1e-6)
        t = stats.t.ppf(0.975, found.df)
        np.testing.assert_allclose(found.hi95_psia - found.pressure_psia, t * found.sd_psia, rtol=1e-9)


def test_one_zero_costs_what_it_should():
    """6 % (2 sd) at 0.12 psia with one zero reading, where in-flight zero alone would promise 3.9."""
    outputs = HOMOSCEDASTIC.output_mV(np.array([0.0, 0.12]), -90.0, 0.0)
    true = {"subplot_variance": HOMOSCEDASTIC.subplot_mV**2, "wholeplot_variance": HOMOSCEDASTIC.wholeplot_mV**2}
    calibration = replace(CALIBRATION, errors=replace(CALIBRATION.errors, **true))
    two_sd_pct = [
        200 * infer_pressure(calibration, outputs[1:], -90.0, 0.0, zero).sd_psia[0] / 0.12
        for zero in (None, Zero(outputs[0], -90.0, 0.0), Zero(outputs[0], -90.0, 0.0, readings=1000))
    ]
    # of the errors alone: 2 sqrt(0.01433^2 + 0.00453^2) / (2 * 0.12), sqrt(2) and 1 times 2 * 0.00453 / (2 * 0.12)
    np.testing.assert_allclose(two_sd_pct[1:], [5.3, 3.8], rtol=0.02)
    assert 12.5 < two_sd_pct[0] < 15.0  # and the model's own error, which shows only here


def test_what_cannot_be_inferred_says_why():
    output = np.array([2.0, 2.0, 2.0, np.nan, 400.0, -3.0, 12.5])
    sensor = np.array([-90.0, -140.0, -90.0, -90.0, -90.0, -90.0, -90.0])
    sse = np.array([0.0, 0.0, 55.0, 0.0, 0.0, 0.0, np.nan])
    found = infer_pressure(CALIBRATION, output, sensor, sse)
    assert found.flag[0] == ""
    assert found.flag[1] == "sensor temperature is outside the calibrated -130 to -50 degC"
    assert found.flag[2] == "SSE temperature is outside the calibrated -40 to 40 degC"
    assert found.flag[3] == "not a finite number"
    assert found.flag[4] in (NO_ROOT, "pressure is outside the calibrated 0.01 to 5 psia")
    assert found.flag[5] == "pressure is outside the calibrated 0.01 to 5 psia"
    assert found.flag[6].startswith("SSE temperature is outside")
    for values in (found.pressure_psia, found.sd_psia, found.lo95_psia, found.hi95_psia):
        np.testing.assert_array_equal(np.isnan(values), found.flag != "")


def test_temperatures_outside_the_calibrated_are_flagged_though_the_formula_has_none():
    """A calibration at one pair of temperatures says nothing of readings at another: their intervals would be short."""
    table = DATA.table
    formula = Formula.parse("1 + P + P^2")
    at = {"P": (0.0, 5.0), "T_sensor": (-90.0, -89.8), "T_SSE": (20.0, 20.0)}
    k = len(formula.columns({name: values[:1] for name, values in table.items()})[0])
    alone = replace(
        CALIBRATION,
        formula=formula,
        coefficients=np.array([0.1, 2.0, 0.01]),
        covariance=1e-8 * np.eye(k),
        derivatives=CALIBRATION.derivatives[:, :k, :k],
        ranges=at,
    )
    sensor, sse = np.array([-90.5, -89.0, -88.7, -90.0, np.nan]), np.array([20.9, 20.0, 20.0, 22.0, 20.0])
    found = infer_pressure(alone, np.full(5, 2.0), sensor, sse)
    assert list(found.flag[:2]) == ["", ""]
    assert found.flag[2] == "sensor temperature is outside the calibrated -90 to -89.8 degC"
    assert found.flag[3] == "SSE temperature is outside the calibrated 20 to 20 degC"
    assert found.flag[4].startswith("sensor temperature is outside")
    with pytest.raises(ValueError, match="the zero was read where the SSE temperature is outside"):
        infer_pressure(alone, np.full(1, 2.0), -90.0, 20.0, Zero(0.1, -90.0, 40.0))


def test_no_pressure_gives_more_than_the_model_can():
    bent = replace(
        CALIBRATION,
        coefficients=np.array(
            [
                -0.2 if str(t) == "P^2" else b
                for t, b in zip(CALIBRATION.formula.terms, CALIBRATION.coefficients, strict=True)
            ]
        ),
    )
    top = max(model(p, -90.0, 0.0, bent) for p in np.linspace(0, 9, 500))
    found = infer_pressure(bent, [top - 0.01, top + 0.2, model(3.0, -90.0, 0.0, bent)], -90.0, 0.0)
    assert found.flag[1] == NO_ROOT
    assert found.pressure_psia[2] == pytest.approx(3.0)


def test_vacuum_itself_is_within_reach_and_a_strange_zero_is_not():
    found = infer_pressure(CALIBRATION, model(0.0, -90.0, 0.0), -90.0, 0.0)
    assert found.flag[0] == ""
    assert found.pressure_psia[0] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match="the zero was read where the sensor temperature is outside"):
        infer_pressure(CALIBRATION, 2.0, -90.0, 0.0, Zero(0.3, 20.0, 0.0))
    with pytest.raises(ValueError, match="not a finite number"):
        Zero(float("nan"), -90.0, 0.0)
    with pytest.raises(ValueError, match="mean of 0 readings"):
        Zero(0.3, -90.0, 0.0, readings=0)


def test_a_zero_at_another_temperature_pays_for_the_difference():
    outputs = HOMOSCEDASTIC.output_mV(np.zeros(2), np.array([-90.0, -120.0]), 0.0)
    v = HOMOSCEDASTIC.output_mV(0.5, -90.0, 0.0)
    near, far = (
        infer_pressure(CALIBRATION, v, -90.0, 0.0, Zero(z, t, 0.0))
        for z, t in zip(outputs, (-90.0, -120.0), strict=True)
    )
    assert near.pressure_psia[0] == pytest.approx(0.5, abs=0.01)
    assert far.pressure_psia[0] == pytest.approx(0.5, abs=0.03)
    assert far.sd_psia[0] > 1.3 * near.sd_psia[0]


def test_json_there_and_back():
    grown = fit_pressure(simulate(GROWING, 1)[0], "bridge_mV", "hierarchical").calibration("in-flight zero + WLS")
    back = PressureCalibration.from_dict(json.loads(json.dumps(grown.to_dict(), allow_nan=False)))
    zero = Zero(0.35, -90.0, 0.0)
    here, there = (infer_pressure(c, [0.6, 2.3], -90.0, 0.0, zero) for c in (grown, back))
    for name in ("pressure_psia", "sd_psia", "lo95_psia", "hi95_psia"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    with pytest.raises(ValueError, match="kind is 'attitude'"):
        PressureCalibration.from_dict({"kind": "attitude"})
    with pytest.raises(ValueError, match="lacks or garbles 'errors'"):
        PressureCalibration.from_dict({k: v for k, v in grown.to_dict().items() if k != "errors"})
    with pytest.raises(ValueError, match="has numbers for"):
        PressureCalibration.from_dict(grown.to_dict() | {"coefficients": [1.0]})


@pytest.mark.parametrize(
    ("formula", "method", "message"),
    [
        ("P + I(elapsed_s)", "GLS", "the model needs elapsed_s; in flight"),
        ("1 + T_sensor", "GLS", "no pressure in it"),
        ("P + log(P)", "GLS", "no value at zero pressure"),
        ("full", "least squares", "no method 'least squares', only GLS"),
    ],
)
def test_calibrations_that_cannot_fly(formula, method, message):
    with pytest.raises(ValueError, match=message):
        fit_pressure(DATA, "bridge_mV", formula).calibration(method)


@pytest.mark.parametrize(
    ("truth", "method"), [(HOMOSCEDASTIC, "GLS"), (GROWING, "in-flight zero + WLS")], ids=["even", "growing"]
)
def test_coverage(truth, method):
    """A bounded share of proving/statistics/pressure.py coverage, which counts 10,000 calibrations a cell."""
    runs = 30
    held = [coverage(truth, method, seed) for seed in range(runs)]
    low, high = stats.binom.ppf([1e-4, 1 - 1e-4], runs, 0.95)
    for interval in held[0]:
        count = sum(one[interval] for one in held)
        assert low <= count <= high, interval
