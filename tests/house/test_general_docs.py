"""What docs/how_to/general.md shows is in the example and works as it stands."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from command import rig

from rig.examples import example

DOCUMENT = (Path(__file__).parents[2] / "docs" / "how_to" / "general.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", DOCUMENT, re.DOTALL)
FILES = [text for language, text in BLOCKS if language == "toml" and not text.startswith("[design]")]
COMMANDS = next(text for language, text in BLOCKS if language == "sh").strip().splitlines()


def test_files_in_the_document_are_those_of_the_example():
    shown = [tomllib.loads(text) for text in FILES]
    lab = example("load-cell-lab")
    assert shown[1] == tomllib.loads((lab / "bench.toml").read_text())
    procedure = tomllib.loads((lab / "procedure.toml").read_text())
    assert {key: procedure[key] for key in shown[0]} == shown[0]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What each command of the document said."""
    folder = tmp_path_factory.mktemp("lab")
    shutil.copytree(example("load-cell-lab"), folder, dirs_exist_ok=True)
    run, found = "", {}
    for line in COMMANDS:
        words = [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', line)]
        assert words.pop(0) == "rig"
        done = rig(*(run if word == "RUN" else word for word in words), cwd=folder)
        assert done.returncode == 0, (line, done.stderr)
        run = done.stdout.splitlines()[0] if words[0] == "run" else run
        found[line.replace("RUN", "")] = done.stdout
    return folder, str(folder / run), found


def test_commands_of_the_document_run_one_after_the_other(said):
    folder, _, found = said
    assert len(found) == 9
    assert (folder / "cell.html").is_file()
    assert "force_kN" in (folder / "forces.csv").read_text().splitlines()[0]
    assert "the fitted value has an sd of" in found["rig plan procedure.toml --bench bench.toml"]


def test_the_undeclared_creep_is_named(said):
    _, _, found = said
    told = next(text for line, text in found.items() if line.startswith("rig trace"))
    before, after = (float(cell) for cell in re.search(r"│ cell_V │ explained │ (\S+) -> (\S+) +│", told).groups())
    assert "creep:force_kN: cell_V still moves minutes after a change of force_kN" in told
    assert "all of the error beyond scatter" in " ".join(told.split())
    assert 0.9e-3 < before < 1.1e-3
    assert after < 12e-6
