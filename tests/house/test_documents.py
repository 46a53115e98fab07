"""What a document claims, a test runs."""

from __future__ import annotations

import re
from importlib.metadata import entry_points
from pathlib import Path

from rig.cli.commands import loaded
from rig.engine import states
from rig.engine.at_point import AtPoint
from rig.engine.sequencer import Sequencer
from rig.explain import TOPICS, explained

ROOT = Path(__file__).parents[2]


def marks() -> set[str]:
    """What the site has of the generated references."""
    pages = (path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    return {mark for text in pages for mark in re.findall(r"<!-- rig explain ([\w -]+) -->", text)}


def test_the_site_has_every_generated_reference():
    of_parts = {
        "effects": {"attitude", "whole", "tables"},
        "instruments": {point.name for point in entry_points(group="rig.twins")},
    }
    wanted = {f"{topic} {part}" for topic, parts in of_parts.items() for part in parts}
    assert marks() == wanted | TOPICS.keys() - of_parts.keys()
    assert all(explained(*mark.split()).strip() for mark in wanted)


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


def test_commands_on_pages_exist_with_their_options():
    wrong = []
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        shown = re.findall(r"`(rig [a-z][^`]*)`", text) + re.findall(r"(?m)^(rig [a-z][^#\n]*)", text)
        for line in (part.strip() for whole in shown for part in re.split(r"&&|>>|[|>]", whole)):
            program, name, *words = [*line.split(), "", ""]
            if program != "rig" or name == "study":  # a group of commands
                continue
            known = {"--help"}
            known |= {o for one in loaded(name).params for o in (*one.opts, *one.secondary_opts)}
            given = {word.split("=")[0].rstrip(".,;:)") for word in words if re.match(r"--[a-z]", word)}
            wrong += [(page.name, line, option) for option in given - known]
    assert wrong == [("kinds.md", "rig fit level.csv --tilt", "--tilt")]  # of the kind that the page adds


def documents():
    return (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "proving" / "notes").glob("*.md"))


def anchors(document: Path) -> set[str]:
    """Anchors of a document's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.*)$", document.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_page_is_in_a_list_of_the_site():
    """`make docs` refuses another one; it is not run with these tests."""
    docs = ROOT / "docs"
    listed = set((docs / "index.md").read_text(encoding="utf-8").splitlines())
    pages = {page.relative_to(docs).with_suffix("").as_posix() for page in docs.rglob("*.md")}
    assert sorted(page for page in pages - listed if page != "index" and not page.startswith("decisions/0")) == []


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
