"""Answers of `rig trace` that the documents show are those of the examples, word by word."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from command import rig

from rig.cli.demo import _NIGHTS, Lab
from rig.examples import example

DOCS = Path(__file__).parents[2] / "docs" / "how_to"


def shown(place: int) -> str:
    """The answer in this place of the page: of the demo, of the load cell."""
    answers = re.findall(r"```text\n(.*?)```", (DOCS / "trace.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(answers) == 2
    return words(answers[place])


def words(text: str) -> str:
    """The same without numbers, line ends and indents."""
    return re.sub(r"\d[\d.e-]*", "N", " ".join(text.split()))


def traced(lab: Lab, folder: Path, *, short: bool = False) -> str:
    """What the trace of a dry run of an example says."""
    night = _NIGHTS[lab]
    shutil.copytree(example(night.folder), folder, dirs_exist_ok=True)
    if short:
        procedure = folder / night.procedure
        procedure.write_text(procedure.read_text(encoding="utf-8").replace(*night.shortened, 1), encoding="utf-8")
    run = rig("run", night.procedure, "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    return words(rig("trace", run.stdout.splitlines()[0], cwd=folder).stdout)


def test_the_trace_of_the_load_cell_says_what_its_page_shows(tmp_path):
    assert shown(1) in traced(Lab.LOAD_CELL, tmp_path)


def test_the_trace_of_the_demo_says_what_its_page_shows(tmp_path):
    assert shown(0) in traced(Lab.ATTITUDE, tmp_path, short=True)


def test_words_are_compared_without_numbers_and_line_ends():
    assert words("p < 5.8e-05\n  0.02 V at 21 points") == "p < N N V at N points"
