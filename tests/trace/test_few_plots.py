"""A trace of few whole plots that finds no drift says how large one would have to be."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rig.procedures.general.column_roles import Roles
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.tables.table import Table


def traced(plots, drift, seed=1):
    """The trace of whole plots of seven readings each, whose means scatter by 0.02 Hz and drift over the run."""
    rng, n = np.random.default_rng(seed), 7 * plots
    plot, x = np.repeat(np.arange(plots), 7), np.tile(np.linspace(0.5, 4.0, 7), plots)
    time = np.arange(n) * 60.0 + plot * 1800.0
    y = 50.0 + 180.0 * x + drift * (time - time.mean()) / np.ptp(time)
    y = y + rng.normal(0, 0.02, plots)[plot] + rng.normal(0, 0.02, n)
    columns = {"whole_plot": plot * 1.0, "elapsed_s": time, "flow_kg": x, "s_Hz": y}
    table = Table("t.csv", columns, simulated=True, provenance={})
    roles = Roles("s_Hz", "1 + flow_kg", whole_plot=("whole_plot",), time="elapsed_s")
    return trace_general_table(lambda _: table, roles, validate=False).trace


def test_six_whole_plots_are_said_to_be_few_with_the_drift_that_they_would_show():
    """A drift with p = 0.0006 by plots was answered "nothing to add" without a word."""
    found = traced(6, 0.07, seed=5)
    assert not found.added
    (said,) = (one for one in found.notes if "whole plots are few" in one)
    assert said.startswith("6 whole plots are few for effects that change from one to the next")
    assert "chance gives as much" in said
    (smallest,) = map(float, re.findall(r"found here is about ([0-9.]+) Hz over the run", said))
    (own,) = map(float, re.findall(r"drift by ([0-9.]+) Hz", said))
    assert own < smallest
    larger = traced(6, 0.07 + 1.2 * (smallest - own), seed=5)
    assert any(one.effect.startswith("drift:") for one in larger.added)


@pytest.mark.parametrize(("plots", "drift"), [(20, 0.0), (6, 1.0)])
def test_nothing_is_said_of_many_whole_plots_or_beside_an_effect_in_time(plots, drift):
    assert not any("whole plots are few" in one for one in traced(plots, drift).notes)
