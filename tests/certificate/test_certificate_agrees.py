"""A certificate of a confirmed effect does not leave its cause open: "cannot separate" stood beside "confirmed"."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from rig.procedures.present.joined import once
from rig.verbs.budget.found import Found
from rig.verbs.budget.lacking import Holding
from rig.verbs.certificate.parts_in_numbers import effects, models, notes
from rig.verbs.certificate.runs import CertifiedRun, _doubts

NOTE = (
    "cell_V: drift:elapsed_s: it is doubtful: two causes do as well; these data cannot separate it from "
    "ageing:elapsed_s, slow-wander"
)
OTHER = "cell_V: creep:force_kN: these data cannot separate it from lag:force_kN"


def member(effect, *, holds):
    sizes = {"cell_V": "1.2 mV (1.1 to 1.3)"} if holds else {}
    return SimpleNamespace(effect=effect, holds=holds, sizes=sizes, zero=())


def confirmed(verdict="confirmed", effect="drift:elapsed_s"):
    members = (
        member(effect, holds=True),
        member("ageing:elapsed_s", holds=False),
        member("step:elapsed_s", holds=False),
    )
    answer = SimpleNamespace(effect=effect, verdict=verdict, members=members)
    return SimpleNamespace(answers=[answer], paths=[Path("later.sqlite")])


def run(*said):
    return SimpleNamespace(notes=said, sensors=(), budgets=(), of=SimpleNamespace(table=SimpleNamespace(outputs={})))


def test_a_note_says_what_the_run_alone_leaves_open_and_what_the_further_run_says():
    first, second = notes(run(NOTE, OTHER), confirmed())
    assert "these data cannot separate" not in first
    assert "doubtful" not in first, "the further run settled the name"
    assert "the data of this run alone cannot separate it from ageing:elapsed_s, slow-wander" in first
    assert "the further run excludes ageing:elapsed_s, and the budgets count the difference all the same." in first
    assert second == f"{OTHER}."


def test_a_doubt_that_the_further_run_settled_is_not_on_the_page():
    """It stood there once for each effect and sensor, beside "confirmed"."""
    doubt = "cell_V: drift:elapsed_s: it is doubtful: step:elapsed_s and creep:force_kN do as well together"
    answers = [*confirmed().answers, *confirmed(effect="creep:force_kN").answers]
    assert list(notes(run(doubt), SimpleNamespace(answers=answers))) == []


@pytest.mark.parametrize(
    "given",
    [None, confirmed("undecided"), confirmed(effect="drift:elapsed_s,force_kN"), confirmed(effect="drift:elapsed")],
    ids=["no further run", "undecided", "a longer name", "a shorter name"],
)
def test_without_a_confirmation_of_this_effect_it_says_what_it_said(given):
    assert list(notes(run(NOTE), given)) == [f"{NOTE}."]


def test_the_state_of_the_effect_says_what_was_excluded():
    finding = SimpleNamespace(
        own_keys={},
        kind="effect",
        effect="drift:elapsed_s",
        size="1 mV",
        size_95="",
        cause="drifts",
        aliases=("ageing:elapsed_s",),
        shared="",
    )
    outcome = SimpleNamespace(sensor="cell_V", findings=[finding])
    (one,) = effects(run(), [outcome], confirmed(), "", {Path("later.sqlite"): "ab" * 16})
    assert one.confirmed
    assert one.how == f"by later.sqlite, head {'ab' * 8}, which excludes ageing:elapsed_s"
    assert one.size == "1 mV; by the further run 1.2 mV (1.1 to 1.3)"
    both = confirmed()
    mine = both.answers[0].members[0]
    mine.zero, mine.terms, mine.intervals_together = ("t",), ("t (a_V)", "t (cell_V)"), ((1.0, 2.0), (0.1, 0.3))
    (one,) = effects(run(), [outcome], both, "", {Path("later.sqlite"): "ab" * 16})
    assert one.size == "1 mV; by both runs 0.1 to 0.3 for t", "that run alone leaves the size open"
    finding.effect = "outliers"
    (other,) = effects(run(), [outcome], confirmed(), "", {Path("later.sqlite"): "ab" * 16})
    assert other.how == "the further run was not judged by it"


def test_an_effect_that_a_further_run_replaced_has_one_name_on_the_page():
    """The table of effects said setting-lag, the line of the budget carry-over."""
    found = [SimpleNamespace(sensor="mfs_Hz", named=[SimpleNamespace(kind="effect", effect="carry-over:flow")])]
    answer = SimpleNamespace(effect="carry-over:flow", verdict="replaced", holding=("lag:flow",))
    about = SimpleNamespace(of=SimpleNamespace(table=SimpleNamespace(outputs={"mfs_Hz": "mfs"})), lacks={})
    about.lacking = {"mfs_Hz": Holding({"lag:flow": "at rest"})}
    (said,) = models(about, "", Found(found, SimpleNamespace(answers=[answer])))
    assert "with the effects that were found (mfs: lag:flow (at rest))." in said
    assert "rig " not in said, "a customer's page has no command lines"


def test_one_reason_stands_for_all_names_and_sensors_with_the_same_doubt():
    """Three effects of four sensors were twelve reasons that differed in a name."""
    names = ("lag:flow", "drift:t", "square:flow")
    outcomes = [
        SimpleNamespace(sensor=f"s{n}_Hz", named=[SimpleNamespace(effect=one, doubtful="3 together") for one in names])
        for n in range(4)
    ]
    of = SimpleNamespace(table=SimpleNamespace(outputs={f"s{n}_Hz": f"s{n}" for n in range(4)}))
    (reason,) = _doubts(CertifiedRun(Path("run.sqlite"), "", of=of, outcomes=outcomes))
    assert reason.startswith("s0, s1, s2, s3: names of effects are doubtful (lag:flow, drift:t, square:flow): 3 toget")
    (one,) = _doubts(CertifiedRun(Path("run.sqlite"), "", of=of, outcomes=[replace_named(outcomes[0])]))
    assert one.startswith("s0: the name of effect lag:flow is doubtful: 3 together; confirm it by a further run")


def replace_named(outcome):
    return SimpleNamespace(sensor=outcome.sensor, named=outcome.named[:1])


def test_a_note_that_is_so_of_several_sensors_stands_once_with_their_names():
    said = ["a_Hz: flow is inferred", "b_Hz: flow is inferred", "Of no sensor: this", "b_Hz: another"]
    assert list(once(said, {"a_Hz": "a", "b_Hz": "b"})) == [
        "a, b: flow is inferred",
        "Of no sensor: this",
        "b: another",
    ]
