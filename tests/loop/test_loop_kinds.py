"""Loops of other kinds, with the true cause hidden in the simulated world (`python -m proving loops` does many)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from proving.loops import KINDS, Silent, files_of, loop_in, one_loop
from rig.engine.session import Signals
from rig.loop import open_program, resume_loop
from rig.loop.evaluation import Evaluation


@pytest.mark.parametrize(("kind", "seed"), [("attitude", 1), ("attitude", 2), ("load-cell", 1)])
def test_the_true_cause_is_confirmed(kind: str, seed: int):
    """Also where the trace named its look-alike (attitude, seed 2), and where a person sets the weights."""
    told = one_loop(kind, seed)
    assert told.found
    assert told.verdict == "right", told.holds
    assert told.before is not None
    assert told.after is not None
    assert told.after < told.before


class Killed(Exception):
    """The process is gone."""


def test_an_effect_of_temperature_that_the_first_run_hardly_shows_is_confirmed_by_further_ones(tmp_path: Path):
    """The temperature of the first run hardly changes. Killed after the first further run, the loop goes on."""
    found = list[str]()

    def killing(event: str) -> None:
        found.extend([event] * (event == "LoopFound"))
        if len(found) == 2:
            raise Killed

    files_of("attitude-warm", KINDS["attitude-warm"](3), tmp_path)
    with pytest.raises(Killed):
        loop_in(tmp_path, recorded=killing)
    (path,) = tmp_path.glob("*.loop.sqlite")
    common: dict[str, Any] = {"signals": Signals(), "on_progress": lambda _: None, "told": Silent()}
    program = resume_loop(path, certified=False, **common).program
    assert program.closed is not None
    assert program.closed.settled, program.closed.why
    evaluation = Evaluation(open_program(path))
    assert evaluation.told is not None
    assert evaluation.told.paths == tuple(program.file_of(run) for run in program.runs[1:])
    verdicts = {one.effect: one.verdict for one in evaluation.told.answers}
    assert verdicts == {"sensitivity-temperature": "confirmed", "isolation-pad-deflection": "confirmed"}
    assert verdicts == program.found[program.complete].verdicts
    error = evaluation.told.judged.errors["x_V"]
    assert error.after < 1.2 * error.sigma < error.before
