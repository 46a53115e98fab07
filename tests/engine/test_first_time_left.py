"""The time that a run says is left at its begin agrees with its plan: it was later than the latest of the plan."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.engine.pace import Pace
from rig.runs.forecast import rehearse
from rig.runs.plans import load_plan

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("lab", ["flow-lab", "bath-lab"])
def test_the_first_time_left_is_not_later_than_the_plans_latest(lab):
    plan = load_plan(EXAMPLES / lab / "procedure.toml", EXAMPLES / lab / "bench.toml")
    forecast = rehearse(plan, lambda _: None)
    first_s = Pace(plan.run_list, plan.procedure.conduct, plan.bench).remaining_s(0.0)
    assert 0.9 * forecast.total_s < first_s <= forecast.latest_s
