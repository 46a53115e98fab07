"""Errors of effects beside whole plots: by least squares of the plots' means, which balanced rows make exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.fitter.trace.engine.judge import TableJudge
from rig.fitter.trace.engine.shared import Shared
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.estimate import estimate
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

PLOTS, ROWS = 12, 5


def test_an_effect_of_whole_plots_has_the_error_and_the_freedom_of_their_means():
    """Twelve plots of five rows: 10 degrees of freedom, where it had 57."""
    rng = np.random.default_rng(3)
    plot, x = np.repeat(np.arange(PLOTS), ROWS), np.tile(np.arange(ROWS, dtype=float), PLOTS)
    heat = rng.normal(size=PLOTS)[plot]
    y = 1.0 + 2.0 * x + 3.0 * heat + rng.normal(size=PLOTS)[plot] + rng.normal(size=plot.size)
    table = Table("bench", {"y": y, "x": x, "heat_c": heat, "plot": plot.astype(float)}, True, {})
    roles = Roles(response="y", formula="1 + x", whole_plot=("plot",))
    problem = problem_of(roles_of(table, roles)[0])
    own = next(one for one in problem.candidates if one.effect.name == "temperature:heat_c")
    judge = TableJudge(replace(problem, candidates=(own,)))
    found = estimate(judge, (0,))

    means = np.array([y[plot == k].mean() for k in range(PLOTS)])
    columns = np.column_stack([np.ones(PLOTS), heat[::ROWS]])
    b, rss, *_ = np.linalg.lstsq(columns, means, rcond=None)
    stderr = np.sqrt(rss[0] / (PLOTS - 2) * np.linalg.inv(columns.T @ columns)[1, 1])
    scale = b[1] / found.coefficients[-1]  # the trace's column may have another unit
    assert found.dfs[-1] == pytest.approx(PLOTS - 2, rel=1e-6)
    assert found.stderr[-1] * abs(scale) == pytest.approx(stderr, rel=1e-6)
    assert found.dfs[1] > 40  # a slope within plots is as well known as before


def redrawn(seed, slope_sd):
    """Sixteen whole plots of eight rows, each with an offset and a slope of its own."""
    rng = np.random.default_rng(seed)
    plot, x = np.repeat(np.arange(16), 8), np.tile(np.arange(8.0), 16)
    heat = rng.permutation(np.repeat([-20.0, 0.0, 20.0, 40.0], 4))[plot]
    offset, slope = 0.3 * rng.normal(size=16), slope_sd * rng.normal(size=16)
    y = 1.0 + 2.0 * x + 0.1 * heat + offset[plot] + slope[plot] * x + 0.1 * rng.normal(size=plot.size)
    columns = {"y": y, "x": x, "heat_c": heat, "plot": plot.astype(float), "elapsed_s": 60.0 * np.arange(y.size)}
    roles = Roles(response="y", formula="1 + x + heat_c + x:heat_c", whole_plot=("plot",), time="elapsed_s")
    return roles_of(Table("bench", columns, True, {}), roles)[0]


@pytest.mark.parametrize("seed", [0, 2])
def test_a_slope_that_each_whole_plot_draws_anew_is_no_effect(seed):
    """It was a drift or a step of the sensitivity, and an autocorrelation, in 4 of 5 such tables."""
    found = trace_general(redrawn(seed, 0.05), validate=False)
    (said,) = found.effects
    assert (found.verdict, said.effect, said.stratum) == ("unexplained", "slopes-differ", "noise")
    assert said.unit == "y per x"
    assert said.coefficients[0] == pytest.approx(0.05, rel=0.5)
    assert found.after.fit.dfs.max() <= 15


def test_whole_plots_of_one_slope_have_errors_of_their_offsets_alone():
    problem = problem_of(redrawn(3, 0.0))
    assert type(problem.noise) is Shared
