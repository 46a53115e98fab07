"""`rig demo --loop`: killed in its first run, resumed, and closed with what it confirmed."""

from __future__ import annotations

import json
from pathlib import Path

from command import in_its_own_process

from rig.loop import open_program
from rig.run_file.verify.verification import verify_file


def test_the_demo_of_a_loop_is_killed_resumed_and_closed(tmp_path: Path):
    done = in_its_own_process("demo", "voltmeter", "--short", "--loop", "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    first, _, told = done.stdout.partition("\n")
    assert verify_file(Path(first)).whole
    program = open_program(Path(first))
    assert program.run.sessions == 2
    assert program.closed is not None
    assert json.loads(told)["found"][-1]["verdicts"] == {"range-step:input_V": "confirmed"}
    assert "The controller was killed with SIGKILL" in done.stderr
