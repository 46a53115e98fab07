"""Tests in several processes have the results that they have in one, and a process that dies is no silent success."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[1] / "support"
CONFTEST = """
from processes import Processes

def pytest_configure(config):
    config.pluginmanager.register(Processes(2))
"""
RIGHT = """
import os
from pathlib import Path

import pytest

@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    yield tmp_path_factory.mktemp("it")
    Path("ended").write_text("once")

def test_right(folder, capfd):
    os.write(1, b"said")
    assert capfd.readouterr().out == "said"

def test_again(folder):
    assert not Path("ended").exists()
"""
WRONG = """
def test_wrong():
    print("why it is wrong")
    assert [1, 2] == [1, 3]
"""
DEAD = """
import os

def test_dead():
    os._exit(0)

def test_never():
    pass
"""


@pytest.mark.parametrize(
    ("dead", "says"),
    [(False, "1 failed, 2 passed"), (True, "2 tests have no result: processes died at ['test_dead.py::test_dead']")],
)
def test_every_test_has_its_result_or_the_run_fails(tmp_path, dead, says):
    files = {"conftest.py": CONFTEST, "test_right.py": RIGHT, "test_wrong.py": WRONG} | (
        {"test_dead.py": DEAD} if dead else {}
    )
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-o", f"pythonpath={SUPPORT}"]
    done = subprocess.run([*command, "."], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert says in done.stdout
    assert "why it is wrong" in done.stdout
    assert (tmp_path / "ended").read_text() == "once"
