"""The largest reading error as it is in use: the in-flight zero's own error in it, and said with its uncertainty."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from command import rig

from proving.truth.whole_plot import SUBPLOT, Bench, simulate
from rig.procedures.pressure.fit import fit_pressure
from rig.tables import write_csv

AT = 0.12
BOTH = "in-flight zero + WLS"


def columns_of(data):
    return {
        "whole_plot": data.whole_plot,
        "order": data.order,
        "elapsed_s": data.elapsed_s,
        "pressure_psia": data.pressure_psia,
        "sensor_temperature_degC": data.sensor_temperature_degC,
        "sse_temperature_degC": data.sse_temperature_degC,
        "bridge_mV": next(iter(data.outputs.values())),
    }


def at_low(fit, method):
    use, pressure = fit.methods[method].in_use, fit.methods[method].reading_error.pressure_psia
    i = int(np.argmin(np.abs(pressure - AT)))
    return use.max_pct[i], use.half95_pct[i], use.chance_pct[i]


def fitted(data):
    return fit_pressure(data, data.transducers[0], growth=False)


def test_one_zero_reading_costs_about_six_percent():
    """The whole plots' variance ten times the readings': with one zero reading 6 % at 0.12 psia, not the fit's 3.9."""
    halves = [at_low(fitted(simulate(seed=seed)), "in-flight zero")[1] for seed in range(5)]
    assert np.mean(halves) == pytest.approx(196.0 * 2**0.5 * SUBPLOT / (2.0 * AT), rel=0.1)
    assert np.mean(halves) == pytest.approx(6.0, abs=0.5)


def test_readings_in_use_are_inside_their_interval():
    """New whole plots, each zeroed by one reading and read at 0.12 psia by the calibration of other ones."""
    rng = np.random.default_rng(1)
    inside = []
    for seed in range(8):
        data = simulate(seed=seed)
        fit = fitted(data)
        half = at_low(fit, BOTH)[1]
        method = fit.methods[BOTH]
        at = {"T_sensor": np.full(50, -90.0), "T_SSE": np.zeros(50)}
        model = [fit.formula.columns({**at, "P": np.full(50, p)})[1] @ method.coefficients for p in (AT, 0.01)]
        true = [0.3 + 2.0 * p - 1e-3 * p**2 for p in (AT, 0.01)]
        read = [t + SUBPLOT * rng.standard_normal(50) for t in true]
        error = (read[0] - read[1]) - (model[0] - model[1])
        inside.append(np.abs(error) / (2.0 * AT) * 100.0 < half)
    assert 0.91 < np.mean(inside) < 0.99  # of 400, of which 95 % are expected


@pytest.fixture(scope="module")
def one_low():
    """Whole plots whose lowest pressure is read once: weighted by 1/P^2 it decides its whole plot's intercept."""
    data = simulate(Bench(whole_plot=0.0155), seed=3)
    keep = np.ones(len(data), bool)
    for plot in data.whole_plots:
        keep[np.flatnonzero((data.whole_plot == plot) & (data.pressure_psia < 0.02))[1:]] = False
    pressure = np.where(data.pressure_psia < 0.02, 1e-3, data.pressure_psia)
    y = next(iter(data.outputs.values()))
    y = y - 2.0 * (data.pressure_psia - pressure)
    return replace(data, pressure_psia=pressure, outputs={"bridge_mV": y}).take(np.flatnonzero(keep))


def test_a_reading_that_decides_its_own_fit_is_no_reading_error(one_low):
    method = fitted(one_low).methods[BOTH]
    assert method.reading_error.max_pct[0] < 1e-2 * method.reading_error.width_pct[0]
    assert np.isnan(method.in_use.max_pct[0])
    assert method.in_use.half95_pct[0] > 100.0


def test_the_headline_does_not_flatter(one_low, tmp_path):
    write_csv(columns_of(one_low), tmp_path / "t.csv")
    done = rig("fit", tmp_path / "t.csv", "--formula", "full", "--report", tmp_path / "r.html")
    assert done.returncode == 0, done.stderr
    assert "largest reading error in use" in done.stdout
    assert re.search(r"^ +in-fl\S* .*\? +\d", done.stdout, re.MULTILINE)  # narrow columns shorten the method's name
    assert "±, the 95 % interval of one reading in use" in done.stdout
    assert "largest residual / %: no error in use" in done.stdout
    assert "Largest reading error in use at" in (tmp_path / "r.html").read_text()


def test_the_largest_error_has_its_uncertainty():
    """The largest of 20 normal errors lies between what its 2.5 % and 97.5 % quantiles say, 19 times of 20."""
    hits = []
    for seed in range(20):
        largest, _, (low, high) = at_low(fitted(simulate(seed=seed)), "GLS")
        hits.append(low < largest < high)
    assert sum(hits) >= 17
