"""Figures with their commit and date: written where they belong, and told when their code has changed since."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from benchmarks import figures, in_turns

ROOT = Path(__file__).parents[2]


def row(name: str, commit: str, said: str = "1 s") -> figures.Row:
    return figures.Row(name, "what", said, "rig --help", commit, "2026-11-24")


def test_the_document_has_the_place_for_the_rows_and_only_known_ones():
    text = figures.DOCUMENT.read_text()
    standing = figures.rows(text)
    assert set(standing) <= set(figures.figures())
    assert figures.written(text, standing) == text, "rows are written by their command, not by hand"


def test_a_row_is_replaced_and_the_others_stay():
    marks = "\n".join(mark for pair in figures.MARKS for mark in pair)
    text = f"before\n{marks}\nafter\n"
    once = figures.written(text, {"start-up": row("start-up", "aaaa"), "exchange": row("exchange", "bbbb")})
    again = figures.written(once, figures.rows(once) | {"exchange": row("exchange", "cccc", "2 us | 3 us")})
    assert figures.rows(again)["start-up"] == row("start-up", "aaaa")
    assert figures.rows(again)["exchange"] == row("exchange", "cccc", "2 us / 3 us")
    assert again.startswith("before\n")
    assert again.endswith("after\n")
    last = figures.written(again, figures.rows(again) | {"kills": row("kills", "aaaa")})
    first, _, second = last.partition(figures.MARKS[0][1])
    assert "| kills |" in second, "campaigns have a table of their own"
    assert "| exchange |" in first


def test_a_document_without_the_place_is_refused():
    with pytest.raises(SystemExit, match="lacks the marks"):
        figures.written("nothing here", {})


def test_what_a_command_says_is_quoted_and_another_answer_is_refused():
    said = figures.Figure("one", "what", "python -c 'print(\"took   12 ms, all\")'", ("(took.*ms)",))
    assert figures.measure(said) == "took 12 ms"
    with pytest.raises(SystemExit, match="no longer says"):
        figures.measure(figures.Figure("one", "what", "python -c 'print(1)'", ("(took)",)))
    with pytest.raises(SystemExit, match="ended with 3"):
        figures.measure(figures.Figure("one", "what", "python -c 'raise SystemExit(3)'", ("(took)",)))


def test_numbers_are_known_by_the_words_around_them():
    said = "F4T: read() 15.1 us, 2 of them\nF4T: read() 16 us, 3 of them"
    assert in_turns.numbers(said) == {
        "F4T: read() # us, # of them [1]": 15.1,
        "F4T: read() # us, # of them [2]": 2.0,
        "F4T: read() # us, # of them [1]'": 16.0,
        "F4T: read() # us, # of them [2]'": 3.0,
    }


def test_a_command_that_the_other_commit_does_not_have_is_said(tmp_path):
    figure = figures.Figure("none", "what", "python -m benchmarks.no_such_thing")
    (said,) = in_turns.compared(figure, tmp_path, 1)
    assert said.startswith("none: fails there: ")
    assert "no_such_thing" in said or "benchmarks" in said


def test_a_campaign_quotes_every_match_and_the_span_of_numbers():
    output = "a: named 3, of 4\n  at 0 deg: 94.5\n  at 30 deg: 95.5\nb: named 4, of 4\n"
    asked = {"says": (r"(named \d)",), "spans": (r"(?m)^  .*: ([\d.]+)$",)}
    one = figures.Figure("one", "what", "rig --help", **asked)
    assert figures.told(one, output) == ["named 3", "94.5 to 95.5, mean 95, in 2"]
    assert figures.told(dataclasses.replace(one, campaign=True), output)[:2] == ["named 3", "named 4"]
    assert figures.told(one, "something else") == []
