"""Quantities that a run waits for: instrument, value, target, band, time; in status, its JSON, and on the page."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import create_autospec

import general_lab as lab
import pytest

from rig.drivers.clock import RealClock
from rig.drivers.roles import Head
from rig.engine.actions import BenchActions
from rig.engine.session import Progress
from rig.procedures.present.blocks import Block, Line
from rig.procedures.present.durations import duration
from rig.run_file.live import LiveState
from rig.verbs.run.status import Status, status_of
from rig.watch.feed import RunFeed


def test_status_says_what_settles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Status said "settling", and not for what."""
    before = LiveState.publish
    monkeypatch.setattr(LiveState, "publish", lambda self, content, *, now=False: before(self, content, now=True))
    found: list[tuple[Status, list[Block], dict[str, Any]]] = []
    moving: list[str] = []

    def look(news: Progress) -> None:
        if news.state == "moving" and len(moving) < 9 and (paths := list(tmp_path.glob("*.sqlite"))):
            moving.append(status_of(paths[0]).told["message"])
        if news.state == "settling" and not found and (paths := list(tmp_path.glob("*.sqlite"))):
            seen = status_of(paths[0])
            if seen.told["settling"] and seen.told["settling"][0]["for_s"]:
                feed = RunFeed(paths[0], None, RealClock().stopwatch, RealClock().utc)
                feed.refresh()
                found.append((seen, list(seen.blocks()), feed.view()))

    world = lab.SOURCE_WORLD.replace("time_constant_s = 0.3", "time_constant_s = 30")
    lab.run_dry(tmp_path, lab.SOURCE_PROCEDURE.replace("dwell_s=3", "dwell_s=20"), lab.SOURCE, world, on_progress=look)
    ((status, lines, page),) = found
    (one,) = status.to_json()["settling"]
    assert (one["name"], one["by"], one["unit"], one["outcome"]) == ("input", "calibrator", "V", "waiting")
    assert one["for_s"] > 0
    assert 0 < abs(one["value"] - one["target"]) < one["band"]
    (said,) = [line.text for line in lines if isinstance(line, Line) and "settling: " in line.text]
    assert said.startswith(f"  settling: input (calibrator) reads {one['value']:.6g}, {one['target']:g} within ")
    assert said.endswith(f" V is asked, for {duration(one['for_s'])}")
    (shown,) = page["settling"]
    assert {key: shown[key] for key in ("name", "by", "for_s")} == {key: one[key] for key in ("name", "by", "for_s")}
    on_way = r"input \(calibrator\) at -?[0-9.e-]+ V, on its way to -?[0-9]+, for [1-9][0-9.]* s"
    assert re.fullmatch(on_way, moving[-1])


def test_a_quantity_that_nothing_on_the_bench_sets_or_reads_is_nobodys() -> None:
    """A thermometer of a person was said to be the head's."""
    head = create_autospec(Head, instance=True)
    config = SimpleNamespace(setters={"input_V": "calibrator"})
    bench = SimpleNamespace(config=config, temperatures={"oven_degC": ("meter", "1")}, instruments={"stage": head})
    own: Any = SimpleNamespace(_bench=bench, axis_names=("pitch", "roll"))
    names = ("pitch", "input", "oven_degC", "room_degC")
    assert [BenchActions._instrument_of(own, name) for name in names] == ["stage", "calibrator", "meter", ""]
