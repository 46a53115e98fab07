"""A loop in which no question is open says whether the error on its further runs is more than scatter, and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from proving.crashes.loops import CrashedLoop, Evaluations
from rig.errors import RunFileError
from rig.fitter.confirm.minor_causes import MinorCause
from rig.loop import open_program
from rig.loop.decide import Decision
from rig.loop.evaluation import Evaluation, left_over
from rig.run_file.chain import Record, encode
from rig.verbs.confirm import Confirmed, consider, first, following, judge, open_traced, proposals, traces_kept


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Confirmed:
    """The judgement of a loop of the voltmeter."""
    loop = CrashedLoop(tmp_path_factory.mktemp("night"), Evaluations())
    assert loop.go_on()
    program = open_program(loop.path)
    with loop.watched():
        return judge(open_traced(program.segments[0]), *program.further)


def with_error(told: Confirmed, times: float) -> Confirmed:
    """The same with another error on the further run, in scatters."""
    errors = {name: replace(one, after=times * one.sigma) for name, one in told.judged.errors.items()}
    return replace(told, judged=replace(told.judged, errors=errors))


def test_error_that_is_scatter_is_nothing(told: Confirmed):
    assert left_over(told.first, told) == ""
    assert left_over(told.first, with_error(told, 1.2)) == ""


def test_error_beyond_scatter_is_said_with_its_size(told: Confirmed):
    said = left_over(told.first, with_error(told, 2.5))
    assert said.startswith("the error on the further runs is 2.5 times the scatter in meter_V, with the effects: ")
    assert said.endswith("no trace of the first run and a further one together names a cause")


def test_a_remainder_without_a_name_and_without_a_question_is_said(told: Confirmed):
    outcome = told.first.traced.outcomes[0]

    class Nameless:
        sensor, unnamed, findings, table = outcome.sensor, ("more",), outcome.findings, told.first.traced.table
        outcomes: Any = property(lambda self: (self,))

    nameless = replace(told.first, traced=Nameless(), questions=())
    assert left_over(nameless, None) == "meter_V has more than error, without a name"
    assert left_over(replace(told.first, questions=()), None) == ""


# --- what a further run shows -----------------------------------------------------------------------------------------


@pytest.fixture
def shows_more(told: Confirmed, monkeypatch: pytest.MonkeyPatch) -> Evaluation:
    """A loop whose further run has error left, and shows a further effect together with the first run."""
    evaluation = Evaluation(open_program(next(told.path.parent.glob("*.loop.sqlite"))))
    question = told.first.questions[0]
    new = tuple(replace(question.members[0], effect=name) for name in ("sensitivity-temperature", "sensitivity-drift"))
    both = replace(told.first, questions=(question, replace(question, members=new)))
    judged: dict[int, Confirmed | None] = {1: with_error(told, 2.5), 2: None}
    monkeypatch.setattr(Evaluation, "told", property(lambda self: judged[len(self.program.segments)]))
    monkeypatch.setattr(Evaluation, "judged", lambda self, segments, _later: judged[len(segments)])
    monkeypatch.setattr(Evaluation, "traced", lambda self, segments: both if len(segments) > 1 else told.first)
    return evaluation


def test_a_run_that_shows_a_further_effect_is_one_with_the_first_and_judges_no_more(shows_more: Evaluation):
    program, last = shows_more.program, Decision(None, "", settled=True)
    (later,) = program.further
    joined = shows_more.regrouped(last, 1)
    assert joined is not None
    assert joined.why == (
        "the error on the further runs is 2.5 times the scatter in meter_V, with the effects; together with run 2 the "
        "first run shows sensitivity-temperature or sensitivity-drift: from now on they are one run, and the others "
        "judge"
    )
    program.add(Record(1, joined.kind, 0.0, 0.0, status=joined.status, body=encode(joined.body())))
    assert (program.segments[1:], program.further) == ([later], [])
    assert shows_more.told is None
    assert program.complete not in program.found


def test_without_a_run_that_could_judge_nothing_is_joined(shows_more: Evaluation):
    assert shows_more.regrouped(Decision(None, ""), 0) is None


def test_a_loop_whose_runs_cannot_be_evaluated_is_closed_with_that_reason(
    shows_more: Evaluation, monkeypatch: pytest.MonkeyPatch
):
    def damaged(_: Evaluation) -> Confirmed | None:
        raise RunFileError("a page is damaged")

    monkeypatch.setattr(Evaluation, "told", property(damaged))
    assert shows_more.regrouped(Decision(None, "the runs cannot be evaluated: a page is damaged"), 1) is None


def test_runs_are_apart_again_if_they_leave_open_what_was_settled(shows_more: Evaluation):
    """As when the time is over before another run could judge."""
    program = shows_more.program
    for expected in (False, True):
        event = shows_more.regrouped(Decision(None, "no time is left"), 1)
        assert event is not None
        assert event.apart is expected
        program.add(Record(1, event.kind, 0.0, 0.0, status=event.status, body=encode(event.body())))
    assert event.why == "together with run 2 other runs leave range-step:input_V open: they are apart, as before"
    assert (len(program.segments), len(program.further)) == (1, 1)
    assert shows_more.regrouped(Decision(None, "no time is left"), 1) is None


def test_the_next_run_is_not_made_longer_for_a_second_cause_beside_a_confirmed_one(told: Confirmed):
    (answer,) = told.answers
    assert answer.question is not None
    beside = replace(answer.question.members[0], effect="third-order:input_V")
    question = replace(answer.question, members=(*answer.question.members, beside))
    open_one = replace(answer, members=tuple(replace(one, sigmas=0.0, shown=0.0) for one in answer.members))
    settled = replace(answer, question=question, minor_causes=(MinorCause("third-order:input_V", 0.35),))
    both = replace(told, judged=replace(told.judged, answers=(settled, open_one)))
    assert (open_one.verdict, settled.verdict) == ("not shown", "confirmed")
    for alone, count in ((True, 2), (False, 1)):
        asked = following(both, alone=alone)
        assert asked is not None
        assert len(asked.questions) == count


# --- work that is done once -------------------------------------------------------------------------------------------


def test_the_same_run_is_traced_once_in_a_session_of_a_loop(told: Confirmed, monkeypatch: pytest.MonkeyPatch):
    """Calibration, certificate and report begin with the trace that the decisions had."""
    traced: list[Path] = []
    monkeypatch.setattr(first, "trace_table", lambda table, **_: traced.append(Path(table.source)) or told.first.traced)
    with traces_kept():
        open_traced(told.first.path)
        open_traced(told.first.path)
        assert len(traced) == 1
        open_traced(told.path)
        assert len(traced) == 2
    open_traced(told.first.path)
    assert len(traced) == 3


def test_the_best_run_of_a_kind_is_chosen_once_for_a_decision(told: Confirmed, monkeypatch: pytest.MonkeyPatch):
    known: dict[tuple[str, int], Any] = {}
    alone = consider(told.first, only=lambda one: one.varies == "again", changes=False, known=known)
    assert {key[0] for key in known} == {one.variation.what for one in alone}
    chosen: list[str] = []
    best = proposals.best
    monkeypatch.setattr(proposals, "best", lambda *asked: chosen.append(asked[1][0].what) or best(*asked))
    everything = consider(told.first, changes=False, known=known)
    assert {one.variation.what for one in alone} <= {one.variation.what for one in everything}
    assert not {one.variation.what for one in alone} & set(chosen)
