"""What `rig confirm` prints is read at 80 columns: words are not broken into the columns of a table."""

from __future__ import annotations

from itertools import combinations
from math import inf
from types import SimpleNamespace

import pytest

from rig.cli import confirm_show
from rig.fitter.confirm import NOTHING, Member
from rig.fitter.confirm.constants import CONSTANT_OF
from rig.procedures.general.confirming import OWN_UNITS, GeneralConfirming
from rig.verbs.confirm.answers import Confirmed
from rig.verbs.confirm.proposals import Inseparable, unlikely

WHAT = "force_kN at the settings of the first run and between them"


@pytest.fixture
def plain(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("rig.verbs.confirm.proposals.otherwise", lambda *_: ["it may leave two causes open"])


SIZE = "23 points x 1 replication"


def proposal(**more):
    known = {
        "size": SIZE,
        "hours": 0.5,
        "separated": (3, 4),
        "nearest": (0.97, 4.1),
        "shown": (1.0, 278.0),
    }
    return SimpleNamespace(variation=SimpleNamespace(what=WHAT), **{**known, **more})


def test_a_proposed_run_is_two_lines(plain, capsys):
    confirm_show.show_proposals(None, [proposal(), proposal(nearest=None, separated=(0, 0))], (), 1, every=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == [
        f"1  {WHAT}",
        f"   {SIZE}, 30 min; 3 of 4 pairs separated; nearest pair 4.1 (97%); weakest cause 278 (100%)",
        f"2  {WHAT}",
        f"   {SIZE}, 30 min; weakest cause 278 (100%)",
    ]
    assert lines[-1] == "  run 1: it may leave two causes open"


def test_a_run_that_tells_no_more_and_takes_no_less_is_a_number_alone(plain, capsys):
    """Seven runs stood there, "0 of 1 pairs separated" each, five of them with the same figures."""
    one = proposal(separated=(0, 1), nearest=(0.9, 5.3))
    better = proposal(separated=(0, 1), nearest=(0.94, 6.0), hours=0.7)
    cheaper = proposal(separated=(0, 1), nearest=(0.8, 4.7), hours=0.4)
    longer = proposal(separated=(0, 1), nearest=(0.9, 5.3), hours=0.8)
    confirm_show.show_proposals(None, [one, one, better, longer, cheaper], (), 1, every=True)
    lines = capsys.readouterr().out.splitlines()
    assert [line[0] for line in lines[:6:2]] == ["1", "3", "5"]
    assert lines[1] == f"   {SIZE}, 30 min; pair 5.3 (90%); weakest cause 278 (100%)"
    assert "  2, 4: no figure is better, and no time shorter, than that of a run above" in lines


LEFT_OVER = {"p_fits": 1e-12, "place": "over force_kN"}


def test_a_verdict_has_its_numbers_in_sentences(plain, capsys):
    member = SimpleNamespace(
        effect="creep:force_kN",
        holds=True,
        fits=True,
        sigmas=0.0,
        shown=116.0,
        limit=3.1,
        p_shown=1e-12,
        p_changed=0.081,
        missed=0.021,
        sizes={"a_V": "1 mV", "b_V": "2 mV"},
    )
    other = SimpleNamespace(
        **{**vars(member), "effect": "drift", "holds": False, "fits": False, "sigmas": 8.0, "missed": inf, **LEFT_OVER}
    )
    answer = SimpleNamespace(effect="creep:force_kN", verdict="confirmed", members=(member, other), outliers=())
    confirm_show.show_answer(answer)
    assert capsys.readouterr().out.splitlines()[1:] == [
        "creep:force_kN: confirmed",
        "  creep:force_kN",
        "    shown by 116.0 standard errors (limit 3.1), p < 1e-06; the same size in both runs: p 0.081; predicted by "
        "the first run, all but 2.1 % of it",
        "    size in the further run, 95 %: a_V: 1 mV",
        "                                   b_V: 2 mV",
        "  drift: does not hold",
        "    8.0 standard errors behind the best; shown by 116.0 standard errors (limit 3.1), p < 1e-06; the same size "
        "in both runs: p 0.081; does not fit: what it leaves in the further run follows a shape over force_kN "
        "(p < 1e-06, limit 0.001)",
        "    size in the further run, 95 %: a_V: 1 mV",
        "                                   b_V: 2 mV",
    ]


def test_many_pairs_that_no_run_separates_take_one_line(plain, capsys):
    """An effect with 43 explanations had 643 lines."""
    names = [f"cause-{k}" for k in range(1, 9)]
    never = [Inseparable("cause-1", pair, 0.1 * k, "visit it twice") for k, pair in enumerate(combinations(names, 2))]
    members = [SimpleNamespace(effect=name, near=False) for name in names]
    question = SimpleNamespace(effect="cause-1", members=members)
    confirm_show.show_open(SimpleNamespace(questions=[question], shared=lambda _: ""), never)
    assert capsys.readouterr().out.splitlines() == [
        "cause-1: these data do not distinguish it from cause-2, cause-3, cause-4, cause-5, cause-6, cause-7, cause-8",
        "  cause-1: 28 pairs of 8 explanations: no run of this bench separates them (at most 2.7 standard errors "
        "expected) as it stands; a person would have to change something: visit it twice",
    ]
    confirm_show.show_open(SimpleNamespace(questions=[question], shared=lambda _: ""), never[:2])
    pairs = [line.partition(": ")[0] for line in capsys.readouterr().out.splitlines()[1:]]
    assert pairs == ["  cause-1 or cause-2", "  cause-1 or cause-3"]


def test_why_no_run_is_likely_to_settle_everything_is_said():
    def run(chance, **more):
        chances = {("lag", "line"): chance, ("lag", NOTHING): 0.99}
        return SimpleNamespace(separations=[SimpleNamespace(chances=chances)], **{"likely": False, **more})

    said = unlikely([run(0.01), run(0.04)])
    assert said == (
        "no run of this bench is likely to settle everything: none decides between lag and line (probability 4% at "
        "most)"
    )
    assert "each of them leaves another question open" in unlikely([run(0.9)])
    assert unlikely([run(0.01), run(0.6, likely=True)]) == ""


def test_a_searched_constant_is_no_size_that_has_to_differ_from_zero():
    lag, shift = "lag(x, 300) (a_V)", f"{CONSTANT_OF}lag(x, 300) (a_V)"
    known = {"terms": (lag, shift), "intervals": ((-2.0, -1.0), (-0.1, 0.1)), "shifts": frozenset({shift})}
    others = dict.fromkeys(Member.__dataclass_fields__, None)
    assert Member(**{**others, **known}).zero == ()
    assert Member(**{**others, **known, "shifts": frozenset()}).zero == (shift,)
    seen = {"shown": 9.0, "limit": 3.0, "intervals_together": ((-2.0, 1.0), (200.0, 400.0))}
    assert not Member(**{**others, **known, **seen}).seen
    assert Member(**{**others, **known, **seen, "intervals_together": ((1.0, 2.0), (200.0, 400.0))}).seen


def test_errors_of_outputs_in_different_units_have_their_own():
    confirming = GeneralConfirming(SimpleNamespace(each={"a_mV_per_V": None, "b_V": None}))
    confirmed = Confirmed(SimpleNamespace(confirming=confirming), (), (), None)
    assert confirming.unit == OWN_UNITS
    assert [confirmed.named(name) for name in ("a_mV_per_V", "b_V")] == ["a_mV_per_V / mV/V", "b_V / V"]
    error = SimpleNamespace(before=2.0, after=1.0, sigma=1.0, slope=1.0)
    assert set(confirmed._error("a_mV_per_V", error)) == {f"{one}_mV_per_V" for one in ("before", "after", "reading")}
    alike = GeneralConfirming(SimpleNamespace(each={"b_V": None}))
    assert Confirmed(SimpleNamespace(confirming=alike), (), (), None).named("b_V") == "b_V"


@pytest.mark.parametrize(
    ("alike", "near", "says"),
    [
        ((), (), "these data exclude every other cause of the catalogue"),
        ((), ("b",), "less clearly excluded, and so judged again by the further run: b (3.5 standard errors)"),
        (("c",), (), "these data do not distinguish it from c"),
    ],
)
def test_an_open_question_is_told_in_one_way(capsys, alike, near, says):
    members = [SimpleNamespace(effect="a", near=False, sigmas=0.0)]
    members += [SimpleNamespace(effect=name, near=name in near, sigmas=3.5) for name in (*alike, *near)]
    question = SimpleNamespace(effect="a", members=tuple(members))
    confirm_show.show_open(SimpleNamespace(questions=(question,), shared=lambda effect: ""), ())
    assert capsys.readouterr().out.splitlines() == [f"a: {says}"]
