"""What an instrument remembers over an interruption of a run: what stood meanwhile, and for how long, is in no row."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rig.fitter.trace.engine import family
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.effects import effects_of
from rig.procedures.general.effects.literal import Rows, column
from rig.procedures.general.effects.time_columns import lag, lagging, of_start
from rig.procedures.general.run_terms import columns_of
from rig.procedures.general.together import Remembered, Whole
from rig.procedures.general.trace import trace_general
from rig.procedures.general.trace.cross import _undetermined
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

TAU, SIZE, NOISE = 240.0, -0.0006, 1e-5
LOADS = np.concatenate([np.arange(11.0), np.arange(9.0, -1.0, -1.0)])


def _night(seed: int, breaks: tuple[int, ...] = (43,), gap_s: float = 420.0) -> dict[str, np.ndarray]:
    """Three series of loads, 78 s each; the cell creeps. In every gap 10 kN stand for half of it, then nothing."""
    loads = np.tile(LOADS, 3)
    state, t, rows = 0.0, 0.0, []
    for i, load in enumerate(loads):
        if i in breaks:
            for stood in (10.0, 0.0):
                state = stood + (state - stood) * np.exp(-gap_s / 2.0 / TAU)
            t += gap_s
        state = load + (state - load) * np.exp(-78.0 / TAU)
        t += 78.0
        rows.append((t, load, 1.0 + sum(b <= i for b in breaks), state))
    times, force, block, creep = np.array(rows).T
    noise = NOISE * np.random.default_rng(seed).normal(size=len(force))
    y = 0.0123 + 0.5 * force - 4e-6 * force**2 + SIZE * creep + noise
    return {"elapsed_s": times, "force_kN": force, "block": block, "cell_V": y, "replicate": np.repeat([1.0, 2, 3], 21)}


def _data(columns, group=()):
    roles = Roles("cell_V", "1 + force_kN + force_kN^2", replicate="replicate", time="elapsed_s", group=group)
    return roles_of(Table("night", columns, simulated=True, provenance={}), roles)[0]


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(family, "MOST", 500)


def test_creep_over_an_interruption_leaves_the_noise_and_nothing_else():
    """In the demo of the load cell 33 uV were left, with a doubtful name and two findings that were none."""
    result = trace_general(_data(_night(5)))
    assert [(one.effect, one.doubtful) for one in result.added] == [("creep:force_kN", None)]
    assert result.after.fit.sigma_E == pytest.approx(NOISE, rel=0.3)
    (found,) = result.added
    size, start = found.coefficients
    assert size == pytest.approx(SIZE, rel=0.25), "the loads jump, and the column is linear between rows"
    assert abs(start) > 10.0 * found.stderr[1]
    labels = [row.label for row in result.after.rows()]
    assert {"within replications", "between replications"} <= {*labels}, "it has no whole plots"
    assert result.left_out == "replications"


def test_what_a_left_out_fit_cannot_determine_is_not_predicted_by_it():
    """A killed and resumed run: `the data left out do not confirm what was found`, 2512 %, of a true creep."""
    night = _night(5, breaks=(43,)) | {"replicate": np.repeat([1.0, 2.0, 3.0], [21, 22, 20])}
    problem = problem_of(_data(night))
    every = [k for k, one in enumerate(problem.candidates) if one.effect.kind.terms is lag]
    j = min(every, key=lambda k: abs(problem.candidates[k].term.profile.value - TAU))
    one, group = problem.only((j,)), np.repeat([0, 1, 2], [21, 22, 20])
    far = [_undetermined(one, np.flatnonzero(group != k)) for k in range(3)]
    assert [int(one.sum()) for one in far[:2]] == [0, 0]
    assert far[2][43]
    assert _undetermined(one, np.flatnonzero(np.arange(63) != 43)).sum() == 0, "the next row determines it"


def test_a_setting_whose_time_is_known_is_a_step_in_a_trace_and_in_a_later_run():
    table = _night(5, breaks=()) | {"force_since_s": np.full(63, 30.0)}
    scene, state, creep = _data(table).scene, 0.0, [0.0]
    for before, load in zip(table["force_kN"], table["force_kN"][1:], strict=False):
        for stood, seconds in ((before, 48.0), (load, 30.0)):
            state = stood + (state - stood) * np.exp(-seconds / TAU)
        creep.append(state)
    found = lagging(table["force_kN"], np.diff(table["elapsed_s"]), TAU, scene.stood("force_kN"))
    np.testing.assert_allclose(found, creep, atol=1e-12)
    assert list(scene.covariates) == list(_data(_night(5, breaks=())).scene.covariates)
    term = lag(scene, "force_kN")[3]
    np.testing.assert_allclose(column(term.labels[0], Rows(table, table["elapsed_s"])), term.columns[:, 0], atol=1e-9)


def test_with_the_times_of_the_settings_the_interval_holds_the_truth():
    night = _night(5, breaks=())
    plain = trace_general(_data(night))
    assert any("when force_kN was set is not known" in note for note in plain.notes)
    table = night | {"force_since_s": np.full(63, 78.0)}
    data = _data(table)
    result = trace_general(data)
    ((found,), (off,)) = result.added, plain.added
    assert abs(found.coefficients[0] - SIZE) < 2.5 * found.stderr[0] < 0.02 * abs(SIZE)
    assert abs(off.coefficients[0] - SIZE) > 2.5 * off.stderr[0]
    assert not any("is not known" in note for note in result.notes)


def _term(columns, group=()):
    scene = _data(columns, group).scene
    return next(term for term in lag(scene, "force_kN") if term.profile is not None)


def test_each_later_session_has_a_column_up_to_three_and_none_is_the_effect():
    assert [_term(_night(1, breaks=(*range(12, 12 * k, 12),))).columns.shape[1] for k in (1, 2, 4, 5)] == [1, 2, 4, 1]
    term = _term(_night(1))
    assert _term(_night(1), ("block",)).labels == term.labels, "`rig trace` of an exported run proposes --group block"
    assert [of_start(label) for label in term.labels] == [False, True]
    rows = Rows(_night(1), _night(1)["elapsed_s"])
    for label, wanted in zip(term.labels, term.columns.T, strict=True):
        np.testing.assert_allclose(column(label, rows), wanted, atol=1e-5 * np.abs(wanted).max(), err_msg=label)
    effect = next(one for one in effects_of(_data(_night(1)).scene, "cell_V") if one.kind.terms is lag)
    kept = [one.term.name for one in columns_of(effect, term, "cell_V", np.array([SIZE, 2e-4]))]
    assert kept == [term.labels[0], f"change with the constant of {term.labels[0]}"]


def test_runs_judged_together_begin_anew_at_each_of_their_sessions():
    columns = _night(1, breaks=(30,))
    table = SimpleNamespace(columns=columns, __len__=lambda self: 63)
    known = {"cell_V": Remembered((TAU,))}
    one = Whole(table, {}, {}, {}, (0, 42), known).started("cell_V")  # the second run begins with row 43
    assert one.shape == (63, 2)
    assert [int(v.argmax()) for v in one.T] == [30, 42]
    assert one[30, 0] == one[42, 1] == 1.0


def test_columns_that_count_the_rows_are_no_covariates():
    """Of an exported run the trace said that a drift is in the coefficients of `order` and `run_index`."""
    counted = {
        "order": np.arange(1.0, 64.0),
        "run_index": np.arange(63.0),
        "room_degC": np.tile([22.0, 23.0, 24.0], 21),
    }
    assert list(_data(_night(1) | counted).scene.covariates) == ["block", "room_degC"]
