"""Points that are added for a goal: at the settings that tell most of it, by the declared formula."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_goal import EVALUATIONS, why, with_goal

from proving.crashes.loops import CrashedLoop
from proving.loops import KINDS, files_of, loop_in
from rig.bench.config import parse_toml
from rig.loop import Program
from rig.loop.best_points import Candidates, candidates, chosen_points
from rig.loop.goal_of_results import Made
from rig.procedures.plan.settings import GoalSettings
from rig.run_file.verify.verification import verify_file
from rig.tables.segments import table_of
from rig.verbs.confirm import First, open_traced

SLOPE = "sigma = { input_V = 1e-8 }\nleast_replications = 2\nmost_replications = 30\n"


@pytest.fixture(scope="module")
def met(tmp_path_factory: pytest.TempPathFactory) -> Program:
    return with_goal(tmp_path_factory.mktemp("points"), f'{SLOPE}add = "points"')


def test_points_at_the_ends_meet_a_goal_of_the_slope_with_fewer_of_them(met: Program, tmp_path: Path):
    """A slope is known best by readings at both ends (Atkinson, Donev and Tobias, 2007, section 6.1)."""
    assert why(met).startswith("the goal is met with 2 replications and ")
    added = [run for run in met.runs if run.planned.segment]
    each = met.runs[0].ended.points // 2
    for run in added:
        rows = parse_toml(run.planned.procedure, "")["design"]["rows"]
        assert rows == [[-1000.0], [1000.0]]
        assert run.ended.points <= -(-each // 4) + 1
    whole = with_goal(tmp_path, SLOPE)
    assert sum(run.ended.points for run in added) < 0.6 * each * whole.replications
    assert verify_file(met.path).whole


def test_added_points_are_one_run_with_the_first(met: Program):
    joined = table_of(met.segments, met.segments[0])
    assert len(joined) == sum(run.ended.points for run in met.runs if run.ended is not None)
    assert str(len(joined)) in met.path.with_name(f"{met.name}.calibration.json").read_text()


@pytest.fixture(scope="module")
def first(met: Program) -> First:
    with CrashedLoop(met.path.parent, EVALUATIONS).watched():
        return open_traced(met.segments[0])


def variance(of: Candidates, wanted: Any, units: Any, times: int) -> float:
    """That of a value, by least squares of all rows at once."""
    both = of.both
    columns = both.weigh(0, both.declared[0])
    fresh = columns[both.fresh]
    rows = [columns[~both.fresh], *(fresh[np.isin(of.units, units)] for _ in range(times))]
    r = np.linalg.qr(np.concatenate(rows), mode="r")
    return float(np.sum(np.linalg.solve(r.T, wanted) ** 2))


@pytest.mark.parametrize("wanted", [(0.0, 1.0), (1.0, 0.0), (1.0, 400.0)])
def test_no_other_two_settings_leave_less(first: First, wanted: tuple[float, float]):
    of = candidates(first)
    assert of is not None
    best = of.best(np.array([wanted]), np.ones(1))
    chosen = [point.setpoints for point in best.run.run_list.points]
    start = variance(of, wanted, [], 0)
    pairs = itertools.combinations(range(len(of.rows)), 2)
    least = min(variance(of, wanted, pair, of.step // 2) for pair in pairs)
    assert len(chosen) <= of.step
    assert best.left <= least / start * (1.0 + 1e-6)


def test_a_goal_of_outputs_is_made_of_the_same_coefficients(first: First, met: Program):
    """At 0 V the output is the offset: every setting tells as much of it, and at 1000 V the ends tell most."""
    of = candidates(first)
    assert of is not None
    left = {}
    for at in (0.0, 1000.0):
        goal = GoalSettings(prediction={"meter": 1e-9}, at=({"input_V": at},), add="points")
        made = Made(goal, met.segments[:1], 2, 2, 0, of.replication, of.part)
        best = chosen_points(of, made, {"meter output": 4.0})
        assert best is not None
        left[at] = {abs(point.setpoints[0]) for point in best.run.run_list.points}, best.left
    assert left[1000.0][0] == {1000.0}
    rows, more = 2 * of.replication, of.step
    assert left[0.0][1] == pytest.approx(rows / (rows + more), rel=0.05)


def test_a_sensitivity_is_known_best_near_one_g_and_the_enclosure_need_not_settle_again(tmp_path: Path):
    """The forecast had the settling of a first run in it, 37 min for points of 8."""
    world = KINDS["attitude"](2)
    world.procedure["goal"] = {"sigma": {"S_V": 5.5e-6}, "most_replications": 12, "add": "points"}
    files_of("attitude", world, tmp_path)
    program = loop_in(tmp_path, considered=lambda _first, **_how: ())
    assert why(program).startswith("the goal is met with 3 replications and ")
    added = [run for run in program.runs if run.planned.segment]
    assert added
    for run in added:
        pitches = [pitch for pitch, _ in parse_toml(run.planned.procedure, "")["design"]["points_deg"]]
        assert len(pitches) == 12  # each replication has an alignment of its own
        assert min(abs(np.sin(np.radians(pitches)))) > 0.6
        assert run.ended.took_s == pytest.approx(3600.0 * run.planned.hours, rel=0.25)
