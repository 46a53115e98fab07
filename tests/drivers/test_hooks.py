"""Hooks: a Python file beside an instrument's file, for what the file cannot say."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from command import rig
from declared_bench import DeclaredBench

from rig.contracts.declared import hooks
from rig.contracts.declared.hooks import placed
from rig.drivers.errors import BadReply
from rig.errors import ConfigurationError

BATH = """
maker = "ACME"
model = "C1"
hook = "my_bath.py"
[identity]
ask = "ID"
answer = "{maker} {model}"
[source]
unit = "degC"
low = 0
high = 95
set = { tell = "SP {value:.2}", answer = "OK" }
setpoint = "SP?"
read = { ask = "T?", answer = "{value:.2} {unit}" }
safe_value = 25
time_constant_s = 5
"""
HOOK = '''
def parse(question, answer):
    """Its numbers have a comma."""
    return answer.replace(",", ".")

def say(question, answer):
    return answer.replace(".", ",")

def settled(setpoint, readings):
    """Within 0.1 for five seconds."""
    since, _ = readings[-1]
    last = [value for seconds, value in readings if since - seconds <= 5]
    return since >= 5 and all(abs(value - setpoint) < 0.1 for value in last)
'''
BENCH = """name = "bath"
[instruments.bath]
driver = "./my_bath.toml"
address = "/dev/ttyUSB0"
[instruments.dvm]
driver = "keithley-2000"
address = "/dev/ttyUSB1"
[sensors.dvm]
reader = "dvm"
[factors]
bath_degC = "bath"
"""
PROCEDURE = """kind = "general"
name = "bath"
seed = 1
replications = 1
[factors.bath_degC]
levels = [20, 30]
[settle]
dwell_s = 5
[measure]
readings = 2
[model]
formula = "1"
"""


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "my_bath.py").write_text(HOOK)
    (tmp_path / "my_bath.toml").write_text(BATH)
    (tmp_path / "bench.toml").write_text(BENCH)
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    return tmp_path


def opened(folder: Path, hook: str = HOOK) -> DeclaredBench:
    (folder / "my_bath.py").write_text(hook)
    made: Any = DeclaredBench(placed(BATH, folder))
    made.it.identify()
    made.it.prepare()
    return made


def test_its_answers_are_read_and_it_arrives(folder):
    bench = opened(folder)
    bench.it.set(30.0)
    assert not bench.it.read().settled
    for _ in range(30):
        bench.sleep(1.0)
        bench.it.read()
    state = bench.it.read()
    assert state.settled
    assert state.value == pytest.approx(30.0, abs=0.1)
    assert b"29,98 C" in b"".join(data for direction, data in bench.wire if direction == "rx")


@pytest.mark.parametrize(
    ("after", "said"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("None", "a text from parse"),
        ("'x' + answer", "expected an answer as in"),
        ("'nan C'", "expected an answer as in"),
    ],
)
def test_a_hook_that_reads_nonsense_gives_no_reading(folder, after, said):
    own = f"{after} if question == 'T?' else answer"
    with pytest.raises(BadReply, match=said):
        opened(
            folder,
            HOOK.replace('answer.replace(",", ".")', own.replace("else answer", 'else answer.replace(",", ".")')),
        ).it.read()


@pytest.mark.parametrize(("gives", "said"), [("None", "neither True nor False"), ("[][0]", "IndexError")])
def test_a_hook_that_does_not_decide_is_told(folder, gives, said):
    bench = opened(folder, HOOK.replace("    since, _ = readings[-1]\n", f"    return {gives}\n"))
    with pytest.raises(BadReply, match=said):
        bench.it.read()


@pytest.mark.parametrize(
    ("hook", "said"),
    [
        ("def parse(:", "cannot be run: SyntaxError"),
        ("import nothing_such", "ModuleNotFound"),
        ("x = 1", "has none of"),
    ],
)
def test_a_hook_that_is_none_is_refused(folder, hook, said):
    with pytest.raises(ConfigurationError, match=said):
        opened(folder, hook)


def test_a_run_has_its_digest_and_goes_on_with_the_same_hook_alone(folder):
    done = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--create-only", cwd=folder)
    assert done.returncode == 0, done.stderr
    (run,) = (folder / "runs").glob("*.sqlite")
    assert b"def parse" not in run.read_bytes()
    (folder / "my_bath.toml").unlink()
    (folder / "my_bath.py").write_text(HOOK + "\n# changed")
    refused = rig("resume", run, cwd=folder)
    assert refused.returncode == 78
    assert "has been changed since" in refused.stderr
    assert rig("status", run, cwd=folder).returncode == 0
    (folder / "my_bath.py").write_text(HOOK)
    done = rig("resume", run, cwd=folder)
    assert "complete: 2 of 2 points" in done.stderr


def test_a_missing_hook_is_named(folder):
    (folder / "my_bath.py").unlink()
    for command in (("plan", "procedure.toml", "--bench", "bench.toml"), ("instrument", "check", "my_bath.toml")):
        done = rig(*command, cwd=folder)
        assert done.returncode == 78
        assert "my_bath.py cannot be read" in " ".join(done.stderr.split())


def test_a_checked_instrument_uses_its_hook(folder):
    assert rig("instrument", "check", "my_bath.toml", "--set", "30", cwd=folder).returncode == 0


@pytest.mark.parametrize("name", ["../my_bath.py", "/etc/my_bath.py", "my_bath", ".py"])
def test_a_hook_stands_beside_its_file(folder, name):
    (folder / "my_bath.toml").write_text(BATH.replace("my_bath.py", name))
    done = rig("instrument", "check", "my_bath.toml", cwd=folder)
    assert done.returncode == 78
    assert "a Python file beside it" in " ".join(done.stderr.split())


def test_a_hook_that_does_not_end_is_given_up(monkeypatch):
    monkeypatch.setattr(hooks, "LONGEST_S", 0.05)
    ended = threading.Event()
    found = hooks._Bounded(lambda question, answer: ended.wait())
    for _ in range(2):  # the second time at once
        with pytest.raises(TimeoutError, match=r"longer than 0\.05 s, and is not called again"):
            found("T?", "1")
    ended.set()
    assert hooks._Bounded(lambda a, b: a + b)(1, 2) == 3
    with pytest.raises(ZeroDivisionError):
        hooks._Bounded(lambda: 1 / 0)()
