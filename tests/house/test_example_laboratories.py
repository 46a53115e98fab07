"""docs/tutorials/example_laboratories.md: its files are those of the examples, and its commands say what it says."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from command import rig

from proving.statistics.laboratories import HIDDEN, affected, names
from rig.cli.demo import _NIGHTS, Lab
from rig.examples import example

DOCUMENT = (Path(__file__).parents[2] / "docs" / "tutorials" / "example_laboratories.md").read_text(encoding="utf-8")
BLOCKS = {name: text for _, name, text in re.findall(r"```(\w+) (\S+)\n(.*?)```", DOCUMENT, re.DOTALL)}
LABS = ("bath-lab", "voltmeter-lab")


@pytest.mark.parametrize("lab", LABS)
def test_the_shown_part_of_the_procedure_is_in_the_example(lab):
    shown = BLOCKS[f"{lab}/procedure.toml"]
    assert shown in (example(lab) / "procedure.toml").read_text()
    assert tomllib.loads(shown)["factors"]


@pytest.fixture(scope="module", params=LABS)
def told(request, tmp_path_factory):
    """The laboratory, and what its trace said after the commands of the document."""
    folder = tmp_path_factory.mktemp(request.param)
    shutil.copytree(example(request.param), folder, dirs_exist_ok=True)
    run, said = "", ""
    for line in BLOCKS[request.param].strip().splitlines():
        words = line.split()[1:]
        done = rig(*(run if word == "RUN" else word for word in words), cwd=folder)
        assert done.returncode == 0, (line, done.stderr)
        run = done.stdout.splitlines()[0] if words[0] == "run" else run
        said = done.stdout
    return request.param, said


def test_the_undeclared_effect_is_named_and_nothing_else(told):
    lab, said = told
    effect, sensors = {
        "bath-lab": ("self-heating:current_A", [f"prt_{i}_mV" for i in range(1, 5)]),
        "voltmeter-lab": ("range-step:input_V", ["meter_V"]),
    }[lab]
    flat = " ".join(said.split())
    found = re.findall(r"(\S+) \(declared [^)]*\): (explained|nothing to add)", flat)
    assert [name for name, verdict in found if verdict == "explained"] == sensors
    assert [name for name, verdict in found if verdict == "nothing to add"] == (["couple_mV"] if "bath" in lab else [])
    assert re.findall(r"(\S+:\S+) \([\w-]+\): \S+ ?\S* ?of the error beyond scatter", flat) == [effect] * len(sensors)


def test_errors_before_and_after_are_as_in_the_document(told):
    lab, said = told
    rows = re.findall(r"standard error of one row\s*│\s*(\S+)\s*│\s*(\S+)", said)
    before, after = ([float(cell) for cell in column] for column in zip(*rows, strict=True))
    if lab == "bath-lab":  # the last is the thermocouple
        assert all(3e-3 < error < 5.2e-3 for error in before[:4])
        assert all(error < 0.35e-3 for error in after[:4])
    else:
        assert before[0] == pytest.approx(27e-6, abs=1e-6)
        assert after[0] == pytest.approx(10e-6, abs=1e-6)
        assert "(abs(input_V) > 22.36)" in said


@pytest.mark.parametrize("lab", Lab)
def test_demos_shorten_what_is_there(lab):
    night = _NIGHTS[lab]
    text = (example(night.folder) / night.procedure).read_text()
    assert text.count(night.shortened[0]) == 1
    assert night.short_kill_at_point < night.kill_at_point


@pytest.mark.parametrize(("lab", "seed"), [("load-cell-lab", 21), ("voltmeter-lab", 22)])
def test_a_share_of_the_campaign(lab, seed):
    """Campaign `laboratories`: the hidden effect in another world and order, and nothing without it."""
    (sensor,) = affected(lab)
    assert [set(found) for found in names(lab, seed, hidden=True).values()] == [{HIDDEN[lab]}], seed
    clean = [names(lab, seed + more, hidden=False) for more in range(2)]
    assert sum(bool(found) for one in clean for found in one.values()) <= 1, (seed, sensor)
