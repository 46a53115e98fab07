"""Ends of a session: which outputs stay on, closed terminals, and signals that were ignored at the start."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
from types import SimpleNamespace
from unittest.mock import Mock

import general_lab as lab
import pytest
from command import rig
from test_hard_anything import LINE, LINE_PROCEDURE, LINE_WORLD

from rig.bench.protection import SafetyConfig
from rig.cli.status import check_code
from rig.drivers.roles import Chamber, ChamberState, PressureController, PressureState, Reader, Source, SourceState
from rig.engine.safe_state import outputs_on
from rig.run_file.events.bench import MadeSafe
from rig.run_file.state.state import RunState

RUN = (sys.executable, "-m", "rig", "run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml")

INTERRUPTING = """
import signal, sys
from rig.engine.journal import Journal
observed = Journal.point_observed
def interrupting(self):
    observed(self)
    if len(self.fold.accepted) == 3:
        WHAT
Journal.point_observed = interrupting
from rig.__main__ import main
sys.argv = ["rig", "run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml"]
main()
"""


def laboratory(folder, safety=""):
    (folder / "procedure.toml").write_text(lab.SOURCE_PROCEDURE)
    (folder / "bench.toml").write_text(lab.SOURCE + safety)
    (folder / "world.toml").write_text(lab.SOURCE_WORLD)


def session(folder, what="signal.raise_signal(signal.SIGTERM)", **options):
    code = INTERRUPTING.replace("WHAT", what)
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False, **options
    )


@pytest.mark.parametrize(
    ("safety", "on"),
    [
        ("", True),
        ('\n[safety]\non_stop = "hold"\n', True),
        ('\n[safety]\non_stop = "off"\n', False),
        ('\n[safety]\non_stop = { calibrator = "off" }\n', False),
    ],
)
def test_an_interruption_says_which_outputs_stay_on_and_at_what_value(tmp_path, safety, on):
    laboratory(tmp_path, safety)
    done = session(tmp_path)
    assert done.returncode == 75, done.stderr
    path = done.stdout.strip()
    status = json.loads(rig("status", path, "--json", cwd=tmp_path).stdout)
    assert len(status["left_on"]) == on
    assert ("left on: calibrator stays on at " in done.stderr) == on
    assert ("left on: calibrator stays on at " in rig("status", path, cwd=tmp_path).stdout) == on
    assert rig("verify", path, cwd=tmp_path).returncode == 0


WELDED = """
        import rig.drivers.scpi_source as source
        def make_safe(self):
            raise RuntimeError("relay welded")
        source.DescribedSource.make_safe = make_safe
        """


@pytest.mark.parametrize("on_stop", ['"off"', '{ calibrator = "off" }'])
def test_what_was_to_be_switched_off_and_is_not_is_named_with_its_value(tmp_path, on_stop):
    laboratory(tmp_path, f"\n[safety]\non_stop = {on_stop}\n")
    done = session(tmp_path, f"{WELDED}signal.raise_signal(signal.SIGTERM)")
    assert done.returncode == 5, done.stderr
    said = " ".join(done.stderr.split())
    assert "left on: calibrator stays on at " in said
    told = re.search(r"NOT everything could be brought to its safe state: (.*?) SIMULATED", said)
    assert told is not None, said
    assert re.fullmatch(r"calibrator: relay welded; it stays on at [\d.]+ V", told[1])
    path = done.stdout.strip()
    status = json.loads(rig("status", path, "--json", cwd=tmp_path).stdout)
    assert (status["state"], status["safe"]["unsafe"]) == ("faulted", [told[1]])
    assert [words.partition(" at ")[0] for words in status["left_on"]] == ["calibrator stays on"]
    assert rig("status", path, cwd=tmp_path).stdout.count("NOT in its safe state: calibrator: relay welded") == 1
    assert rig("status", path, "--check", cwd=tmp_path).returncode == 5
    assert rig("status", "runs", "--check", cwd=tmp_path).returncode == 5
    assert rig("verify", path, cwd=tmp_path).returncode == 0
    assert rig("resume", path, cwd=tmp_path).returncode == 0
    assert rig("status", path, "--check", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize(
    ("break_it", "code", "words"),
    [
        ("", 1, "safe after"),
        (WELDED, 5, "NOT everything could be brought to its safe state: calibrator: relay welded; it stays on at "),
        (
            """
        import rig.engine.parking as parking
        def make_safe(*_):
            raise MemoryError("no more")
        parking.make_safe = make_safe
        """,
            5,
            "NOT everything could be brought to its safe state: the bench: not known, check it on site: MemoryError",
        ),
    ],
    ids=["safe", "welded", "not known"],
)
def test_a_fault_says_whether_the_bench_is_safe_and_so_does_its_status(tmp_path, break_it, code, words):
    laboratory(tmp_path)
    done = session(tmp_path, f"{break_it}raise ZeroDivisionError('a defect')")
    assert done.returncode == code, done.stderr
    assert words in done.stderr or code == 1
    (path,) = (tmp_path / "runs").glob("*.sqlite")
    assert words in rig("status", path, cwd=tmp_path).stdout
    assert rig("status", path, "--check", cwd=tmp_path).returncode == code
    assert rig("verify", path, cwd=tmp_path).returncode == 0


def test_a_safe_state_of_a_part_of_the_bench_is_not_said_of_all_of_it():
    assert MadeSafe(seconds=4.2, only=("oven",)).sentence(None) == "oven safe after 4.2 s"
    assert MadeSafe(seconds=4.2).sentence(None) == "bench safe after 4.2 s"


def test_a_safe_state_says_nothing_of_a_later_session(tmp_path):
    laboratory(tmp_path, '\n[safety]\non_stop = "off"\n')
    path = session(tmp_path).stdout.strip()
    assert json.loads(rig("status", path, "--json", cwd=tmp_path).stdout)["safe"]["unsafe"] == []
    killed = INTERRUPTING.replace("== 3", "== 5").replace("WHAT", "os._exit(9)").replace("import signal", "import os")
    killed = re.sub(r"sys.argv = .*", f"sys.argv = ['rig', 'resume', {path!r}]", killed)
    done = subprocess.run([sys.executable, "-c", killed], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 9, done.stderr
    assert json.loads(rig("status", path, "--json", cwd=tmp_path).stdout)["safe"] == {}


def test_a_pressure_controller_that_stays_on_is_named_with_its_pressure(tmp_path):
    for name, text in (("procedure", LINE_PROCEDURE), ("bench", LINE), ("world", LINE_WORLD)):
        (tmp_path / f"{name}.toml").write_text(text)
    done = session(tmp_path)
    assert done.returncode == 75, done.stderr
    assert re.search(r"left on: supply keeps control at [\d.]+ psia, setpoint [\d.]+ psia", done.stderr)


def chamber(**state):
    return Mock(spec=Chamber, read=lambda: ChamberState(80.0, 75.234, 40.0, **state))


def controller(psia, *, controlling=False, venting=False):
    return Mock(spec=PressureController, read=lambda: PressureState(4.0, psia, True, controlling, venting, 0.0))


def source(*, output, safe):
    read = SourceState(1000.0, 1000.02, True, output, safe)
    return Mock(spec=Source, read=lambda: read, unit=lambda: "V")


@pytest.mark.parametrize(
    ("instrument", "words"),
    [
        (chamber(running=True), "x stays on at a setpoint of 80 degC, now 75.23 degC"),
        (chamber(running=False), None),
        (controller(4.00012, controlling=True), "x keeps control at 4.0001 psia, setpoint 4 psia"),
        (controller(9.5, venting=True), "x is venting, now at 9.5 psia"),
        (controller(1000.26), "x is off, and its line stays at 1000.3 psia"),
        (controller(14.7), None),
        (source(output=True, safe=False), "x stays on at 1000.02 V"),
        (source(output=True, safe=True), None),
        (source(output=False, safe=True), None),
        (Mock(spec=Chamber, read=Mock(side_effect=OSError("no answer"))), "x may be on, it was not read: no answer"),
        (Mock(spec=Reader), None),
    ],
)
def test_an_output_that_stays_on_is_said_with_its_value_whatever_it_is(instrument, words):
    bench = SimpleNamespace(instruments={"x": instrument}, config=SimpleNamespace(safety=SafetyConfig()))
    assert outputs_on(bench, ["x"]) == ([] if words is None else [words])


def test_on_stop_names_an_instrument_of_the_bench(tmp_path):
    laboratory(tmp_path, '\n[safety]\non_stop = { kettle = "off" }\n')
    done = subprocess.run(RUN, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 78
    assert "safety.on_stop: this bench has no instrument kettle" in done.stderr


@pytest.mark.parametrize("number", ["SIGHUP", "SIGINT"])
@pytest.mark.parametrize(("ignored", "code"), [(True, 0), (False, 75)])
def test_what_was_ignored_at_the_start_stays_ignored(tmp_path, number, ignored, code):
    laboratory(tmp_path)
    set_to = signal.SIG_IGN if ignored else signal.SIG_DFL
    if number == "SIGINT" and not ignored:
        set_to = signal.default_int_handler
    before = signal.signal(getattr(signal, number), set_to)
    try:
        done = session(tmp_path, f"signal.raise_signal(signal.{number})")
    finally:
        signal.signal(getattr(signal, number), before)
    assert done.returncode == code, done.stderr


@pytest.mark.parametrize(
    ("what", "code"), [("os.close(master); signal.raise_signal(signal.SIGHUP)", 75), ("os.close(master)", 0)]
)
def test_a_closed_terminal_is_no_fault(tmp_path, what, code):
    laboratory(tmp_path)
    master, terminal = pty.openpty()
    passed = INTERRUPTING.replace("WHAT", what).replace("import signal", f"master = {master}; import os, signal", 1)
    command = [sys.executable, "-c", passed]
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=terminal, stdout=terminal, stderr=terminal, pass_fds=[master]
    ) as process:
        os.close(terminal)
        os.close(master)
        assert process.wait() == code


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"]])
def test_a_reader_that_has_gone_is_no_fault(arguments):
    """`rig --help | head -1` ended in 1: the command-line library turns a closed pipe into an exit code of its own."""
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "rig", *arguments], stdout=write, stderr=subprocess.PIPE, check=False, text=True
        )
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("lost", "code"), [(0, 0), (1, 0), (2, 3)])
def test_status_of_a_complete_run_counts_lost_points_as_its_end_did(lost, code, tmp_path):
    """A run that loses more than a tenth ends in 3; its status said 0."""
    state = RunState(points=10, ended="complete", skipped=dict.fromkeys(range(lost), "no reply"))
    assert check_code(state, tmp_path / "run.sqlite") == code
