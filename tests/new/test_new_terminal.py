"""`rig new` at a terminal of its own: a wrong answer, a changed one, Ctrl-C, end of input."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import tomllib

import pytest


def _session(tmp_path, typed: list[str], end: bytes = b"", at: str = ""):
    """A person at a terminal, who sends `end` when `at` is shown; returns exit code and what was shown."""
    ours, theirs = pty.openpty()
    own = "import fcntl, runpy, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); sys.argv = ['rig', 'new', 'lab']"
    command = [sys.executable, "-c", f"{own}; runpy.run_module('rig', run_name='__main__')"]
    environment = {**os.environ, "TERM": "dumb", "COLUMNS": "100"}
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs, env=environment, start_new_session=True,
    ) as process:  # fmt: skip
        os.close(theirs)
        os.write(ours, "".join(f"{line}\n" for line in typed).encode())
        shown, quiet = b"", 0
        while quiet < 30:
            if select.select([ours], [], [], 1.0)[0]:
                try:
                    shown, quiet = shown + os.read(ours, 65536), 0
                except OSError:
                    break
            elif end and at.encode() in shown:  # a second key, since readline misses one just before it waits
                os.write(ours, end)
            quiet += 1
        if process.poll() is None:
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
    os.close(ours)
    return process.returncode, shown.decode().replace("\r", "")


def test_a_person_at_a_terminal_is_told_what_is_wrong_changes_an_answer_and_gets_files(tmp_path):
    typed = ["force stand", "force", "kN", "nonsense", "0 5 10", "", "", "cell", "", "", "", "", "?", "/dev/rig/dvm"]
    code, shown = _session(tmp_path, [*typed, *[""] * 5, "replications", "2", "yes"])
    assert code == 0, shown
    assert "'nonsense' is no number" in shown
    assert "no USB serial port is present" in shown or "/dev/" in shown
    assert "5 s of preparation" in shown or "of preparation" in shown
    assert tomllib.loads((tmp_path / "lab" / "procedure.toml").read_text())["replications"] == 2


@pytest.mark.parametrize("end", [b"\x03", b"\x04"], ids=["Ctrl-C", "end of input"])
def test_ctrl_c_and_end_of_input_write_nothing(tmp_path, end):
    code, shown = _session(tmp_path, ["x", "force"], end, "[kN]: ")
    assert code == 75, shown
    assert "nothing was written" in shown
    assert list(tmp_path.iterdir()) == []
