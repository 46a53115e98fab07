"""The README is one screen, its commands are there, and every document can be reached from it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES, MOST_LINKS, MOST_BYTES = 60, 3, 80_000
LINK = re.compile(r"\]\(([^)#:]+)")


def commands(text: str) -> list[str]:
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [line.partition("#")[0].strip() for block in blocks for line in block.splitlines()]


def test_it_is_one_screen():
    lines = README.splitlines()
    assert len(lines) <= MOST_LINES
    assert max(len(LINK.findall(line)) for line in lines) <= MOST_LINKS


def test_its_two_commands_are_made_and_run_by_continuous_integration():
    assert commands(README) == ["make demo", "make test"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(
        re.search(rf"^{command.split()[1]}: \$\(STAMP\)$", makefile, re.MULTILINE) for command in commands(README)
    )
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1] == "make test"


def test_its_picture_is_small():
    (picture,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    data = (ROOT / picture).read_bytes()
    assert data.startswith(b"\x89PNG\r\n")
    assert len(data) < MOST_BYTES


def test_the_changelog_begins_with_this_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    (first, *_) = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert first.rstrip(",") == version


def test_every_document_can_be_reached():
    waiting, reached = [ROOT / "README.md"], set()
    while waiting:
        document = waiting.pop()
        if document in reached:
            continue
        reached.add(document)
        for target in LINK.findall(document.read_text(encoding="utf-8")):
            found = (document.parent / target).resolve()
            waiting += [found] if found.suffix == ".md" else sorted(found.glob("*.md"))
    assert set((ROOT / "docs").rglob("*.md")) - reached == set()


def test_before_the_first_release_the_changelog_says_in_ten_lines_what_there_is():
    """Changes of what nobody has had are no changes; it had grown to 46 lines."""
    _, _, unreleased = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").partition(", not released yet")
    lines = [line for line in unreleased.split("\n## ")[0].splitlines() if line.startswith("- ")]
    assert 0 < len(lines) <= 10
