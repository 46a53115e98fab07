"""When a source was set, in the run file and its table; and a late response, which that decides.

The stranger's flow bench on which a true lag was rejected by its own confirmation: the settings were taken to change
evenly from row to row.
"""

from __future__ import annotations

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from command import rig
from flow_bench import PROCEDURE, WORLD, run_of
from scipy.integrate import solve_ivp

from rig.engine.motion import delay_of_step
from rig.procedures.general.effects.scene import Stood
from rig.procedures.general.effects.time_columns import lagging
from rig.tables.table_of_run import run_table


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return run_of(tmp_path_factory.mktemp("moves"), "first")


def test_a_table_says_when_each_setting_was_left_and_which_it_was(first):
    columns = run_table(first).columns
    asked = columns["flow_kg_per_min"]
    came, since, gap = columns["flow_from_kg_per_min"], columns["flow_since_s"], np.diff(columns["elapsed_s"])
    left = asked[1:] != asked[:-1]
    assert (left.sum(), len(left)) == (36, 38), "each replication begins where the one before ended"
    assert came[0] == 0.0, "where it stood when the run began"
    assert came[1:][left].tolist() == asked[:-1][left].tolist()
    assert np.all((since[1:][left] < gap[left]) & (since[1:][left] > 30.0)), (
        "after the reading before it, before the dwell"
    )
    stayed = np.flatnonzero(~left)
    np.testing.assert_allclose(since[stayed + 1], since[stayed] + gap[stayed], atol=0.01)
    assert came[stayed + 1].tolist() == came[stayed].tolist(), "nothing moved"


def test_a_late_response_is_named_alone_with_its_size_and_constant(first):
    told = rig("trace", first, "--full").stdout
    assert "setting-lag:flow_kg_per_min" in told
    assert "direction:" not in told
    size, tau = map(
        float, re.search(r"([\d.]+) \+- [\d.]+ mfs_Hz per unit .*lag\(flow_kg_per_min - 2, ([\d.]+)\)", told).groups()
    )
    assert tau == pytest.approx(60.0, rel=0.1)
    assert size == pytest.approx(6.0, rel=0.1), "readings last half a time constant, and count as moments"
    assert "when flow_kg_per_min was set is not known" not in told


@pytest.fixture(scope="module")
def later(first):
    """A run in another order, of another day."""
    procedure = PROCEDURE.replace('"up-down"', '"random"').replace("seed = 3", "seed = 9")
    world = WORLD.replace("seed = 5", 'seed = 77\nepoch = "2036-12-05T20:00:00Z"')
    return run_of(first.parent, "later", procedure, world)


def test_a_late_response_is_confirmed_by_a_run_in_another_order(first, later):
    done = rig("confirm", first, "--by", later)
    assert done.returncode == 0, done.stdout
    assert "setting-lag:flow_kg_per_min is confirmed by a further run" in done.stdout
    part = float(re.search(r"predicted by the first run, all but ([\d.]+) % of it", done.stdout)[1])
    assert part < 10.0


def test_a_calibration_by_a_confirmed_lag_is_that_of_the_trace(first, later):
    """The lag stayed in the outputs of a calibration whose further run had confirmed it: it was less right for that."""
    told = [json.loads(rig("fit", first, *how, "--json").stdout) for how in (("--confirmed-by", later), ("--traced",))]
    confirmed, traced = ({term: value["estimate"] for term, value in one["coefficients"].items()} for one in told)
    assert confirmed == traced
    (effect,) = told[0]["confirmed_by"]["effects"]
    assert "setting-lag:flow_kg_per_min was fitted and taken off" in effect["used"]


def test_a_lag_that_is_half_as_large_again_in_the_further_run_is_rejected(first):
    procedure = PROCEDURE.replace("seed = 3", "seed = 9")
    world = WORLD.replace("seed = 5", 'seed = 77\nepoch = "2036-12-05T20:00:00Z"').replace("6*volume", "9*volume")
    later = run_of(first.parent, "changed", procedure, world)
    done = rig("confirm", first, "--by", later)
    assert done.returncode == 3
    assert "does not hold" in done.stdout


def test_a_lag_after_known_steps_is_that_of_the_differential_equation():
    rng = np.random.default_rng(11)
    gap, tau = rng.uniform(20.0, 90.0, 30), 60.0
    t = np.concatenate([[0.0], np.cumsum(gap)])
    v = rng.uniform(-2.0, 3.0, 31)
    since = np.concatenate([[15.0], rng.uniform(1.0, gap)])
    start = np.concatenate([[1.2], v[:-1]])

    def slope(now, y):
        at = int(np.searchsorted(t - since, now, side="right")) - 1
        return ((v[at] if at >= 0 else start[0]) - y) / tau

    found, y = [], np.array([1.2])
    edges = np.unique(np.concatenate([t, t - since]))
    for low, high in pairwise(edges):
        if low in t:
            found.append(y[0])
        middle = 0.5 * (low + high)
        y = solve_ivp(lambda _, y, at=middle: slope(at, y), (low, high), y, rtol=1e-10, atol=1e-12).y[:, -1]
    found.append(y[0])
    np.testing.assert_allclose(lagging(v, gap, tau, Stood(since, start)), found, atol=1e-8)


def test_a_gradual_move_is_a_step_at_the_time_of_its_mean():
    t = np.linspace(0.0, 400.0, 4001)
    approach = [(s, 20.0 * (1.0 - np.exp(-s / 30.0))) for s in t.tolist()]
    assert delay_of_step(approach, 0.0, 20.0) == pytest.approx(30.0, abs=0.01)
    assert delay_of_step([(0.0, 0.0), (10.0, 5.0)], 0.0, 5.0) == 5.0
    assert delay_of_step([(0.0, 5.0), (10.0, 5.0)], 0.0, 5.0) == 0.0
