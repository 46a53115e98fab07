"""Whole plots' errors that transducers have in common: said, and not where each has its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from proving.truth.whole_plot import SUBPLOT, WHOLE_PLOT, Bench, Transducer, simulate
from rig.fitter.trace.chance import ALPHA, COUNTED
from rig.procedures.pressure.fit import named_formula
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.common import common_error
from rig.procedures.pressure.trace.posed import white_of
from rig.procedures.pressure.trace.problem import pose
from rig.procedures.pressure.trace.run import scene_of

TWO = (Transducer(), Transducer(offset=-0.2, sensitivity=1.7))
ONE, OTHER = "bridge_1_mV", "bridge_2_mV"


def common(data):
    """What the first transducer has in common with the other one beside the declared model."""
    names, columns = named_formula("full").columns(data.table)
    problem = pose(data, names, columns, scene_of(data), ())
    white = white_of(problem, np.tile([(WHOLE_PLOT / SUBPLOT) ** 2, 0.0, 0.0], (len(problem.sensors), 1)))
    return common_error(problem, white.view("whole-plot", ()), 0)


@pytest.mark.parametrize("wanders", [0.0, 0.7])
def test_transducers_with_errors_of_their_own_have_nothing_in_common(wanders):
    """100 runs, neighbours in time alike or not: 3.5 % of a seventh of the level, so hardly one."""
    bench = Bench(TWO, wanders=wanders)
    ps = [common(simulate(bench, seed=seed)).p for seed in range(100)]
    assert np.sum(np.array(ps) < 0.05) <= 5 + 3 * np.sqrt(5)
    assert np.sum(np.array(ps) * 2 / COUNTED <= ALPHA) <= 1


def test_one_transducer_has_nothing_to_share():
    assert common(simulate(Bench((Transducer(),)), seed=1)) is None


def test_a_cause_of_whole_plots_that_all_transducers_see_is_said():
    """What stood in the line at the last cooling, say: three times a whole plot's error, in no catalogue."""
    data = simulate(Bench(TWO), seed=4)
    held = 3.0 * WHOLE_PLOT * np.random.default_rng(9).standard_normal(int(data.whole_plot.max()) + 1)[data.whole_plot]
    outputs = {ONE: data.outputs[ONE] + held, OTHER: data.outputs[OTHER] - 0.8 * held}
    found = trace_whole_plots(replace(data, outputs=outputs), validate=False)
    for name, other in ((ONE, OTHER), (OTHER, ONE)):
        (said,) = found.sensors[name].effects
        assert (said.effect, said.stratum) == ("common-whole-plot-error", "noise")
        assert said.terms == (f"correlation with {other}",)
        assert said.coefficients[0] < -0.7
        assert other in said.cause
    clean = trace_whole_plots(data, validate=False)
    assert all(one.effects == () for one in clean.sensors.values())


@pytest.mark.parametrize("seed", range(7000, 7004))
def test_sensitivities_that_differ_from_plot_to_plot_are_said(seed):
    """By 0.1 %, of which a run of a stranger's laboratory said "nothing to add" until November 2026."""
    (found,) = trace_whole_plots(simulate(Bench(sensitivity_sd=1e-3), seed=seed), validate=False).sensors.values()
    (said,) = (one for one in found.effects if one.kind == "noise")
    assert (said.effect, said.stratum) == ("slopes-differ", "noise")
    assert said.coefficients[0] == pytest.approx(1e-3 * abs(found.sensitivity), rel=0.5)
    assert found.verdict in ("unexplained", "partly explained")


@pytest.mark.parametrize("seed", range(7000, 7004))
def test_sensitivities_that_are_one_are_not(seed):
    (found,) = trace_whole_plots(simulate(Bench(), seed=seed), validate=False).sensors.values()
    assert all(one.effect != "slopes-differ" for one in found.effects)
