"""Phrases that may not come back: odd words in docstrings, comments, messages and documents."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CODE = ("rig", "drivers", "sims", "fitter", "procedures")

EVERYWHERE = (
    r"how manieth",
    r"\bhold all the same\b",
    r"\bmust have come at least\b",
    r"\blies? to hand\b",
    r"\bthat which\b",
    r"\bwithout a word\b",
    r"\bcarr(y|ies) on\b",
    r"\bno ordinary file\b",
    r"\bspeaks (for|against)\b",
    r"\bone a (line|row|sensor|point|stratum)\b",
    r"\bstands (there )?twice in\b",
    r"\bsee(s|n)? to (it|the network)\b",
)
"""In code, in documents, and in help texts."""
IN_DOCSTRINGS = (
    r"^What (a|an|the|is|was|were|of|to do|every|each|all)\b",
    r"^Of (a|an|the|all|each|every|its|new|one|those)\b",
    r"^By which\b",
    r"\bwhat is left (of|beside|in|after)\b",
    r"\bin the place of\b",
    r"\bwhoever\b",
    r"\bto be had\b",
    r"\bso many (seconds|points|real|draws)\b",
)
"""In docstrings: objects before the subject, and clauses in place of a noun."""


def offences(text: str, phrases: tuple[str, ...]) -> list[str]:
    flat = re.sub(r"\s+", " ", text)
    return [found.group() for phrase in phrases for found in re.finditer(phrase, flat, re.IGNORECASE)]


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
    assert offences("What the run has come to.", IN_DOCSTRINGS) == ["What the"]
    assert offences("State of the run.", IN_DOCSTRINGS) == []
