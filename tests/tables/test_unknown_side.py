"""Rows whose side of approach is not known: the first setting of a run. Zero is not a side between both."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.directions import with_changes
from rig.procedures.general.effects import effects_of
from rig.procedures.general.effects.columns import loop, side, side_times, without_side
from rig.procedures.general.effects.literal import Rows, column
from rig.procedures.general.run_terms import columns_of
from rig.procedures.general.trace import trace_general
from rig.procedures.tables.table import Table

LEVELS = [4.0, 5.0, 6.0, 7.0, 8.0, 7.0, 6.0, 5.0, 4.0]
SIZE, NOISE = 0.003, 2e-4


def _run(seed=1, plots=6):
    """Whole plots with an error of their own; in each the supply goes up and down. The first row came from below."""
    rng = np.random.default_rng(seed)
    supply = np.tile(LEVELS, plots)
    known = np.sign(np.diff(supply, prepend=supply[:1]))
    known[9::9] = -1.0
    true = np.where(known == 0.0, 1.0, known)
    n, plot = len(supply), np.repeat(np.arange(1.0, plots + 1), 9)
    own = 0.004 * rng.normal(size=plots)[plot.astype(int) - 1]
    y = 0.1 + 0.02 * supply + own + SIZE * true + NOISE * rng.normal(size=n)
    return {"elapsed_s": 12.0 * np.arange(1.0, n + 1), "supply_V": supply, "supply_side": known, "whole_plot": plot} | {
        "one_V": y
    }


def _data(columns, **given):
    roles = {"whole_plot": ("whole_plot",), "time": "elapsed_s", "direction": "supply_side", **given}
    return roles_of(Table("run", columns, True, {}), Roles("one_V", "1 + supply_V", **roles))[0]


def test_a_backlash_is_named_without_a_doubt_although_the_side_of_the_first_row_is_not_known(monkeypatch):
    """The first row was taken to be half-way between both sides, so the coefficient "changed with its own size"."""
    monkeypatch.setattr(family, "MOST", 500)
    result = trace_general(_data(_run()))
    (found,) = result.added
    assert (found.effect, found.doubtful) == ("direction:sign(supply_side)", None)
    assert found.terms == ("sign(supply_side)", "(sign(supply_side) == 0)")
    assert found.coefficients == pytest.approx((SIZE, SIZE), rel=0.3)
    assert found.coefficients[0] == pytest.approx(SIZE, rel=0.05)
    assert (result.unnamed, result.instead, result.verdict) == ((), None, "explained")


def test_rows_of_an_unknown_side_have_a_column_of_their_own_in_every_effect_of_direction():
    data = _data(_run())
    values = {**_run(), "sign(supply_side)": data.scene.direction[1]}
    name = data.scene.direction[0]
    for (term,) in (side(data.scene, name), side_times(data.scene, name, "supply_V")):
        assert [without_side(label) for label in term.labels] == [False, True]
        np.testing.assert_array_equal(np.flatnonzero(term.columns[:, 1]), [0])
        for label, wanted in zip(term.labels, term.columns.T, strict=True):
            np.testing.assert_allclose(column(label, Rows(values, values["elapsed_s"])), wanted, atol=1e-12)
        effect = next(one for one in effects_of(data.scene, "one_V") if one.kind.terms is side)
        assert [one.at for one in columns_of(effect, term, "one_V", np.ones(2))] == [0], "no part of it in other rows"
    (term,) = loop(data.scene, name, "supply_V")
    assert len(term.labels) == 1, "a loop is closed at the first setting"


def test_a_velocity_of_zero_is_rest_and_no_unknown_side():
    columns = _run() | {"supply_side": np.tile([0.0, 1.0, 2.0], 18)}
    (term,) = side(_data(columns).scene, "sign(supply_side)")
    assert term.columns.shape[1] == 1


def test_a_row_without_a_side_has_that_of_the_change_before_it_also_across_whole_plots():
    columns = _run()
    gaps = {**columns, "supply_side": np.where(np.arange(54) % 9 < 2, 0.0, columns["supply_side"])}
    np.testing.assert_array_equal(_data(gaps).scene.direction[1], columns["supply_side"])
    np.testing.assert_array_equal(
        _data({**columns, "x": columns["supply_V"]}, direction="supply_V").scene.direction[1], columns["supply_side"]
    )
    other = np.array([0.0, 1.0, 0.0, -1.0])
    np.testing.assert_array_equal(with_changes(other, [np.array([1.0, 0.0, 1.0, 2.0])]), other)


def test_the_side_of_a_measured_setting_is_that_of_its_setpoints():
    """Readings of a reference standard scatter while the setting stays, and have no side."""
    columns = _run()
    read = columns["supply_V"] + 1e-3 * np.random.default_rng(2).normal(size=54)
    data = _data({**columns, "supply_V": read, "supply_set_V": columns["supply_V"]}, direction="supply_V")
    assert data.scene.direction[0] == "side(supply_set_V)"
    np.testing.assert_array_equal(data.scene.direction[1], columns["supply_side"])


def test_the_size_of_an_effect_of_direction_is_that_of_rows_whose_side_is_known(monkeypatch):
    """One first row, 0.105 by itself, was the size "to either side" of a direction effect of 0.05."""
    monkeypatch.setattr(family, "MOST", 500)
    run = _run()
    run["one_V"][0] += 20 * SIZE
    (found,) = [one for one in trace_general(_data(run)).added if one.effect.startswith("direction")]
    assert found.coefficients[1] > 10 * SIZE
    assert float(re.search(r"up to ([\d.e-]+)", found.size)[1]) == pytest.approx(SIZE, rel=0.1)
    assert found.rms < 1.2 * SIZE
