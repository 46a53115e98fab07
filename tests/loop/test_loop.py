"""A loop, its steps, its records, its recovery: the six ranges of a voltmeter, two of them with a hidden offset."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from command import rig

from proving.crashes.loops import LAB, CrashedLoop, Evaluations, crash_at, crash_often, shorter, verdicts
from proving.disk import Disk
from proving.loops import Silent
from rig.bench.config import parse_bench
from rig.drivers.errors import NoReply
from rig.engine.gap import Gap
from rig.engine.session import Outcome, Progress, Signals
from rig.errors import BenchFault, BusyError, ConfigurationError, ExitCode, UsageError
from rig.examples import example
from rig.fitter.confirm.minor_causes import MinorCause
from rig.instruments.locks import locked_addresses
from rig.loop import blocks, continue_loop, findings_of_runs, open_program, resume_loop, start_loop, timeline, to_json
from rig.loop.decide import Left, decide
from rig.loop.timeline import Timeline, seconds_until
from rig.procedures.plan.settings import LoopSettings
from rig.procedures.present.blocks import Line
from rig.run_file.live import Requests, send_request
from rig.run_file.state.state import RunState
from rig.run_file.verify.verification import verify_file
from rig.runs.controller import Site, opened
from rig.runs.plans import load_plan
from rig.verbs.confirm import judge, open_traced

FILES = {"signals": Signals(), "on_progress": lambda _: None, "told": Silent()}


@pytest.fixture(scope="module")
def evaluations() -> Evaluations:
    return Evaluations()


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory, evaluations: Evaluations) -> CrashedLoop:
    """A loop that nobody disturbed."""
    loop = CrashedLoop(tmp_path_factory.mktemp("night"), evaluations)
    assert loop.go_on()
    return loop


@pytest.fixture
def copied(night: CrashedLoop, tmp_path: Path) -> Path:
    """The program file of a copy of that loop with its files."""
    shutil.copytree(night.folder, tmp_path / "copy")
    (path,) = (tmp_path / "copy").glob("*.loop.sqlite")
    return path


def test_it_runs_finds_confirms_and_calibrates_by_itself(night: CrashedLoop):
    program = open_program(night.path)
    assert [run.planned.what for run in program.runs] == ["voltmeter, six ranges", "the same again"]
    assert verdicts(program) == {"range-step:input_V": "confirmed"}
    assert program.closed is not None
    assert (program.closed.settled, program.closed.fault) == (True, False)
    first, second = (program.file_of(run) for run in program.runs)
    calibration = json.loads((night.folder / f"{program.name}.calibration.json").read_text())
    assert calibration["confirmed_by"]["effects"][0]["verdict"] == "confirmed"
    page = (night.folder / f"{program.name}.html").read_text()
    assert "SIMULATED" in page
    assert "range-step:input_V is confirmed by a further run" in page
    assert first.name in page
    assert second.name in page
    assert night.judge() == ""


def test_every_decision_says_why_with_numbers(night: CrashedLoop):
    story = [record.sentence() for record in open_program(night.path).story]
    (why,) = [words for words in story if words.startswith("range-step:input_V is not confirmed; the same again")]
    assert "points x 1 replication, takes 3 min of 2 h 5" in why
    assert "settles everything with 9" in why or "settles everything with 100%" in why
    assert "per hour" in why
    assert "closed: no question is open: range-step:input_V: confirmed" in story


def test_errors_before_and_after_are_those_on_runs_that_no_model_has_seen(night: CrashedLoop):
    found = open_program(night.path).found[2]
    assert found.unit == "V"
    assert found.with_effects["meter_V"] < 0.5 * found.before["meter_V"]


def test_the_program_file_is_verified_with_the_heads_of_its_runs(copied: Path):
    assert rig("verify", copied).returncode == ExitCode.DONE
    program = open_program(copied)
    first, second = (program.file_of(run) for run in program.runs)
    shutil.copy(first, second)
    (finding,) = findings_of_runs(program)
    assert second.name in str(finding)
    assert rig("verify", copied).returncode == ExitCode.FAULT
    second.unlink()
    assert second.name in str(next(findings_of_runs(program)))
    with open(copied.with_name(f"{program.name}.calibration.json"), "a") as file:
        file.write(" ")
    assert "is not the calibration that the loop wrote" in str(list(findings_of_runs(program)))


def test_a_closed_loop_is_not_touched_by_a_resume(copied: Path):
    before = copied.read_bytes()
    done = rig("resume", copied)
    assert done.returncode == ExitCode.DONE
    assert "nothing to resume" in done.stderr
    assert copied.read_bytes() == before


def test_a_loop_is_no_run_and_says_so(copied: Path):
    done = rig("fit", copied)
    assert (done.returncode, "name one of its runs" in done.stderr) == (ExitCode.FAULT, True)
    done = rig("stop", copied)
    assert (done.returncode, "is at work; `rig status" in done.stderr) == (ExitCode.USAGE, True)


def test_status_of_a_loop_and_of_its_folder(copied: Path):
    done = rig("status", copied, "--check")
    assert done.returncode == ExitCode.DONE
    assert "confirmed by a further run" in done.stdout.replace("\n", " ")
    rows = {Path(row["run_file"]).name: row for row in json.loads(rig("status", copied.parent, "--json").stdout)}
    assert rows[copied.name]["state"] == "loop closed"
    assert rows[copied.name]["done"] == 2


@pytest.mark.parametrize(("nth", "lost"), [(8, "all"), (75, "none"), (180, "all"), (300, "some")])
def test_after_a_crash_at_any_write_it_goes_on(nth: int, lost: Any, evaluations: Evaluations):
    assert crash_at(nth, lost, evaluations) == (True, "")


def test_after_many_crashes_it_goes_on(evaluations: Evaluations):
    crashes, _, wrong = crash_often(11, evaluations)
    assert crashes >= 10
    assert wrong == ""


def test_a_full_disk_in_a_further_run_is_no_fault_of_the_bench(tmp_path: Path, evaluations: Evaluations):
    with Disk(seed=5, default=True) as disk:

        @contextlib.contextmanager
        def filling(plan: Any, *, start: float = 0.0) -> Any:
            disk.full_after(60_000 if plan.procedure.name != "voltmeter, six ranges" else None)
            with opened(plan, start=start) as found:
                yield found

        loop = CrashedLoop(tmp_path, evaluations, {"site": Site(filling)}, ends=Outcome.FAULT)
        assert loop.go_on(disk)
        assert loop.path is not None
        (_, further) = open_program(loop.path).runs
        assert further.ended is None
        disk.full_after(None)
        loop.how, loop.ends = {}, Outcome.COMPLETE
        assert loop.go_on(disk)
    assert loop.judge() == ""


def failing(how: str) -> Site:
    """A site whose second bench cannot be opened, or has a meter that does not answer any more."""
    benches: list[Any] = []

    @contextlib.contextmanager
    def broken(plan: Any, *, start: float = 0.0) -> Any:
        if plan.procedure.name != "voltmeter, six ranges" and how == "not there":
            raise BenchFault("the source does not answer")
        with opened(plan, start=start) as found:
            benches.append(found[0])
            if plan.procedure.name != "voltmeter, six ranges":
                for reader in found[0].readers.values():
                    reader.start = reader.read = silent
            yield found

    def silent(*_args: Any, **_more: Any) -> Any:
        raise NoReply("dvm", "no answer")

    return Site(broken)


@pytest.mark.parametrize("how", ["not there", "silent"])
def test_a_further_run_that_faults_closes_the_loop_with_what_it_has(how: str, tmp_path: Path, evaluations: Evaluations):
    loop = CrashedLoop(tmp_path, evaluations, {"site": failing(how)})
    assert loop.go_on()
    program = open_program(loop.path)
    assert program.closed is not None
    assert program.closed.fault
    assert not program.closed.settled
    assert "run 2 ended by a fault" in program.closed.why
    assert "the loop closes with what it has" in program.closed.why
    assert "calibration" in program.wrote
    assert program.wrote["calibration"].why == ""


def test_a_changed_bench_or_procedure_is_refused(tmp_path: Path, evaluations: Evaluations):
    evaluations.forecast()  # its rehearsal writes as well, on a worker where no other test has made it
    with Disk(seed=5, default=True) as disk:
        loop = CrashedLoop(tmp_path, evaluations)
        disk.crash_at(35)
        # before the first reading
        assert not loop.go_on(disk)
        disk.power_cut("none")
        procedure = tmp_path / "procedure.toml"
        text = procedure.read_text()
        procedure.write_text(text.replace("seed = 1", "seed = 2"))
        with pytest.raises(ConfigurationError, match="the procedure file was changed after the loop began") as told:
            loop.go_on(disk)
        assert told.value.exit_code == ExitCode.CONFIGURATION
        procedure.write_text(text)
        assert loop.go_on(disk)


def begin(folder: Path, **how: Any) -> Any:
    lab = example(LAB)
    common: dict[str, Any] = {**FILES, "announce": lambda _path, _plan: None}
    return start_loop(shorter(folder), lab / "bench.toml", folder / "runs", **common, **how)


def test_a_second_loop_on_a_bench_is_refused_and_leaves_nothing(tmp_path: Path):
    bench = parse_bench((example(LAB) / "bench.toml").read_text(), "bench.toml")
    with locked_addresses(bench.instruments), pytest.raises(BusyError, match="in use by another controller"):
        begin(tmp_path, hours=3)
    assert not list((tmp_path).glob("runs/*.sqlite"))


def test_without_an_end_or_time_for_the_first_run_nothing_begins(tmp_path: Path):
    with pytest.raises(UsageError, match="a loop ends at a time"):
        begin(tmp_path, dry=True)
    with pytest.raises(UsageError, match="the first run alone takes 7 min"):
        begin(tmp_path, dry=True, hours=0.05)
    with pytest.raises(UsageError, match="both say when the loop ends"):
        begin(tmp_path, dry=True, hours=3, until="07:00")
    assert not list((tmp_path).glob("runs/*.sqlite"))


def test_only_a_closed_loop_is_continued_and_then_it_goes_on(
    copied: Path, evaluations: Evaluations, night: CrashedLoop
):
    with pytest.raises(UsageError, match="say how long"):
        continue_loop(copied, **FILES)
    with night.watched():
        ending = continue_loop(copied, hours=2, considered=evaluations.consider, **FILES)
    assert ending.outcome is Outcome.COMPLETE
    program = ending.program
    assert (len(program.runs), program.continued) == (2, 1)
    assert copied.with_name(f"{program.name}.html").exists()
    assert program.name.endswith("-continued-1")
    assert verify_file(copied).whole


def test_a_person_stops_its_run_and_a_service_leaves_it_so(
    tmp_path: Path, evaluations: Evaluations, monkeypatch: pytest.MonkeyPatch
):
    asked: list[str] = []
    # Requests are seen at once, and not only ten times in a second that such a run does not take.
    monkeypatch.setattr(Requests, "_looked", property(lambda _: -1e9, lambda _, __: None), raising=False)

    def stop(news: Progress) -> None:
        if news.done == 5 and not asked:
            asked.extend(send_request(run, "stop") or "" for run in tmp_path.glob("*-1.sqlite"))

    loop = CrashedLoop(tmp_path, evaluations, {"on_progress": stop}, ends=Outcome.STOPPED)
    assert loop.go_on()
    left = rig("resume", loop.path, "--unless-stopped")
    assert left.returncode == ExitCode.STOPPED
    assert "was stopped by a person" in left.stderr
    program = open_program(loop.path)
    assert program.runs[0].ended is None
    loop.how, loop.ends = {}, Outcome.COMPLETE
    assert loop.go_on()
    assert loop.judge() == ""
    refused = rig("service", loop.path)
    assert (refused.returncode, "there is nothing to continue" in refused.stderr) == (ExitCode.USAGE, True)


# --- decisions --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def first(night: CrashedLoop):
    program = open_program(night.path)
    with night.watched():
        return open_traced(program.file_of(program.runs[0]))


BOUNDS = LoopSettings()
AMPLE = Left(hours=10.0, runs=3, allow=BOUNDS.allow)


@pytest.mark.parametrize(
    ("bounds", "left", "why"),
    [
        ({}, {"runs": 0}, "all runs that most_runs permits have been made"),
        ({}, {"hours": 0.11}, "are left, and the shortest run that may decide it takes 3 min"),
        ({}, {"allow": ("temperature",)}, "no run that the bench makes by itself would decide it"),
        (
            {"least_gain": 1.0},
            {},
            "settles an open question with a probability of 0.1.. per hour, less than least_gain",
        ),
        ({"stop_when": "explained"}, {}, "every effect has one explanation, which is enough by stop_when"),
    ],
)
def test_why_no_further_run_is_made(bounds: Any, left: Any, why: str, first: Any, evaluations: Evaluations):
    def slow(asked: Any, **how: Any) -> Any:
        return [
            replace(one, hours=8.0 if bounds.get("least_gain") else one.hours)
            for one in evaluations.consider(asked, **how)
        ]

    decision = decide(first, None, BOUNDS.model_copy(update=bounds), replace(AMPLE, **left), slow)
    assert decision.run is None
    assert not decision.settled
    assert re.search(why, decision.why), decision.why


@pytest.mark.parametrize(("before", "now", "goes_on"), [(13, 13, False), (14, 13, True), (12, 12, True)])
def test_a_question_of_many_explanations_takes_no_second_run_if_the_first_excludes_none(
    before: int, now: int, goes_on: bool, first: Any, night: CrashedLoop, evaluations: Evaluations, monkeypatch: Any
):
    """Before, three runs were made for a chance effect with 24 explanations, 6 times the hours of the design twice."""
    with night.watched():
        told = judge(first, *open_program(night.path).further)
    (question,) = first.questions

    def having(count: int) -> Any:
        members = (*question.members, *([replace(question.members[0], effect="another")] * count))[:count]
        return replace(first, questions=(replace(question, members=members),))

    monkeypatch.setattr("rig.loop.decide.following", lambda _, alone: having(now))
    decision = decide(having(before), told, BOUNDS, AMPLE, lambda _, **how: evaluations.consider(first, **how))
    assert (decision.run is not None) is goes_on
    if not goes_on:
        assert "the further runs leave as many explanations as before" in decision.why
        assert not decision.for_person


def test_the_best_run_that_the_bench_makes_alone_is_made_and_others_are_left_to_a_person(
    first: Any, evaluations: Evaluations
):
    runs = list(evaluations.consider(first))
    turned = replace(runs[0], variation=replace(runs[0].variation, turned=True))
    weather = replace(runs[0], variation=replace(runs[0].variation, by_weather=True))
    decision = decide(first, None, BOUNDS, AMPLE, lambda _, **_how: [weather, turned, *runs])
    assert decision.run is runs[0]
    left = replace(AMPLE, runs=0)
    assert decide(first, None, BOUNDS, left, lambda _, **_how: [weather, turned, *runs]).for_person[0] is turned


@pytest.mark.parametrize("of_time", [False, True])
def test_a_question_of_time_or_temperature_is_asked_of_an_environment_that_settles_anew(
    of_time: bool, first: Any, evaluations: Evaluations, monkeypatch: Any
):
    """A run that only goes on in the state of the last one confirms whatever followed that state."""
    seen: list[float | None] = []

    def asked(within: Any, **how: Any) -> Any:
        seen.append(within.confirming.stands_degC)
        return evaluations.consider(first, **how)

    monkeypatch.setattr("rig.loop.decide.lasting", lambda _: not of_time)
    standing = replace(first, confirming=first.confirming.at_rest(23.0))
    decision = decide(standing, None, BOUNDS, AMPLE, asked)
    assert decision.run is not None
    assert (decision.anew, seen) == (of_time, [None if of_time else 23.0])


# --- time -------------------------------------------------------------------------------------------------------------


def test_the_time_of_day_is_the_next_one():
    at = datetime(2026, 1, 15, 18, tzinfo=UTC).timestamp()
    assert seconds_until("07:00", at) == 13 * 3600
    assert seconds_until("18:00", at) == 24 * 3600
    with pytest.raises(ConfigurationError, match="a time of day such as 07:00"):
        seconds_until("7 am", at)


def test_a_step_of_the_machines_clock_does_not_move_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Stepped:
        seconds, utc_s = 1000.0, 1.8e9

        def now(self) -> float:
            return self.seconds

        def utc(self) -> float:
            return self.utc_s

    clock, lab = Stepped(), example(LAB)
    monkeypatch.setattr(timeline, "bench_clock", lambda _plan: (clock, "a boot"))
    real = Timeline(load_plan(shorter(tmp_path), lab / "bench.toml"), RunState())
    clock.seconds, clock.utc_s = 4600.0, 1.8e9 + 90_000.0
    assert real.elapsed_s == 3600.0
    assert real.gap == Gap(1000.0)
    assert not real.dry


def test_resume_refuses_a_run_file(night: CrashedLoop):
    program = open_program(night.path)
    with pytest.raises(UsageError, match="is a run file, not the program file of a loop"):
        resume_loop(program.file_of(program.runs[0]), **FILES)


@pytest.mark.parametrize(("stop_when", "goes_on"), [("confirmed", False), ("alone", True)])
def test_a_confirmed_cause_is_enough_and_a_second_one_beside_it_is_told(
    stop_when: str, goes_on: bool, first: Any, night: CrashedLoop, evaluations: Evaluations, monkeypatch: Any
):
    """Before, a loop went on for hours to exclude small second causes."""
    with night.watched():
        told = judge(first, *open_program(night.path).further)
    (answer,) = told.answers
    beside = replace(answer, minor_causes=(MinorCause("third-order:input_V", 0.35),))
    told = replace(told, judged=replace(told.judged, answers=(beside,)))
    monkeypatch.setattr("rig.loop.decide.following", lambda _, alone: first if alone else None)
    decision = decide(first, told, BOUNDS.model_copy(update={"stop_when": stop_when}), AMPLE, evaluations.consider)
    assert (decision.run is not None) is goes_on
    if not goes_on:
        assert decision.settled
        assert decision.why == (
            "no question is open: range-step:input_V: confirmed (beside it may be third-order:input_V up to 35% of it; "
            "stop_when = 'alone' would go on)"
        )


def test_warnings_of_its_runs_are_in_the_status_of_a_loop(copied: Path, monkeypatch: pytest.MonkeyPatch):
    program = open_program(copied)
    said = {program.file_of(program.runs[0]): ["emerging: pads in x_V, since replication 2"]}
    monkeypatch.setattr("rig.loop.shown.warnings_in", lambda path: said.get(path, []))
    assert [one["warnings"] for one in to_json(program)["runs"]] == [*said.values(), []]
    lines = [line.text for line in blocks(program) if isinstance(line, Line)]
    assert any("warning, run 1:" in line and "since replication 2" in line for line in lines)
