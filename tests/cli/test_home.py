"""`rig` alone is one screen: what runs, what waits for somebody, what to do next."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rig.cli import home
from tests.support.command import rig

DATA = Path(__file__).parents[1] / "data"


def test_an_empty_folder_says_how_to_begin(tmp_path):
    done = rig(cwd=tmp_path)
    assert done.returncode == 0
    assert "rig new FOLDER" in done.stdout
    assert "rig --help" in done.stdout


def test_runs_that_are_open_wait_and_complete_ones_have_a_next_command(tmp_path):
    runs = tmp_path / "runs"
    runs.mkdir()
    for file in sorted(DATA.glob("*.sqlite")):
        shutil.copy(file, runs)
    (runs / "torn file.sqlite").write_bytes(b"no run")
    done = rig(cwd=tmp_path)
    assert done.returncode == 0
    assert "Nothing is at work." in done.stdout
    assert "rig verify 'runs/torn file.sqlite'" in done.stdout
    assert "  rig trace runs/" in done.stdout
    assert len(done.stdout.splitlines()) <= 22


@pytest.mark.parametrize(
    ("row", "code", "says"),
    [
        ({"state": "interrupted", "running": False}, 75, "runs/a.sqlite: interrupted: rig resume runs/a.sqlite"),
        ({"state": "faulted", "running": False}, 5, "the bench is NOT SAFE: rig status runs/a.sqlite"),
        ({"state": "holding", "running": True}, 6, "runs/a.sqlite holds: rig release runs/a.sqlite"),
    ],
)
def test_a_run_says_what_it_needs(row, code, says):
    assert [line for line in home.waits({"run_file": "runs/a.sqlite", **row}, code) if says in line]


def test_a_complete_run_needs_nobody():
    assert not list(home.waits({"run_file": "runs/a.sqlite", "state": "complete", "running": False}, 0))


def test_a_queue_that_waits_says_so(tmp_path):
    shutil.copy(DATA.parents[1] / "examples" / "load-cell-lab" / "bench.toml", tmp_path)
    shutil.copy(DATA.parents[1] / "examples" / "load-cell-lab" / "procedure.toml", tmp_path)
    assert rig("queue", "add", "procedure.toml", "--bench", "bench.toml", "--dry", cwd=tmp_path).returncode == 0
    assert "1 item waits in the queue: rig queue run" in rig(cwd=tmp_path).stdout


def test_words_are_completed(tmp_path):
    asked = {"COMP_WORDS": "rig tr", "COMP_CWORD": "1", "_RIG_COMPLETE": "complete_bash"}
    assert rig(cwd=tmp_path, env=asked).stdout.split() == ["trace"]
