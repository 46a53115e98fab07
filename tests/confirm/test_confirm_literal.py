"""Columns of effects in the rows of another run: the printed formula of a term, computed again."""

from __future__ import annotations

import numpy as np
import pytest
from test_trace_tables_printed import awkward

from rig.fitter.errors import FitError
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects import effects_of
from rig.procedures.general.effects.literal import Rows, column
from rig.procedures.general.run_terms import columns_of
from rig.procedures.tables.table import Table


def rows(columns, runs=(0,)):
    return Rows(columns, columns["t_s"], runs)


def test_every_formula_of_the_catalogue_gives_its_column_again():
    columns, _ = awkward()
    columns["unit"] = np.arange(60.0) % 3
    table = Table("t.csv", columns, True, {})
    data, _ = roles_of(table, Roles("y", "1 + log(x)", group=("unit",), time="t_s", direction="side"))
    seen = set()
    for effect in effects_of(data.scene, "y"):
        for term in effect.terms(data.scene)[::5]:
            for label, wanted in zip(term.labels, term.columns.T, strict=True):
                scale = np.abs(wanted).max()
                np.testing.assert_allclose(column(label, rows(columns)), wanted, atol=1e-6 * scale, err_msg=label)
            seen.add(effect.kind.name)
    assert {"setting-lag", "carry-over", "kink", "warm-up", "hysteresis", "group-gain", "harmonic"} <= seen


def test_what_remembers_begins_anew_with_every_run():
    one = {"t_s": np.array([0.0, 10.0, 20.0]), "x": np.array([1.0, 4.0, 9.0])}
    two = {"t_s": np.array([0.0, 10.0]), "x": np.array([9.0, 3.0])}
    both = {"t_s": np.concatenate([one["t_s"], two["t_s"] + 1e5]), "x": np.concatenate([one["x"], two["x"]])}
    for label in ("previous(x) - x", "lag(x - 5, 12)", "rate(x)", "side(x) * (x - 5)"):
        alone = [column(label, rows(run)) for run in (one, two)]
        np.testing.assert_allclose(column(label, rows(both, (0, 3))), np.concatenate(alone), err_msg=label)
    np.testing.assert_allclose(column("previous(x) - x", rows(both, (0, 3))), [0.0, -3.0, -5.0, 0.0, 6.0])


def test_a_name_that_the_rows_do_not_have_is_said():
    with pytest.raises(FitError, match="needs humidity, which these rows do not have"):
        column("humidity - 40", rows({"t_s": np.arange(3.0)}))
    with pytest.raises(FitError, match="levels of text"):
        column("C(unit)[a]", rows({"t_s": np.arange(3.0), "unit": np.arange(3.0)}))


def test_one_error_of_a_searched_constant_moves_all_columns_of_its_term():
    """Sine and cosine have one period: two free columns for its error would fit almost anything."""
    columns = {"t_s": np.arange(60.0), "x": np.linspace(0.0, 10.0, 60)}
    table = Table("t.csv", columns | {"y": np.zeros(60)}, True, {})
    data, _ = roles_of(table, Roles("y", "1 + x", time="t_s"))
    effect = next(effect for effect in effects_of(data.scene, "y") if effect.name == "periodic:x")
    block = next(term for term in effect.terms(data.scene) if term.profile is not None and term.profile.value == 3.0)
    *waves, error = columns_of(effect, block, "y", np.array([2.0, 1.0]))
    assert [term.term.name for term in waves] == list(block.labels)
    phase = 2.0 * np.pi * 3.0 * columns["x"] / 10.0
    expected = phase * (2.0 * np.cos(phase) - np.sin(phase))  # of the logarithm of the number of periods
    np.testing.assert_allclose(error.column(rows(columns)), expected, atol=1e-3 * np.abs(expected).max())


def test_settings_that_were_read_back_are_not_enough_values_for_a_period():
    at = np.repeat([0.0, 25.0, 50.0, 75.0, 100.0], 8)
    read = at + np.random.default_rng(7).normal(0.0, 0.01, 40)
    for values, periods in ((read, False), (np.linspace(0.0, 100.0, 40), True)):
        table = Table("t.csv", {"t_s": np.arange(40.0), "x": values, "y": np.zeros(40)}, True, {})
        data, _ = roles_of(table, Roles("y", "1 + x", time="t_s"))
        effect = next(effect for effect in effects_of(data.scene, "y") if effect.name == "periodic:x")
        assert bool(effect.terms(data.scene)) is periods
