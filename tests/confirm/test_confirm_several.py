"""Several further runs, judged together: two causes of one class, and wrong names that hide each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from command import rig

from proving.truth import attitude
from rig.fitter.confirm import Hypothesis, Later, Question, confirm, confirm_all, questions_of, separation, still_open
from rig.fitter.confirm.minor_causes import notable
from rig.fitter.confirm.together import Fit
from rig.procedures.attitude.model import mounting_matrix
from rig.procedures.attitude.together import AttitudeTogether
from rig.procedures.attitude.trace import trace

DAY_S = 86400.0
PADS, HEAD = "isolation-pad-deflection", "head-once-per-turn"
WRONG = {HEAD: PADS, "sensor-asymmetry": "sensor-third-order"}
"""Wrong names, and the true ones."""
PITCHES = np.linspace(-180, 180, 13)
SAG, ECCENTRIC = 8e-4, 4e-4
BOTH = attitude.Bench(
    sensors=(attitude.Sensor("x"),), compliance={("y", "x"): SAG}, pitch_error_deg=(ECCENTRIC, 0.0, 0.0, 0.0)
)


def run(bench: attitude.Bench, pitches, rolls, replications: int, seed: int):
    return attitude.simulate(bench, attitude.Plan(np.array(pitches), np.array(rolls), replications=replications), seed)[
        0
    ]


@pytest.fixture(scope="module")
def traced():
    """A first run without roll of a bench with soft pads and an eccentric head, and its trace."""
    first = run(BOTH, PITCHES, [0.0], 4, 3)
    found = trace(first)
    (question,) = questions_of(found)
    assert {m.effect for m in question.members} == {PADS, HEAD}
    return first, found, question


def later(*, pitches=PITCHES[::2], replications: int = 1, days: int = 1, seed: int = 4) -> Later:
    return Later(run(BOTH, pitches, [0.0, 180.0], replications, seed), days * DAY_S)


def test_a_second_further_run_is_asked_between_a_cause_and_both_and_tells(traced) -> None:
    first, found, question = traced
    short = later()
    answer = confirm(AttitudeTogether.of(found, first, [short]), question)
    assert answer.verdict in ("confirmed", "replaced"), "a short run excludes only one of them alone"
    assert answer.minor_causes
    asked = still_open(answer)
    assert asked is not None
    (alone, both) = asked.members
    assert set(both.causes) == {PADS, HEAD}
    assert both.has(alone)
    planned = later(pitches=PITCHES, replications=4, days=2)
    few = later(pitches=PITCHES[::6], days=2)
    chances = [
        separation(AttitudeTogether.of(found, first, [short, run]), [asked])[0].chances[alone.effect, both.effect]
        for run in (few, planned)
    ]
    assert chances[0] < 0.5
    assert chances[1] > 0.9
    told = confirm(AttitudeTogether.of(found, first, [short, planned]), question)
    assert told.verdict == "replaced"
    best = told.members[0]
    assert set(best.causes) == {PADS, HEAD}
    (size,) = best.sizes.values()
    assert size.count("(") == 2, "both with their intervals"
    low, high = best.intervals[[term.startswith("about") for term in best.terms].index(True)]
    assert min(abs(low), abs(high)) < SAG < max(abs(low), abs(high))
    assert still_open(told) is None


def test_there_is_nothing_to_ask_if_a_cause_holds_alone_or_none_does(traced) -> None:
    first, found, question = traced
    answer = confirm(AttitudeTogether.of(found, first, [later(replications=3, pitches=PITCHES)]), question)
    assert still_open(replace(answer, minor_causes=())) is None
    none = replace(answer, members=tuple(replace(member, fits=False) for member in answer.members))
    assert none.verdict == "none holds"
    assert still_open(none) is None
    two = replace(answer, members=tuple(replace(m, fits=True, sigmas=0.0, p_changed=1.0) for m in answer.members[:2]))
    asked = still_open(two)
    assert asked is not None
    assert tuple(member.effect for member in asked.members) == two.holding


def test_a_planned_share_of_a_second_cause_is_one_that_would_be_mentioned(traced) -> None:
    first, found, question = traced
    runs = AttitudeTogether.of(found, first, [later()])
    one = runs.only(~runs.fresh)
    pads, head = question.members
    both = pads.beside(head)
    columns, q = one.columns_of(both.terms), len(pads.terms)
    alone = float(np.linalg.norm(columns[:, :q] @ Fit.of(columns[:, :q], one.outputs).estimate))
    guess = Fit.of(columns, one.outputs).estimate
    guess[q:] *= 0.05
    sizes = notable(one, both, (), guess[:, None])[:, 0]
    assert np.linalg.norm(columns[:, q:] @ sizes[q:]) == pytest.approx(alone / 3)
    same = (columns[:, :q].T @ (columns @ values) for values in (sizes, guess))
    np.testing.assert_allclose(*same, rtol=1e-9, err_msg="the other one is fitted again beside it")


def test_every_further_run_has_its_own_response_and_after_a_turn_its_own_mounting(traced) -> None:
    first, found, _ = traced
    one, other = later(), later(days=2, seed=5)
    single, double = (AttitudeTogether.of(found, first, runs) for runs in ([one], [one, other]))
    assert np.linalg.matrix_rank(double.again) == 2 * np.linalg.matrix_rank(single.again)
    np.testing.assert_array_equal(np.unique(double.run), [0, 1, 2])
    turned = np.broadcast_to(mounting_matrix(180.0, 0.0, 0.0), (len(one.data), 3, 3))
    back = AttitudeTogether.of(found, first, [replace(one, data=replace(one.data, mounting=turned)), other])
    assert back.part[back.run == 1].tolist() == [1] * len(one.data)
    assert back.part[back.run == 2].tolist() == [2] * len(other.data), "mounted again, it never stands as before"
    assert back.loose.shape[1] == 8


def test_a_cause_that_the_first_run_barely_excludes_is_judged_and_has_to_be_excluded_clearly(traced) -> None:
    _, found, _ = traced
    explained = {PADS: [e for e in found.explanations[PADS] if e.alias]}
    barely = [replace(e, sigmas=3.2, alias=False, near=True) if e.effect == HEAD else e for e in explained[PADS]]
    (asked,) = questions_of(Explained(found, {PADS: barely}))
    assert [(m.effect, m.near) for m in asked.members] == [(PADS, False), (HEAD, True)]
    limits = [member.limit(1e6) for member in asked.members]
    assert limits == pytest.approx([3.0, 4.0], abs=0.01)


class Explained:
    """The findings of a trace with other explanations."""

    def __init__(self, found, explanations) -> None:
        self.sensors, self.chosen, self.explanations = found.sensors, found.chosen, explanations


def test_two_wrong_names_do_not_hide_each_other() -> None:
    """Each leaves too much beside the other: both were refused before, though a better pair was among them."""
    bench = attitude.Bench(sensors=(attitude.Sensor("x", cubic=4e-5),), compliance={("y", "x"): SAG})
    first = run(bench, np.linspace(-180, 180, 25), [0.0], 4, 3)
    found = trace(first)
    by_name = {e.effect: Hypothesis(e.effect, e.terms, 0.0) for own in found.explanations.values() for e in own}
    wrong = [Question((by_name[name], by_name[true]), by_name[name].terms, ()) for name, true in WRONG.items()]
    later = Later(run(bench, PITCHES, [0.0, 90.0, 180.0], 3, 4), DAY_S)
    judged = confirm_all(AttitudeTogether.of(found, first, [later]), wrong)
    assert [answer.holding for answer in judged.answers] == [(true,) for true in WRONG.values()]
    assert [answer.verdict for answer in judged.answers] == ["replaced", "replaced"]


def test_causes_together_have_all_names_and_terms() -> None:
    one, two, three = (Hypothesis(name, (object(),), 1.0) for name in "abc")
    pair = one.beside(two)
    assert (pair.effect, pair.causes, pair.last) == ("a with b", ("a", "b"), two.terms)
    assert pair.beside(three).causes == ("a", "b", "c")
    assert pair.has(one)
    assert not one.has(pair)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--by", "a.sqlite", "--after", "b.sqlite"), "excludes --after"),
        (("--by", "a.sqlite", "--runs", "2"), "--runs"),
    ],
)
def test_options_that_exclude_each_other_are_refused(tmp_path, words, why) -> None:
    for name in ("run.sqlite", "a.sqlite", "b.sqlite"):
        (tmp_path / name).write_bytes(b"")
    done = rig("confirm", tmp_path / "run.sqlite", *(tmp_path / w if w.endswith("sqlite") else w for w in words))
    assert done.returncode == 2
    assert why in " ".join(done.stderr.split())
