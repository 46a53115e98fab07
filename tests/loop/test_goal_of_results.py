"""Goals of expanded uncertainties and predictions: what replications make smaller, and what they do not."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

import rig
from rig.engine.session import Signals
from rig.errors import UsageError
from rig.examples import example
from rig.loop.goal import Look, Next, looked
from rig.loop.goal_of_results import Made
from rig.procedures.plan.settings import GoalSettings
from rig.runs.controller import start_run
from rig.runs.plans import load_plan


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the load cell that lacks no effect, with its register: three replications."""
    folder, lab = tmp_path_factory.mktemp("straight"), example("load-cell-lab")
    (folder / "world.toml").write_text((lab / "world.toml").read_text().replace("-0.0006*creep", ""))
    plan = load_plan(lab / "procedure.toml", lab / "bench.toml", dry=True, world=folder / "world.toml")
    told: list[Path] = []
    start_run(plan, folder, announce=told.append, signals=Signals(), on_progress=lambda _: None)
    return told[0]


INFERRED = "cell inferred force"


def look(run: Path, **goal: Any) -> Look:
    settings = GoalSettings(**goal)
    return looked(settings, Made(settings, [run], 3, 3), lambda _: Next("one more", 0.5, 3.0), 8.0)


def test_an_expanded_uncertainty_is_a_goal_with_the_register(straight: Path):
    told = look(straight, U={INFERRED: 0.01})
    assert told.more is None
    assert told.why.startswith("the goal is met with 3 replications: U of cell inferred force at force ")
    assert "(with the register, 95 %, in spite of looking), the goal is +-0.01" in told.why


def test_a_goal_below_the_errors_of_instruments_is_said_at_the_first_look(straight: Path):
    """The weights and the meter have type B errors, which no further replication makes smaller."""
    told = look(straight, U={INFERRED: 1e-5}, at=({"force_kN": 10.0},))
    assert told.more is None
    assert told.why.startswith("the goal cannot be met by replications: U of cell inferred force at force 10 kN is ")
    assert "with any number of them it would be at least +-" in told.why
    assert told.why.endswith(", type B)")


def test_the_least_uncertainty_is_that_of_the_budget_without_the_part_of_the_fit(straight: Path):
    """By the root of the sum of squares, with the coverage factor of infinite degrees of freedom."""
    at = ({"force_kN": 10.0},)
    (result,) = [one for one in rig.budget(straight, at=at).found.budgets if one.name.startswith(INFERRED)]
    of_type_b = sum(line.standard_uncertainty**2 for line in result.contributions if line.kind == "B") ** 0.5
    why = look(straight, U={INFERRED: 1e-5}, at=at).why
    least = float(why.partition("at least +-")[2].partition(",")[0])
    assert 1.64 * of_type_b <= least <= 1.97 * result.standard_uncertainty


def test_one_more_replication_is_made_for_a_goal_that_they_can_meet(straight: Path):
    at = ({"force_kN": 10.0},)
    half = float(re.search(r" kN is (\S+) V ", look(straight, prediction={"cell": 1.0}, at=at).why)[1])
    told = look(straight, prediction={"cell": 0.6 * half}, at=at)
    assert told.more is not None
    assert (told.more.what, told.more.run) == ("one more", None)
    needed = int(told.why.partition("about ")[2].partition(" ")[0])
    assert 8 <= needed <= 9


def test_a_prediction_needs_no_register_and_a_result_of_no_name_is_said(straight: Path):
    told = look(straight, prediction={"cell": 0.1})
    assert "(by the scatter of the run alone, 95 %, in spite of looking)" in told.why
    with pytest.raises(
        UsageError, match=r"goal\.U: no result is named cell inferred mass; known: cell coefficient 1, "
    ):
        look(straight, U={"cell inferred mass": 1.0})


def test_a_goal_says_what_it_wants():
    with pytest.raises(ValidationError, match="a goal is sigma, U or prediction: give one of them"):
        GoalSettings()
    with pytest.raises(ValidationError, match="deadline is a time of day such as 07:00"):
        GoalSettings(sigma={"S_V": 1.0}, deadline="seven")
