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


def test_the_demo_of_the_readme_confirms_both_effects_and_adds_them_by_morning(tmp_path: Path):
    """`make demo`: an accelerometer on soft pads whose sensitivity follows the temperature."""
    makefile = (Path(__file__).parents[2] / "Makefile").read_text(encoding="utf-8")
    assert "demo: $(STAMP)\n\t@.venv/bin/rig demo --loop\n" in makefile
    done = in_its_own_process("demo", "--loop", "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    program = open_program(Path(done.stdout.partition("\n")[0]))
    assert (program.run.sessions, len(program.runs)) == (2, 2)
    assert program.run.elapsed_s < 13 * 3600.0
    found = program.found[2]
    assert found.verdicts == {"sensitivity-temperature": "confirmed", "isolation-pad-deflection": "confirmed"}
    assert found.holds == {name: name for name in found.verdicts}
    assert "cross-axis" in program.found[1].words, "which the first run cannot tell from the pads"
    assert found.with_effects["x_V"] < 0.6 * found.before["x_V"]
    (calibration,) = tmp_path.glob("*.calibration.json")
    kept = json.loads(calibration.read_text(encoding="utf-8"))["kept"]["x_V"]["effects"]
    assert sorted(kept) == ["isolation-pad-deflection", "sensitivity-temperature"]
    assert list(tmp_path.glob("*.html"))


def test_a_session_that_cannot_begin_says_how_the_loop_goes_on(tmp_path: Path):
    lab, ports = example("voltmeter-lab"), itertools.count(1)
    text = (lab / "bench.toml").read_text()
    nobody = re.sub('address = ".*"', lambda _: f'address = "socket://127.0.0.1:{next(ports)}"', text)
    (tmp_path / "bench.toml").write_text(nobody)
    done = rig("loop", lab / "procedure.toml", "--bench", "bench.toml", "--hours", "3", cwd=tmp_path)
    assert done.returncode == 1
    assert f"the loop goes on with: rig resume {done.stdout.strip()}" in done.stderr
