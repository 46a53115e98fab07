"""One cause that all sensors of a run share is told as one: it was told once for each sensor, as a fault of each."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles
from rig.procedures.general.common import common_of
from rig.procedures.general.evaluate import trace_general_table
from rig.procedures.general.of_runs import RunTraced
from rig.procedures.tables.table import Table
from rig.verbs.confirm import sentences

SLOPES = {"a_Hz": 100.0, "b_Hz": 180.0, "c_Hz": 260.0}
NOISE = 0.1


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def traced(error, noise=NOISE, **bench):
    """Three flow meters over three repeats of eight flows; `error` of each, from flow, time, and slope."""
    rng = np.random.default_rng(4)
    flow = np.concatenate([rng.permutation(np.linspace(0.5, 4.0, 8)) for _ in range(3)])
    time = np.arange(24.0) * 300.0
    columns = {"elapsed_s": time, "flow_kg_per_min": flow}
    for number, (name, slope) in enumerate(SLOPES.items()):
        columns[name] = 50.0 + slope * flow + error(flow, time, slope, number) + noise * rng.normal(size=24)
    table = Table("bench.csv", columns, simulated=True, provenance={}, **bench)
    others = {name: tuple(set(SLOPES) - {name}) for name in SLOPES}
    return {
        name: trace_general_table(
            lambda needed=(): table,
            Roles(name, "1 + flow_kg_per_min", time="elapsed_s", ignore=others[name], sensors=3),
            validate=False,
        )
        for name in SLOPES
    }


def test_a_drift_of_what_they_share_is_one_of_its_size_in_each_output():
    (found,) = common_of(traced(lambda flow, time, slope, number: 4.0 * time / 7200.0))
    assert found.effect == "drift:elapsed_s"
    assert found.same_in == ("Hz",)
    assert found.p[0] > 0.01
    assert found.sentence.startswith("drift:elapsed_s is common to all 3 outputs: of one size in Hz, within errors.")
    assert "a supply or reader that they share" in found.sentence


def test_a_drift_of_the_reference_is_one_of_its_size_in_the_setting():
    (found,) = common_of(traced(lambda flow, time, slope, number: slope * 0.02 * time / 7200.0))
    assert found.same_in == ("flow_kg_per_min",)
    assert "the source or the reference of flow_kg_per_min" in found.sentence
    assert found.spread == pytest.approx(160.0 / 180.0, rel=0.1)


def test_a_bench_file_names_what_they_share():
    """It said "a supply or reader that they share" of sensors with a reader each."""
    (found,) = common_of(
        traced(lambda flow, time, slope, number: 4.0 * time / 7200.0, readers=dict.fromkeys(SLOPES, "scan"))
    )
    assert "what they share: their reader scan or a supply that they share." in found.sentence
    own = {name: f"counter_{name[0]}" for name in SLOPES}
    (found,) = common_of(traced(lambda flow, time, slope, number: 4.0 * time / 7200.0, readers=own))
    assert "what they share: a supply that they share (each has a reader of its own)." in found.sentence
    assert found.sentence.endswith("To tell: give one of them another supply")
    bench = {"readers": own | {"flow_kg_per_min": "coriolis"}, "sources": {"flow_kg_per_min": "valve"}}
    (found,) = common_of(traced(lambda flow, time, slope, number: slope * 0.02 * time / 7200.0, **bench))
    assert "what they share: the source (valve) or the reference (coriolis) of flow_kg_per_min." in found.sentence


def test_drifts_of_each_their_own_are_not_said_to_be_one():
    (found,) = common_of(traced(lambda flow, time, slope, number: (4.0, 9.0, 5.0)[number] * time / 7200.0))
    assert found.same_in == ()
    assert found.spread == pytest.approx(5.0 / 6.0, rel=0.1)
    assert "more than their errors" in found.sentence


def test_drifts_of_both_signs_are_not_given_a_share_of_their_mean():
    """Sizes of 0.03, 0.02 and -0.02 were said to be 360 % apart: their mean is nearly zero."""
    (found,) = common_of(traced(lambda flow, time, slope, number: (4.0, 9.0, -5.0)[number] * time / 7200.0))
    assert found.same_in == ()
    assert found.spread == pytest.approx(14.0 / 6.0, rel=0.1)
    assert "is in all 3 outputs, with both signs: each has a cause of its own" in found.sentence


def test_what_one_sensor_lacks_is_not_common():
    assert common_of(traced(lambda flow, time, slope, number: (number > 0) * 4.0 * time / 7200.0)) == ()


def test_what_sensors_share_is_said_with_a_confirmed_effect_and_the_run_that_would_tell():
    """A drift of the reference was called confirmed, with every other cause excluded."""
    each = traced(lambda flow, time, slope, number: slope * 0.02 * time / 7200.0)
    run = RunTraced(each)
    (shared,) = {one.shared for outcome in run.outcomes for one in outcome.findings}
    assert "cannot tell the sensors from what they share: the source or the reference of flow_kg_per_min" in shared
    assert shared.endswith("To tell: repeat the run with another source or reference of flow_kg_per_min")
    answer = SimpleNamespace(
        effect="drift", verdict="undecided", cannot_tell=False, holding=("drift", "b"), minor_causes=()
    )
    error = SimpleNamespace(before=np.nan, sigma=1.0)
    first = SimpleNamespace(shared=lambda effect: shared)
    told = sentences(SimpleNamespace(answers=(answer,), judged=SimpleNamespace(errors={"a": error}), first=first))
    assert next(told).endswith(f"{shared}.")
