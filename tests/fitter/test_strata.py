"""Type A of runs whose rows depend on each other: replications, rising and falling series, neighbours in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from rig.fitter.strata import Strata, strata
from rig.procedures.evaluate.influences import influences
from rig.procedures.evaluate.stated import Statements
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.tables.table import Table

SERIES = np.concatenate([np.arange(11.0), np.arange(9.0, -1.0, -1.0)])
FORCE, REPLICATE = np.tile(SERIES, 3), np.repeat([0, 1, 2], 21)
SIDE = np.tile(np.concatenate([[-1.0], np.ones(10), -np.ones(10)]), 3)
SIDE[0] = 0.0  # as the run file has it
MODEL = np.column_stack([np.ones(63), FORCE])
AT = np.array([[1.0, 2.0], [1.0, 10.0]])


def _strata(y, columns=MODEL, side=SIDE) -> tuple[np.ndarray, Strata]:
    fitted = np.linalg.lstsq(columns, y, rcond=None)[0]
    return fitted, strata(columns, y - columns @ fitted, REPLICATE, side)


def test_replications_that_differ_give_the_mean_of_n_of_them():
    """JCGM 100, 4.2.3: the experimental standard deviation of the mean, with n - 1 degrees of freedom."""
    y = 0.5 * FORCE + np.array([0.0, 0.03, -0.01])[REPLICATE] + 1e-4 * np.random.default_rng(1).normal(size=63)
    _, found = _strata(y)
    covariance, df = found.of(AT)
    alone = [np.linalg.lstsq(MODEL[r == REPLICATE], y[r == REPLICATE], rcond=None)[0] for r in range(3)]
    outputs = AT @ np.array(alone).T
    assert np.diag(covariance) == pytest.approx(np.var(outputs, axis=1, ddof=1) / 3, rel=1e-9)
    assert df == pytest.approx([2.0, 2.0], abs=1e-6)
    assert found.differ


def test_replications_that_do_not_differ_are_pooled_with_all_rows():
    y = 0.5 * FORCE + 1e-3 * np.random.default_rng(4).normal(size=63)
    _, found = _strata(y)
    covariance, df = found.of(AT)
    own = np.linalg.lstsq(MODEL, y, rcond=None)
    sigma2 = float(own[1][0]) / 61
    assert np.diag(covariance) == pytest.approx(sigma2 * np.sum(AT @ np.linalg.inv(MODEL.T @ MODEL) * AT, axis=1))
    assert df.tolist() == [61.0, 61.0]


def test_neighbours_that_depend_on_each_other_are_counted_as_fewer():
    """63 readings of an error with correlation 0.9 are about as good as 63 (1 - 0.9) / (1 + 0.9), three."""
    rng, one = np.random.default_rng(3), np.array([[1.0, 5.0]])
    rows = np.zeros(63, np.int64)
    held, effective, naive = 0, [], 0
    for _ in range(200):
        e = rng.normal(size=63)
        for i in range(1, 63):
            e[i] = 0.9 * e[i - 1] + np.sqrt(1 - 0.81) * e[i]
        fitted = np.linalg.lstsq(MODEL, e, rcond=None)[0]
        left = e - MODEL @ fitted
        covariance, df = strata(MODEL, left, rows, np.zeros(63)).of(one)
        error = abs(float((one @ fitted)[0]))
        held += error < stats.t.isf(0.025, df[0]) * np.sqrt(covariance[0, 0])
        naive += error < 2.0 * np.sqrt(left @ left / 61 * (one @ np.linalg.inv(MODEL.T @ MODEL) @ one.T)[0, 0])
        effective.append(float(df[0]))
    assert naive < 120
    assert held > 180
    assert np.median(effective) < 15


def test_coverage_of_replications_with_offsets_of_their_own():
    rng, held = np.random.default_rng(5), np.zeros(2)
    for _ in range(300):
        fitted, found = _strata(rng.normal(size=63) + 5.0 * rng.normal(size=3)[REPLICATE])
        covariance, df = found.of(AT)
        held += np.abs(AT @ fitted) < stats.t.isf(0.025, df) * np.sqrt(np.diag(covariance))
    assert (held > 0.91 * 300).all()  # 0.45 without the strata


def _table(y) -> Table:
    columns = {
        "replicate": REPLICATE + 1.0,
        "elapsed_s": 60.0 * np.arange(63.0),
        "force_kN": FORCE,
        "force_side": SIDE,
        "cell_V": y,
    }
    declared = {"formula": "1 + force_kN"}
    given = {"declared": declared, "kind": "general", "outputs": {"cell_V": "cell"}, "factors": ("force_kN",)}
    return Table("a stand", columns, simulated=True, provenance={}, **given)


@pytest.mark.parametrize("traced", [False, True])
def test_rising_and_falling_series_have_one_line_for_reversibility(traced):
    """Half of the difference, 4 mV, and what the fit is nearer to the rising side: that has the largest force."""
    noise = 1e-5 * np.random.default_rng(2).normal(size=63)
    evaluation = general_evaluation(_table(0.5 * FORCE + 0.002 * SIDE + noise), [{"force_kN": 4.0}], traced=traced)
    lines = influences(evaluation, Statements(), same_meter=False).grouped
    (line,) = [one for one in lines if one.name == "reversibility of cell_V"]
    sizes = dict(zip(evaluation.results.names, np.sqrt(np.diag(line.covariance)), strict=True))
    assert sizes["cell output at force 4 kN"] == pytest.approx(0.002, rel=0.1)
    assert sizes["cell inferred force at force 4 kN"] == pytest.approx(0.004, rel=0.1)
    scatter = dict(zip(evaluation.results.names, np.diag(evaluation.results.type_a.covariance), strict=True))
    assert scatter["cell output at force 4 kN"] < 5e-6**2  # the direction is in one line, not in two
    assert traced or any("rising and falling series" in one for one in evaluation.notes())


def test_series_that_do_not_differ_have_no_line():
    y = 0.5 * FORCE + 1e-5 * np.random.default_rng(7).normal(size=63)
    evaluation = general_evaluation(_table(y), [{"force_kN": 4.0}])
    assert not list(evaluation.reversibility())
    assert any("pooled, with 61 degrees of freedom" in one for one in evaluation.notes())


def test_what_agrees_too_well_to_be_chance_is_said():
    """A scatter of 1 mV that is the same in every replication: F is zero, and that is no good sign."""
    once = 1e-3 * np.random.default_rng(11).normal(size=21)
    y = 0.5 * FORCE + np.tile(once, 3) + 1e-9 * np.random.default_rng(9).normal(size=63)
    evaluation = general_evaluation(_table(y), [{"force_kN": 4.0}])
    assert any("agree too well to be chance" in one for one in evaluation.notes())
