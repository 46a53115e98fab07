"""What comes again faster than there are readings is seen where their waits differ, and noise is not taken for it."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.trace.engine import family
from rig.fitter.trace.repeats import repeats
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import report, trace_general
from rig.procedures.tables.table import Table

PERIOD_S = 438.0


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)
    monkeypatch.setattr(report, "left_out", lambda *_: None)


def times(rng, n, spread=0.4, days=3):
    """Readings some six minutes apart, in so many days."""
    waits = 360.0 * (1.0 + spread * rng.uniform(-1.0, 1.0, n))
    waits[n // days :: n // days] += 50_000.0
    return np.round(np.cumsum(waits))


def kicks(at):
    """A pump starts and stops again: a minute up at once, then half a minute down, once in `PERIOD_S`."""
    phase = np.mod(at - 100.0, PERIOD_S)
    return np.where(phase < 60.0, 1.0, np.where(phase < 90.0, -1.0, 0.0))


def walking(rng, at, tau_s):
    """Errors that are alike over some time, of sd one."""
    out = rng.standard_normal(at.size)
    for k, rho in enumerate(np.exp(-np.diff(at) / tau_s), start=1):
        out[k] = rho * out[k - 1] + np.sqrt(1.0 - rho**2) * out[k]
    return out


@pytest.mark.parametrize("seed", range(2))
def test_kicks_of_both_signs_between_readings_are_said(seed):
    rng, n = np.random.default_rng([71, seed]), 150
    at, x = times(rng, n), rng.uniform(0.0, 10.0, n)
    columns = {"x": x, "t_s": at, "y": 3.0 + 2.0 * x + 5.0 * kicks(at) + rng.standard_normal(n)}
    data, _ = roles_of(Table("table.csv", columns, True, {}), Roles(response="y", formula="1 + x", time="t_s"))
    found = trace_general(data)
    assert not found.added
    (rest,) = found.unnamed
    assert rest.cause.startswith("along the run: periodic, one period in 7.3")
    assert rest.shape.over.unit == "s"


@pytest.mark.parametrize("tau_s", [700.0, 9000.0])
def test_noise_does_not_come_again(tau_s):
    told = []
    for seed in range(2):
        rng, n = np.random.default_rng([72, seed]), 90
        at, x = times(rng, n), rng.uniform(0.0, 10.0, n)
        columns = {"x": x, "t_s": at, "y": 3.0 + 2.0 * x + walking(rng, at, tau_s)}
        data, _ = roles_of(Table("table.csv", columns, True, {}), Roles(response="y", formula="1 + x", time="t_s"))
        told += [rest.cause for rest in trace_general(data).unnamed if "periodic" in rest.cause]
    assert not told


def test_the_likeliest_periods_have_the_true_one():
    rng = np.random.default_rng(73)
    at = times(rng, 200)
    found = repeats(3.0 * kicks(at) + rng.standard_normal(200), at)
    assert min(abs(one - PERIOD_S) for one in found.periods) < 1.0
    assert all(0.9 * 360.0 < one < 5.0 * 360.0 for one in found.periods)


def test_equal_waits_tell_no_short_period():
    rng = np.random.default_rng(74)
    assert repeats(rng.standard_normal(200), times(rng, 200, spread=0.05)) is None
    assert repeats(rng.standard_normal(40), times(rng, 40)) is None
    assert repeats(rng.standard_normal(100), np.zeros(100)) is None
