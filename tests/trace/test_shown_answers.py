"""Answers of `rig trace` that the documents show are those of the examples, word by word."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

from command import rig

from rig.cli.demo import _NIGHTS, Lab
from rig.examples import example

DOCS = Path(__file__).parents[2] / "docs" / "how_to"


def shown(place: int) -> str:
    """The answer in this place of the page: of the demo on one screen, of the demo and of the load cell in full."""
    answers = re.findall(r"```text\n(.*?)```", (DOCS / "trace.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(answers) == 3
    return words(answers[place])


def words(text: str) -> str:
    """The same without numbers, line ends and indents."""
    return re.sub(r"\d[\d.e-]*", "N", " ".join(text.split()))


def traced(lab: Lab, folder: Path, *options: str, short: bool = False) -> str:
    """What the trace of a dry run of an example says."""
    night = _NIGHTS[lab]
    shutil.copytree(example(night.folder), folder, dirs_exist_ok=True)
    if short:
        procedure = folder / night.procedure
        procedure.write_text(procedure.read_text(encoding="utf-8").replace(*night.shortened, 1), encoding="utf-8")
    run = rig("run", night.procedure, "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)
    return words(rig("trace", run.stdout.splitlines()[0], *options, cwd=folder).stdout)


def test_the_trace_of_the_load_cell_says_what_its_page_shows(tmp_path):
    assert shown(2) in traced(Lab.LOAD_CELL, tmp_path, "--full")


def test_the_trace_of_the_demo_says_what_its_page_shows(tmp_path):
    said = traced(Lab.ATTITUDE, tmp_path, short=True)
    # the page leaves out a sensor, and the end of a sentence
    for line in (DOCS / "trace.md").read_text(encoding="utf-8").split("```text\n")[1].split("```")[0].splitlines():
        part = words(line.removesuffix(" ..."))
        assert part.startswith("SIMULATED") or "┏" in part or "┡" in part or "└" in part or part in said, line
    assert shown(1) in traced(Lab.ATTITUDE, tmp_path, "--full", short=True)


def test_words_are_compared_without_numbers_and_line_ends():
    assert words("p < 5.8e-05\n  0.02 V at 21 points") == "p < N N V at N points"


def test_a_simulated_run_is_marked_in_every_answer_about_it(tmp_path):
    night = _NIGHTS[Lab.LOAD_CELL]
    shutil.copytree(example(night.folder), tmp_path, dirs_exist_ok=True)
    run = rig("run", night.procedure, "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=tmp_path)
    file = run.stdout.splitlines()[0]
    for command in (("fit",), ("trace",), ("trace", "--full")):
        assert rig(*command, file, cwd=tmp_path).stdout.startswith("SIMULATED "), command
        assert json.loads(rig(*command, file, "--json", cwd=tmp_path).stdout)["data"]["simulated"], command
