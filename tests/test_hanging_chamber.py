"""A chamber whose readback hangs is no proof that it stood; one that is coarse is not doubted for standing still."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ideal_pressure_bench import PROCEDURE

from rig.engine.whole_plots import WholePlots

RUN_LIST = PROCEDURE.expand()
CHAMBERS = dict(zip((f.name for f in RUN_LIST.hard), ("cold_box", "hot_box"), strict=True))
POINT = RUN_LIST.points[0]


def rules(steps):
    """After eight points of one whole plot, at which the cold box read so much more than its setpoint."""
    bench = SimpleNamespace(setting=lambda factor, role: (CHAMBERS[factor], None), temperatures={})
    found = WholePlots(bench, RUN_LIST, PROCEDURE)
    for off in steps:
        found.note(1, states(found, off))
    return found


def states(found, off, **more):
    targets = found.targets(POINT)
    return {
        name: {"running": True, "setpoint_degC": target, "temperature_degC": target + off * (name == "cold_box")}
        | (more if name == "cold_box" else {})
        for name, target in targets.items()
    }


FINE = [0.01, 0.013, 0.008, 0.011, 0.009, 0.012, 0.007, 0.0125]


def test_what_always_changed_and_stands_for_a_minute_hangs():
    found = rules(FINE)
    assert found.lost_now(POINT, states(found, 0.0125, unchanged_s=59.0), {}) == ""
    why = found.lost_now(POINT, states(found, 0.0125, unchanged_s=61.0), {})
    assert why.startswith("cold_box hangs: it has read ")
    assert why.endswith(" degC for 61 s")


@pytest.mark.parametrize("steps", [[*FINE[:5], FINE[4], *FINE[5:]], [0.0] * 9, FINE[:6]])
def test_a_coarse_one_or_one_of_which_little_is_known_is_believed(steps):
    found = rules(steps)
    assert found.lost_now(POINT, states(found, 0.0, unchanged_s=600.0), {}) == ""


def test_neighbours_in_different_whole_plots_say_nothing():
    found = rules([])
    for identity, off in enumerate(FINE * 3):
        found.note(identity, states(found, off))
    assert found.lost_now(POINT, states(found, 0.0, unchanged_s=600.0), {}) == ""
