"""Phrases that may not come back: odd words in docstrings, comments, messages and documents."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CODE = ("rig", "drivers", "sims", "fitter", "procedures")

# One expression of lower-case letters, which begins with none but these: a search for each phrase took 3 s.
EVERYWHERE = (
    r"how manieth|hold all the same\b|must have come at least\b|lies? to hand\b|that which\b|without a word\b|"
    r"carr(?:y|ies) on\b|no ordinary file\b|speaks (?:for|against)\b|one a (?:line|row|sensor|point|stratum)\b|"
    r"stands (?:there )?twice in\b|see[sn]? to (?:it|the network)\b"
)
"""In code, in documents, and in help texts."""
IN_DOCSTRINGS = (
    r"^(?:what (?:a|an|the|is|was|were|of|to do|every|each|all)|by which)\b|"
    r"^of (?:a|an|the|all|each|every|its|new|one|those)\b|what is left (?:of|beside|in|after)\b|"
    r"in the place of\b|whoever\b|to be had\b|so many (?:seconds|points|real|draws)\b"
)
"""In docstrings: objects before the subject, and clauses in place of a noun."""


def offences(text: str, phrases: str) -> list[str]:
    return re.findall(phrases, re.sub(r"\s+", " ", text).lower())


def code_files() -> list[Path]:
    return [path for folder in CODE for path in sorted((ROOT / folder).rglob("*.py"))]


def documents() -> list[Path]:
    return [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *(path for path in sorted((ROOT / "docs").rglob("*.md")) if path.parent.name != "decisions"),
    ]


def docstrings(path: Path) -> list[str]:
    return [text.strip() for text in re.findall(r'"""(.*?)"""', path.read_text(encoding="utf-8"), re.DOTALL)]


@pytest.mark.parametrize("folder", [*CODE, "documents"])
def test_odd_phrases_do_not_come_back(folder):
    paths = documents() if folder == "documents" else [path for path in code_files() if ROOT / folder in path.parents]
    assert paths
    found = {path.relative_to(ROOT): offences(path.read_text(encoding="utf-8"), EVERYWHERE) for path in paths}
    assert {path: words for path, words in found.items() if words} == {}


@pytest.mark.parametrize("folder", CODE)
def test_docstrings_name_what_they_describe(folder):
    texts = [(path, text) for path in code_files() if ROOT / folder in path.parents for text in docstrings(path)]
    assert texts
    found = [(str(path.relative_to(ROOT)), words) for path, text in texts if (words := offences(text, IN_DOCSTRINGS))]
    assert found == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("The point carries on\n    without a word.", {"carries on", "without a word"}),
        ("It continues silently.", set()),
        ("A phrase that\nwhich is odd", {"that which"}),
    ],
)
def test_a_phrase_is_found_across_lines(text, words):
    assert set(offences(text, EVERYWHERE)) == words


def test_a_docstring_that_begins_with_its_object_is_found():
    assert offences("What the run has come to.", IN_DOCSTRINGS) == ["what the"]
    assert offences("State of the run.", IN_DOCSTRINGS) == []
