"""Run files that earlier versions of rig wrote open, resume, fit and verify.

`data/` has two of 2026-11-21 (a complete one of each laboratory, and an interrupted one of the first: none of them says
that the bench was made safe, when readings were made, or by how much a clock was off) and one of 2026-11-23.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from command import rig

from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.verbs.page import story

DATA = Path(__file__).parents[1] / "data"
COMPLETE = {"attitude-20261121": (24, ()), "pressure-20261121": (12, ("--formula", "1 + pressure_psia"))}
INTERRUPTED = {"attitude-20261121-interrupted": (9, 24), "pressure-20261123-interrupted": (6, 12)}


@pytest.fixture
def stored(tmp_path):
    def copy(name: str) -> Path:
        return Path(shutil.copy(DATA / f"{name}.sqlite", tmp_path))

    return copy


def whole(path: Path) -> None:
    done = rig("verify", path, "--json")
    assert (done.returncode, json.loads(done.stdout)["findings"]) == (0, []), done.stdout


def told(path: Path) -> list[str]:
    return [line.what for line in story(path)]


@pytest.mark.parametrize("name", COMPLETE)
def test_a_complete_run_opens_verifies_and_fits(stored, name):
    path, (points, model) = stored(name), COMPLETE[name]
    whole(path)
    with RunReader.open(path) as reader:
        state = read_state(reader)
    assert (state.ended, len(state.accepted), state.session.operator) == ("complete", points, None)
    assert told(path)[-1].startswith(f"complete: {points} points observed")
    fitted = rig("fit", path, "--json", *model)
    assert fitted.returncode == 0, fitted.stderr
    assert json.loads(fitted.stdout)


@pytest.mark.parametrize("name", INTERRUPTED)
def test_an_interrupted_run_opens_is_resumed_to_its_end_and_verifies(stored, name):
    path, (before, points) = stored(name), INTERRUPTED[name]
    whole(path)
    assert json.loads(rig("status", path, "--json").stdout)["accepted"] == before
    done = rig("resume", path)
    assert done.returncode == 0, done.stderr
    whole(path)
    sentences = told(path)
    assert any(words.startswith("session 2 began") for words in sentences), sentences
    assert sentences[-1].startswith(f"complete: {points} points observed")
    fitted = rig("fit", path, "--json")
    assert fitted.returncode == 0, fitted.stderr
