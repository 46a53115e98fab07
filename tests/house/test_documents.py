"""What a document claims, a test runs."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from rig.engine import states
from rig.engine.at_point import AtPoint
from rig.engine.sequencer import Sequencer

ROOT = Path(__file__).parents[2]


REFERENCE = runpy.run_path(str(ROOT / "tools" / "reference"))
GENERATED = ("commands", "effects", "exit_codes", "files", "instruments", "sequencer", "table_models")


@pytest.mark.parametrize("page", [f"reference/{name}.md" for name in GENERATED] + ["how_to/scpi.md"])
def test_generated_documents_are_fresh(page):
    path = ROOT / "docs" / page
    assert path.read_text(encoding="utf-8") == REFERENCE["renewed"](path), "run .venv/bin/python tools/reference"


def test_everything_that_can_be_generated_is_in_a_page():
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")]
    shown = {name for text in pages for _, name, _ in REFERENCE["BLOCK"].findall(text)}
    of_both = {f"options of {name}" for name in REFERENCE["SCPI"]}
    assert shown == REFERENCE["BLOCKS"].keys() - of_both


def test_every_state_can_be_reached_and_left():
    reached = {states.State.READY}
    for _ in states.TRANSITIONS:
        reached |= {t.target for t in states.TRANSITIONS if set(t.sources) & reached}
    assert reached == set(states.State)
    left = {source for t in states.TRANSITIONS for source in t.sources}
    assert left == set(states.State) - states.FINAL


def test_every_state_that_can_be_left_has_a_handler():
    names = {state.value for state in states.State} - {state.value for state in states.FINAL} - {"ready"}
    assert all(hasattr(Sequencer, f"_{name}") or hasattr(AtPoint, name) for name in names)


def documents():
    return (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "proving" / "notes").glob("*.md"))


def anchors(document: Path) -> set[str]:
    """Anchors of a document's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.*)$", document.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_between_documents_lead_somewhere():
    for document in documents():
        for target, anchor in re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", document.read_text()):
            there = document.parent / target if target else document
            link = f"{document.relative_to(ROOT)} links to {target}#{anchor}"
            assert there.exists(), link
            assert not anchor or there.suffix != ".md" or anchor in anchors(there), link


def test_pages_that_code_and_examples_name_exist():
    """Messages, help and comments send people to pages."""
    folders = ("rig", "drivers", "sims", "fitter", "procedures", "examples", "proving", "tests", "tools", "benchmarks")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in ("", ".py", ".toml")]
    files += [ROOT / "pyproject.toml", ROOT / "Makefile", ROOT / ".ci" / "run"]
    named = {
        (page, path.relative_to(ROOT).as_posix())
        for path in files
        if path.is_file()
        for page in re.findall(r"\bdocs/[\w/-]+\.md\b", path.read_text(encoding="utf-8", errors="ignore"))
    }
    assert len(named) > 50
    assert {(page, path) for page, path in named if not (ROOT / page).exists()} == set()
