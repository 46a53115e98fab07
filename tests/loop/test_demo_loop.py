"""`rig demo --loop`: killed in its first run, resumed, and closed with what it confirmed."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path

from command import in_its_own_process, rig

from rig.examples import example
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


def test_a_session_that_cannot_begin_says_how_the_loop_goes_on(tmp_path: Path):
    lab, ports = example("voltmeter-lab"), itertools.count(1)
    text = (lab / "bench.toml").read_text()
    nobody = re.sub('address = ".*"', lambda _: f'address = "socket://127.0.0.1:{next(ports)}"', text)
    (tmp_path / "bench.toml").write_text(nobody)
    done = rig("loop", lab / "procedure.toml", "--bench", "bench.toml", "--hours", "3", cwd=tmp_path)
    assert done.returncode == 1
    assert f"the loop goes on with: rig resume {done.stdout.strip()}" in done.stderr
