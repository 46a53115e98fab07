"""Whole plots that differ by hundreds of times what rows in one scatter: a fixture set anew, beside a good meter."""

from __future__ import annotations

import numpy as np
import pytest

from rig.fitter.trace.engine.shared import scale_of
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table
from rig.procedures.tables.table import Table

PLOTS, APART, NOISE = 12, 3e-3, 4e-6


def table(seed, missing=lambda gap, volts, plot: 0.0):
    """Two gaps in random order, six times, each with an error of its own; three voltages at each."""
    rng, rows = np.random.default_rng(seed), []
    for plot in range(PLOTS):
        gap = rng.permutation([1.0, 2.0])[0] if plot % 2 == 0 else 3.0 - rows[-1][4]
        own = rng.normal(0.0, APART)
        for volts in rng.permutation([-5.0, 0.0, 5.0]):
            y = 0.01 + 0.02 * gap + volts + own + missing(gap, volts, plot) + rng.normal(0.0, NOISE)
            rows.append((plot + 1, plot // 2 + 1, 25.0 * plot + 7.5 * len(rows), volts, gap, y))
    names = ("whole_plot", "replicate", "elapsed_s", "input_V", "gap_mm", "meter_V")
    return dict(zip(names, np.array(rows).T, strict=True))


def found(columns):
    roles = Roles(response="meter_V", formula="1 + input_V + gap_mm", whole_plot=("whole_plot",), replicate="replicate")
    result = search_table(roles_of(Table("t.csv", columns, simulated=True, provenance={}), roles)[0])
    return [result.judge.candidates[j].effect.name for j in result.chosen]


@pytest.mark.parametrize("seed", range(6))
def test_errors_of_whole_plots_are_no_effects(seed):
    """Steps in time were named in half of such tables: the ratio of the variances was searched up to 400 only."""
    assert found(table(seed)) == []


def test_a_curve_in_the_rows_of_whole_plots_is_found_beside_them():
    assert "second-order:input_V" in found(table(1, lambda _, volts, __: 2e-4 * volts**2))


@pytest.mark.parametrize(("noise", "scaled"), [(4e-6, True), (3e-3, False)])
def test_the_ratios_move_only_where_the_usual_ones_end(noise, scaled):
    rng = np.random.default_rng(2)
    group = np.repeat(np.arange(40), 3)
    y = rng.normal(0.0, APART, 40)[group] + rng.normal(0.0, noise, 120)
    scale = scale_of(group, y, np.ones((120, 1)))
    if scaled:
        assert 8.0 * scale == pytest.approx((APART / noise) ** 2, rel=0.6)
    else:
        assert scale == 1.0
    assert scale_of(group, np.zeros(120), np.ones((120, 1))) == 1.0
