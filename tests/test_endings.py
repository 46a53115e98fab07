"""Ends of a session: which outputs stay on, closed terminals, and signals that were ignored at the start."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys

import general_lab as lab
import pytest
from command import rig

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
