"""Steps by hand: procedure files, holds, answers, time-outs, kills and resumes, the simulated person."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import few_points
import ideal_pressure_bench as pressure
import numpy as np
import pytest
from dry import LAB, SHORT, dry, write_short
from few_points import Killed, kill_where, records, whole_plot
from ideal_bench import new_run, run_session
from pydantic import ValidationError

import rig
from rig.engine.by_hand.asking import ByHand
from rig.engine.session import Outcome, Progress, Signals
from rig.procedures.plan.fault_policies import ABORT
from rig.procedures.plan.hand_steps import HandStep
from rig.procedures.present.blocks import Line
from rig.run_file.events.by_hand import AskedByHand, DoneByHand
from rig.run_file.live import live_path, read_json, request_path
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import read_state
from rig.run_file.verify.sense import judged
from rig.runs.controller import resume_run, start_run
from rig.runs.plans import load_plan
from rig.sims.physics import Plant
from rig.sims.world import World
from rig.tables.table_of_run import run_table
from rig.unattended.happenings import Kind, RunFacts, from_record
from rig.unattended.notify.message import compose
from rig.verbs.plan.result import plan
from rig.watch.words import state_now

PADS = {"say": "lock the pads.", "change": "pads-locked"}
FORCE = {"say": "hang the 5 kN weight", "change": "weight", "value": "force_kN"}
TWO = [{"before": 1, **PADS}, {"before": 3, **FORCE}]


def attitude(hold_max_s=3600.0, **more):
    """Four points, with time for answers: a wait of 1 s of the bench takes 50 ms."""
    return few_points.attitude(**{"recovery": {"hold_max_s": hold_max_s}, **more})


def asked(path):
    return [r.event for r in records(path, "by-hand", "asked")]


def done(path):
    return [r.event for r in records(path, "by-hand", "done")]


class Answers:
    """Sends requests while the run holds, one after the other, and keeps what was said meanwhile."""

    def __init__(self, path: Path, *requests, session=1):
        self._path, self._requests, self._session = path, list(requests), session
        self._ids = itertools.count()
        self._sent = self._answered = ""
        self.refused: list[str] = []
        self.held: list[str] = []
        self.live: list[dict] = []

    def __call__(self, news: Progress) -> None:
        live = read_json(live_path(self._path)) or {}
        if self._sent and live.get("acknowledged") == self._sent:
            self.refused.append(live["refused"])
            self._sent = ""
            if not live["refused"]:
                self._answered = self.held[-1]
        if news.state != "holding" or not news.message:
            return
        self.held.append(news.message)
        self.live.append(live)
        if not self._sent and self._requests and news.message != self._answered:
            self._sent = f"{self._session}-{next(self._ids)}"
            content = {"id": self._sent, "session": self._session, **self._requests.pop(0)}
            request_path(self._path).write_text(json.dumps(content))


# --- procedure files ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "says"),
    [
        ({}, "none is given"),
        ({"before": 1, "before_replication": 1}, "one place"),
        ({"before": 0}, "greater than or equal to 1"),
        ({"before": 5}, "the run has 4 points"),
        ({"before_replication": 2}, "the run has 1 replication"),
        ({"before_whole_plot": 1}, "the run has 0 whole plots"),
        ({"before": 1, "change": "Pads Locked"}, "pattern"),
        ({"before": 1, "say": "two\nlines"}, "one line"),
        ({"before": 1, "say": " . "}, "one line"),
        ({"before": 1, "value": "force"}, "pattern"),
        ({"before": 1, "timeout_h": 0}, "greater than 0"),
        ({"before_every": "whole plot"}, "the run has no whole plots"),
        ({"before_every": "point"}, "'replication' or 'whole plot'"),
        ({"before_every": "replication", "before": 1}, "one place"),
        ({"before": 1, "range": [0, 1]}, "give it a name"),
        ({"before": 1, "value": "force_kN", "range": [1, 1]}, "the smaller number comes first"),
    ],
)
def test_a_step_that_makes_no_sense_is_refused(step, says):
    with pytest.raises(ValidationError, match=says):
        attitude(by_hand=[{**PADS, **step}])


def test_steps_are_part_of_the_run_list_and_of_its_hash():
    plain, with_it = attitude().expand(), attitude(by_hand=[TWO[1], TWO[0]]).expand()
    assert [(s.before, s.change) for s in with_it.steps] == [(0, "pads-locked"), (2, "weight")]
    assert plain.points == with_it.points
    assert plain.sha256() != with_it.sha256()
    assert plain.sha256() == with_it.with_steps(()).sha256()
    other = replace(with_it.steps[0], say="lock three of the pads")
    assert with_it.with_steps([other, with_it.steps[1]]).sha256() != with_it.sha256()


def test_places_are_found_in_replications_and_whole_plots():
    twice = attitude(replications=2, by_hand=[{"before_replication": 2, **PADS}]).expand()
    assert twice.steps == (HandStep(4, "lock the pads.", "pads-locked"),)
    plots = whole_plot(((-60, 0), (-50, 10)), by_hand=[{"before_whole_plot": 2, **PADS}]).expand()
    assert [step.before for step in plots.steps] == [2]
    with pytest.raises(ValidationError, match="the run has 2 whole plots"):
        whole_plot(((-60, 0), (-50, 10)), by_hand=[{"before_whole_plot": 3, **PADS}])


def test_a_step_before_every_replication_or_whole_plot_is_one_entry():
    twice = attitude(replications=3, by_hand=[{"before_every": "replication", **PADS}]).expand()
    assert [step.before for step in twice.steps] == [0, 4, 8]
    plots = whole_plot(((-60, 0), (-50, 10)), by_hand=[{"before_every": "whole plot", **PADS}]).expand()
    each = whole_plot(
        ((-60, 0), (-50, 10)), by_hand=[{"before_whole_plot": 1, **PADS}, {"before_whole_plot": 2, **PADS}]
    ).expand()
    assert [replace(step, again=False) for step in plots.steps] == list(each.steps)
    assert [step.again for step in plots.steps] == [True, True], "and where one is measured again"
    assert not any(step.again for step in (*each.steps, *twice.steps))


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ("4.9", ""),
        ("5.1", ""),
        ("-5", "--value -5 is outside the range of force_kN, 4.9 to 5.1"),
        ("1e9", "outside the range"),
        ("5,0", "write the decimal sign as a point"),
    ],
)
def test_a_stated_number_has_a_range_that_the_run_file_keeps(tmp_path, stated, says):
    procedure = attitude(by_hand=[{"before": 1, **FORCE, "range": [4.9, 5.1]}])
    with RunReader.open(new_run(tmp_path, procedure)) as run:
        (step,) = run.run_list().steps
    assert says in step.refuses(stated)
    assert bool(says) == bool(step.refuses(stated))


def test_the_run_file_holds_the_steps(tmp_path):
    procedure = attitude(by_hand=TWO)
    path = new_run(tmp_path, procedure)
    with RunReader.open(path) as reader:
        assert reader.run_list() == procedure.expand()
        assert reader.run_list_sha256() == procedure.expand().sha256() == reader.about().run_list


# --- waiting and answers -----------------------------------------------------------------------------------------


def test_the_run_holds_says_what_to_do_and_goes_on_when_it_is_done(tmp_path):
    procedure = attitude(by_hand=TWO)
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done", "who": "Ada"}, {"verb": "done", "value": "5.0003", "step": 2})
    outcome, state, _, message = run_session(path, procedure=procedure, on_progress=answers)
    assert outcome is Outcome.COMPLETE, message
    assert answers.refused == ["", ""]
    first, second = done(path)
    assert (first.step, first.before, first.change, first.number, first.who) == (1, 0, "pads-locked", None, "Ada")
    assert (second.step, second.value, second.number, second.who) == (2, "force_kN", 5.0003, "")
    assert second.waited_s > 0
    assert f"to do by hand: lock the pads; then `rig done {path}`" in answers.held
    assert f"to do by hand: hang the 5 kN weight; then `rig done {path} --value V` (V: force_kN)" in answers.held
    assert sorted(state.by_hand) == [1, 2]
    order = [(r.kind, r.status) for r in records(path) if r.kind in ("by-hand", "observation")]
    step, seen = [("by-hand", "asked"), ("by-hand", "done")], [("observation", "accepted")] * 2
    assert order == [*step, *seen, *step, *seen]


def test_a_stated_number_is_a_column_where_every_row_has_one(tmp_path):
    procedure = attitude(by_hand=[{"before": 1, **FORCE}, {"before": 3, **FORCE, "say": "hang it again"}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done", "value": "5.0003"}, {"verb": "done", "value": "5.0008"})
    run_session(path, procedure=procedure, on_progress=answers)
    assert run_table(path).columns["force_kN"].tolist() == [5.0003, 5.0003, 5.0008, 5.0008]
    (tmp_path / "late").mkdir()
    late = new_run(tmp_path / "late", attitude(by_hand=[{"before": 3, **FORCE}]))
    run_session(late, procedure=attitude(by_hand=[{"before": 3, **FORCE}]),
                on_progress=Answers(late, {"verb": "done", "value": "5"}))  # fmt: skip
    assert "force_kN" not in run_table(late).columns


def test_nothing_moves_while_a_person_is_asked(tmp_path):
    procedure = attitude(by_hand=[{"before": 1, **PADS}, {"before": 3, **PADS, "say": "unlock them"}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done"}, {"verb": "done"})
    sent = {}

    def spoil(_bench, head, _reader):
        sent["head"] = head

    counts = []

    def on_progress(news):
        if news.state == "holding":
            counts.append((news.done, len(sent["head"].sent)))
        answers(news)

    run_session(path, procedure=procedure, spoil=spoil, on_progress=on_progress)
    assert len({n for points, n in counts if points == 0}) == 1
    assert {n for points, n in counts if points == 0} == {0}
    assert len({n for points, n in counts if points == 2}) == 1


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ({"verb": "done"}, "this step asks for force_kN: say it with --value"),
        ({"verb": "done", "value": "five"}, "'five' is not a number"),
        ({"verb": "done", "value": "5,0003"}, "not a number"),
        ({"verb": "done", "value": "1_000"}, "not a number"),
        ({"verb": "done", "value": "nan"}, "not a finite number"),
        ({"verb": "done", "value": "1e999"}, "not a finite number"),
        ({"verb": "done", "value": "5", "step": 2}, "step 2 is not what the run waits for, it is step 1"),
        ({"verb": "release"}, "`rig release` does not say that it was done"),
    ],
)
def test_a_wrong_answer_is_refused_and_the_run_waits_on(tmp_path, request_, says):
    procedure = attitude(by_hand=[{"before": 2, **FORCE}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, request_, {"verb": "done", "value": "5"})
    outcome, *_ = run_session(path, procedure=procedure, on_progress=answers)
    assert outcome is Outcome.COMPLETE
    assert says in answers.refused[0]
    assert answers.refused[1] == ""
    assert [event.number for event in done(path)] == [5.0]
    assert not records(path, "release")


def test_a_value_that_nobody_asked_for_is_refused(tmp_path):
    procedure = attitude(by_hand=[{"before": 2, **PADS}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done", "value": "5"}, {"verb": "done"})
    assert run_session(path, procedure=procedure, on_progress=answers)[0] is Outcome.COMPLETE
    assert "asks for no value" in answers.refused[0]


def test_an_answer_for_an_earlier_session_counts_for_nothing(tmp_path):
    procedure = attitude(by_hand=[{"before": 2, "timeout_h": 0.002, **PADS}])
    path = new_run(tmp_path, procedure)
    stale = Answers(path, {"verb": "done"}, session=7)
    outcome, *_ = run_session(path, procedure=procedure, on_progress=stale)
    assert outcome is Outcome.INTERRUPTED
    assert stale.refused == []
    assert done(path) == []


def test_done_without_a_step_is_refused(tmp_path):
    path = new_run(tmp_path, attitude())
    answers = Answers(path, {"verb": "done"}, {"verb": "release"})

    def held(_bench, _head, reader):
        reader.overloads = {1}

    procedure = attitude(faults={"overload": ["hold"]}, recovery={"hold_max_s": 30.0})
    run_session(path, procedure=procedure, spoil=held, on_progress=answers)
    assert "nothing has to be done by hand" in answers.refused[0]
    assert done(path) == []


# --- time-out, kill, resume --------------------------------------------------------------------------------------


def test_nobody_comes_and_the_run_parks_and_can_be_resumed(tmp_path):
    procedure = attitude(hold_max_s=3.0, by_hand=[{"before": 3, **PADS}])
    path = new_run(tmp_path, procedure)
    outcome, state, head, message = run_session(path, procedure=procedure)
    assert outcome is Outcome.INTERRUPTED
    assert "nobody said within" in message
    assert f"`rig resume {path}` asks again" in message
    assert head.sent[-1] == {"pitch": 0.0, "roll": 0.0}
    assert len(state.accepted) == 2
    assert state.ended is None
    assert not [r for r in records(path, "fault") if r.status == ABORT]
    again = Answers(path, {"verb": "done"}, session=2)
    assert run_session(path, procedure=procedure, on_progress=again)[0] is Outcome.COMPLETE
    assert (len(asked(path)), len(done(path))) == (2, 1)


@pytest.mark.parametrize("when", ["asked", "done"])
def test_a_kill_before_or_after_the_answer(tmp_path, when):
    """A step that is recorded is not asked for again, one that is not recorded is."""
    procedure = attitude(by_hand=[{"before": 3, **PADS}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, *([{"verb": "done"}] if when == "done" else []))

    def on_progress(news):
        answers(news)
        if when == "asked" and news.state == "holding" and len(answers.held) > 2:
            raise Killed
        if when == "done" and news.state == "checking" and news.done == 2:
            raise Killed

    with pytest.raises(Killed):
        run_session(path, procedure=procedure, on_progress=on_progress)
    assert len(done(path)) == (when == "done")
    later = Answers(path, {"verb": "done"}, session=2)
    outcome, *_ = run_session(path, procedure=procedure, on_progress=later)
    assert outcome is Outcome.COMPLETE
    assert len(asked(path)) == (1 if when == "done" else 2)
    assert len(done(path)) == 1
    assert bool(later.held) is (when == "asked")


def test_a_kill_at_the_next_point_does_not_ask_again(tmp_path):
    procedure = attitude(by_hand=[{"before": 3, **PADS}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done"})

    def on_progress(news):
        answers(news)
        kill_where(lambda n: n.done == 3)(news)

    with pytest.raises(Killed):
        run_session(path, procedure=procedure, on_progress=on_progress)
    assert run_session(path, procedure=procedure)[0] is Outcome.COMPLETE
    assert (len(asked(path)), len(done(path))) == (1, 1)


def test_a_postponed_point_is_tried_again_before_the_bench_is_changed(tmp_path):
    procedure = attitude(by_hand=[{"before": 3, **PADS}], faults={"overload": ["skip"]})
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done"})

    def spoil(_bench, _head, reader):
        reader.overloads = {1}  # the first point; it is tried again after the second

    outcome, *_ = run_session(path, procedure=procedure, spoil=spoil, on_progress=answers)
    assert outcome is Outcome.COMPLETE
    order = [r.run_index if r.accepted else r.status for r in records(path) if r.accepted or r.kind == "by-hand"]
    assert order == [1, 0, "asked", "done", 2, 3]


def test_a_whole_plot_that_a_person_interrupts_for_long_is_measured_again(tmp_path):
    """It is looked at less often than `continue_gap_s`. The step itself is not repeated."""
    procedure = whole_plot(
        ((-60, 0),), by_hand=[{"before": 2, **PADS}], recovery={"continue_gap_s": 5.0}, faults={"retries": 1}
    )
    path, bench = pressure.new_run(tmp_path, procedure), pressure.PressureBench()
    fetch = bench.dvm.fetch
    bench.dvm.fetch = lambda: {n: [r + 1e-12 * bench.dvm.starts for r in rs] for n, rs in fetch().items()}
    answers = Answers(path)

    def on_progress(news):
        answers(news)
        if len(answers.held) == 12:
            content = {"id": "late", "session": 1, "verb": "done"}
            request_path(path).write_text(json.dumps(content))

    outcome, state, message = pressure.run_session(path, bench, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    assert len(state.lost) == 1
    assert len(done(path)) == len(asked(path)) == 1
    assert sorted(r.run_index for r in records(path, "observation", "accepted")) == [0, 0, 1]


def test_a_step_before_every_whole_plot_is_done_again_before_one_that_is_measured_again(tmp_path):
    steps = [{"before_every": "whole plot", **PADS}, {"before": 2, **FORCE}]
    procedure = whole_plot(((-60, 0),), by_hand=steps, recovery={"continue_gap_s": 5.0}, faults={"retries": 1})
    path, bench = pressure.new_run(tmp_path, procedure), pressure.PressureBench()
    fetch = bench.dvm.fetch
    bench.dvm.fetch = lambda: {n: [r + 1e-12 * bench.dvm.starts for r in rs] for n, rs in fetch().items()}
    answers = Answers(path, {"verb": "done"})

    def on_progress(news):
        answers(news)
        if len(answers.held) == 12:
            request_path(path).write_text(json.dumps({"id": "late", "session": 1, "verb": "done", "value": "5"}))
        elif len(done(path)) == 2 and news.state == "holding":
            request_path(path).write_text(json.dumps({"id": "once more", "session": 1, "verb": "done"}))

    outcome, state, message = pressure.run_session(path, bench, procedure=procedure, on_progress=on_progress)
    assert outcome is Outcome.COMPLETE, message
    assert len(state.lost) == 1
    assert [event.step for event in done(path)] == [1, 2, 1], "the weight is a change that stays"
    with RunReader.open(path) as reader:
        assert judged(reader, 9).findings == ()


# --- what people read --------------------------------------------------------------------------------------------


def test_page_and_message_say_what_to_do_and_the_command(tmp_path):
    procedure = attitude(by_hand=[{"before": 2, **FORCE}])
    path = new_run(tmp_path, procedure)
    answers = Answers(path, {"verb": "done", "value": "5"})
    run_session(path, procedure=procedure, on_progress=answers)
    with RunReader.open(path) as reader:
        shown = state_now(read_state(reader), answers.live[-1], True, path)
    assert shown["doing"] == "waits for a person: hang the 5 kN weight"
    assert shown["todo"] == f"rig done {path} --value V"
    assert shown["said"] == "(V: force_kN)", "what is to be done and the command are not said twice"
    assert shown["tone"] == "hold"

    record = next(iter(records(path, "by-hand", "asked")))
    happening = from_record(record, after_crash=False)
    assert happening is not None
    assert happening.kind is Kind.HOLD
    message = compose(happening, RunFacts(path, "small", "ideal", "small", False), None)
    assert message.headline == "ideal: waits for a person's hand"
    assert "hang the 5 kN weight; force_kN is asked for" in message.what
    assert f"rig done {path} --value V, where V is force_kN" in message.next_step
    assert "rig release does not count as done" in message.next_step
    assert message.urgent


def test_words_of_a_live_file_that_makes_no_sense_are_those_of_a_hold(tmp_path):
    path = new_run(tmp_path, attitude())
    with RunReader.open(path) as reader:
        fold = read_state(reader)
    for told in ("x", {}, {"step": "1", "of": 2, "say": "a", "value": ""}, {"step": 1, "of": 2, "say": 3, "value": ""}):
        shown = state_now(fold, {"state": "holding", "message": "held", "asked": told}, True, path)
        assert shown["todo"] == f"rig release {path}"


# --- dry runs ----------------------------------------------------------------------------------------------------

BY_HAND = """
[[by_hand]]
before = 1
say = "hang the 5 kN weight"
change = "weight"
value = "force_kN"
[[by_hand]]
before_replication = 2
say = "lock the pads"
change = "pads-locked"
"""
PADS_WORLD = """
seed = 1
[sensors]
x = { noise_V = 1e-9 }
y = { noise_V = 1e-9 }
z = { noise_V = 1e-9 }
[effects.isolation_pad]
pitch_compliance_deg_per_g = 0.1
"""


def world(folder: Path, text: str) -> Path:
    path = folder / "world.toml"
    path.write_text(text)
    return path


def _change_of_x_V(path: Path) -> float:
    """Root mean square of the differences of x between both replications."""
    table = run_table(path)
    x, first = table.columns["x_V"], table.columns["replicate"] == 1
    key = np.round(table.columns["pitch_deg"] * 1000 + table.columns["roll_deg"], 3)
    before = dict(zip(key[first], x[first], strict=True))
    differences = [value - before[at] for at, value in zip(key[~first], x[~first], strict=True)]
    return float(np.sqrt(np.mean(np.square(differences))))


def test_the_simulated_person_changes_the_simulated_bench(tmp_path):
    path = dry(tmp_path / "a", text=SHORT + BY_HAND, world=world(tmp_path, PADS_WORLD))
    same = dry(tmp_path / "b", text=SHORT, world=world(tmp_path, PADS_WORLD))
    assert _change_of_x_V(path) > 1e-3  # 0.1 deg of pads is 4 mV
    assert _change_of_x_V(same) < 1e-4
    table = run_table(path)
    assert [(made.change, made.number) for made in table.by_hand] == [("weight", 0.0), ("pads-locked", None)]
    assert table.provenance["by_hand"][0]["force_kN"] == 0.0
    block, replicate = table.columns["block"], table.columns["replicate"]
    assert (block == replicate + 1).all()  # a step in time that is given in advance, as after an interruption
    assert (run_table(same).columns["block"] == 1).all()
    assert set(run_table(path).columns) - set(run_table(same).columns) == {"force_kN"}, "what the person stated"
    assert not run_table(same).by_hand


def test_a_resumed_dry_run_remembers_what_the_person_did(tmp_path):
    plan = load_plan(
        write_short(tmp_path, SHORT + BY_HAND), LAB / "bench.toml", dry=True, world=world(tmp_path, PADS_WORLD)
    )
    paths: list[Path] = []

    def stop(news):
        if news.done == 18:
            raise Killed

    with pytest.raises(Killed):
        start_run(plan, tmp_path, signals=Signals(), announce=paths.append, on_progress=stop)
    result = resume_run(paths[0], signals=Signals(), on_progress=lambda _: None)
    assert result.outcome is Outcome.COMPLETE
    whole = dry(tmp_path / "whole", text=SHORT + BY_HAND, world=world(tmp_path, PADS_WORLD))
    one, other = (run_table(p).columns["x_V"] for p in (paths[0], whole))
    assert np.abs(one - other).max() < 1e-4
    assert len(done(paths[0])) == 2


def test_nobody_comes_to_a_simulated_bench_if_the_world_says_so(tmp_path):
    text = SHORT + BY_HAND.replace('change = "weight"', 'change = "weight"\ntimeout_h = 0.002')
    absent = world(tmp_path, PADS_WORLD + "[person]\ncomes = false\n")
    plan = load_plan(write_short(tmp_path, text), LAB / "bench.toml", dry=True, world=absent)
    result = start_run(plan, tmp_path, signals=Signals(), announce=lambda _: None, on_progress=lambda _: None)
    assert result.outcome is Outcome.INTERRUPTED
    assert "nobody said within 0.002 h that this was done: hang the 5 kN weight" in result.message


# --- events ------------------------------------------------------------------------------------------------------


def test_events_say_who_did_what_when():
    about = {"step": 2, "before": 7, "say": "lock the pads.", "change": "pads-locked"}
    made = DoneByHand(**about, who="Ada", waited_s=61.4)
    assert made.sentence(None) == "step 2 was done by hand by Ada after 61 s: lock the pads"  # type: ignore[arg-type]
    question = AskedByHand(**about, value="force_kN", timeout_s=60.0)
    assert question.sentence(None) == (  # type: ignore[arg-type]
        "a person is asked for step 2, before point 7: lock the pads; force_kN is asked for"
    )


def test_an_observation_without_its_step_is_found_by_verification(tmp_path, monkeypatch):
    monkeypatch.setattr(ByHand, "due", lambda _self, _following: False)
    path = dry(tmp_path, text=SHORT + BY_HAND, world=world(tmp_path, PADS_WORLD))
    with RunReader.open(path) as reader:
        found = [str(finding) for finding in judged(reader, 100).findings]
    assert len(found) == 30
    assert "nothing says that step 1 by hand was done, which comes before its point" in found[0]


def test_a_sound_run_with_steps_is_verified_without_findings(tmp_path):
    path = dry(tmp_path, text=SHORT + BY_HAND, world=world(tmp_path, PADS_WORLD))
    with RunReader.open(path) as reader:
        assert judged(reader, 100).findings == ()


# --- the simulated bench -----------------------------------------------------------------------------------------


def _attitude_plant(values):
    sensors = {"x": {"axis": "x", "reader": "dvm", "channel": "1"}}
    return Plant(World(), {"seed": 3, **values}, {"sensors": sensors})


def test_locked_pads_do_not_deflect():
    effects = {"effects": {"isolation_pad": {"pitch_compliance_deg_per_g": 0.5}}}
    soft, stiff = _attitude_plant(effects), _attitude_plant({})
    assert soft.clean_V("dvm", "1", 1.0, 2.0) != stiff.clean_V("dvm", "1", 1.0, 2.0)
    soft.by_hand("pads-locked")
    assert soft.clean_V("dvm", "1", 1.0, 2.0) == stiff.clean_V("dvm", "1", 1.0, 2.0)


def test_every_mounting_has_its_own_small_error():
    plant = _attitude_plant({"mounting": {"error_deg": 0.1}})
    seen = [plant.clean_V("dvm", "1", 1.0, 2.0)]
    for _ in range(3):
        plant.by_hand("remount")
        seen.append(plant.clean_V("dvm", "1", 1.0, 2.0))
    assert len(set(seen)) == 4
    assert np.ptp(seen) < 5.0 * np.radians(0.1) * 8
    again = _attitude_plant({"mounting": {"error_deg": 0.1}})
    for _ in range(3):
        again.by_hand("remount")
    assert again.clean_V("dvm", "1", 1.0, 2.0) == seen[3]


def test_another_voltmeter_has_another_error():
    bent, fine = _attitude_plant({"voltmeter": {"square_ppm_per_V": 500.0}}), _attitude_plant({})
    true_V = fine.clean_V("dvm", "1", 1.0, 2.0)
    assert bent.clean_V("dvm", "1", 1.0, 2.0) == pytest.approx(true_V * (1 + 500e-6 * true_V), rel=1e-12)
    bent.by_hand("voltmeter-swapped")
    assert abs(bent.clean_V("dvm", "1", 1.0, 2.0) - true_V) < abs(500e-6 * true_V**2) + 60e-6 * abs(true_V)
    fine.by_hand("voltmeter-swapped")
    assert 0 < abs(fine.clean_V("dvm", "1", 1.0, 2.0) / true_V - 1) < 60e-6


@pytest.mark.parametrize(
    ("change", "effects"),
    [
        ("gauge-swapped", {"reference_nonlinearity": {"upsi_per_psi3": 5000.0}}),
        ("line-swapped", {"thermal_transpiration": {"bore_mm": 0.02}}),
        ("voltmeter-swapped", {"excitation_temperature": {"ppm_per_sse_degC": 500.0}}),
    ],
)
def test_changes_of_a_pressure_bench(change, effects):
    """The effect is less than before, and no other bench is changed as much."""
    bench = {
        "sensors": {"b": {"reader": "dvm", "channel": "1"}},
        "factors": {
            "pressure_psia": "supply",
            "sensor_temperature_degC": "cold_box",
            "sse_temperature_degC": "hot_box",
        },
    }
    boxes = {
        "sensor_chamber": {"start_setpoint_degC": -90.0, "start_controlled": True},
        "sse_chamber": {"start_setpoint_degC": 40.0, "start_controlled": True},
        "pressure_line": {"start_psia": 0.5 if change == "line-swapped" else 14.7},
    }

    def output(changes, **more):
        plant = Plant(World(), {"seed": 3, **boxes, **more}, bench)
        for one in changes:
            plant.by_hand(one)
        return plant.clean_V("dvm", "1", 1.0, 2.0)

    effect = output([], effects=effects) - output([])
    left = output([change], effects=effects) - output([change])
    assert abs(left) < 0.9 * abs(effect)
    assert output(["something-else"], effects=effects) == output([], effects=effects)


# --- plan, whole plots, trace ------------------------------------------------------------------------------------


def test_a_plan_says_when_a_person_must_be_there(tmp_path):
    with_steps, without = (
        plan(write_short(tmp_path / name, text), LAB / "bench.toml", out=tmp_path)
        for name, text in (("a", SHORT + BY_HAND), ("b", SHORT))
    )
    assert with_steps.forecast.total_s == pytest.approx(without.forecast.total_s + 2 * 900.0)
    told = with_steps.to_json()
    assert [(one["before"], one["change"], one.get("value")) for one in told["by_hand"]] == [
        (1, "weight", "force_kN"),
        (16, "pads-locked", None),
    ]
    assert told["seconds"]["by_hand"] == 1800.0
    found = with_steps.forecast
    second = with_steps.checked.run_list.steps[1]
    assert found.when_s(second, with_steps.checked.run_list) == pytest.approx(
        900.0 + found.preparation_s + 15 * found.point_s
    )
    text = " ".join(block.text for block in with_steps.blocks() if isinstance(block, Line))
    assert "a person must be there 2 times" in text
    assert "before point 16 of 30: lock the pads" in text
    assert "a person must be there" not in " ".join(b.text for b in without.blocks() if isinstance(b, Line))


def test_a_step_before_a_whole_plot_comes_before_its_soak(tmp_path):
    procedure = whole_plot(
        ((-60, 0), (-50, 10)),
        by_hand=[{"before": 1, **PADS}, {"before_whole_plot": 2, **PADS, "say": "unlock them"}],
        faults={"retries": 1},
    )
    path, bench = pressure.new_run(tmp_path, procedure), pressure.PressureBench()
    fetch = bench.dvm.fetch
    bench.dvm.fetch = lambda: {n: [r + 1e-12 * bench.dvm.starts for r in rs] for n, rs in fetch().items()}
    answers = Answers(path, {"verb": "done"}, {"verb": "done"})
    outcome, state, message = pressure.run_session(path, bench, procedure=procedure, on_progress=answers)
    assert outcome is Outcome.COMPLETE, message
    assert not state.lost
    kinds = {"asked", "done", "accepted", "whole-plot"}
    assert [r.status for r in records(path) if r.status in kinds] == [
        *("asked", "done", "whole-plot", "accepted", "accepted"),
        *("asked", "done", "whole-plot", "accepted", "accepted"),
    ]


def test_the_time_of_a_change_is_given_to_the_trace(tmp_path):
    """A step that is recorded needs no search over all times: it has another name than one that is found."""
    text = SHORT.replace("replications = 2", "replications = 4") + BY_HAND[BY_HAND.rindex("[[by_hand]]") :].replace(
        "before_replication = 2", "before = 38"
    ).replace("pads-locked", "voltmeter-swapped")
    path = dry(tmp_path, text=text, world=world(tmp_path, "seed = 3\n[voltmeter]\nspread_ppm = 300\n"))
    sensors = rig.open(path).trace().to_json()["sensors"]
    assert all("sensitivity-step" in {e["effect"] for e in one["effects"]} for one in sensors.values())


@pytest.mark.parametrize(("max_gap_s", "settled"), [(300, 2), (1800, 1)])
def test_the_wait_is_a_gap_like_others(tmp_path, max_gap_s, settled):
    """The simulated person needs ten minutes. The first step comes before the environment is settled."""
    text = f"{SHORT}[recovery]\nmax_gap_s = {max_gap_s}\n{BY_HAND}"
    path = dry(tmp_path, text=text, world=world(tmp_path, PADS_WORLD))
    assert len(records(path, "event", "prepared")) == settled


def test_early_warnings_do_not_hold_a_change_by_hand_against_the_sensors(tmp_path):
    text = SHORT.replace("replications = 2", "replications = 4")
    step = '[[by_hand]]\nbefore = 31\nsay = "use another voltmeter"\nchange = "voltmeter-swapped"\n'
    other = world(tmp_path, "seed = 3\n[voltmeter]\nspread_ppm = 3000\n")
    told = dry(tmp_path / "told", text=text + step, world=other)
    assert not records(told, "event", "warning")
