"""Data rounded to their resolution: recognised, and no reason to call a reading an outlier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench
from proving.truth.attitude import simulate as attitude
from proving.truth.whole_plot import simulate as whole_plots
from rig.fitter.resolution import least_sd, resolution, robust_sd
from rig.fitter.trace.engine.robust import excess, scale
from rig.procedures.attitude.trace.noise import alone
from rig.procedures.general.column_roles import Roles
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.general.gross import of_table
from rig.procedures.pressure.fit import named_formula
from rig.tables import FileSource, write_csv

SDS = (0.3, 0.5, 1.0)
"""Of the noise, in steps of the resolution."""


@pytest.mark.parametrize(
    ("values", "step"),
    [
        ([0.01, 0.03, 0.17], 0.02),
        ([1.25, 1.5, 3.0], 0.25),
        ([1e-6, 3e-6, 4e-6], 1e-6),
        ([21.0, 21.5, 22.0, 21.5, 21.0], 0.5),
        ([-300.0, 500.0, 1200.0], 100.0),
    ],
)
def test_decimal_steps(values, step):
    assert resolution(np.array(values)) == pytest.approx(step, rel=1e-9)


def test_the_step_of_a_converter_is_seen_where_values_repeat():
    lsb = 10.0 / 2**15
    counts = np.random.default_rng(1).integers(-8, 9, 200)
    assert resolution(counts * lsb) == pytest.approx(lsb, rel=1e-9)
    assert resolution(np.round(counts * lsb, 6)) == pytest.approx(lsb, abs=1.1e-6)


def test_unrounded_values_have_none():
    assert resolution(np.random.default_rng(2).standard_normal(50)) < 1e-12
    assert resolution(np.full(5, 2.0)) == 0.0


@pytest.mark.parametrize("sd", SDS)
@pytest.mark.parametrize("inside", [0.5, 0.95])
def test_the_sd_of_rounded_normals(sd, inside):
    """At most 30 % too small; two fifths too large at worst, for sd 0.3 half a step off the lattice."""
    rng = np.random.default_rng(3)
    for offset in (0.0, 0.25, 0.5):
        y = np.round(offset + sd * rng.standard_normal(20_000))
        found = robust_sd(y - y.mean(), 1.0, inside)
        assert found >= least_sd(1.0) * 0.999
        assert 0.7 * y.std() < found < 1.4 * y.std()


def test_without_a_step_it_is_the_median_absolute_deviation():
    e = np.random.default_rng(4).standard_normal(999)
    assert robust_sd(e) == pytest.approx(1.4826 * np.median(np.abs(e)), rel=1e-4)


@pytest.mark.parametrize("sd", SDS)
def test_rounded_rows_do_not_stand_alone(sd):
    """Beyond 4.5 (1 + 8/60) sd normal errors of 100 tables have 0.002 rows."""
    for seed in range(100):
        rng = np.random.default_rng([seed, int(10 * sd)])
        y = np.round(rng.uniform() + sd * rng.standard_normal(60))
        assert not np.any(excess(y - y.mean(), ordered=bool(seed % 2), step=resolution(y)))


def test_a_reading_that_is_off_still_stands_alone():
    y = np.round(0.5 * np.random.default_rng(5).standard_normal(60))
    y[17] += 8.0
    left = y - y.mean()
    assert np.flatnonzero(excess(left, ordered=False, step=resolution(y))).tolist() == [17]
    assert scale(left, 1.0) == pytest.approx(0.55, abs=0.15)
    assert of_table(y, np.ones((60, 1))).rows.tolist() == [17]


@pytest.mark.parametrize("sd", SDS)
def test_the_trace_of_a_rounded_table_finds_no_outliers(tmp_path, sd):
    rng = np.random.default_rng([int(10 * sd), 6])
    write_csv({"x": np.tile(np.arange(10.0), 6), "y": np.round(4.0 + sd * rng.standard_normal(60))}, tmp_path / "t.csv")
    traced = trace_general_table(FileSource(tmp_path / "t.csv").read, Roles("y", "1")).to_json()
    assert {e["effect"] for e in traced["sensors"]["y"]["effects"]} <= {"quantisation"}  # which is what happened


@pytest.mark.parametrize("sd", SDS)
def test_no_gross_errors_in_rounded_tables_of_any_kind(sd):
    rng = np.random.default_rng(7)
    for _ in range(10):
        y = np.round(rng.uniform() + sd * rng.standard_normal(60))
        assert not of_table(y, np.ones((60, 1))).rows.size


@pytest.mark.parametrize("sd", SDS)
def test_rounded_readings_of_attitude_are_no_outliers(sd):
    data = attitude(Bench(), D1(180, 9, 9), 8)[0]
    step = np.radians(1.5e-4) * 5.0 / sd
    rounded = {name: np.round(y / step) * step for name, y in data.outputs.items()}
    clean = attitude(Bench(sigma_deg=1e-12), D1(180, 9, 9), 8)[0]
    data = replace(data, outputs=rounded)
    residual = np.stack([data.outputs[name] - clean.outputs[name] for name in data.outputs])
    assert not np.any(alone(data, residual))


@pytest.mark.parametrize("sd", SDS)
def test_rounded_readings_of_whole_plots_are_no_outliers(sd):
    from rig.procedures.pressure.gross import of_whole_plots  # noqa: PLC0415
    from rig.procedures.pressure.trace.run import trace_whole_plots  # noqa: PLC0415

    data = whole_plots(seed=9)
    step = 0.0049 / sd
    data = replace(data, outputs={name: np.round(y / step) * step for name, y in data.outputs.items()})
    found = trace_whole_plots(data, validate=False)
    assert not any(e.effect == "outliers" for sensor in found.sensors.values() for e in sensor.effects)
    assert not any(g.rows.size for g in of_whole_plots(data, named_formula("full", ())).values())
