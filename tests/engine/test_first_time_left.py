"""The time that a run says is left at its begin is that of its plan: it was later, by 12 % and more."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.engine.pace import Pace
from rig.runs.forecast import rehearse
from rig.runs.plans import load_plan

EXAMPLES = Path(__file__).parents[2] / "examples"
SILENT = (
    'read = "READ?"',
    "tolerance = 0.1 ",
    '[references.chamber_degC]\nreader = "thermometer"',
    "chamber_degC = [5, 50]",
)
STARTED = 'start = "SAMP:COUN {count};:INIT"'


@pytest.mark.parametrize(
    ("lab", "without"),
    [
        ("flow-lab", ()),
        ("flow-lab", ("time_constant_s = 300", *[STARTED] * 4)),  # with READ? alone meters read one after another
        ("flow-lab", SILENT),  # nothing reads the chamber: a soak is its dwell alone, and was 20 minutes more
        ("bath-lab", ()),
    ],
)
def test_the_first_time_left_is_that_of_the_plan(tmp_path, lab, without):
    for file in (EXAMPLES / lab).glob("*.toml"):
        text = file.read_text()
        if file.name == "bench.toml":
            for line in without:
                assert line in text
                text = text.replace(line, "", 1)
        (tmp_path / file.name).write_text(text)
    plan = load_plan(tmp_path / "procedure.toml", tmp_path / "bench.toml")
    forecast = rehearse(plan, lambda _: None)
    first_s = Pace(plan.run_list, plan.procedure.conduct, plan.bench).remaining_s(0.0)
    assert first_s == pytest.approx(forecast.total_s, rel=0.04)
