"""A loop in which no question is open says whether the error on its further runs is more than scatter, and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from proving.crashes.loops import CrashedLoop, Evaluations
from rig.loop import open_program
from rig.loop.left_over import left_over
from rig.verbs.confirm import Confirmed, consider, first, judge, open_traced, proposals, traces_kept


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
    assert said.endswith("no trace of a further run by itself names a cause")


def test_a_remainder_without_a_name_and_without_a_question_is_said(told: Confirmed):
    outcome = told.first.traced.outcomes[0]

    class Nameless:
        sensor, unnamed, findings, table = outcome.sensor, ("more",), outcome.findings, told.first.traced.table
        outcomes: Any = property(lambda self: (self,))

    nameless = replace(told.first, traced=Nameless(), questions=())
    assert left_over(nameless, None) == "meter_V has more than error, without a name"
    assert left_over(replace(told.first, questions=()), None) == ""


def test_an_effect_that_only_a_further_run_shows_is_named(monkeypatch: pytest.MonkeyPatch, told: Confirmed):
    """Its trace by itself has a question that the first run's has not; the other runs are asked about it."""
    question = told.first.questions[0]
    member = replace(question.members[0], effect="sensitivity-temperature")
    own = replace(told.first, path=Path("later.sqlite"), questions=(replace(question, members=(member,)),))
    monkeypatch.setattr("rig.loop.left_over.open_traced", lambda _path, _read: own)
    asked: list[Any] = []

    def judged(first: Any, *others: Path, anywhen: bool) -> Any:
        asked.append((first, others, anywhen))
        (answer,) = told.answers
        renamed = tuple(replace(one, effect=member.effect) for one in answer.members)
        answer = replace(answer, effect=member.effect, members=renamed)
        return replace(told, judged=replace(told.judged, answers=(answer,)))

    monkeypatch.setattr("rig.loop.left_over.judge", judged)
    said = left_over(told.first, with_error(told, 2.5))
    assert said.endswith(f"{told.path.name} shows sensitivity-temperature (by the other runs: confirmed)")
    assert asked == [(own, (told.first.path,), True)]


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
