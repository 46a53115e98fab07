"""Sizes of what changes from one replication to the next, where they differ: against other formulas, by seeds."""

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, Sensor, simulate
from rig.fitter.quantiles import t_limit
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace.estimate import estimate
from rig.procedures.attitude.trace.make_problem import make_problem

PLAN = D1(90, 7, 6)
READING = np.radians(1.5e-4) * 5.0


def fitted(bench, seed, effect, term=None):
    """A run fitted with one effect of the catalogue in x, told and not searched; and the run."""
    data, _ = simulate(bench, PLAN, seed)
    problem = make_problem(data, [one for one in CATALOGUE if one.name == effect])
    own = (j for j, one in enumerate(problem.candidates) if one.sensor == "x_V" and term in (None, one.term.name))
    return estimate(problem, (next(own),)), data


def held(offset_sd, runs=40):
    """Share of the 95 % intervals of an offset's drift that hold it, and half their median width, V/h."""
    bench = Bench(sensors=(Sensor("x", b_per_h=0.2 * READING),), offset_sd=offset_sd)
    right, halves = 0, []
    for seed in range(runs):
        found, _ = fitted(bench, 900 + seed, "offset-drift")
        reach = t_limit(0.95, min(found.fits[0].df, found.dfs[0])) * np.sqrt(found.covariance[0, 0])
        right += abs(found.gamma[0] - 0.2 * READING) < reach
        halves.append(reach)
    return right / runs, float(np.median(halves))


def test_a_drift_holds_where_offsets_differ_by_less_than_the_test_of_drift_sees():
    """By scatter of readings alone 78 % of the intervals hold."""
    assert held(0.25)[0] >= 0.9


def test_a_drift_is_hardly_wider_where_replications_agree():
    right, half = held(0.0)
    assert right >= 0.93
    assert half < 1.5 * 1.96 * READING / np.sqrt(6 * 42 / 12) / 28.0


def test_a_step_between_replications_is_a_comparison_of_two_groups_of_replications():
    """Its error is that of Student's t of three offsets before and three after, by 4 degrees of freedom."""
    found, data = fitted(Bench(offset_sd=2.0), 3, "offset-step-unrecorded", "from replication 4")
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)
    h = np.column_stack([np.ones_like(a), np.sin(a), np.cos(a) * np.sin(r), np.cos(a) * np.cos(r)])
    y = data.outputs["x_V"] - h[:, 1:] @ np.linalg.lstsq(h, data.outputs["x_V"], rcond=None)[0][1:]
    offsets = [y[data.replicate == one].mean() for one in data.replicates]
    pooled = (np.var(offsets[:3], ddof=1) + np.var(offsets[3:], ddof=1)) / 2
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(np.sqrt(pooled * 2 / 3), rel=1e-6)
    assert found.dfs[0] == pytest.approx(4.0)


def test_a_step_between_replications_that_agree_is_known_as_well_as_readings_are():
    bench = replace(Bench(), sensors=(Sensor("x"),))
    every = [fitted(bench, seed, "offset-step-unrecorded", "from replication 4")[0] for seed in range(12)]
    assert any(one.dfs[0] > 100.0 for one in every), "pooled with readings"
    assert min(np.sqrt(one.covariance[0, 0]) for one in every) > 0.8 * READING / np.sqrt(6 * 42 / 4)
