"""Evaluations that take long say where they are: a bar on a terminal, a line per minute in a log, else nothing."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from rig.cli import waiting as module
from rig.cli.waiting import waiting
from rig.fitter.steps import heard, steps
from rig.verbs.data.result import open as open_data

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(module.RealClock, "stopwatch", lambda _: now[0])
    return now


def work(now, seconds):
    for _ in steps(["a_V", "b_V"]):
        for _ in steps(range(2), lambda one: f"rows left out, {one + 1} of 2", after=0.5):
            now[0] += seconds


def test_a_log_has_a_line_per_minute_with_the_time_left(clock, monkeypatch, capsys):
    monkeypatch.setattr(module, "err", Console(stderr=True, force_terminal=False))
    with waiting("tracing"):
        work(clock, 61.0)
    assert capsys.readouterr().err.splitlines() == [
        "tracing: 2 min left  a_V: rows left out, 2 of 2",
        "tracing: 2 min left  b_V",
        "tracing: 26 s left  b_V: rows left out, 2 of 2",
    ]


def test_short_work_says_nothing(clock, monkeypatch, capsys):
    for terminal in (False, True):
        monkeypatch.setattr(module, "err", Console(stderr=True, force_terminal=terminal))
        with waiting("tracing"):
            work(clock, 0.1)
    assert capsys.readouterr().err == ""


def test_a_terminal_has_a_bar_that_is_gone_at_the_end(clock, monkeypatch):
    drawn = io.StringIO()
    monkeypatch.setattr(module, "err", Console(file=drawn, force_terminal=True, width=100))
    with waiting("tracing"):
        work(clock, 3.0)
        for _ in steps(["once more"]):
            pass
    shown = drawn.getvalue()
    assert "2 s left  once more" in shown
    assert shown.rstrip("\n").endswith("\x1b[2K")


def test_nobody_hears_of_work_outside_or_after_an_error():
    def fails():
        for _ in steps([1, 2]):
            raise ZeroDivisionError

    told = []
    with pytest.raises(ZeroDivisionError), heard(lambda done, words: told.append((done, words))):
        fails()
    assert [*steps([3])] == [3]
    assert told == [(0.0, "1")]


def test_the_trace_of_a_run_of_attitude_sensors_says_which_replication_is_left_out():
    told = []
    with heard(lambda done, words: told.append((done, words))):
        open_data(DATA / "attitude-20261121.sqlite").trace()
    assert told == [(0.5, "replication left out, 1 of 2"), (0.75, "replication left out, 2 of 2")]
