"""Fine periods over a variable, and what comes again after so many rows: found, and not where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from proving.truth.attitude import Bench, Plan, simulate
from rig.fitter.trace.fine_periods import fine_period
from rig.fitter.trace.flexible import remainders
from rig.procedures.attitude.trace import trace as trace_of_sensors
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table


def trace(columns):
    table = Table("table.csv", columns, simulated=True, provenance={})
    return trace_general(roles_of(table, Roles(response="y", formula="1 + x", time="t_s"))[0])


def readings(n, x, error):
    return {"x": x, "t_s": 60.0 * np.arange(n), "y": 3.0 + 2.0 * x + error}


def test_p_is_that_of_chance():
    """200 residuals of noise over values of their own: 5 % below 0.05, within three standard deviations of counting."""
    ps = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        y, x = rng.standard_normal(100), rng.uniform(0.0, 10.0, 100)
        y -= y.mean()

        def ask(block, y=y):
            return next(iter(remainders(y, 99, [block], lambda columns: columns - columns.mean(axis=0))), None)

        ps.append(fine_period(y, x, "x", ask).p)
    assert np.sum(np.array(ps) < 0.05) <= 10 + 3 * np.sqrt(10)
    assert np.sum(np.array(ps) < 1e-3) <= 2


def test_lines_of_an_encoder_are_found():
    """20 um over 10 mm: five hundred periods, two readings in three of them apart."""
    rng = np.random.default_rng(4)
    x = np.round(rng.uniform(0.0, 10.0, 160), 4)
    error = 1.2 * np.sin(2.0 * np.pi * x / 0.02 + 0.4) + rng.standard_normal(160)
    result = trace(readings(160, x, error))
    (found,) = result.unnamed
    assert found.cause.startswith("over x: periodic, one period in ")
    assert float(found.cause.split()[-1]) == pytest.approx(0.02, rel=2e-4)
    assert found.shape is not None
    assert result.verdict == "unexplained"


@pytest.mark.parametrize("values", [np.linspace(0.0, 10.0, 21), np.arange(0.0, 10.0, 0.5) + 0.001])
def test_a_grid_tells_no_fine_period(values):
    rng = np.random.default_rng(5)
    x = rng.choice(values, 200)
    assert fine_period(rng.standard_normal(200), x, "x", lambda _block: None) is None


def test_a_coarse_display_is_no_period_of_the_setting():
    """A reading rounded to ten times its noise errs as a saw tooth over the setting: it is said to be rounded."""
    rng = np.random.default_rng(6)
    x = rng.uniform(0.0, 10.0, 150)
    columns = readings(150, x, 0.005 * rng.standard_normal(150))
    columns["y"] = np.round(columns["y"] / 0.05) * 0.05
    result = trace(columns)
    assert [one.effect for one in result.effects] == ["quantisation"]
    assert result.unnamed == ()


@pytest.mark.parametrize("sd", [2.5, 4.0])
def test_a_meter_that_zeroes_itself_after_every_sixth_reading_is_seen(sd):
    """Of 80 readings; a wave in time is part of it, and no more than that."""
    rng = np.random.default_rng(7)
    relay = np.where(np.arange(80) % 6 == 2, sd, 0.0)
    result = trace(readings(80, rng.uniform(0.0, 10.0, 80), relay + rng.standard_normal(80)))
    assert all(one.doubtful for one in result.added)
    (found,) = result.unnamed
    assert found.cause in {f"along the run, again after {k} rows" for k in (2, 6, 12)}


def test_an_encoder_of_many_lines_is_seen_at_its_true_period():
    """360 in a turn of pitch, more than are searched by name."""
    rng = np.random.default_rng(3)
    plan = Plan(np.sort(rng.uniform(-60.0, 60.0, 80)), rng.uniform(-180.0, 180.0, 6), 3)
    data = simulate(Bench(pitch_gear_deg=(2e-4, 1e-4), pitch_teeth=360.0), plan, 1)[0]
    for found in trace_of_sensors(data, validate=False).sensors.values():
        (where,) = [one.cause for one in found.unnamed if "periodic" in one.cause]
        assert where.startswith("between points, package: an error of pitch, over pitch: periodic")
        assert float(where.split()[-2]) == pytest.approx(1.0, rel=1e-3)
