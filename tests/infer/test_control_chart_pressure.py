"""Control charts of a pressure transducer over simulated calibrations."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy import stats

from proving.truth import attitude as attitude_truth
from proving.truth.pressure import HOMOSCEDASTIC, SENSOR_CENTRE_DEGC, SSE_CENTRE_DEGC, simulate
from rig.by_kind import fit_table
from rig.errors import UsageError
from rig.procedures.errors import DataError
from rig.procedures.pressure.charting import pressure_charted
from rig.procedures.pressure.fit import fit_pressure
from rig.tables import read_table, write_csv
from rig.verbs.chart.charted import chart_calibrations
from rig.verbs.chart.together import read_together

TODAY = datetime(2026, 2, 1, tzinfo=UTC)
PPM_PER_YEAR = -2000.0


def output_mV(pressure):
    return HOMOSCEDASTIC.output_mV(pressure, SENSOR_CENTRE_DEGC, SSE_CENTRE_DEGC)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Five calibrations, one a year, of a transducer that loses gain."""
    folder, named = tmp_path_factory.mktemp("transducer"), []
    for year in range(5):
        gain = HOMOSCEDASTIC.sensitivity_mV_per_psi * (1 + 1e-6 * PPM_PER_YEAR * year)
        data, _ = simulate(replace(HOMOSCEDASTIC, sensitivity_mV_per_psi=gain), 40 + year)
        columns = {
            name: getattr(data, name)
            for name in ("whole_plot", "order", "elapsed_s", "pressure_psia", "sensor_temperature_degC")
        }
        columns |= {"sse_temperature_degC": data.sse_temperature_degC, **data.outputs}
        write_csv(columns, folder / f"{year}.csv")
        named.append(f"{folder / f'{year}.csv'}@{2022 + year}-01-10")
    return named


def test_intercept_and_gain_are_those_at_the_centre_and_vary_as_they_say():
    fits = [fit_pressure(simulate(HOMOSCEDASTIC, seed)[0], "bridge_mV") for seed in range(60)]
    found = pressure_charted(fits, np.arange(60.0))
    truth = np.array([output_mV(0.0), (output_mV(5.0) - output_mV(0.0)) / 5.0])
    for i, series in enumerate(found.series):
        chi2 = np.sum((series.values - truth[i]) ** 2 / series.variance)
        assert 0.001 < stats.chi2.cdf(chi2, 60) < 0.999
        assert series.df > 60 * 10
    assert found.centre_degC == (SENSOR_CENTRE_DEGC, SSE_CENTRE_DEGC)
    assert found.output_rows() @ [0.0, found.sensitivity] == pytest.approx([0.0, found.highest_psia])


def test_a_loss_of_gain_is_found_and_dated(tables):
    charts = chart_calibrations(read_together(tables)[0], TODAY, tolerance=0.05)
    result = charts.to_json()["sensors"]["bridge_mV"]
    trend = result["quantities"]["gain_mV_per_psi"]["trend"]
    rate, half = (1e6 * trend[key] / HOMOSCEDASTIC.sensitivity_mV_per_psi for key in ("per_year", "half_width_95"))
    assert abs(rate - PPM_PER_YEAR) < half + 5.0  # ppm are of the mean gain, not of the first
    assert result["sentences"][0].startswith("bridge_mV: gain falls by ")
    # 2000 ppm a year at 5 psia are 0.01 psi a year: without any doubt it would take two and a half years, or five
    assert "2026-06-01" < charts.sensors["bridge_mV"].due(0.025)["date"] < "2028-07-01"
    assert "2028-01-01" < result["due"]["date"] < "2031-01-10"
    assert result["due"]["unit"] == "psi"
    beyond = charts.sensors["bridge_mV"].due(0.2)
    assert (beyond["date"], beyond["at_least"]) == ("2030-01-10", True), "four years of history, no further"


def test_what_goes_with_another_kind_is_refused(tables, tmp_path):
    with pytest.raises(DataError, match="--usage is a range of pitch"):
        chart_calibrations(read_together(tables[:2])[0], TODAY, usage_deg=30)
    table = read_table(type(tmp_path)(tables[0].partition("@")[0]))
    (tmp_path / "kept.json").write_text(json.dumps(fit_table(table).to_json()))
    with pytest.raises(DataError, match="give the run file or table instead"):
        read_together([f"{tmp_path / 'kept.json'}@2022-01-10", tables[1]])
    data, _ = attitude_truth.simulate(attitude_truth.Bench(), attitude_truth.D1(90, 5, 5), 1)
    names = ("replicate", "order", "elapsed_s", "pitch_deg", "roll_deg", "sensor_temperature_degC")
    write_csv({**{name: getattr(data, name) for name in names}, **data.outputs}, tmp_path / "angles.csv")
    angles = f"{tmp_path / 'angles.csv'}@2023-01-01"
    with pytest.raises(UsageError, match="they cannot be charted together"):
        read_together([tables[0], angles])
    with pytest.raises(DataError, match="--formula is for whole plots"):
        read_together([angles, tables[0]], "full")


def test_a_smaller_model_may_be_charted(tables):
    small = chart_calibrations(read_together(tables[:3], "1 + P + P^2 + T_sensor + P:T_sensor + P:T_SSE")[0], TODAY)
    assert small.sensors["bridge_mV"].model.count("+") == 5
    assert small.sensors["bridge_mV"].due(0.05)["unit"] == "psi"
