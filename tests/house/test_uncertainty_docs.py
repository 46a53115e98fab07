"""What docs/explanation/uncertainty.md shows is what happens."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import rig.fitter.decision
from rig.fitter.decision import SharedRisk

DOCUMENT = (Path(__file__).parents[2] / "docs" / "explanation" / "uncertainty.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language} budget\n(.*?)```", DOCUMENT, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_example_prints_what_is_shown():
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(compile(block("python"), "uncertainty.md", "exec"), {})
    assert said.getvalue() == block("text")


def test_every_rule_is_in_the_table():
    rules = set(re.findall(r"^\| `(\w+)", DOCUMENT, re.MULTILINE))
    assert rules == {"SimpleAcceptance", "SharedRisk", "GuardBand", "ProbabilityLimit"}
    assert all(hasattr(rig.fitter.decision, rule) for rule in rules)
    assert SharedRisk().largest_share == 1.0 / 3.0
