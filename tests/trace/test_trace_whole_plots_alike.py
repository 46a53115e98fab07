"""Transducers on one line that show two names at once: one cause of both may look like this."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from proving.truth.whole_plot import SUBPLOT, WHOLE_PLOT, Bench, Transducer, simulate
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.pressure.trace.reasons import of_alias


@pytest.mark.parametrize("seed", [1, 3])
def test_steps_of_two_transducers_at_once_are_doubtful_whatever_steps(seed):
    """The line was opened half way through: one shows its sensitivity, the other its offset, and both had no doubt."""
    data = simulate(Bench((Transducer(), Transducer(sensitivity=1.9))), seed=seed)
    late, share = data.whole_plot_index >= data.whole_plot_index.max() // 2, data.pressure_psia / 100.0
    one, other = data.outputs
    top = data.pressure_psia.max() / 100.0
    outputs = {
        one: data.outputs[one] + 3.6 * SUBPLOT * late * share / top,
        other: data.outputs[other] + 7.0 * WHOLE_PLOT * late,
    }
    found = trace_whole_plots(replace(data, outputs=outputs), validate=False).sensors
    names = [effect for sensor in found.values() for effect in sensor.effects if effect.stratum != "noise"]
    assert {effect.effect for effect in names} == {"sensitivity-step-unrecorded", "offset-step-unrecorded"}
    assert all("show it at once" in effect.doubtful for effect in names)


def test_an_alias_that_is_doubtful_in_another_transducer_is_a_doubt():
    run = SimpleNamespace(sensors=("a_mV", "b_mV", "c_mV"))

    def having(name):
        return SimpleNamespace(run=run, names_at=lambda level: [name] if level == "subplot" else [])

    unmodelled = [having(name) for name in ("saturation", "pressure-third-order", "creep")]

    def doubt(name, k):
        return "why" if (name, k) == ("saturation", 0) else None

    text = of_alias(unmodelled, ("saturation", "creep"), 1, doubt)
    assert text is not None
    assert "saturation, which is doubtful in a_mV" in text
    assert of_alias(unmodelled, ("creep",), 1, doubt) is None
    assert of_alias(unmodelled, ("saturation",), 0, doubt) is None
