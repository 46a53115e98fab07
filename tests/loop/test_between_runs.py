"""Between two runs of a loop the environment stays on, watched, and at every end it is safe."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from typing import Any

import pytest
from dry import LAB, SHORT, write_short

from proving.loops import KINDS, Silent, files_of, loop_in
from rig.drivers.errors import NoReply
from rig.drivers.roles import Chamber
from rig.engine.session import Outcome, Signals
from rig.errors import BenchFault, ExitCode, NotSafe, RigError
from rig.loop import Program, between_runs, blocks, open_program, resume_loop, to_json
from rig.loop.between_runs import MOST_S, BetweenRuns
from rig.procedures.plan.further_runs import Variation
from rig.procedures.present.blocks import Line
from rig.run_file.events.bench import EnvironmentSettled, EnvironmentStands, MadeSafe
from rig.run_file.events.loops import LoopDecided, LoopMadeSafe
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file
from rig.runs.controller import Result, Site, opened, start_run
from rig.runs.plans import Plan, load_plan

POINTS = SHORT.replace("-90, -45, 0, 45, 90", "-45, 0, 45").replace("-120, 0, 120", "0").replace("= 2\n", "= 1\n", 1)
POINTS = POINTS.replace("setpoint_degC = 23", "setpoint_degC = 26")


class Lab:
    """The bench of a loop with short runs; what was opened, and whether it still is."""

    def __init__(self, folder: Path, bench: str = "", *, permitted: bool = True) -> None:
        self.folder, self.signals = folder, Signals()
        self.benches: list[Any] = []
        self.open = 0
        own = folder / "bench.toml"
        own.write_text((LAB / "bench.toml").read_text() + bench)
        (folder / "equipment.toml").write_bytes((LAB / "equipment.toml").read_bytes())
        self.between = BetweenRuns(Site(self.opened), permitted, self.signals)

    def plan(self, text: str = POINTS) -> Plan:
        return load_plan(write_short(self.folder, text), self.folder / "bench.toml", dry=True)

    @contextlib.contextmanager
    def opened(self, plan: Plan, *, start: float = 0.0) -> Any:
        with opened(plan, start=start) as found:
            self.benches.append(found[0])
            self.open += 1
            yield found
            self.open -= 1

    def run(self, begins_s: float, text: str = POINTS) -> Result:
        return start_run(
            self.plan(text), self.folder, signals=self.signals, announce=lambda _: None, on_progress=lambda _: None,
            world_start_s=begins_s, site=self.between.of_runs, run_id=f"run-{begins_s:.0f}",
        )  # fmt: skip

    @property
    def enclosure(self) -> Any:
        return self.benches[-1].instruments["enclosure"]


def events(path: Path, *kinds: type) -> list[Any]:
    with RunReader.open(path) as reader:
        return [record.event for record in reader.records() if isinstance(record.event, kinds)]


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return Lab(tmp_path)


def test_the_next_run_takes_the_environment_over_and_does_not_settle_again(lab: Lab):
    with lab.between:
        first = lab.run(0.0)
        assert lab.between.stands_at == 26.0
        assert lab.between.left_on[0].startswith("enclosure stays on at a setpoint of 26 degC, now 2")
        second = lab.run(first.state.elapsed_s + 120.0)
        assert lab.enclosure.read().running
    assert len(lab.benches) == 1
    assert second.outcome is Outcome.COMPLETE
    assert second.state.elapsed_s < first.state.elapsed_s - 60.0
    (safe,) = events(first.path, MadeSafe)
    assert set(safe.only) == {"head", "scanner"}
    assert (len(events(first.path, EnvironmentSettled)), len(events(second.path, EnvironmentSettled))) == (1, 0)
    (stands,) = events(second.path, EnvironmentStands)
    assert stands.chambers["enclosure"]["setpoint_degC"] == pytest.approx(26.0, abs=1e-3)
    for result in (first, second):
        assert [str(one) for one in verify_file(result.path).findings] == []


def test_at_the_end_it_is_made_safe_and_its_bench_is_closed(lab: Lab, monkeypatch: pytest.MonkeyPatch):
    made: list[str] = []
    with lab.between:
        lab.run(0.0)
        enclosure = lab.enclosure
        monkeypatch.setattr(type(enclosure), "make_safe", lambda self: made.append("safe") or self._guarded.make_safe())
        assert (made, lab.open) == ([], 1)
        assert enclosure.read().setpoint_degC == pytest.approx(26.0, abs=1e-3)
    assert (made, lab.open) == (["safe"], 0)
    (safe,) = lab.between.made
    assert safe.words.startswith("enclosure safe after")
    assert safe.why == "the loop's session ends"
    assert (lab.between.left_on, lab.between.stands_at) == ((), None)


def set_by_somebody(lab: Lab) -> float:
    lab.enclosure.set_temperature(30.0)
    return 120.0


def switched_off(lab: Lab) -> float:
    lab.enclosure._guarded.make_safe()
    return 120.0


def silent(lab: Lab) -> float:
    def no_answer(*_: Any) -> Any:
        raise NoReply("enclosure", "no answer")

    read, asked = lab.enclosure._guarded.read, []

    def later() -> Any:
        asked.append(1)
        return no_answer() if len(asked) < 4 else read()

    lab.enclosure._guarded.read = later
    return 120.0


def too_long(lab: Lab) -> float:
    return MOST_S + 60.0


def interrupted(lab: Lab) -> float:
    lab.signals.interrupt = "SIGTERM"
    return 120.0


def not_looking(lab: Lab) -> float:
    lab.benches[-1].clock.sleep(600.0)
    return 700.0


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (set_by_somebody, "they do not stand as the run before left them"),
        (switched_off, "they do not stand as the run before left them"),
        (silent, "no answer"),
        (too_long, "the decision took longer than 30 min"),
        (interrupted, "interrupted (SIGTERM)"),
        (not_looking, "nobody watched them for 6"),
    ],
)
def test_what_is_not_as_it_was_left_is_made_safe_and_the_next_run_settles_again(lab: Lab, happens: Any, why: str):
    with lab.between:
        first = lab.run(0.0)
        later_s = happens(lab)
        at_s, kept = first.state.elapsed_s + later_s, lab.benches[-1]
        lab.signals = Signals()  # the run itself is not interrupted
        second = lab.run(at_s)
        assert (kept.stands, len(lab.benches)) == (False, 2)
        (safe,) = lab.between.made
    assert why in safe.why
    assert safe.unsafe == ()
    assert safe.words.startswith("enclosure safe after")
    assert len(events(second.path, EnvironmentSettled)) == 1
    assert events(second.path, EnvironmentStands) == []


def test_an_interlock_is_watched_between_runs(tmp_path: Path):
    rule = '\n[interlocks.room]\nwatch = "sensor_temperature_degC"\nwithin = [15, 35]\nwhy = "look at the package"\n'
    lab = Lab(tmp_path, rule)
    with lab.between:
        first = lab.run(0.0)
        scanner = lab.benches[-1].instruments["scanner"]
        fetch = scanner.fetch
        scanner.fetch = lambda: {**fetch(), "104": [41.0]}
        lab.run(first.state.elapsed_s + 120.0)
        (safe,) = lab.between.made
    assert "interlock room: sensor_temperature_degC is 41, and must be 15 to 35; look at the package" in safe.why


@pytest.mark.parametrize(
    ("bench", "permitted", "text"),
    [
        ("", False, POINTS),
        ('\n[safety]\non_stop = "off"\n', True, POINTS),
        ('\n[safety]\non_stop = { enclosure = "off" }\n', True, POINTS),
        ("", True, POINTS.partition("[environment]")[0]),
    ],
)
def test_nothing_stays_on_where_that_is_not_permitted(tmp_path: Path, bench: str, permitted: bool, text: str):
    lab = Lab(tmp_path, bench, permitted=permitted)
    with lab.between:
        first = lab.run(0.0, text)
        assert (lab.open, lab.between.left_on, lab.between.stands_at) == (0, (), None)
        (safe,) = events(first.path, MadeSafe)
        assert not safe.only
        lab.run(first.state.elapsed_s + 120.0, text)
    assert (len(lab.benches), lab.between.made) == (2, [])


@pytest.mark.parametrize(
    "text", [POINTS + '[[by_hand]]\nbefore = 1\nsay = "clean the base"\nchange = "base-cleaned"\n']
)
def test_before_a_person_comes_it_is_made_safe(lab: Lab, text: str):
    with lab.between:
        first = lab.run(0.0)
        lab.between.hand_over(lab.plan(text))
        (safe,) = lab.between.made
        assert safe.why == "a person comes to the bench before the next run"
        assert lab.open == 0
        second = lab.run(first.state.elapsed_s + 120.0, text)
    assert len(events(second.path, EnvironmentSettled)) == 1


def test_a_run_that_is_interrupted_leaves_its_bench_as_any_run_does(lab: Lab):
    with lab.between:
        first = lab.run(0.0)
        lab.signals = Signals("SIGTERM")
        lab.between.signals = Signals()
        second = lab.run(first.state.elapsed_s + 120.0)
        assert second.outcome is Outcome.INTERRUPTED
        assert lab.enclosure.read().running
    assert lab.between.made == []
    assert second.state.left_on[0].startswith("enclosure stays on at a setpoint of 26 degC")


def test_a_run_that_cannot_begin_leaves_nothing_on(lab: Lab):
    with lab.between, pytest.raises(RigError):  # noqa: PT012 - the second of two runs
        lab.run(0.0)
        lab.run(0.0)  # its file is there already
    assert not lab.benches[-1].stands
    (safe,) = lab.between.made
    assert safe.why == "the next run did not begin"


def ends_with(lab: Lab, error: Exception, at_s: float) -> None:
    """A loop whose session ends by an error after a run."""
    lab.between.made.clear()
    with lab.between:
        lab.run(at_s)
        raise error


def test_an_error_says_that_it_was_made_safe_or_that_it_was_not(lab: Lab, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(RigError, match=r"the disk is full\nenclosure safe after"):
        ends_with(lab, RigError("the disk is full"), 0.0)
    with pytest.raises(KeyError) as told:
        ends_with(lab, KeyError("a defect"), 1000.0)
    assert told.value.__notes__[0].startswith("enclosure safe after")
    monkeypatch.setattr("rig.engine.safe_state._Chamber._read_back", lambda *_: "its setpoint reads 90 degC")
    with pytest.raises(NotSafe, match="its setpoint reads 90 degC") as unsafe:
        ends_with(lab, RigError("the disk is full"), 2000.0)
    assert unsafe.value.exit_code is ExitCode.UNSAFE


def test_on_a_bench_in_real_time_a_thread_watches(lab: Lab, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(between_runs, "VIRTUAL", "none")
    monkeypatch.setattr(between_runs, "_LOOK_S", 1e-3)
    seen = threading.Event()
    look = between_runs.Watch.look
    monkeypatch.setattr(between_runs.Watch, "look", lambda self: (look(self), seen.set()))
    with lab.between:
        lab.run(0.0)
        assert seen.wait(20.0)
        assert lab.between.stands_at == 26.0
        lab.signals.interrupt = "SIGINT"
        watch = lab.between._watch
        assert watch is not None
        watch._thread.join(20.0)
        assert lab.between.stands_at is None
    (safe,) = lab.between.made
    assert safe.why == "interrupted (SIGINT)"


def test_a_chamber_that_could_not_be_left_alone_is_all_made_safe(lab: Lab, monkeypatch: pytest.MonkeyPatch):
    """Where the head is not safe, nothing stays on."""
    monkeypatch.setattr("rig.engine.safe_state._Head._read_back", lambda *_: "still moving")
    with lab.between:
        result = lab.run(0.0)
        assert result.outcome is Outcome.UNSAFE
        assert lab.between.stands_at is None
        (safe,) = events(result.path, MadeSafe)
        assert not safe.only
        assert "enclosure" in safe.found


# --- a whole loop -----------------------------------------------------------------------------------------------------


class Killed(Exception):
    """The process is gone."""


def cut_between_runs(folder: Path) -> Path:
    """A loop that is killed when its first run has ended."""

    def killing(event: str) -> None:
        if event == "LoopRunEnded":
            raise Killed

    files_of("attitude", KINDS["attitude"](1), folder)
    with pytest.raises(Killed):
        loop_in(folder, recorded=killing)
    (path,) = folder.glob("*.loop.sqlite")
    return path


def said(program: Program) -> list[str]:
    return [line.text for line in blocks(program) if isinstance(line, Line)]


def resumed(path: Path, **how: Any) -> Any:
    return resume_loop(path, signals=Signals(), on_progress=lambda _: None, told=Silent(), certified=False, **how)


def test_after_a_kill_between_runs_it_is_made_safe_before_anything_else(tmp_path: Path):
    path = cut_between_runs(tmp_path)
    program = open_program(path)
    (on,) = program.on_between_runs
    assert to_json(program)["left_on"] == [on]
    assert any("left on:" in line and on in line for line in said(program))

    @contextlib.contextmanager
    def gone(plan: Plan, *, start: float = 0.0) -> Any:
        raise BenchFault("the enclosure does not answer")
        yield

    ending = resumed(path, site=Site(gone))
    assert (ending.outcome, ending.unsafe) == (Outcome.UNSAFE, True)
    assert on in ending.message
    assert "the enclosure does not answer" in ending.message

    ending = resumed(path)
    story = [record.event for record in ending.program.story]
    safe = next(one for one in story if isinstance(one, LoopMadeSafe))
    assert safe.why == "the session before was cut between two runs"
    assert story.index(safe) < next(k for k, one in enumerate(story) if isinstance(one, LoopDecided))
    assert ending.program.closed is not None
    assert (ending.program.on_between_runs, ending.unsafe) == ((), False)
    assert verify_file(path).whole


def test_a_loop_leaves_the_enclosure_on_between_its_runs_and_is_shorter_by_its_settling(tmp_path: Path):
    files_of("attitude", KINDS["attitude"](1), tmp_path)
    program = loop_in(tmp_path)
    first, second = program.runs
    assert first.ended is not None
    assert second.ended is not None
    assert first.ended.left_on[0].startswith("enclosure stays on at a setpoint of 23 degC")
    assert second.ended.took_s < 1800.0
    assert 3600.0 * second.planned.hours < 1800.0
    story = [record.sentence() for record in program.story]
    safe = next(k for k, words in enumerate(story) if words.startswith("enclosure safe after"))
    assert story[safe].endswith("(no further run)")
    assert safe < next(k for k, words in enumerate(story) if words.startswith("calibration:"))
    assert program.on_between_runs == ()
    page = tmp_path / f"{program.name}.html"
    assert "enclosure stays on at a setpoint of 23 degC" in page.read_text()


def test_a_run_for_which_a_person_comes_first_settles_again(lab: Lab):
    turned = Variation("", lab.plan().procedure, turned=True)
    assert (turned.touched, Variation("", lab.plan().procedure).touched) == (True, False)


def test_only_chambers_and_baths_stay_on(lab: Lab):
    with lab.between:
        lab.run(0.0)
        bench = lab.benches[-1]
        assert bench.stays_on == {name for name, one in bench.instruments.items() if isinstance(one, Chamber)}
