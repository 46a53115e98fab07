"""Readings of one person in whole coarse steps: found by the lattice that they leave, with nothing else to see."""

import numpy as np
import pytest

from rig.fitter.trace.coarse import lattice
from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table

LEVELS = np.linspace(0.0, 200.0, 9)


@pytest.fixture(autouse=True)
def _few_tables(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def readings(seed, count=60):
    r = np.random.default_rng(seed)
    return r, r.choice(LEVELS, count) + r.normal(size=count)


@pytest.mark.parametrize(("step", "printed"), [(2.5, 0.1), (np.pi, 0.01), (4.3, 0.05)])
def test_a_coarse_step_is_found_among_values_that_are_printed_finely(step, printed):
    """Also a step that is no decimal, and beside some readings that are not rounded."""
    r, y = readings(1)
    coarse = np.round(np.round(y / step) * step / printed) * printed
    found = lattice(coarse, printed, np.hypot(1.0, step / np.sqrt(12)))
    assert found.step == pytest.approx(step, rel=0.01)
    assert found.rows == 60
    assert found.p < 1e-6
    some = np.where(r.random(60) < 0.3, np.round(y / printed) * printed, coarse)
    mixed = lattice(some, printed, np.hypot(1.0, step / np.sqrt(12)))
    assert mixed.rows < 60
    assert mixed.p < 1e-6


def test_values_without_a_coarse_step_have_none():
    """Of readings at a few levels, with errors of four shapes."""
    for seed in range(30):
        r, y = readings(seed)
        long_tails = y + (seed % 2) * r.standard_t(2, size=60)
        found = lattice(np.round(long_tails / 0.01) * 0.01, 0.01, float(np.std(long_tails - y)) + 1.0)
        assert found is None or found.p > 1e-3, seed


def test_nothing_is_searched_in_few_or_constant_values_or_without_digits():
    assert lattice(np.arange(5.0) * 3.0, 0.1, 1.0) is None
    assert lattice(np.full(30, 7.0), 0.1, 1.0) is None
    assert lattice(readings(1)[1], 0.0, 1.0) is None
    assert lattice(np.round(readings(1)[1] * 1e9), 1e-3, 1.0) is None


def traced():
    """A table with a column of readers that has no role, and what a trace says of it."""
    r, _ = readings(3)
    load = np.tile(LEVELS, 14)
    who = np.repeat(["Ada", "Ben", "Cleo"], 42)
    y = np.round(3.0 + 0.5 * load + r.normal(size=126), 2)
    y = np.where(who == "Ben", np.round(np.round(y / 4.1) * 4.1, 2), y)
    columns = {"y": y, "load": load, "time_s": 10.0 * np.arange(126.0)}
    table = Table("table.csv", columns, simulated=True, provenance={}, text={"who": who})
    data, notes = roles_of(table, Roles(response="y", formula="load", time="time_s"))
    return trace_general(data), notes


def test_a_trace_names_who_rounds_without_being_told_that_there_are_people():
    found, notes = traced()
    assert notes == ("who holds text: its 3 levels are taken for a group; --ignore who if not",)
    rounds = next(one for one in found.effects if one.effect == "quantisation")
    assert rounds.cause.startswith("y is rounded to a coarse step where who is Ben")
    assert rounds.coefficients[0] == pytest.approx(4.1, rel=0.01)
    assert "in 42 of 42 rows" in rounds.size
