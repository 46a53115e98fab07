"""Which rows are gross errors, and what a trace names, does not hang on the last bits of the readings.

Symmetric designs with equal errors at opposite settings have subsets of rows that fit equally well; columns of several
causes are the same in many designs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from proving.statistics.attitude import GRID
from proving.truth.attitude import simulate
from proving.truth.attitude_hidden import HIDDEN, sized, together
from proving.truth.table import MISSING, Lab
from proving.truth.table import simulate as simulate_table
from proving.truth.whole_plot_hidden import hide
from rig.fitter.arrays import FloatArray
from rig.fitter.gross.forward_search import gross_errors
from rig.procedures.attitude.trace import trace
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.pressure.trace import trace_whole_plots
from rig.procedures.tables.table import Table


def symmetric(rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Columns of a line, and readings whose errors have the opposite sign at the opposite setting."""
    x = np.repeat(np.linspace(-1.0, 1.0, int(rng.integers(3, 6))), int(rng.integers(3, 6)))
    errors = rng.integers(-2, 3, x.size) * 0.01
    errors[rng.choice(x.size // 2, int(rng.integers(1, 4)), replace=False)] += float(rng.choice([0.5, 1.0, 3.0]))
    return np.column_stack([np.ones_like(x), x]), 2.0 * x + errors - errors[::-1]


@pytest.mark.parametrize("seed", range(12))
def test_readings_changed_in_their_last_bits_have_the_same_gross_errors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns, y = symmetric(rng)
    named = {
        tuple(gross_errors(y * (1.0 + 1e-15 * rng.integers(-2, 3, y.size)), columns).rows.tolist()) for _ in range(5)
    }
    assert len(named) == 1, named


def test_some_of_them_are_named() -> None:
    every = [symmetric(np.random.default_rng(seed)) for seed in range(12)]
    assert any(gross_errors(y, columns).rows.size for columns, y in every)


def changed(y: Any) -> FloatArray:
    """Readings (n,) up to three last bits away."""
    return np.asarray(y) * (1.0 + np.finfo(float).eps * np.random.default_rng(5).integers(-3, 4, len(y)))


def assert_same(found: Mapping[str, Any], again: Mapping[str, Any]) -> None:
    """Of each sensor the verdict, and each effect with its aliases, its doubt, and its share to four digits."""
    first, second = (
        {
            name: (one.verdict, [(e.effect, e.aliases, e.doubtful, round(e.share, 4)) for e in one.effects])
            for name, one in sensors.items()
        }
        for sensors in (found, again)
    )
    assert any(effects for _, effects in first.values())
    assert first == second


@pytest.mark.parametrize(("one", "other"), [("pads", "cube"), ("wobble", "square axes"), ("gear, pitch", "index")])
def test_attitude_sensors_changed_in_their_last_bits_have_the_same_names(one: str, other: str) -> None:
    bench = together([sized(name, 1.0, GRID) for name in (one, other)])
    data = simulate(bench, GRID, 3, **HIDDEN[one].options, **HIDDEN[other].options)[0]
    again = replace(data, outputs={name: changed(y) for name, y in data.outputs.items()})
    assert_same(trace(data, validate=False).sensors, trace(again, validate=False).sensors)


@pytest.mark.parametrize("name", ["cubic", "sensor cubed", "hysteresis"])
def test_transducers_changed_in_their_last_bits_have_the_same_names(name: str) -> None:
    hidden = hide([name], [1.5], seed=3)
    again = replace(hidden.data, outputs={sensor: changed(y) for sensor, y in hidden.data.outputs.items()})
    assert_same(*(trace_whole_plots(data, hidden.model, validate=False).sensors for data in (hidden.data, again)))


@pytest.mark.parametrize("name", ["kink", "carry-over", "drift"])
def test_a_table_changed_in_its_last_bits_has_the_same_names(name: str) -> None:
    columns = simulate_table(Lab(120, clock=True), 3, MISSING[name].at(1.0))
    roles = Roles(response="y", formula="1 + x", time="t_s")

    def of(columns: Any) -> Any:
        return {"y": trace_general(roles_of(Table("table.csv", columns, simulated=True, provenance={}), roles)[0])}

    arrays = {key: np.asarray(values, np.float64) for key, values in columns.items()}
    assert_same(of(arrays), of({**arrays, "y": changed(arrays["y"])}))
