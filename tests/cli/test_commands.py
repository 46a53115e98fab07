"""The table of commands, and what the program loads before it knows which one is asked for."""

from __future__ import annotations

import subprocess
import sys

import pytest
from command import rig

from rig.cli.commands import COMMANDS, loaded


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_says_what_the_commands_own_help_says(name):
    own = " ".join(loaded(name).help.split("\n\n")[0].split())
    assert own == COMMANDS[name].does


def test_help_and_version_load_neither_numbers_nor_settings():
    code = (
        "import sys, contextlib\n"
        "from rig.cli import main\n"
        "sys.argv = ['rig', sys.argv[1]]\n"
        "with contextlib.suppress(SystemExit): main()\n"
        "print(sorted({'numpy', 'scipy', 'pydantic', 'apsw', 'rig.fitter', 'rig.drivers'} & set(sys.modules)))\n"
    )
    for option in ("--help", "--version"):
        done = subprocess.run([sys.executable, "-c", code, option], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == "[]"


def test_a_mistake_of_the_fitter_is_no_error_of_whoever_asked(tmp_path, monkeypatch):
    def wrong(*_, **__):
        raise ValueError("expected 3 values in one dimension, found shape (4,)")

    table = tmp_path / "table.csv"
    table.write_text("x,y\n" + "".join(f"{k},{2 * k + k % 3}\n" for k in range(12)))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("rig.procedures.general.fit.search", wrong)
    done = rig("fit", table, "--response", "y", "--formula", "1 + x")
    assert done.returncode == 1
    assert "unforeseen: ValueError: expected 3 values" in done.stderr
