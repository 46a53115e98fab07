"""A goal: replications are added as segments of their own until it is met, cannot be met, or no time is left."""

from __future__ import annotations

import math
import random
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from proving.crashes.loops import LAB, CrashedLoop, Evaluations, shorter
from proving.disk import Disk
from proving.loops import Silent
from rig.engine.session import Outcome, Signals
from rig.errors import ConfigurationError
from rig.examples import example
from rig.loop import Program, open_program, replications, start_loop
from rig.loop.decide import Left, decide
from rig.loop.timeline import clock_time
from rig.procedures.plan.settings import LoopSettings
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file
from rig.tables.segments import table_of
from rig.verbs.confirm import consider, open_traced

EVALUATIONS = Evaluations()
"""Traces of the same readings are computed once."""


def with_goal(folder: Path, goal: str, hours: float | None = None, begin: bool = True, most_runs: int = 0) -> Any:
    """A loop of the voltmeter with a goal, closed after it; or its folder, prepared."""
    path = shorter(folder)
    if goal and "[goal]" not in path.read_text():
        path.write_text(f"{path.read_text()}\n[goal]\n{goal}\n[loop]\nmost_runs = {most_runs}\n")
    if not begin:
        return path
    lab = example(LAB)
    with CrashedLoop(folder, EVALUATIONS).watched():
        ending = start_loop(
        path, lab / "bench.toml", folder, hours=hours or 8, dry=True, world=lab / "world.toml",
        announce=lambda _path, _plan: None, signals=Signals(), on_progress=lambda _: None, told=Silent(),
        considered=EVALUATIONS.consider if most_runs else lambda _first, **_how: (),
        )  # fmt: skip
    assert ending.outcome is Outcome.COMPLETE
    return ending.program


def why(program: Program) -> str:
    assert program.goal is not None
    return program.goal.why


@pytest.fixture(scope="module")
def met(tmp_path_factory: pytest.TempPathFactory) -> Program:
    return with_goal(
        tmp_path_factory.mktemp("met"), "sigma = { input_V = 1.1e-8 }\nleast_replications = 2\nmost_replications = 9"
    )


def test_replications_are_added_until_the_goal_is_met(met: Program):
    assert why(met).startswith("the goal is met with 3 replications: input_V of meter_V is known to +-")
    assert why(met).endswith("(by the model; an effect that these data are too few to show is not in this interval)")
    assert [run.planned.segment for run in met.runs] == [False, True]
    assert [run.planned.what for run in met.runs][1:] == ["replication 3"]
    assert verify_file(met.path).whole


def test_each_decision_was_recorded_before_its_replication_began(met: Program):
    with RunReader.open(met.path) as reader:
        order = [record.status for record in reader.records() if record.kind in ("loop", "loop-run")]
    assert order[:6] == ["planned", "ended", "found", "decided", "planned", "ended"]


def test_the_calibration_and_the_trace_have_all_replications(met: Program):
    first, *more = met.segments
    joined = table_of(met.segments, first)
    parts = [len(table_of(met.segments, one)) for one in more]
    assert len(joined) == 2 * parts[0] + sum(parts)
    assert sorted(set(joined.columns["replicate"])) == [1, 2, 3]
    assert np.all(np.diff(joined.columns["elapsed_s"]) > 0)
    assert np.array_equal(joined.columns["order"], np.arange(1, len(joined) + 1))
    assert str(len(joined)) in met.path.with_name(f"{met.name}.calibration.json").read_text()
    assert met.found[2].after == 2


def test_a_goal_out_of_reach_is_said_after_the_least_replications(tmp_path: Path):
    program = with_goal(tmp_path, "sigma = { input_V = 1e-10 }\nleast_replications = 2\nmost_replications = 9")
    assert why(program).startswith("the goal cannot be met: ")
    assert "and most_replications = 9" in why(program)
    assert len(program.runs) == 1


def test_a_goal_for_which_no_time_is_left_is_said(tmp_path: Path):
    goal = "sigma = { input_V = 4e-9 }\nleast_replications = 2\nmost_replications = 30"
    program = with_goal(tmp_path, goal, hours=0.4)
    assert why(program).startswith("no time is left for the goal: ")
    assert len(program.runs) == 1


def said(program: Program) -> list[str]:
    return [record.sentence() for record in program.story]


def test_time_that_is_scarce_goes_to_what_leaves_the_smaller_error(tmp_path: Path):
    """After the first run 15 min are left: for one more replication, or for the run that confirms the step."""
    goal = "sigma = { input_V = 4e-9 }\nleast_replications = 2\nmost_replications = 30"
    program = with_goal(tmp_path, goal, hours=0.45, most_runs=1)
    (plan,) = [words for words in said(program) if "by forecast" in words]
    assert "about 23 replications meet it, 2 are made" in plan
    assert "one more replication takes 16% from the error of the aimed values (1.6 per hour)" in plan
    assert "a further run, the same again, 12 points x 1 replication, 3 min, 64% (12 per hour)" in plan
    assert "1.3 of the goal with the run and 0 more replications, 2.9 with 1 more replication alone" in plan
    assert [run.planned.what for run in program.runs] == ["voltmeter, six ranges", "the same again"]
    assert why(program).startswith("no time is left for the goal: ")
    assert program.closed is not None
    assert program.closed.settled


def test_a_confirmed_effect_leaves_fewer_replications_to_make(tmp_path: Path):
    """23 of them meet the goal with the declared model, and 4 with the step in it: so the further run comes first."""
    goal = "sigma = { input_V = 4e-9 }\nleast_replications = 2\nmost_replications = 30"
    program = with_goal(tmp_path, goal, hours=3.0, most_runs=1)
    assert [run.planned.what for run in program.runs][:2] == ["voltmeter, six ranges", "the same again"]
    assert why(program).startswith("the goal is met with ")
    assert program.replications <= 3
    assert len(program.segments) == 1 + program.replications
    assert verify_file(program.path).whole
    assert program.closed is not None
    assert program.closed.settled


def test_a_longer_run_that_the_time_does_not_hold_is_named_with_its_hours(met: Program):
    with CrashedLoop(met.path.parent, EVALUATIONS).watched():
        first = open_traced(met.segments[0])
    short = consider(first, only=lambda one: one.varies == "again", changes=False)[0]
    long = replace(short, hours=3.0)
    left = Left(hours=1.0, runs=3, allow=LoopSettings().allow)
    told = decide(
        first, None, LoopSettings(), left, lambda within, **_how: [long if within.most_h == math.inf else short]
    )
    assert told.run is short
    assert "; given up for lack of time: the same again, " in told.why
    assert ", takes 3 h 00 min and settles everything with " in told.why.partition("given up")[2]


def test_of_the_possible_runs_the_one_that_helps_the_goal_most_is_made(met: Program):
    with CrashedLoop(met.path.parent, EVALUATIONS).watched():
        first = open_traced(met.segments[0])
    one = consider(first, only=lambda one: one.varies == "again", changes=False)[0]
    runs = [one, replace(one, hours=one.hours + 0.1), replace(one, hours=one.hours + 0.2)]
    told = decide(
        first, None, LoopSettings(), Left(3.0, 3, LoopSettings().allow), lambda _, **_how: runs,
        helps=lambda run: 1.0 if run is runs[1] else 0.0,
    )  # fmt: skip
    assert told.run is runs[1]
    assert runs[1].worth > 0


def test_a_name_that_no_sensor_has_is_said_with_the_known_ones(tmp_path: Path):
    program = with_goal(tmp_path, "sigma = { S_V = 1e-6 }\nleast_replications = 2")
    assert "no sensor has such a value; known: 1, input_V" in why(program)


def test_a_goal_without_room_for_more_is_refused(tmp_path: Path):
    with pytest.raises(ConfigurationError, match="most_replications = 3 is not more than the 3 of the first run"):
        with_goal(tmp_path, "sigma = { input_V = 1e-8 }\nleast_replications = 3\nmost_replications = 3")


def test_crashes_between_and_in_replications_lose_none(tmp_path: Path):
    with_goal(tmp_path, "sigma = { input_V = 9e-9 }\nleast_replications = 2\nmost_replications = 9", begin=False)
    rng = random.Random(4)
    how = {"considered": lambda _first, **_how: ()}
    with Disk(seed=4, default=True) as disk:
        loop = CrashedLoop(tmp_path, Evaluations(), how)
        while True:
            disk.crash_at(rng.randint(40, 300) if loop.crashes < 6 else 10**9)
            if loop.go_on(disk):
                break
            disk.power_cut("all")
    assert loop.crashes >= 3
    assert loop.judge() == ""
    program = open_program(loop.path)
    assert "the goal" in why(program)
    assert [run.planned.number for run in program.runs] == list(range(1, len(program.runs) + 1))


# --- replications for a name ------------------------------------------------------------------------------------------


@pytest.fixture
def nameless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every trace leaves error without a name."""
    monkeypatch.setattr(replications, "left_over", lambda _first, _told: "x has more than error, without a name")


@pytest.mark.usefixtures("nameless")
def test_error_without_a_name_takes_the_design_once_more_and_no_third_time(tmp_path: Path):
    with Disk(seed=5, default=True) as disk:
        loop = CrashedLoop(tmp_path, EVALUATIONS, {"considered": lambda _first, **_how: ()})
        for writes in (230, 260, 10**9):
            disk.crash_at(writes)
            if loop.go_on(disk):
                break
            disk.power_cut("all")
    program = open_program(loop.path)
    assert loop.crashes >= 1
    assert [(run.planned.what, run.planned.segment) for run in program.runs[1:]] == [("replication 2", True)]
    assert len(program.segments) == 2
    told = [record.event.why for record in program.story if record.status == "decided"]
    assert re.search(
        r"; one further replication of \d+ min is traced with the first run as one: "
        r"together they name effects of 0\.71 times the size$",
        told[0],
    )
    assert len(told) == 2
    assert verify_file(program.path).whole


@pytest.mark.usefixtures("nameless")
@pytest.mark.parametrize("loop", ['hours = 0.25\nallow = ["again"]', 'hours = 8\nallow = ["order"]'])
def test_the_design_is_not_made_again_without_time_or_permission(tmp_path: Path, loop: str):
    path = shorter(tmp_path)
    path.write_text(f"{path.read_text()}\n[loop]\n{loop}\n")
    assert len(with_goal(tmp_path, "", hours=float(loop.split()[2])).runs) == 1


def test_an_expanded_uncertainty_without_a_register_is_refused(tmp_path: Path):
    with pytest.raises(ConfigurationError, match="the bench has no register of equipment"):
        with_goal(tmp_path, 'U = { "meter inferred input" = 1e-5 }\nleast_replications = 2')


def test_no_replication_is_added_after_the_deadline(tmp_path: Path):
    """The loop has hours left for further runs, and the goal has not."""
    dry = datetime(2026, 1, 15, 18, tzinfo=UTC).timestamp()
    goal = f'sigma = {{ input_V = 4e-9 }}\nleast_replications = 2\ndeadline = "{clock_time(dry + 1260.0)}"'
    program = with_goal(tmp_path, goal)
    assert why(program).startswith("no time is left for the goal: ")
    assert program.goal.left_h < 0.35
    assert program.ends_s == 8 * 3600.0
