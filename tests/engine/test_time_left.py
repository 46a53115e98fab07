"""The time left beside the time it then took, and what `rig plan` says beside both; in virtual time."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from command import rig
from few_sensors import with_sensors

from rig.bench.config import parse_toml
from rig.engine.session import Outcome, Progress, Signals
from rig.examples import example
from rig.files.toml_text import toml_text
from rig.runs.controller import resume_run, start_run
from rig.runs.forecast import rehearse
from rig.runs.plans import Plan, load_plan, plan_of

WITHIN = 0.05
"""Of the whole time."""
PLANNED = 0.02


class Killed(BaseException):
    """Stands for SIGKILL."""


@dataclass
class Told:
    """The first news after each number of points, as (elapsed, left), in hours; killed after so many."""

    kill_at: int | None = None
    news: dict[int, tuple[float, float | None]] = field(default_factory=dict)
    end: float = 0.0

    def __call__(self, news: Progress) -> None:
        left = None if news.remaining_s is None else news.remaining_s / 3600.0
        if news.done not in self.news or self.news[news.done][1] is None:
            self.news[news.done] = news.elapsed_s / 3600.0, left
        if news.done == news.total and not self.end:
            self.end = news.elapsed_s / 3600.0
        if self.kill_at is not None and news.done >= self.kill_at:
            raise Killed

    def off(self, done: int) -> float:
        """By how much the end was misjudged, as a share of all the time."""
        elapsed, left = self.news[done]
        assert left is not None
        return (elapsed + left - self.end) / self.end


def left_in(run_file: Path) -> float:
    """What `rig status` says of an interrupted run, hours."""
    status = rig("status", run_file, "--json", cwd=run_file.parent)
    assert status.returncode == 0, status.stderr
    left = json.loads(status.stdout)["remaining_s"] / 3600.0
    assert " left once it is resumed" in rig("status", run_file, cwd=run_file.parent).stdout
    return float(left)


def made(plan: Plan, folder: Path) -> Told:
    told = Told()
    result = start_run(plan, folder, signals=Signals(), announce=lambda _: None, on_progress=told)
    assert result.outcome is Outcome.COMPLETE, result.message
    return told


@pytest.fixture(scope="module")
def pressure(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """The example's 20 whole plots, on one of its transducers; three pressures in each, and polled less often."""
    lab, folder = example("pressure-lab"), tmp_path_factory.mktemp("lab")
    bench, world = with_sensors(lab, folder, "bridge_1")
    procedure = parse_toml((lab / "procedure.toml").read_text(), "procedure")
    procedure["design"] |= {"pressures_psia": [0.12, 2.5, 5.0], "repeated_psia": []}
    procedure["soak"]["poll_s"] = 120
    (folder / "procedure.toml").write_text(toml_text(procedure))
    return load_plan(folder / "procedure.toml", bench, dry=True, world=world)


def test_time_left_of_whole_plots_from_the_first_to_the_last(pressure: Plan, tmp_path: Path) -> None:
    told = made(pressure, tmp_path)
    stages = (0, 1, 3, 9, 30, 57)
    assert {done: told.off(done) for done in stages} == pytest.approx(dict.fromkeys(stages, 0.0), abs=WITHIN)
    forecast = rehearse(pressure, lambda _: None, points=9)
    assert forecast.total_s / 3600.0 == pytest.approx(told.end, rel=PLANNED)


def test_a_rehearsal_waits_for_no_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody keeps its run file. SQLite asks for a sync at every commit all the same, so no other part changes."""
    asked: list[int] = []
    monkeypatch.setattr("rig.run_file.write.unsynced._File.xSync", lambda _, flags: asked.append(flags))
    monkeypatch.setattr("os.fsync", lambda _: pytest.fail("a folder or a file was synced"))
    plan = load_plan(example("attitude-lab") / "procedure.toml", example("attitude-lab") / "bench.toml", dry=True)
    forecast = rehearse(plan, lambda _: None, points=5)
    assert forecast.rehearsed == 5
    assert len(asked) > 5


def test_time_left_after_an_interruption_in_a_whole_plot(pressure: Plan, tmp_path: Path) -> None:
    """Twelve hours of gap, the whole plot measured again: neither is taken for what a point or a soak takes."""
    paths: list[Path] = []
    with pytest.raises(Killed):
        start_run(pressure, tmp_path, signals=Signals(), announce=paths.append, on_progress=Told(kill_at=17))
    interrupted = left_in(paths[0])
    told = Told()
    result = resume_run(paths[0], signals=Signals(), on_progress=told, dry_gap_s=12 * 3600.0)
    assert result.outcome is Outcome.COMPLETE
    assert interrupted == pytest.approx(told.end - told.news[15][0], rel=0.1), "one whole plot of 15 comes on top"
    assert 15 in told.news, "the sixth whole plot was begun again"
    stages = (15, 16, 18, 30, 57)
    assert {done: told.off(done) for done in stages} == pytest.approx(dict.fromkeys(stages, 0.0), abs=WITHIN)


def test_time_left_of_attitude_sensors_resumed_too(tmp_path: Path) -> None:
    lab = example("attitude-lab")
    bench, procedure = (parse_toml((lab / f"{name}.toml").read_text(), name) for name in ("bench", "night"))
    bench["sensors"] = {"x": bench["sensors"]["x"]}
    procedure["replications"] = 1
    procedure["design"] |= {"pitch_count": 25, "roll_count": 7}
    texts = {"bench.toml": bench, "procedure.toml": procedure, "world.toml": {"seed": 3}}
    plan = plan_of({name: toml_text(values) for name, values in texts.items()}, dry=True)
    told = made(plan, tmp_path)
    stages = (2, 10, 40, 90, 170)
    assert {done: told.off(done) for done in stages} == pytest.approx(dict.fromkeys(stages, 0.0), abs=WITHIN)
    assert rehearse(plan, lambda _: None, points=40).total_s / 3600.0 == pytest.approx(told.end, rel=PLANNED)
    paths: list[Path] = []
    with pytest.raises(Killed):
        start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=Told(kill_at=60))
    interrupted = left_in(paths[0])
    again = Told()
    assert resume_run(paths[0], signals=Signals(), on_progress=again, dry_gap_s=7200.0).outcome is Outcome.COMPLETE
    assert interrupted == pytest.approx(again.end - again.news[61][0], rel=WITHIN)
    stages = (61, 70, 100, 170)
    assert {done: again.off(done) for done in stages} == pytest.approx(dict.fromkeys(stages, 0.0), abs=WITHIN)
