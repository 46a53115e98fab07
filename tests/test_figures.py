"""Figures with their commit and date: written where they belong, and told when their code has changed since."""

from __future__ import annotations

import dataclasses
import re
import subprocess
from pathlib import Path

import pytest

from benchmarks import figures, in_turns

ROOT = Path(__file__).parent.parent


def row(name: str, commit: str, said: str = "1 s") -> figures.Row:
    return figures.Row(name, "what", said, "rig --help", commit, "2026-11-24")


def test_every_figure_speaks_of_code_that_is_there():
    missing = [p for one in figures.figures().values() for p in one.paths if not (ROOT / p).exists()]
    assert missing == []


def test_every_larger_campaign_has_its_commit_and_date_and_code_that_is_there():
    text = figures.LARGER.read_text()
    every = figures.campaigns(text)
    assert len(every) > 40
    for one in every:
        assert re.fullmatch(r"(<= )?[0-9a-f]{8}\+?", one.row.commit), one.row
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", one.row.date), one.row
    assert {one.section for one in every} == set(figures.sections())
    missing = [p for paths in figures.sections().values() for p in paths if not (ROOT / p).exists()]
    assert missing == []
    tables = [line for line in text.splitlines() if line.startswith("| what | figure")]
    assert set(tables) == {figures.CAMPAIGNS[0]}, "a table without commits"


def test_a_campaign_is_stamped_and_nothing_else_changes():
    table = "\n".join(
        (*figures.CAMPAIGNS, "| nights | 0 of 10 | `rig night` | <= aaaa | 2026-11-01 |", "| a | b | c | d | e |")
    )
    text = f"# Nights\n\n{table}\nafter\n"
    done = figures.stamped(text, figures.campaign(text, "night"), "bbbb", "2026-11-24")
    assert done == text.replace("| <= aaaa | 2026-11-01 |", "| bbbb | 2026-11-24 |")
    assert [one.section for one in figures.campaigns(text)] == ["Nights", "Nights"]
    with pytest.raises(SystemExit, match="0 rows begin with 'fit'"):
        figures.campaign(text, "fit")


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


def test_a_row_is_old_when_the_code_it_speaks_of_has_changed(tmp_path):
    def git(*arguments: str) -> str:
        told = ("-c", "user.name=t", "-c", "user.email=t@example.org")
        done = subprocess.run(["git", *told, *arguments], cwd=tmp_path, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    def commit(name: str) -> str:
        (tmp_path / name).write_text((tmp_path / name).read_text() + "x" if (tmp_path / name).exists() else "x")
        git("add", ".")
        git("commit", "-q", "-m", name)
        return git("rev-parse", "--short", "HEAD")

    git("init", "-q")
    figure = figures.Figure("one", "what", "rig --help", ("code.py",))
    first = commit("code.py")
    commit("other.py")
    assert figures.stale(figure, row("one", first), tmp_path) == ""
    last = commit("code.py")
    assert f"changed in 1 commits since, last in {last}" in figures.stale(figure, row("one", first), tmp_path)
    assert figures.stale(figure, row("one", last), tmp_path) == ""
    assert "not in this clone" in figures.stale(figure, row("one", "0123456"), tmp_path)
    assert "not committed" in figures.stale(figure, row("one", f"{last}+"), tmp_path)
    assert "not measured yet" in figures.stale(figure, None, tmp_path)


def test_what_a_command_says_is_quoted_and_another_answer_is_refused():
    said = figures.Figure("one", "what", "python -c 'print(\"took   12 ms, all\")'", (), ("(took.*ms)",))
    assert figures.measure(said) == "took 12 ms"
    with pytest.raises(SystemExit, match="no longer says"):
        figures.measure(figures.Figure("one", "what", "python -c 'print(1)'", (), ("(took)",)))
    with pytest.raises(SystemExit, match="ended with 3"):
        figures.measure(figures.Figure("one", "what", "python -c 'raise SystemExit(3)'", (), ("(took)",)))


def test_numbers_are_known_by_the_words_around_them():
    said = "F4T: read() 15.1 us, 2 of them\nF4T: read() 16 us, 3 of them"
    assert in_turns.numbers(said) == {
        "F4T: read() # us, # of them [1]": 15.1,
        "F4T: read() # us, # of them [2]": 2.0,
        "F4T: read() # us, # of them [1]'": 16.0,
        "F4T: read() # us, # of them [2]'": 3.0,
    }


def test_a_command_that_the_other_commit_does_not_have_is_said(tmp_path):
    figure = figures.Figure("none", "what", "python -m benchmarks.no_such_thing", ())
    (said,) = in_turns.compared(figure, tmp_path, 1)
    assert said.startswith("none: fails there: ")
    assert "no_such_thing" in said or "benchmarks" in said


def test_a_campaign_quotes_every_match_and_the_span_of_numbers():
    output = "a: named 3, of 4\n  at 0 deg: 94.5\n  at 30 deg: 95.5\nb: named 4, of 4\n"
    asked = {"says": (r"(named \d)",), "spans": (r"(?m)^  .*: ([\d.]+)$",)}
    one = figures.Figure("one", "what", "rig --help", ("code.py",), **asked)
    assert figures.told(one, output) == ["named 3", "94.5 to 95.5, mean 95, in 2"]
    assert figures.told(dataclasses.replace(one, campaign=True), output)[:2] == ["named 3", "named 4"]
    assert figures.told(one, "something else") == []
