"""Scatter of budgets: residuals, or differences between repeats where stated errors explain the lack of fit."""

from __future__ import annotations

import numpy as np
import pytest

from proving.truth.attitude import D1, Bench, simulate
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.evaluate.influences import explain
from rig.procedures.evaluate.scatter_for_budgets import scatter
from rig.procedures.evaluate.stated import PlaceConstant, Stated, Statements
from rig.procedures.general.budget import GeneralEvaluation
from rig.procedures.general.for_budgets import general_evaluation
from rig.procedures.tables.table import Table

FORCE = np.tile(np.linspace(0.0, 10.0, 9), 3)


def run(error: np.ndarray) -> GeneralEvaluation:
    """A load cell of 0.5 V/kN that reads 1e-4 V of noise and an error that repeats at its nine weights."""
    noise = np.random.default_rng(5).normal(0.0, 1e-4, 27)
    columns = {"force_kN": FORCE, "cell_V": 0.5 * FORCE + np.tile(error, 3) + noise}
    table = Table(
        "a stand",
        columns,
        True,
        {},
        declared={"formula": "1 + force_kN"},
        kind="general",
        outputs={"cell_V": "cell"},
        factors=("force_kN",),
    )
    return general_evaluation(table, [{"force_kN": 4.0}])


WEIGHTS = Stated(
    "weights", "c", {"force_kN": 1.0}, "setting", np.zeros_like, lambda x: np.full_like(x, 2e-3)
)  # 1e-3 V of output
SEVEN = np.random.default_rng(6).normal(0.0, 1e-3, 9)


def reading(evaluation: GeneralEvaluation) -> float:
    """Scatter of one reading, V."""
    results = evaluation.results
    at = results.names.index("cell inferred force at force 4 kN")
    return 0.5 * float(np.sqrt(results.type_a.covariance[at, at] - results.of_fit[at]))


def test_errors_of_weights_that_the_register_states_are_not_in_the_scatter_again():
    evaluation = run(SEVEN)
    explain(evaluation, Statements([WEIGHTS]))
    assert reading(evaluation) == pytest.approx(1e-4, rel=0.3)  # 18 degrees of freedom
    (note,) = evaluation.notes()
    assert "as large as the register's errors of settings make it" in note


def test_lack_of_fit_that_nothing_states_stays_in_the_scatter_and_is_said():
    evaluation = run(SEVEN)
    explain(evaluation, Statements())
    assert reading(evaluation) > 5e-4
    (note,) = evaluation.notes()
    assert "larger than the register's errors of settings make it" in note


def test_a_model_that_lacks_more_than_the_weights_can_explain_is_said():
    evaluation = run(20.0 * SEVEN)
    explain(evaluation, Statements([WEIGHTS]))
    assert reading(evaluation) > 1e-2
    assert "the numbers of the model itself do not have what that moves" in next(iter(evaluation.notes()))


def test_without_lack_of_fit_nothing_is_said_and_all_residuals_count():
    evaluation = run(np.zeros(9))
    explain(evaluation, Statements([WEIGHTS]))
    assert list(evaluation.notes()) == []
    assert evaluation.results.type_a.df[0] == pytest.approx(25, rel=1e-12)  # rounding differs by processor


@pytest.mark.parametrize(("pure_ss", "pure_df"), [(0.0, 0.0), (0.0, 5.0), (5.0, 20.0)])
def test_without_repeats_or_without_points_to_spare_residuals_count(pure_ss, pure_df):
    found = scatter(10.0, 20.0, pure_ss, pure_df, 1e9)
    assert (found.variance, found.df, found.lacks_fit) == (0.5, 20.0, False)


def test_errors_of_a_head_are_not_in_the_scatter_again():
    """Local gravity among the constants must not have the run evaluated before errors are explained: it once had."""
    true, says = np.random.default_rng(9).normal(0.0, 1.0, 2), 1e-3
    bench = Bench(pitch_error_deg=(says * true[0], says * true[1], 0.0, 0.0), sigma_deg=1e-4)
    data, _ = simulate(bench, D1(60.0, 7, 9, replications=2), 9)
    evaluation = AttitudeEvaluation(data, [(0.0, 0.0)], temperature=False, gravity=9.8)
    turn = Stated("turn", "c", {"pitch_deg": 1.0}, "turn", np.zeros_like, lambda x: np.full_like(x, says))
    explain(evaluation, Statements([turn], {"gravity": PlaceConstant("gravity", 9.8, 1e-4)}))
    every = {one.name: one.sigma_V for one in evaluation.calibration.sensors}
    noise = np.radians(1e-4) * 5.1
    assert every["y_V"] == pytest.approx(noise, rel=0.3)
    assert any("as large as the register's errors" in note for note in evaluation.notes())
    with pytest.raises(ValueError, match="before anything is evaluated"):
        explain(evaluation, Statements([turn]))


def test_a_lack_of_fit_that_rounding_made_negative_is_none():
    """Equal sums of squares: the tail of F was not a number, and the model was said to lack fit."""
    found = scatter(1.0, 20.0, 1.0 + 2e-16, 12.0, 0.0)
    assert not found.lacks_fit
    assert found.df == 20.0
