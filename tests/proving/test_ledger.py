"""The ledger of ratios: a loss is told from the last line on the same kind of machine, with the functions that grew."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from benchmarks import ledger, ratios

THEN = ledger.Entry(
    "fit",
    4.0,
    4e-4,
    1e-4,
    "aaaa",
    "2026-11-01",
    "a processor, 2 cores, Python 3.11",
    0.2,
    {"a.py:f": 3.0, "b.py:g": 1.0},
)


def test_the_last_line_of_the_same_ratio_and_machine_counts():
    other = replace(THEN, machine="another", ratio=1.0)
    text = "\n".join(json.dumps(asdict(one)) for one in (replace(THEN, ratio=5.0), THEN, other))
    standing = ledger.entries(text)
    assert ledger.last(standing, "fit", THEN.machine) == THEN
    assert ledger.last(standing, "night", THEN.machine) is None


def test_a_loss_names_the_functions_that_grew():
    now = replace(THEN, ratio=5.0, profile={"a.py:f": 3.02, "b.py:g": 1.9, "c.py:new": 0.3})
    said = ledger.told(now, THEN)
    assert "LOSS" in said
    assert [line.split()[0] for line in said.splitlines()[1:]] == ["b.py:g:", "c.py:new:"]


@pytest.mark.parametrize("ratio", [3.0, 4.3])
def test_a_gain_and_less_than_a_tenth_more_are_no_loss(ratio: float):
    assert "LOSS" not in ledger.told(replace(THEN, ratio=ratio), THEN)


def test_a_busy_machine_is_said_with_a_loss():
    assert "load 3.0 a core now" in ledger.told(replace(THEN, ratio=9.0, load=3.0), THEN)


def test_both_sides_are_timed_in_turns_and_by_the_unit(tmp_path: Path):
    ticks = iter(range(1000))
    took = {"ours": 6, "peer": 2}
    turns: list[str] = []

    def action(side: str) -> None:
        turns.append(side)
        for _ in range(took[side] - 1):  # the clock adds one by itself
            next(ticks)

    pair = ratios.Pair(lambda: action("ours"), lambda: action("peer"), (3.0, 1.0), lambda: float(next(ticks)))
    found = ledger.measured(ratios.Ratio("x", "", lambda _: pair, rounds=3))
    assert (found.ours, found.peer, found.ratio) == (2.0, 2.0, 1.0)
    assert turns == ["ours", "peer"] * 4


def slow() -> int:
    total = 0
    for i in range(300_000):
        total += i
    return total


def test_the_profile_is_of_ours_in_units_of_the_peers_time():
    profile = ledger.profile_of(ratios.Pair(slow, lambda: None), 1e-3)
    assert max(profile, key=profile.__getitem__) == "tests/proving/test_ledger.py:slow"
    assert profile["tests/proving/test_ledger.py:slow"] > 1.0, "it takes several milliseconds"


def test_every_ratio_of_the_issue_is_there():
    assert {"own-point", "exchange", "night", "fit", "table-2", "reml-flat", "reml-nested", "inference"} <= set(
        ratios.RATIOS
    )
    assert {"trace-attitude", "trace-pressure", "plan-attitude", "start-up", "csv", "memory"} <= set(ratios.RATIOS)
